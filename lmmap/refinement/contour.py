"""The ring's contour to a fraction of a pixel: sampled from the soft mask, free of lens distortion.

Points are measured on the mask as the lens made it and undistorted one by one; an ellipse cannot be,
because distortion bends it into something else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..geometry.compiled import njit
from ..geometry.conic_fit import normalise, sampson_distance, sampson_fit, to_pixels
from ..geometry.conics import conic_coefficients, conic_from_ellipse, conic_matrix, ellipse_from_conic
from ..geometry.projection import distort_points
from ..geometry.robust import median, tukey_cut, tukey_weights
from ..geometry.sampling import profiles, sample
from ..settings import OURS, Settings
from ..types import Camera, Ellipse


class Edge(NamedTuple):
    """Points (M, 2) of one of the ring's edges, undistorted, and the standard deviation (M,) of each."""

    points_px: np.ndarray
    sigma_px: np.ndarray


@dataclass(frozen=True)
class Contour:
    """An ellipse and the points (M, 2) it was fitted to, both undistorted, with the points' standard
    deviation about it in pixels.

    ``score`` is the mask's mean along the ellipse, ``arc_coverage`` the fraction of it on which points of the
    ring lie.  If the mask has a stroke, ``width`` is its width in radii, and ``edges`` are its inner and its
    outer edge.
    """

    ellipse: Ellipse
    points_px: np.ndarray
    sigma_px: float
    score: float = 1.0
    arc_coverage: float = 0.0
    width: float | None = None
    edges: tuple[Edge, ...] = ()


def trace(
    ellipse: Ellipse, mask, half_width_px: float, camera: Camera | None = None, settings: Settings = OURS,
    rounds: tuple[int, ...] = (2, 2),
) -> Contour | None:  # fmt: skip
    """Trace both edges of a soft mask's stroke and the middle between them, starting from a nearby ellipse;
    return None if there is no stroke.

    Sample the mask along rays from the ellipse's centre, find where each profile falls to half its height on
    either side, and refit the ellipse to the midpoints, once for each of ``rounds``.  Anything fainter than
    half of the ring beside it moves no edge, and a point is weighted by the square of the slope there.  Rays
    without a stroke, or with a width unlike the others' (a second blob, an occluder), don't count; with too
    few good rays there is no stroke.

    The middle of an annulus' image is not exactly the image of its centre line.  Along rays, an affine
    camera would make it so; perspective leaves at most 0.05 deg and 0.12 mm from 0.3 m on (along the
    normals it would be 1.8 mm).

    Parameters
    ----------
    ellipse : undistorted
    mask : (H, W), values in [0, 1], as the camera saw it
    half_width_px : of the strip along the major axis, about the stroke's full width
    camera : whose distortion the mask has; default none
    rounds : of weights, in each fit; a start within a pixel or two needs one fit only
    """
    mask = np.asarray(mask, np.float32)
    offsets = np.arange(-half_width_px, half_width_px + 0.25, 0.5)
    for fits in rounds:
        points = ellipse.points(max(24, int(2 * ellipse.semi_axes_px.sum())))
        radius = np.linalg.norm(points - ellipse.centre_px, axis=1, keepdims=True)
        rays = (points - ellipse.centre_px) / radius
        profile = profiles(mask, points, rays, offsets, camera)
        falls, slopes = _half_heights(profile, settings.contour_floor)
        ends = np.stack([offsets[-1] - 0.5 * falls[0], offsets[0] + 0.5 * falls[1]])
        shares = ends / radius[:, 0]  # along every ray an annulus is as wide, in radii
        width = shares[1] - shares[0]
        good = np.isfinite(width)
        if not good.any():
            return None
        typical = median(width[good])
        narrow, wide = settings.contour_widths
        good &= (width > narrow * typical) & (width < wide * typical)
        if good.mean() < settings.contour_min_rays:
            return None
        slopes = slopes[:, good]
        weights = np.minimum(slopes / _medians(slopes), 1) ** 2
        edges_px = points[good] + ends[:, good, None] * rays[good]
        start, middle_px = ellipse, edges_px.mean(0)
        ellipse, inlier, sigma_px = _fit_robust(middle_px, start, fits, 2 / np.sum(1 / weights, 0))
    edges = _edges(edges_px, shares[:, good], weights, np.flatnonzero(good) / len(good), start)
    return Contour(ellipse, middle_px[inlier], sigma_px, width=float(typical), edges=edges)


