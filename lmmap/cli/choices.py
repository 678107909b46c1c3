"""What the command line offers to choose from.

The modules that own these names take seconds to import, and ``--help`` is to answer at once; tests compare
them.
"""

import re
from pathlib import Path

MODALITIES = ("rgb", "event")
DOMAIN_GAPS = ("high", "low", "robust", "light")
DEFAULT_WEIGHTS, PAPER_WEIGHTS = "robust", "low"
TIME_UNITS = ("s", "ms", "us", "ns")
FLIPS = tuple(camera + flip for camera in ("", "rgb:", "event:") for flip in ("x", "y", "180"))
POSE_BAGS = (".bag", ".mcap")
SHELLS = ("bash", "zsh", "tcsh")


def camera_or_file(text: str) -> str | Path:
    """The name of a camera that OpenCV opens, a text, or the path of a recording."""
    return text if re.fullmatch(r"\d+|/dev/video\d+|\w+://.+", text) else Path(text)
