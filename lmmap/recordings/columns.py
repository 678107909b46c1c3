"""Columns of a table of estimates: the names, units and frames that any program needs to read it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

POSE = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
ELLIPSE = ("u_px", "v_px", "semi_major_px", "semi_minor_px", "angle_rad")
SCORES = ("arc_coverage", "marker_score", "rival_score")
CERTAINTY = ("margin", "tilt_sigmas", "confidence")
OUTSIDE = "outside_training"
AXES = ("x", "y", "z", "rx", "ry", "rz")  # of a covariance: m and rad, camera's axes
UPPER = np.triu_indices(6)
COVARIANCE = tuple(f"cov_{AXES[i]}_{AXES[j]}" for i, j in zip(*UPPER, strict=True))
UNDISTORTED = "image, free of lens distortion"
PREFIXES = {"T_cam_port": "", "rival": "rival_", "printed": "printed_", "ring": "ring_", "twin": "twin_",
            "doubtful": "doubtful_"}  # fmt: skip


class Columns(NamedTuple):
    """Columns that belong together, in the order of the file."""

    names: tuple[str, ...]
    unit: str
    frame: str
    meaning: str


def _pose(prefix: str, meaning: str) -> tuple[Columns, Columns]:
    names = tuple(prefix + name for name in POSE)
    return (
        Columns(names[:3], "m", "camera", f"position of the port's origin, {meaning}"),
        Columns(names[3:], "1", "camera", f"unit quaternion of the rotation from port to camera, {meaning}"),
    )


TABLE = (
    Columns(("t_us",), "us", "the recording's clock", "time of the frame, or middle of the events' span"),
    Columns(("status",), "", "", "ok; predicted: by a tracker, not by the image; or why there is no pose"),
    *_pose("", "where the status is ok or predicted"),
    Columns(SCORES[:1], "1", "image", "fraction of the ellipse's contour with inliers nearby, 0 to 1"),
    Columns(SCORES[1:2], "1", "image", "mean marker mask inside the projected markers, 0 to 1"),
    Columns(SCORES[2:], "1", "image", "the same for the rival, the pose with the circle's other normal"),
    Columns(ELLIPSE[:2], "px", UNDISTORTED, "centre of the ring's ellipse; whole numbers are pixel centres"),
    Columns(ELLIPSE[2:4], "px", UNDISTORTED, "its semi-axes"),
    Columns(ELLIPSE[4:], "rad", UNDISTORTED, "from +u to its major axis, modulo pi"),
    *_pose("rival_", "by the circle's other normal"),
    *_pose("printed_", "from the same ellipse by the printed formula"),
    Columns(
        CERTAINTY[:1], "1", "image", "how much better the pose explains the markers than its rival, 0 to 1"
    ),
    Columns(CERTAINTY[1:2], "standard deviations", "", "tilt of the ring away from head-on"),
    Columns(CERTAINTY[2:], "1", "", "probability that the pose is right, 0 to 1"),
    Columns(
        (OUTSIDE,), "0 or 1", "image", "1 where the ring is smaller or larger than in the training images"
    ),
    Columns(
        COVARIANCE,
        "m², m rad, rad²",
        "camera",
        "upper triangle of the covariance of x, y, z and of the rotation rx, ry, rz about the camera's axes; "
        "of the ring's pose where there is no other",
    ),
    *_pose("ring_", "from the ring alone; the yaw is unknown"),
    *_pose("twin_", "from the ring alone, by its other normal"),
    *_pose("doubtful_", "withheld: its confidence is too low, and the status is unsure"),
)
COLUMNS = [name for columns in TABLE for name in columns.names]
