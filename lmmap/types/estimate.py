"""The answer for one image."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from .arrays import frozen_numbers
from .checks import checked
from .ellipse import Ellipse
from .pose import Pose


class Status(StrEnum):
    """Whether an image has a pose and, if not, why not.

    Examples
    --------
    >>> lmmap.Status("no_ring") == "no_ring"
    True
    """

    OK = "ok"
    NO_RING = "no_ring"  # too few active pixels (gamma_S of the paper)
    NO_ELLIPSE = "no_ellipse"  # no ellipse of sensible size, shape and arc coverage
    NO_MARKERS = "no_markers"  # a ring, but no marker where the port has one
    UNSURE = "unsure"  # a pose, but the masks hardly support it, or a track with too few images
    PREDICTED = "predicted"  # a tracker's pose that the image does not support: from earlier images alone


@dataclass(frozen=True)
class Estimate:
    """The answer for one frame or histogram.

    Attributes
    ----------
    t_us : int
        Time of the frame, or the middle of the histogram's events, in microseconds.
    status : Status
        ``ok``, or why there is no pose.
    T_cam_port : Pose or None
        The port in the camera's frame; None unless the status is ``ok`` or ``predicted``.
    rival : Pose or None
        The best pose with the circle's other normal.
    printed : Pose or None
        The pose from the formula as the paper prints it, on the same ellipse and markers.
    ellipse : Ellipse or None
        The ring's contour, free of lens distortion.
    arc_coverage : float
        Fraction of the ellipse's contour on which points of the ring lie, in [0, 1].
    marker_score, rival_score : float
        Mean of the marker mask inside the markers as the pose, and its rival, project them, in [0, 1].
    margin : float
        How much better the pose explains the markers than its rival, in [0, 1].
    tilt_sigmas : float
        Tilt of the ring away from head-on, in units of its own standard deviation.
    covariance : numpy.ndarray or None
        Covariance (6, 6) of ``T_cam_port``: x, y, z (m), then the rotation about the camera's axes (rad); if
        there is no pose, that of ``ring``.
    ring, twin : Pose or None
        Without markers: the circle's two poses, their yaw unknown.
    confidence : float
        Probability that the pose is right (`verify.confidence`), in [0, 1]; 0 where none was found.
    doubtful : Pose or None
        The pose that is not reported because its confidence is too low, or because too few images support
        its track; the status is then ``unsure``.
    predicted : Pose or None
        From a tracker: the pose that it predicted before it used the image.
    measured : Pose or None
        From a tracker: the pose from the image alone, or None if the image gives no pose.
    outside_training : bool
        Whether the ring, in the networks' pixels, is smaller or larger than any that they were trained on.
    markers_off_px : float or None
        Distance of the markers from where the port's geometry puts them, at the best pose, in the networks'
        pixels; None without a refined pose.

    Examples
    --------
    >>> e = lmmap.Estimate(8000, lmmap.Status.NO_RING)
    >>> e.T_cam_port is None, e.confidence
    (True, 0.0)
    """

    t_us: int
    status: Status
    T_cam_port: Pose | None = None
    rival: Pose | None = None
    printed: Pose | None = None
    ellipse: Ellipse | None = None
    arc_coverage: float = 0.0
    marker_score: float = 0.0
    rival_score: float = 0.0
    margin: float = 0.0
    tilt_sigmas: float = 0.0
    covariance: np.ndarray | None = None
    ring: Pose | None = None
    twin: Pose | None = None
    confidence: float = 0.0
    doubtful: Pose | None = None
    predicted: Pose | None = None
    measured: Pose | None = None
    outside_training: bool = False
    markers_off_px: float | None = None

    def __post_init__(self):
        if self.covariance is not None:
            object.__setattr__(self, "covariance", frozen_numbers("covariance", self.covariance, 6, 6))

    @property
    def found(self) -> Pose | None:
        """The pose, reported or doubtful."""
        return self.doubtful if self.T_cam_port is None else self.T_cam_port

    @checked
    def judged(self, confidence: float, least: float) -> Estimate:
        """Return this estimate with a new confidence: if it is at least ``least``, the pose is reported;
        otherwise the status is ``unsure``."""
        if confidence >= least:
            answer: dict[str, Any] = {"status": Status.OK, "T_cam_port": self.found, "doubtful": None}
        else:
            answer = {"status": Status.UNSURE, "T_cam_port": None, "doubtful": self.found}
        return replace(self, **answer, confidence=confidence)

    def _repr_html_(self) -> str:
        """A small table, as notebooks show it."""
        rows = {"time": f"{self.t_us * 1e-6:.6f} s", "status": str(self.status)}
        if self.T_cam_port is not None:
            x, y, z = 1e3 * self.T_cam_port.position_m
            tilt_deg = np.degrees(np.arccos(np.clip(-self.T_cam_port.normal[2], -1, 1)))
            rows["port, in the camera's frame"] = f"x {x:.1f}, y {y:.1f}, z {z:.1f} mm"
            rows["tilt of its normal from the optical axis"] = f"{tilt_deg:.1f}°"
            rows["marker score"] = f"{self.marker_score:.2f}"
            if self.covariance is not None and np.all(np.isfinite(self.covariance)):
                x, y, z = 1e3 * np.sqrt(np.diag(self.covariance)[:3])
                rows["standard deviation"] = f"x {x:.1f}, y {y:.1f}, z {z:.1f} mm"
        lines = "".join(f"<tr><th>{name}</th><td>{value}</td></tr>" for name, value in rows.items())
        return f"<table>{lines}</table>"
