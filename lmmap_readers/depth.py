"""Images with 16 bits per value, of which cameras use 10, 12, 14 or all."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

import numpy as np

BITS = (10, 12, 14, 16)
LOOKED_AT = 16  # images of a recording, for the bits that its values use


def eight_bit(path: Path, frames: Callable[[], Iterator]) -> Iterator:
    """Yield the same ``(t_us, image)`` with 8 bits per value.

    All values of 16 bits are scaled alike, by the least of `BITS` that holds those of the first images and of
    the images so far.  A warning says which, unless it is 16.
    """
    bits = 0
    for t_us, image in frames():
        if image.dtype != np.uint8 and bits_of(image) > bits:
            bits = max(bits_of(image), 0 if bits else _first_bits(frames))
            if bits < BITS[-1]:
                text = f"images of 16 bits, whose values take {bits} of them; scaled by these"
                warnings.warn(f"{path}: {text}", stacklevel=2)
        yield t_us, scaled(image, bits)


def bits_of(image: np.ndarray) -> int:
    """The least of `BITS` that holds an image's values; raises ValueError unless they have 8 or 16 bits."""
    if image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"an image of {image.dtype}, expected 8 or 16 bits; convert it")
    return next(bits for bits in BITS if image.max(initial=0) < 1 << bits)


def scaled(image: np.ndarray, bits: int | None = None) -> np.ndarray:
    """Scale an image of 8 or 16 bits, of which ``bits`` are used (default: `bits_of`), to 8 bits a value."""
    return image if image.dtype == np.uint8 else (image >> (bits or bits_of(image)) - 8).astype(np.uint8)


def _first_bits(frames: Callable[[], Iterator]) -> int:
    bits = [BITS[0]]
    with suppress(Exception):  # a fault is raised when its image comes
        bits.extend(bits_of(image) for _, image in islice(frames(), LOOKED_AT))
    return max(bits)
