"""The figure with a slider of the chapter on ellipses, and the points of its trials."""

from __future__ import annotations

import numpy as np

from lmmap.geometry.conic_fit import five_point_conics, normalise, sampson_distance, to_pixels
from lmmap.geometry.conics import conic_matrix, ellipse_from_conic
from lmmap.pipeline import ellipse
from lmmap.settings import OURS, Settings
from lmmap.types import Camera, Ellipse

from .sliders import Step

NOTHING_PX = np.empty((0, 2))


def ransac_steps(
    mask, points_px, draws: int, rng: np.random.Generator, settings: Settings = OURS
) -> list[Step]:
    """RANSAC draw by draw: five points, the conic through them, and the points that lie on it.

    The last step is the answer of `ellipse.fit_ransac`, which makes draws of its own.

    Parameters
    ----------
    mask : (H, W) in [0, 1], the background
    points_px : (N, 2)
    draws : the number of draws to show
    """
    x, centre, scale = normalise(points_px)
    steps, most = [], 0
    for k in range(draws):
        five = rng.choice(len(x), 5, replace=False)
        theta = five_point_conics(x, five[None])  # none where they do not determine one
        fitted, real = ellipse_from_conic(conic_matrix(theta))
        on, contour, title = np.zeros(len(x), bool), NOTHING_PX, "no ellipse passes through these five"
        if real.any():
            on = np.abs(sampson_distance(theta, x))[0] * scale < settings.ransac_tolerance_px
            contour = to_pixels(fitted, centre, scale).points(180)[0]
            title = f"{on.sum()} of {len(x)} points lie on the ellipse"
        most = max(most, on.sum())
        title = f"{title}; best so far {most}"
        steps.append(_step(f"{k + 1}", title, mask, points_px, on, points_px[five], contour))
    answer, inliers = ellipse.fit_ransac(points_px, rng, settings)
    contour = NOTHING_PX if answer is None else answer.points(180)
    title = f"after {settings.ransac_hypotheses} draws and refits: {inliers.sum()} of {len(x)} points"
    return [*steps, _step("all", title, mask, points_px, inliers, NOTHING_PX, contour)]


def half_ellipse(
    outliers: float, camera: Camera, rng: np.random.Generator, count: int = 400, noise_px: float = 0.5
) -> tuple[Ellipse, np.ndarray]:
    """An ellipse, and points (count, 2): a share of them anywhere in the image, the others on one half of it.

    Parameters
    ----------
    outliers : the share of wrong points, from 0 to 1
    noise_px : standard deviation of the good points' coordinates
    """
    a, wrong = rng.uniform(35, 85), int(count * outliers)
    drawn = Ellipse(rng.uniform([110, 90], [236, 170]), [a, a * rng.uniform(0.4, 1)], rng.uniform(0, np.pi))
    half = (rng.integers(3600) + rng.integers(0, 1800, count - wrong)) % 3600
    good_px = drawn.points(3600)[half] + noise_px * rng.standard_normal((count - wrong, 2))
    return drawn, np.vstack([good_px, rng.uniform(0, camera.size_px, (wrong, 2))])


def _step(label, title, mask, points_px, on, five_px, contour) -> Step:
    return Step(label, title, 0.4 * np.clip(mask, 0, 1), (
        ("points", points_px[~on], "event", "markers"), ("inliers", points_px[on], "truth", "markers"),
        ("ellipse", contour, "ours", "lines"), ("the five drawn points", five_px, "rival", "markers"),
    ))  # fmt: skip
