"""What the command line offers to choose from.

The modules that own these names take seconds to import, and ``--help`` is to answer at once; tests compare
them.
"""

import os

FILTERS = ("ring", "reflector")
MODALITIES = ("rgb", "event")
DOMAIN_GAPS = ("high", "low", "robust")
DEFAULT_WEIGHTS, PAPER_WEIGHTS = "robust", "low"
PROFILES = ("quick", "paper")
WRITTEN = (".aedat4", ".bag", ".h5", ".hdf5")  # how names of recordings end that can be written
SHELLS = ("bash", "zsh", "tcsh")


def profile() -> str:
    """The profile that the environment asks for, by default the quick one."""
    return os.environ.get("PROFILE", "quick")
