"""Words of the module: cameras, ports, poses, ellipses, events, recordings, estimates.

Frames: ``cam`` has x right, y down, z forward.  ``port`` has its origin at the ring's centre in the
ring's plane, z out of the port toward the visitor and x through marker 0.  ``T_a_b`` maps
b-coordinates to a.  Units are metres, pixels, radians and microseconds unless a name says otherwise;
integer pixel coordinates are pixel centres.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from . import camera_files
from .files import InputError as InputError

EVENT = np.dtype([("t_us", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "?")], align=True)


def frozen_array(a, dtype=float) -> np.ndarray:
    """A read-only copy, so that no holder of a dataclass can change it."""
    a = np.array(a, dtype)
    a.setflags(write=False)
    return a


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

    def marker_corners_m(self) -> np.ndarray:
        """Corners of the markers in the port frame, shape (symmetry, 4, 3)."""
        tangential, radial = np.array(self.marker_size_m) / 2
        x = self.marker_radius_m + radial * np.array([-1, 1, 1, -1])
        y = tangential * np.array([-1, -1, 1, 1])
        corners = np.column_stack([x, y, np.full(4, self.plate_height_m)])
        yaws = np.arange(self.symmetry) * self.yaw_period_rad
        return np.stack([corners @ Rotation.from_rotvec([0, 0, a]).as_matrix().T for a in yaws])


@dataclass(frozen=True)
class Ellipse:
    """Ellipses in the image: ``centre_px (..., 2)``, ``semi_axes_px (..., 2)`` with major first,
    ``angle_rad (...)`` from +u to the major axis, modulo pi."""

    centre_px: np.ndarray
    semi_axes_px: np.ndarray
    angle_rad: np.ndarray

    def __post_init__(self):
        for f in fields(self):
            object.__setattr__(self, f.name, frozen_array(getattr(self, f.name)))

    def points(self, count: int = 360) -> np.ndarray:
        """Points on the contour, shape (..., count, 2)."""
        s = np.linspace(0, 2 * np.pi, count, endpoint=False)
        a, b = self.semi_axes_px[..., :1], self.semi_axes_px[..., 1:]
        c, d = np.cos(self.angle_rad)[..., None], np.sin(self.angle_rad)[..., None]
        local = np.stack([a * np.cos(s) * c - b * np.sin(s) * d, a * np.cos(s) * d + b * np.sin(s) * c], -1)
        return self.centre_px[..., None, :] + local


@dataclass(frozen=True)
class Pose:
    """Rigid transforms ``T_a_b``: ``rotation (..., 3, 3)`` and ``position_m (..., 3)``."""

    rotation: np.ndarray
    position_m: np.ndarray

    def __post_init__(self):
        for f in fields(self):
            object.__setattr__(self, f.name, frozen_array(getattr(self, f.name)))

    @classmethod
    def identity(cls) -> Pose:
        return cls(np.eye(3), np.zeros(3))

    def __matmul__(self, other):
        """``T_a_b @ T_b_c -> T_a_c`` and ``T_a_b @ p_b -> p_a`` for points of shape (..., 3)."""
        if isinstance(other, Pose):
            return Pose(self.rotation @ other.rotation, self @ other.position_m)
        return np.einsum("...ij,...j->...i", self.rotation, other) + self.position_m

    def __getitem__(self, index) -> Pose:
        return Pose(self.rotation[index], self.position_m[index])

    def __len__(self) -> int:
        return len(self.position_m)

    @property
    def inverse(self) -> Pose:
        rotation = np.swapaxes(self.rotation, -1, -2)
        return Pose(rotation, -np.einsum("...ij,...j->...i", rotation, self.position_m))

    @property
    def normal(self) -> np.ndarray:
        """The b-frame's z axis in a, shape (..., 3): the port's normal for ``T_cam_port``."""
        return self.rotation[..., :, 2]

    @property
    def quaternion_xyzw(self) -> np.ndarray:
        return Rotation.from_matrix(self.rotation).as_quat(canonical=True)


@dataclass(frozen=True)
class Trajectory:
    """Poses ``T_cam_port`` at strictly increasing times ``t_us (N,)``."""

    t_us: np.ndarray
    T_cam_port: Pose

    def __post_init__(self):
        object.__setattr__(self, "t_us", frozen_array(self.t_us, np.int64))
        if len(self.t_us) != len(self.T_cam_port):
            raise ValueError(f"Trajectory: {len(self.t_us)} times but {len(self.T_cam_port)} poses")
        if np.any(np.diff(self.t_us) <= 0):
            raise ValueError("Trajectory: times must increase strictly")

    def __len__(self) -> int:
        return len(self.t_us)

    def at(self, t_us) -> Pose:
        """Interpolate (linear, slerp) at times inside the trajectory; ValueError outside it."""
        t = np.asarray(t_us)
        if t.size and (t.min() < self.t_us[0] or t.max() > self.t_us[-1]):
            raise ValueError(f"Trajectory: asked outside [{self.t_us[0]}, {self.t_us[-1]}] us")
        seconds = (self.t_us - self.t_us[0]) * 1e-6
        rotations = Slerp(seconds, Rotation.from_matrix(self.T_cam_port.rotation))
        s = (t - self.t_us[0]) * 1e-6
        position = np.stack([np.interp(s, seconds, c) for c in self.T_cam_port.position_m.T], -1)
        return Pose(rotations(s).as_matrix(), position)


@dataclass(frozen=True)
class Recording:
    """One camera's recording: ``events (M,) EVENT`` sorted by time, ``frames (N, H, W, 3)`` u8 RGB at
    ``frames_t_us (N,)`` (middle of the exposure), and the true trajectory where it is known."""

    name: str
    camera: Camera
    events: np.ndarray
    frames: np.ndarray
    frames_t_us: np.ndarray
    truth: Trajectory | None = None

    def chunks(self):
        """Yield the events in one piece, as a `streams.Stream` yields its own in many."""
        yield self.events

    def timed_frames(self):
        """Yield ``(t_us, frame)``."""
        yield from zip(self.frames_t_us.tolist(), self.frames, strict=True)


class AnyRecording(Protocol):
    """What a `Recording` in memory and a stream from a file have in common."""

    name: str
    camera: Camera
    truth: Trajectory | None

    def chunks(self) -> Iterator[np.ndarray]:
        """Chunks (M,) EVENT in the order of time."""

    def timed_frames(self) -> Iterator[tuple[int, np.ndarray]]:
        """``(t_us, (H, W, 3) u8)`` in the order of time."""


class Status(StrEnum):
    """Why a frame has a pose, or has none."""

    OK = "ok"
    NO_RING = "no_ring"  # too few active pixels (gamma_S of the paper)
    NO_ELLIPSE = "no_ellipse"  # no ellipse of sensible size, shape and arc coverage
    NO_MARKERS = "no_markers"  # a ring, but no marker where the port has one


@dataclass(frozen=True)
class Estimate:
    """The answer for one frame or histogram; ``T_cam_port`` is None unless ``status`` is OK."""

    t_us: int
    status: Status
    T_cam_port: Pose | None = None
    rival: Pose | None = None  # best pose with the other normal
    paper: Pose | None = None  # the paper's formula on the same ellipse and markers
    ellipse: Ellipse | None = None
    arc_coverage: float = 0.0  # of the ellipse's contour that has a ring point, in [0, 1]
    marker_score: float = 0.0  # mean marker mask inside the projected markers, in [0, 1]
    rival_score: float = 0.0  # the same for ``rival``
    margin: float = 0.0  # how much better the normal explains the markers than the rival's, in [0, 1]
    tilt_sigmas: float = 0.0  # distance of the ring from head-on, in its own standard deviations
    covariance: np.ndarray | None = (
        None  # (6, 6) of x, y, z (m), rotation (rad), camera's axes: `uncertainty`; or of ``ring``
    )
    ring: Pose | None = None  # without markers: the circle's pose, its yaw unknown
    twin: Pose | None = None  # and its other pose
