"""The paper's formula for the circle's pose: what it is off by without any noise, and why.

The paper takes the middle of the bearings of the major axis' ends for the direction of the ring's centre. But
the centre of the ellipse is not the image of the circle's centre, unless the circle is seen head-on.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import in_view
from lmmap.pipeline import circle
from lmmap.types import Camera, Ellipse, Port, Pose

from ..bench.laboratory import SECONDS, sequence, sequence_motion

READINGS = {
    "printed": "nearer root of each end, through the printed centre",
    "ends": "from the nearer root of one end to the farther root of the other",
    "four": "the best of both roots of both ends",
    "true centre": "nearer root of each end, through the true centre",
}
DAVIS346_PITCH_M = 18.5e-6


def centre_offset_rad(distance_m, tilt_rad, radius_m: float) -> np.ndarray:
    """Angle between the lines of sight to the ellipse's centre and to the circle's, for a circle on the axis.

    The minor axis' ends are seen at tangents +-nu cos(tilt) / (Z +- nu sin(tilt)).  Their mean, the ellipse's
    centre, is at nu^2 sin(tilt) cos(tilt) / (Z^2 - nu^2 sin(tilt)^2) from the axis.
    """
    sine, cosine = np.sin(tilt_rad), np.cos(tilt_rad)
    return np.arctan(radius_m**2 * sine * cosine / (np.square(distance_m) - (radius_m * sine) ** 2))


def normals(ellipse: Ellipse, camera: Camera, radius_m: float, reading: str, centre_m=None) -> np.ndarray:
    """Candidate normals (..., K, 3) of undistorted ellipses (...) by one of `READINGS`, toward the camera.

    Parameters
    ----------
    reading
        A key of `READINGS`.
    centre_m
        True centres (..., 3), for the reading ``"true centre"``.
    """
    if reading not in READINGS:
        raise ValueError(f"reading: expected one of {', '.join(READINGS)}, got {reading!r}")
    v_major, v_minor = circle.axis_bearings(ellipse, camera)
    major = v_major[..., 1, :] - v_major[..., 0, :]
    p = centre_m if reading == "true centre" else circle.printed_centre(v_major, radius_m)
    p = np.asarray(p, float)
    near, far = circle.points_on_sphere(v_minor, p[..., None, :], radius_m)
    minor = {
        "ends": np.stack([near[..., 0, :] - far[..., 1, :], near[..., 1, :] - far[..., 0, :]], -2),
        "four": np.concatenate([near, far], -2) - p[..., None, :],
    }.get(reading, near - p[..., None, :])
    n = np.cross(major[..., None, :], minor)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return -n * np.where(np.sum(n * p[..., None, :], -1) >= 0, 1.0, -1.0)[..., None]


def bench_poses(camera: Camera, port: Port, trajectories: int = 3, rate_hz: float = 10.0) -> Pose:
    """True poses (N,) of the bench's test trajectories with the whole ring in view; nothing is rendered."""
    t_s = np.arange(0, SECONDS["paper"]["test"], 1 / rate_hz)
    names = ["test-low" + (f"-{k}" if k else "") for k in range(trajectories)]
    motions = [sequence_motion(sequence(name), t_s) for name in names]
    T = Pose.stack(motions)
    return T[np.flatnonzero(in_view(T, port, camera))]


def tilt_to_sight_rad(T: Pose) -> np.ndarray:
    """Angle (...) between the port's normal and the line of sight to its centre."""
    cosine = -np.sum(T.normal * T.position_m, -1) / np.linalg.norm(T.position_m, axis=-1)
    return np.arccos(np.clip(cosine, -1, 1))


def errors_rad(T: Pose, camera: Camera, radius_m: float, reading: str) -> np.ndarray:
    """Angle (...) between the true normal and the better candidate, from ellipses without noise."""
    ellipse = circle_ellipse(T, radius_m, camera)
    n = normals(ellipse, camera, radius_m, reading, T.position_m)
    sine = np.linalg.norm(np.cross(n, T.normal[..., None, :]), axis=-1)
    return np.arctan2(sine, np.sum(n * T.normal[..., None, :], -1)).min(-1)


def medians_by_tilt(
    T: Pose, camera: Camera, radius_m: float, edges_deg=(0, 10, 20, 30, 45, 70)
) -> pd.DataFrame:
    """Median error (deg) of each reading in bins of the tilt to the line of sight, and of all poses."""
    tilt_deg = np.rad2deg(tilt_to_sight_rad(T))
    bins = {f"{a} to {b}": (tilt_deg >= a) & (tilt_deg < b) for a, b in pairwise(edges_deg)}
    bins["all"] = np.ones(len(tilt_deg), bool)
    errors_deg = {reading: np.rad2deg(errors_rad(T, camera, radius_m, reading)) for reading in READINGS}
    return pd.DataFrame(
        {r: {b: np.median(e[inside]) for b, inside in bins.items()} for r, e in errors_deg.items()}
    )


def behind_lens(T: Pose, camera: Camera, radius_m: float, ratio: float) -> tuple[Pose, Camera, float]:
    """Poses, camera and radius with ``ratio`` times the radius over the distance, and the same image.

    Behind a longer lens a smaller ring, nearer to the axis, is seen alike from the same distance.
    """
    focal_px = camera.fx_px / ratio
    lens = Camera(*camera.size_px, focal_px, focal_px, camera.cx_px, camera.cy_px)
    return Pose(T.rotation, T.position_m * [ratio, ratio, 1]), lens, ratio * radius_m


def lens_sweep(T: Pose, camera: Camera, radius_m: float, lenses_m) -> pd.DataFrame:
    """Median error (deg) of each reading by lens, with the ring's size and place in the image held fixed."""
    rows = {}
    for lens_m in lenses_m:
        there = behind_lens(T, camera, radius_m, camera.fx_px * DAVIS346_PITCH_M / lens_m)
        rows[1e3 * lens_m] = {
            reading: float(np.rad2deg(np.median(errors_rad(*there, reading)))) for reading in READINGS
        }
    return pd.DataFrame(rows).T.rename_axis("lens_mm")


def lens_for(median_deg: float, sweep: pd.DataFrame) -> float:
    """Lens (mm) at which the printed reading has a median error, between the rows of a `lens_sweep`."""
    falling = sweep["printed"].iloc[::-1]
    return float(
        np.exp(np.interp(np.log(median_deg), np.log(falling), np.log(falling.index.to_numpy(float))))
    )
