"""Limits on what a recording may hold: a file beyond them is damaged or hostile, and is refused.

Each limit is some tens of times what cameras and drivers write; together they keep reading below a gigabyte.
"""

from ..types.checks import MAX_TIME_US as MAX_TIME_US

MAX_CHUNK_BYTES = 2**28  # decompressed; ROS writes chunks of 0.8 MB, DV packets of some MB
MAX_RECORD_BYTES = 2**26  # of a header or an index, before it is parsed; those of hour-long bags have some MB
MAX_IMAGE_PIXELS = 2**25  # 33 megapixels, 100 MB in RGB; a DAVIS 346 has 0.09
MAX_IMAGE_BYTES = 2**27  # of an image file; 33 megapixels as raw RGB have 100 MB
MAX_TRUTH_BYTES = 2**26  # of a trajectory: 600 000 poses, an hour at 170 Hz
MAX_ESTIMATES_BYTES = 2**29  # of a table of estimates: 400 000 rows, an hour at 110 Hz
MAX_POSITION_M = 1e6  # a thousand kilometres


def check_times(t_us) -> None:
    """Raise ValueError if a time in microseconds (int, or an array of them) is beyond `MAX_TIME_US`."""
    low, high = (t_us, t_us) if isinstance(t_us, int) else (int(t_us.min()), int(t_us.max()))
    if low < -MAX_TIME_US or high > MAX_TIME_US:
        time_us = f"{low if low < -MAX_TIME_US else high}"
        shown = time_us if len(time_us) <= 20 else f"{len(time_us)} digits"
        raise ValueError(f"a time of {shown} us, beyond any clock's; check the unit of its times")


def check_image(width: int, height: int) -> None:
    """Raise ValueError for an image without pixels, or with more than `MAX_IMAGE_PIXELS`."""
    if width < 1 or height < 1 or width * height > MAX_IMAGE_PIXELS:
        raise ValueError(
            f"an image of {width} x {height} px; expected 1 to {MAX_IMAGE_PIXELS // 10**6} megapixels"
        )
