"""lmmap: pose of the LM-MAP docking port from an RGB or event camera, reproducibly."""

from . import circle, ellipse, events
from .core import PAPER, Camera, Ellipse, Estimate, InputError, Port, Pose, Recording, Status, Trajectory
from .recordings import open_recording

__all__ = ["PAPER", "Camera", "Ellipse", "Estimate", "Estimator", "InputError", "Port", "Pose", "Recording",
           "Status", "Trajectory", "circle", "ellipse", "events", "open_recording"]  # fmt: skip


def __getattr__(name: str):
    if name == "Estimator":  # torch takes seconds to import, and only the estimator needs it
        from .pipeline import Estimator

        return Estimator
    raise AttributeError(f"module 'lmmap' has no attribute {name!r}")
