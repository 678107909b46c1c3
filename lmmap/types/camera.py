"""A pinhole camera with lens distortion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import camera_files


@dataclass(frozen=True)
class Camera:
    """Pinhole camera with optional radial-tangential distortion (k1, k2, p1, p2, k3)."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self):
        values = (self.width_px, self.height_px, self.fx_px, self.fy_px, self.cx_px, self.cy_px)
        if not np.all(np.isfinite([*values, *self.distortion])):
            raise ValueError("Camera: every intrinsic must be finite")
        if min(values[:4]) <= 0:
            raise ValueError(f"Camera: sizes and focal lengths must be positive, got {values[:4]}")

    @classmethod
    def davis346(cls) -> Camera:
        """The bench's camera: DAVIS 346 (346 x 260 px, pitch 18.5 um) behind a 6 mm lens."""
        return cls(346, 260, 324.0, 324.0, 172.5, 129.5)

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height)."""
        return self.width_px, self.height_px

    @property
    def K(self) -> np.ndarray:
        """Intrinsic matrix, shape (3, 3)."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1.0]])

    @classmethod
    def load(cls, path) -> Camera:
        """Read our JSON, or an OpenCV or ROS calibration YAML; raises `InputError`."""
        return cls(**camera_files.read_camera(path, cls))

    def save(self, path) -> None:
        """Write the JSON that `load` reads."""
        camera_files.write_fields(path, self)
