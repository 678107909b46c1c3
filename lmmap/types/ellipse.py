"""Ellipses in the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import frozen_numbers
from .checks import check_number


@dataclass(frozen=True)
class Ellipse:
    """Ellipses in the image: ``centre_px (..., 2)``, ``semi_axes_px (..., 2)`` with major first,
    ``angle_rad (...)`` from +u to the major axis, modulo pi.

    Raises
    ------
    ValueError
        If a field has another shape, or the major axis does not come first.

    Examples
    --------
    >>> ring = lmmap.Ellipse(centre_px=[170, 130], semi_axes_px=[40, 30], angle_rad=0.0)
    >>> ring.points(4).round()
    array([[210., 130.],
           [170., 160.],
           [130., 130.],
           [170., 100.]])
    """

    centre_px: np.ndarray
    semi_axes_px: np.ndarray
    angle_rad: np.ndarray

    def __post_init__(self):
        for name, last in (("centre_px", (2,)), ("semi_axes_px", (2,)), ("angle_rad", ())):
            object.__setattr__(self, name, frozen_numbers(name, getattr(self, name), *last))
        if np.any(self.semi_axes_px[..., 1] > self.semi_axes_px[..., 0] * (1 + 1e-9)):
            raise ValueError(f"Ellipse: semi_axes_px, expected major first, got {self.semi_axes_px}")

    def points(self, count: int = 360) -> np.ndarray:
        """Points on the contour in pixels, shape (..., count, 2); raises ValueError for a negative count."""
        check_number("count", count, 0, 1e9)
        s = np.linspace(0, 2 * np.pi, int(count), endpoint=False)
        a, b = self.semi_axes_px[..., :1], self.semi_axes_px[..., 1:]
        c, d = np.cos(self.angle_rad)[..., None], np.sin(self.angle_rad)[..., None]
        local = np.stack([a * np.cos(s) * c - b * np.sin(s) * d, a * np.cos(s) * d + b * np.sin(s) * c], -1)
        return self.centre_px[..., None, :] + local
