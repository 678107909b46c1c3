"""The geometry of a docking port."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from .. import camera_files


@dataclass(frozen=True)
class Port:
    """Geometry of a docking port: the ring, the raised plate with its markers, and the panel."""

    ring_radius_m: float
    ring_inner_radius_m: float
    ring_outer_radius_m: float
    plate_circumradius_m: float
    plate_height_m: float
    marker_radius_m: float
    marker_size_m: tuple[float, float]  # tangential, radial
    petal_widths_m: tuple[float, float]  # at the plate, at the tip
    petal_rise_m: float
    petal_lean_m: float
    stem_radius_m: float
    panel_depth_m: float
    panel_size_m: tuple[float, float]
    symmetry: int = 3

    def __post_init__(self):
        if not 0 < self.ring_inner_radius_m < self.ring_radius_m < self.ring_outer_radius_m:
            raise ValueError("Port: expected 0 < inner < centre-line < outer radius of the ring")
        if self.symmetry < 1:
            raise ValueError(f"Port: symmetry must be at least 1, got {self.symmetry}")

    @classmethod
    def lm_map(cls) -> Port:
        """Lockheed Martin Mission Augmentation Port; proportions of the paper's drawing."""
        return cls(
            ring_radius_m=0.0800,
            ring_inner_radius_m=0.0724,
            ring_outer_radius_m=0.0876,
            plate_circumradius_m=0.052,
            plate_height_m=0.046,
            marker_radius_m=0.0365,
            marker_size_m=(0.0509, 0.0164),
            petal_widths_m=(0.052, 0.032),
            petal_rise_m=0.029,
            petal_lean_m=0.0136,
            stem_radius_m=0.022,
            panel_depth_m=0.009,
            panel_size_m=(0.68, 0.44),
        )

    @classmethod
    def load(cls, path) -> Port:
        """Read a JSON file with the fields of this class; raises `InputError`."""
        return cls(**camera_files.read_port(path, cls))

    def save(self, path) -> None:
        """Write the JSON that `load` reads."""
        camera_files.write_fields(path, self)

    @property
    def yaw_period_rad(self) -> float:
        """Yaw is known modulo this angle."""
        return 2 * np.pi / self.symmetry

    @property
    def apothem_m(self) -> float:
        """Distance of the plate's sides from the axis; it has two sides for each marker."""
        return self.plate_circumradius_m * np.cos(np.pi / (2 * self.symmetry))

    def marker_corners_m(self) -> np.ndarray:
        """Corners of the markers in the port frame, shape (symmetry, 4, 3)."""
        tangential, radial = np.array(self.marker_size_m) / 2
        x = self.marker_radius_m + radial * np.array([-1, 1, 1, -1])
        y = tangential * np.array([-1, -1, 1, 1])
        corners = np.column_stack([x, y, np.full(4, self.plate_height_m)])
        yaws = np.arange(self.symmetry) * self.yaw_period_rad
        return np.stack([corners @ Rotation.from_rotvec([0, 0, a]).as_matrix().T for a in yaws])
