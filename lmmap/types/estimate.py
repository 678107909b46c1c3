"""The answer for one image."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from .ellipse import Ellipse
from .pose import Pose


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
