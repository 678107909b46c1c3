"""The choices that the command line offers.

The modules that define these names take seconds to import, but ``--help`` must answer at once; tests compare
the two.
"""

import re
import warnings
from pathlib import Path

MODALITIES = ("rgb", "event")
SETS, FORMER = ("high", "low", "robust", "slim"), {"light": "slim"}
DEFAULT_WEIGHTS, PAPER_WEIGHTS = "robust", "low"
TIME_UNITS = ("s", "ms", "us", "ns")
FLIPS = tuple(camera + flip for camera in ("", "rgb:", "event:") for flip in ("x", "y", "180"))
POSE_BAGS = (".bag", ".mcap")
SHELLS = ("bash", "zsh", "tcsh")


def camera_or_file(text: str) -> str | Path:
    """Parse the name of a camera that OpenCV opens (a str) or the path of a recording (a Path)."""
    return text if re.fullmatch(r"\d+|/dev/video\d+|\w+://.+", text) else Path(text)


def present_set(name: str) -> str:
    """The present name of a set of networks; warns of a former one."""
    if name in FORMER:
        warnings.warn(f"the networks {name!r} are now called {FORMER[name]!r}", stacklevel=2)
    return FORMER.get(name, name)
