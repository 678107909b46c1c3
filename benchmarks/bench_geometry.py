"""Ellipse, circle and yaw, each against the paper's procedure in the same run.

    OMP_NUM_THREADS=1 python benchmarks/bench_geometry.py

Ratios are what to look at: both sides of a ratio ran on this machine within the same seconds.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # many small matrices: threads only cost

import time

import cv2
import numpy as np

from lmmap import circle, contour, ellipse, geometry, yaw
from lmmap.core import PAPER, Camera, Ellipse, Port, Pose

CAMERA, PORT = Camera.davis346(), Port.lm_map()
NU = PORT.ring_radius_m
REPEATS = 15


def best_s(function) -> float:
    """Least wall time of several calls."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def tilted_pose() -> Pose:
    """A port at 0.6 m, tilted by 30 deg, yawed by 20 deg."""
    c, s = np.cos(np.deg2rad(30)), np.sin(np.deg2rad(30))
    tilt = np.array([[c, 0, s], [0, -1, 0], [s, 0, -c]])
    return Pose(tilt @ geometry.rotation_z(np.deg2rad(20)), [0.03, -0.02, 0.6])


def soft_masks(T: Pose, rng) -> np.ndarray:
    masks = [cv2.GaussianBlur(m, (0, 0), 0.8) for m in geometry.ideal_masks(T, PORT, CAMERA)]
    return (np.stack(masks) + 0.03 * rng.standard_normal((2, 260, 346))).clip(0, 1).astype(np.float32)


def main() -> None:
    rng = np.random.default_rng(0)
    T = tilted_pose()
    ring, reflectors = soft_masks(T, rng)
    points = np.concatenate([ellipse.skeleton_points(ring), rng.uniform(0, 250, (150, 2))])
    image = geometry.circle_ellipse(T, NU, CAMERA)
    pair = circle.poses(image, CAMERA, NU)
    many = Ellipse(
        image.centre_px + rng.normal(size=(1000, 2)),
        np.tile(image.semi_axes_px, (1000, 1)),
        rng.uniform(0, 3, 1000),
    )

    rows = [
        (
            f"ellipse: batched / the paper's RANSAC, {len(points)} points, {PAPER.ransac_hypotheses} trials",
            lambda: ellipse.fit_ransac(points, np.random.default_rng(0)),
            lambda: ellipse.paper_ransac(points, np.random.default_rng(0)),
        ),
        (
            "yaw: correlation in the markers' plane / the paper's grid",
            lambda: yaw.fast_yaw(reflectors, pair, PORT, CAMERA),
            lambda: yaw.paper_yaw(reflectors, pair, PORT, CAMERA),
        ),
        (
            "circle: 1000 ellipses in one call / one by one",
            lambda: circle.poses(many, CAMERA, NU),
            lambda: [
                circle.poses(Ellipse(*e), CAMERA, NU)
                for e in zip(many.centre_px, many.semi_axes_px, many.angle_rad, strict=True)
            ],
        ),
        (
            "circle: exact / the paper's formula, 1000 ellipses",
            lambda: circle.poses(many, CAMERA, NU),
            lambda: circle.paper_poses(many, CAMERA, NU),
        ),
    ]
    print(f"{'ours ms':>9} {'peer ms':>9} {'peer/ours':>9}")
    for name, ours, peer in rows:
        a, b = best_s(ours), best_s(peer)
        print(f"{1e3 * a:9.3f} {1e3 * b:9.3f} {b / a:9.1f}  {name}")
    fine = best_s(lambda: contour.trace(image, ring, 12.0))
    print(f"{1e3 * fine:9.3f} {'-':>9} {'-':>9}  ellipse: refinement on the mask")


if __name__ == "__main__":
    main()
