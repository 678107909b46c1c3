"""lmmap: pose of the LM-MAP docking port from an RGB or event camera, reproducibly.

Each public name is imported when it is first used, so that ``import lmmap`` is immediate.
"""

import importlib

_HOME = {
    "Camera": "types",
    "Ellipse": "types",
    "Estimate": "types",
    "InputError": "types",
    "OURS": "settings",
    "PAPER": "settings",
    "Port": "types",
    "Pose": "types",
    "Recording": "types",
    "Status": "types",
    "Trajectory": "types",
    "Estimator": "pipeline.estimator",
    "PrintedEstimator": "pipeline.printed",
    "Tracker": "tracking.tracker",
    "circle": "pipeline.circle",
    "draw": "drawing.overlay",
    "ellipse": "pipeline.ellipse",
    "estimate": "estimation.estimates",
    "fuse": "tracking.fusion",
    "histograms": "pipeline.histograms",
    "open_recording": "recordings.formats",
    "read_estimates": "recordings.pose_files",
    "write_estimates": "recordings.pose_files",
}
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
