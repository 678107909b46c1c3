"""A pinhole camera with lens distortion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from .arrays import frozen_array
from .checks import camera_files, check_fields, check_number, checked

MOST = 1e9  # pixels
MODELS = {"radtan": (1, 2, 3, 4, 5), "equidistant": (4,)}  # how many coefficients they take


@dataclass(frozen=True)
class Camera:
    """Pinhole camera whose lens may distort.

    ``distortion`` holds (k1, k2, p1, p2, k3) of the model ``"radtan"``, or (k1, k2, k3, k4) of Kalibr's and
    OpenCV's ``"equidistant"`` fisheye; if it is empty, the lens has no distortion, whatever the model.

    Raises
    ------
    ValueError
        If a field has another type or is out of range, or the model does not take that many coefficients.

    Examples
    --------
    >>> camera = lmmap.Camera(640, 480, fx_px=500, fy_px=500, cx_px=319.5, cy_px=239.5)
    >>> camera.size_px
    (640, 480)
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()
    distortion_model: str = "radtan"

    def __post_init__(self):
        check_fields(self)
        for name in ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px"):
            least = -MOST if name in ("cx_px", "cy_px") else 1 / MOST
            check_number(name, getattr(self, name), least, MOST)
        for value in self.distortion:
            check_number("distortion", value, -MOST, MOST)
        if self.distortion_model not in MODELS:
            raise ValueError(f"distortion_model: expected one of {[*MODELS]}, got {self.distortion_model!r}")
        if len(self.distortion) not in (0, *MODELS[self.distortion_model]):
            raise ValueError(
                f"distortion: {self.distortion_model} takes {MODELS[self.distortion_model]} coefficients, "
                f"got {len(self.distortion)}"
            )

    @classmethod
    def davis346(cls) -> Camera:
        """The bench's camera: DAVIS 346 (346 x 260 px, pitch 18.5 um) behind a 6 mm lens."""
        return cls(346, 260, 324.0, 324.0, 172.5, 129.5)

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.width_px, self.height_px

    @cached_property
    def K(self) -> np.ndarray:
        """Intrinsic matrix, shape (3, 3)."""
        return frozen_array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1]])

    @cached_property
    def K_inverse(self) -> np.ndarray:
        """Inverse of `K`, from pixels to normalised coordinates, shape (3, 3)."""
        return frozen_array(np.linalg.inv(self.K))

    def at_focal(self, focal_px: float) -> Camera:
        """Return the camera of the same images, resampled to about this focal length in whole pixels.

        The view, the lens and the frame stay the same, so a pose is the same in both.
        """
        check_number("focal_px", focal_px, 1e-3, 1e6)
        width_px = max(round(self.width_px * focal_px / self.fx_px), 1)
        height_px = max(round(self.height_px * focal_px / self.fy_px), 1)
        x, y = width_px / self.width_px, height_px / self.height_px
        return replace(
            self, width_px=width_px, height_px=height_px, fx_px=x * self.fx_px, fy_px=y * self.fy_px,
            cx_px=x * (self.cx_px + 0.5) - 0.5, cy_px=y * (self.cy_px + 0.5) - 0.5,
        )  # fmt: skip

    @classmethod
    @checked
    def load(
        cls, path: str | Path, size_px: tuple[int, int] | None = None, topics: Sequence[str] = ()
    ) -> Camera:
        """Read our JSON, or a calibration of OpenCV, ROS, Kalibr, dv-processing, Metavision, COLMAP, RPG or
        SPEED+; raises `InputError`.

        If a file holds several cameras, take ``FILE:NAME``, else the one that matches a recording's size and
        topics, else the first, with a warning.  A file that states no size is taken to be for ``size_px``.
        """
        return camera_files().read_camera(path, size_px, topics)

    @checked
    def save(self, path: str | Path) -> None:
        """Write the JSON that `load` reads; raises `InputError`."""
        camera_files().write_fields(path, self)