def _edges(points_px, shares, weights, turns, about: Ellipse) -> tuple[Edge, ...]:
    """Those of both edges' points (2, M, 2) that lie on an ellipse of their own, by their scatter about it.

    ``shares`` (2, M) say how far beyond another ellipse they are, in its radii, at eccentric anomalies (M,)
    in turns.  For an ellipse near that one it is a sum of harmonics up to the second.
    """
    c, s = np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)
    harmonics = np.stack([np.ones_like(c), c, s, c * c - s * s, c * s])
    major_px, minor_px = about.semi_axes_px
    across_px = major_px * minor_px / np.hypot(major_px * s, minor_px * c)  # of one radius
    own = np.ones(shares.shape, bool)
    for _ in range(2):
        weighted = harmonics * (weights * own)[:, None]
        fitted = np.linalg.solve(weighted @ harmonics.T + 1e-9 * np.eye(5), weighted @ shares[..., None])
        gap_px = np.abs(shares - fitted[..., 0] @ harmonics) * across_px
        own = gap_px < np.array([[tukey_cut(edge)] for edge in gap_px])
    w = weights * own
    variance = np.sum(w * gap_px**2, 1, keepdims=True) / np.maximum(w.sum(1, keepdims=True) - 5, 1)
    sigma_px = np.sqrt(variance / weights)
    return tuple(Edge(at[on], sigma[on]) for at, on, sigma in zip(points_px, own, sigma_px, strict=True))


@njit(nogil=True, error_model="numpy")
def _half_heights(profile, floor):
    """Where profiles (N, K) fall to half their maximum before and after it, (2, N) in steps from the last and
    from the first value, and their slopes there; NaN where they do not, or where the half is below the
    floor."""
    count, last = profile.shape[0], profile.shape[1] - 1
    falls, slopes = np.full((2, count), np.nan), np.full((2, count), np.nan)
    for i in range(count):
        half = profile[i].max() / 2
        if half <= floor:
            continue
        for side in range(2):
            one = profile[i, ::-1] if side == 0 else profile[i]
            k = one.argmax()
            while k < last and one[k] >= half:
                k += 1
            if one[k] < half:
                slopes[side, i] = one[k - 1] - one[k]
                falls[side, i] = k - 1 + (one[k - 1] - half) / slopes[side, i]
    return falls, slopes


def _medians(values) -> np.ndarray:
    """Medians (N, 1) of rows (N, M)."""
    return np.array([[median(row)] for row in values])


def score(ellipse: Ellipse, mask, camera: Camera | None = None) -> float:
    """Mean of a mask (H, W) along an undistorted ellipse, zero outside the image."""
    points = ellipse.points(max(24, int(2 * ellipse.semi_axes_px.sum())))
    points = distort_points(points, camera) if camera else points
    return float(sample(mask, points).mean())


def from_points(ellipse: Ellipse, points_px) -> Contour:
    """Make a contour from an ellipse and points (M, 2) that are already known to lie on it."""
    x, theta, _, scale = _normalise(np.asarray(points_px, float), ellipse)
    return Contour(ellipse, points_px, float(scale * np.sqrt(np.mean(sampson_distance(theta, x) ** 2))))


def _normalise(points, ellipse: Ellipse):
    x, centre, scale = normalise(points)
    to_px = np.array([[scale, 0, centre[0]], [0, scale, centre[1]], [0, 0, 1]])
    return x, conic_coefficients(to_px.T @ conic_from_ellipse(ellipse) @ to_px), centre, scale


def _fit_robust(points, start: Ellipse, rounds: int, weight) -> tuple[Ellipse, np.ndarray, float]:
    """Sampson fit with Tukey's weights at `TUKEY` robust standard deviations, times other ones, from a nearby
    ellipse; which points have Tukey's, and their standard deviation about the fit."""
    x, theta, centre, scale = _normalise(points, start)
    for _ in range(rounds):
        r = sampson_distance(theta, x)
        cut = tukey_cut(r)
        theta = sampson_fit(theta, x, weight * tukey_weights(r, cut), steps=2)
    ellipse, real = ellipse_from_conic(conic_matrix(theta))
    real = real and ellipse.semi_axes_px[0] < 10 and ellipse.semi_axes_px[1] > 0.01  # of the points' spread
    inlier = np.abs(r) < cut
    sigma = np.sqrt(np.sum(sampson_distance(theta, x)[inlier] ** 2) / max(inlier.sum() - 5, 1))
    return to_pixels(ellipse, centre, scale) if real else start, inlier, float(sigma * scale)
