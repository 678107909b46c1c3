"""The clip of a paper port in a furnished room: what is done in it, and at which image."""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate, pairwise

import numpy as np

from lmmap.types import Port

STILLS = 10  # images of a port that stands still
SLIDE_MM = np.repeat(np.arange(0, 101, 20), 3)  # along a ruler
LENGTHS = {"wave": 6, "slide": len(SLIDE_MM), "head-on": STILLS, "turned": STILLS, "cover": 6, "lamp": 6,
           "flat": STILLS}  # fmt: skip
ENDS = accumulate(LENGTHS.values(), initial=0)
PARTS = {part: slice(*ends) for part, ends in zip(LENGTHS, pairwise(ENDS), strict=True)}
COUNT = sum(LENGTHS.values())


def flat(port: Port) -> Port:
    """The port with its plate in the plane of the ring, as in the last part."""
    return replace(port, plate_height_m=0.0)
