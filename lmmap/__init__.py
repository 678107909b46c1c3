"""lmmap: pose of the LM-MAP docking port from an RGB or event camera, reproducibly."""

import hashlib
import os
from pathlib import Path

# numba dates its cache by one file and not by those that it inlines: a folder for each state of the source
_FOLDER = Path(__file__).parent
_SOURCE = b"".join(path.read_bytes() for path in sorted(_FOLDER.rglob("*.py")))
os.environ.setdefault(
    "NUMBA_CACHE_DIR", str(_FOLDER / "__pycache__" / hashlib.sha256(_SOURCE).hexdigest()[:16])
)

from .pipeline import circle, ellipse, histograms  # noqa: E402
from .recordings.formats import open_recording  # noqa: E402
from .types import PAPER, Camera, Ellipse, Estimate, InputError, Port, Pose, Recording, Status, Trajectory  # noqa: E402

__all__ = ["PAPER", "Camera", "Ellipse", "Estimate", "Estimator", "InputError", "Port", "Pose", "Recording",
           "Status", "Trajectory", "circle", "ellipse", "histograms", "open_recording"]  # fmt: skip


def __getattr__(name: str):
    if name == "Estimator":  # torch takes seconds to import, and only the estimator needs it
        from .pipeline.estimator import Estimator

        return Estimator
    raise AttributeError(f"module 'lmmap' has no attribute {name!r}")
