"""The geometry of a docking port."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from .checks import camera_files, check_fields, check_number, checked

SYMMETRY = 1, 360  # markers a turn; at a degree each they are one ring
OFFSET_M = -1e3, 1e3  # within a kilometre
WINDOW_M = 0.0, 1e3  # zero: none
TOLERANCE = 1e-4, 0.5  # of a length: from a hair's breadth to half of it
TOLERANCES = "plate_height_tolerance", "marker_radius_tolerance", "ring_width_tolerance"
ROUNDING_M = 1e-9  # by which parts that touch may seem to overlap


@dataclass(frozen=True)
class Port:
    """Geometry of a docking port: the ring, the raised plate with its markers and windows, and the panel.

    Tolerances are relative standard deviations: how far a mock-up, as built, may differ from these
    dimensions.  The defaults follow from the port in the paper's own overlays.  The overlays' lens leaves the
    plate's height uncertain by 5 %, and two images of the mock-up suggest 0.30 and 0.36 of the ring's outer
    radius where the model has 0.40; a larger tolerance would cost accuracy for a port as drawn.  All other
    dimensions moved by less than 2 %.

    Raises
    ------
    ValueError
        If a field has another type or is out of range, or parts of the port overlap.

    Examples
    --------
    >>> port = lmmap.Port.lm_map()
    >>> port.symmetry, round(np.degrees(port.yaw_period_rad))
    (3, 120)
    """

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
    window_radius_m: float = 0.0  # of their centres, which lie half way between the markers
    window_size_m: tuple[float, float] = (0.0, 0.0)  # tangential, radial; zero: no windows
    plate_height_tolerance: float = 0.07
    marker_radius_tolerance: float = 0.01
    ring_width_tolerance: float = 0.05  # about the same centre line

    def __post_init__(self):
        check_fields(self)
        if not 0 < self.ring_inner_radius_m < self.ring_radius_m < self.ring_outer_radius_m:
            radii_m = self.ring_inner_radius_m, self.ring_radius_m, self.ring_outer_radius_m
            raise ValueError(
                "ring_inner_radius_m, ring_radius_m, ring_outer_radius_m: expected the radius of the ring "
                f"between those of its two edges, and all above zero, got {radii_m}"
            )
        check_number("symmetry", self.symmetry, *SYMMETRY)
        for name in ("plate_circumradius_m", "plate_height_m", "marker_radius_m"):
            check_number(name, getattr(self, name), *OFFSET_M)
        for name in TOLERANCES:
            check_number(name, getattr(self, name), *TOLERANCE)
        for value in (self.window_radius_m, *self.window_size_m):
            check_number("window_radius_m, window_size_m", value, *WINDOW_M)
        self._check_windows()

    def _check_windows(self) -> None:
        """ValueError unless the windows, if there are any, lie on the plate and apart from the markers."""
        if bool(self.window_size_m[0]) != bool(self.window_size_m[1]):
            raise ValueError(f"window_size_m: expected two sizes, or two zeros, got {self.window_size_m}")
        if not len(windows := self.window_corners_m()[..., :2]):
            return
        sides = _directions(np.arange(2 * self.symmetry) * np.pi / self.symmetry)
        if (windows[0] @ sides.T).max() > self.apothem_m + ROUNDING_M:
            raise ValueError("window_size_m, window_radius_m: the windows leave the plate")
        for what, others in (("the markers", self.marker_corners_m()[..., :2]), ("one another", windows[1:])):
            if any(_overlap(windows[0], other) for other in others):
                raise ValueError(f"window_size_m, window_radius_m: the windows overlap {what}")

    @classmethod
    def lm_map(cls) -> Port:
        """Lockheed Martin Mission Augmentation Port, with the proportions of the authors' CAD.

        The proportions were measured in the paper's overlays, which show projections of that model.
        """
        return cls(
            ring_radius_m=0.0800,
            ring_inner_radius_m=0.0707,
            ring_outer_radius_m=0.0893,
            plate_circumradius_m=0.0545,
            plate_height_m=0.0361,
            marker_radius_m=0.0393,
            marker_size_m=(0.0536, 0.0161),
            petal_widths_m=(0.0506, 0.0225),
            petal_rise_m=0.0256,
            petal_lean_m=0.0124,
            stem_radius_m=0.0185,
            panel_depth_m=0.009,
            panel_size_m=(0.68, 0.44),
            window_radius_m=0.0317,
            window_size_m=(0.0250, 0.0206),
        )

    @classmethod
    @checked
    def load(cls, path: str | Path) -> Port:
        """Read a JSON file with the fields of this class; raises `InputError`."""
        return camera_files().read_port(path)

    @checked
    def save(self, path: str | Path) -> None:
        """Write the JSON that `load` reads; raises `InputError`."""
        camera_files().write_fields(path, self)

    @property
    def yaw_period_rad(self) -> float:
        """Yaw is known modulo this angle."""
        return 2 * np.pi / self.symmetry

    @property
    def apothem_m(self) -> float:
        """Distance of the plate's sides from the axis; the plate has two sides for each marker."""
        return self.plate_circumradius_m * np.cos(np.pi / (2 * self.symmetry))

    def marker_corners_m(self) -> np.ndarray:
        """Corners of the markers in the port frame, shape (symmetry, 4, 3)."""
        return self._corners_m(self.marker_radius_m, self.marker_size_m, 0.0)

    def window_corners_m(self) -> np.ndarray:
        """Corners of the windows in the port frame, shape (symmetry, 4, 3), or (0, 4, 3) without windows."""
        corners = self._corners_m(self.window_radius_m, self.window_size_m, self.yaw_period_rad / 2)
        return corners if any(self.window_size_m) else corners[:0]

    def _corners_m(self, radius_m: float, size_m, first_yaw_rad: float) -> np.ndarray:
        """Corners of equal rectangles (tangential, radial) on the plate, shape (symmetry, 4, 3)."""
        tangential, radial = np.array(size_m) / 2
        x = radius_m + radial * np.array([-1, 1, 1, -1])
        y = tangential * np.array([-1, -1, 1, 1])
        corners = np.column_stack([x, y, np.full(4, self.plate_height_m)])
        yaws = first_yaw_rad + np.arange(self.symmetry) * self.yaw_period_rad
        return np.stack([corners @ Rotation.from_rotvec([0, 0, a]).as_matrix().T for a in yaws])


def _directions(angle_rad) -> np.ndarray:
    """Unit vectors (N, 2)."""
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], -1)


def _overlap(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two rectangles (4, 2) overlap: no side of either has all of the other beyond it."""
    for corners in (a, b):
        for side in np.diff(corners[:3], axis=0):
            along_a, along_b = a @ side, b @ side
            gap = max(along_a.min() - along_b.max(), along_b.min() - along_a.max())
            if gap > -ROUNDING_M * np.linalg.norm(side):
                return False
    return True
