"""lmmap: pose of the LM-MAP docking port from an RGB or event camera, reproducibly.

Each public name is imported on first use, so that ``import lmmap`` is fast.
"""

import importlib

_OF_MODULES = {
    "types": "Camera Ellipse Estimate InputError Port Pose Recording Status Trajectory",
    "settings": "OURS PAPER",
    "recordings.formats": "open_recording",
    "recordings.pose_files": "read_estimates write_estimates",
    "pipeline.histograms": "histograms",
    "pipeline.ellipse": "ellipse",
    "pipeline.circle": "circle",
    "pipeline.estimator": "Estimator",
    "pipeline.printed": "PrintedEstimator",
    "tracking.tracker": "Tracker",
    "tracking.fusion": "fuse",
    "estimation.estimates": "estimate",
    "drawing.overlay": "draw",
}
_HOME = {name: module for module, names in _OF_MODULES.items() for name in names.split()}
__all__ = sorted(_HOME)


def __getattr__(name: str):
    if name not in _HOME:
        raise AttributeError(f"module 'lmmap' has no attribute {name!r}")
    module = importlib.import_module(f"lmmap.{_HOME[name]}")
    value = module if name == _HOME[name].split(".")[-1] else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__"))]
