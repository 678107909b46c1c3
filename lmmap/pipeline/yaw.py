"""The sixth degree of freedom: which normal, and which yaw, explain the reflector mask.

The markers stand above the ring's plane, so a wrong normal moves them by parallax: that, more than
their outline, tells the two circles' poses apart.  The markers are projected in three dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..geometry.markers import check_yaw_step, corners_m, marker_points_m, polar_template, template_spectrum
from ..geometry.projection import project_points
from ..geometry.rotations import rotation_z
from ..geometry.sampling import sample
from ..settings import OURS, PAPER, PaperSettings, Settings
from ..types import Camera, Port, Pose
from . import outline


@dataclass(frozen=True)
class YawFit:
    """The better of the two normals with its best yaw, and the other normal with its best yaw.

    Scores are the mean of the mask inside the projected markers, in [0, 1].  ``margin`` measures how sure
    the choice of the normal is: the relative drop of the criterion from the better normal to the other, in
    [0, 1].  ``sigma_rad`` is the yaw's standard deviation, given the normal, and ``yaw_margin`` the relative
    drop of the correlation to the best of the other yaws; below `Settings.min_yaw_margin` the yaw is unknown.
    ``log_odds`` are the log odds, given mask and image, that normal and yaw are right; 0 if only the mask was
    used.
    """

    T_cam_port: Pose
    score: float
    rival: Pose
    rival_score: float
    margin: float = 0.0
    sigma_rad: float = np.inf
    yaw_margin: float = 0.0
    log_odds: float = 0.0


def paper_yaw(
    reflector_mask, T_cam_port: Pose, port: Port, camera: Camera, settings: PaperSettings = PAPER
) -> YawFit:
    """The paper's grid: both normals, every degree of yaw, largest sum of mask times projected
    markers (its equation 3 prints argmin where it maximises).

    Parameters
    ----------
    reflector_mask : (H, W), values in [0, 1]
    T_cam_port : Pose of shape (2,)
        The two candidates; their yaw is the grid's zero.
    """
    mask = _check(reflector_mask, T_cam_port, camera)
    check_yaw_step(port, settings.yaw_step_rad)
    yaws = np.arange(0, port.yaw_period_rad - settings.yaw_step_rad / 2, settings.yaw_step_rad)
    hypotheses = _turn(T_cam_port[:, None], yaws)  # (2, N)
    corners = project_points(hypotheses, corners_m(port), camera)  # (2, N, S, 4, 2)
    total, mean = np.zeros((2, len(yaws))), np.zeros((2, len(yaws)))
    if np.all(np.isfinite(corners)):
        low = np.floor(corners.min((0, 1, 2, 3))).astype(int).clip(0, camera.size_px)
        high = np.ceil(corners.max((0, 1, 2, 3))).astype(int).clip(-1, np.array(camera.size_px) - 1) + 1
        crop = mask[low[1] : high[1], low[0] : high[0]]
        if crop.size:
            fixed_point = np.round((corners - low) * 16).astype(np.int32)
            for index in np.ndindex(total.shape):
                drawn = cv2.fillPoly(np.zeros(crop.shape, np.uint8), list(fixed_point[index]), 1, shift=4)
                total[index] = np.sum(crop, where=drawn.astype(bool))
                mean[index] = total[index] / max(drawn.sum(), 1)
    best = total.argmax(1)
    return _fit(hypotheses[[0, 1], best], total.max(1), mean[[0, 1], best])


def fast_yaw(reflector_mask, T_cam_port: Pose, port: Port, camera: Camera, settings: Settings = OURS,
             edges=None, weights=None) -> YawFit:  # fmt: skip
    """Both normals at every yaw by one circular correlation each, to a fraction of a degree.

    The mask is warped to polar coordinates of the markers' plane (z = plate height), where yaw is a
    shift; its symmetric sectors are folded, correlated with one marker by FFT, and a parabola
    through the peak gives the yaw.  Between the normals the larger cosine between mask and projected
    markers wins, mean * sqrt(area): a plain mean would favour the smaller outline and a plain sum the
    larger one.  Arguments as `paper_yaw`; markers outside the image or behind the camera count as
    unlit.

    With the image's `outline.edges`, ``edges`` (H, W), normal and yaw are the most probable ones given the
    mask and `outline.support` together, with ``weights`` (4,), `Settings.yaw_weights`.
    """
    mask = _check(reflector_mask, T_cam_port, camera)
    check_yaw_step(port, settings.yaw_step_rad)
    _, template, step_rad = polar_template(port, settings.yaw_step_rad)
    folded, correlation = correlate(mask, T_cam_port, port, camera, settings)
    criterion = correlation / template.sum()
    if edges is not None:
        seen = outline.support(edges, T_cam_port, port, camera, correlation.shape[-1])
        criterion = weights[0] * criterion + seen @ weights[1:]
        log_odds = outline.log_odds(criterion, T_cam_port, port, settings)

    yaw_rad, sigma_rad = _peak(criterion, correlation, folded, template, step_rad)
    evidence = correlation if edges is None else np.exp(criterion - criterion.max(1, keepdims=True))
    yaw_margin = _margin(evidence, settings.other_yaw_share)
    poses = _turn(T_cam_port, yaw_rad)

    outlines = project_points(poses, np.concatenate([corners_m(port), marker_points_m(port)], 1), camera)
    mean, area = sample(mask, outlines[:, :, 4:]).mean((1, 2)), _area_px(outlines[:, :, :4])
    sigma_rad = settings.yaw_inflation * sigma_rad / np.maximum(mean, 1e-3)  # faint markers err more
    unknown_rad = port.yaw_period_rad / np.sqrt(12)
    known = yaw_margin >= settings.min_yaw_margin
    sigma_rad = np.where(known, np.minimum(sigma_rad, unknown_rad), unknown_rad)
    if edges is None:
        return _fit(poses, mean * np.sqrt(area), mean, sigma_rad, yaw_margin)
    probability = np.exp(criterion.max(1) - criterion.max())
    return replace(_fit(poses, probability, mean, sigma_rad, yaw_margin), log_odds=log_odds)


def marker_score(reflector_mask, T_cam_port: Pose, port: Port, camera: Camera) -> np.ndarray:
    """Mean of the mask (H, W) inside the projected markers of poses (N,), shape (N,)."""
    mask = np.ascontiguousarray(reflector_mask, np.float32)
    return sample(mask, project_points(T_cam_port, marker_points_m(port), camera)).mean((1, 2))


def correlate(mask, T_cam_port: Pose, port: Port, camera: Camera, settings: Settings):
    """The mask on a polar grid in the markers' plane, its sectors folded, (2, R, yaws), and its circular
    correlation with one marker (2, yaws)."""
    points_m, template, _ = polar_template(port, settings.yaw_step_rad)
    folded = sample(mask, project_points(T_cam_port, points_m, camera))
    folded = folded.reshape(2, len(template), port.symmetry, -1).mean(2)
    spectrum = np.einsum("nrf,rf->nf", np.fft.rfft(folded), template_spectrum(port, settings.yaw_step_rad))
    return folded, np.fft.irfft(spectrum, folded.shape[-1])


def _turn(T: Pose, yaw_rad) -> Pose:
    rotation = T.rotation @ rotation_z(yaw_rad)
    return Pose(rotation, np.broadcast_to(T.position_m, rotation.shape[:-1]))


def _area_px(corners_px):
    """Total area of the markers' outlines, (..., S, 4, 2) -> (...); zero behind the camera."""
    following = corners_px[..., [1, 2, 3, 0], :]
    cross = corners_px[..., 0] * following[..., 1] - corners_px[..., 1] * following[..., 0]
    return np.nan_to_num(np.abs(cross.sum(-1)).sum(-1) / 2)


def _fit(poses: Pose, criterion, score, sigma_rad=(np.inf, np.inf), yaw_margin=(0.0, 0.0)) -> YawFit:
    best = int(np.argmax(criterion))
    margin = 1 - criterion[1 - best] / criterion[best] if criterion[best] > 0 else 0.0
    return YawFit(poses[best], float(score[best]), poses[1 - best], float(score[1 - best]), float(margin),
                  float(sigma_rad[best]), float(yaw_margin[best]))  # fmt: skip


def _margin(correlation, other_yaw_share: float) -> np.ndarray:
    """By how much of its own size a correlation (N, yaws) falls from its peak to its highest value at least
    that share of the period away, (N,) in [0, 1]; 0 where nothing correlates."""
    count = correlation.shape[-1]
    apart = np.abs(np.arange(count) - correlation.argmax(1)[:, None])
    far = np.minimum(apart, count - apart) >= other_yaw_share * count
    top, other = correlation.max(1), np.where(far, correlation, -np.inf).max(1)
    return np.where(top > 0, 1 - np.maximum(other, 0) / np.where(top > 0, top, 1), 0)


def _peak(criterion, correlation, folded, template, step_rad: float):
    """Yaw (2,) of the criterion's peak by a parabola, and its standard deviation by the mask.

    To second order half the squared misfit between mask and a scaled template, weighted by area, grows by
    a * bend * yaw^2 / 2, with a the best amplitude; so noise of variance s^2 a sample turns the peak by
    s / sqrt(a * bend).
    """
    at, count = criterion.argmax(1), criterion.shape[-1]
    left, top, right = (criterion[[0, 1], (at + k) % count] for k in (-1, 0, 1))
    bend = np.maximum(2 * top - left - right, 0)
    offset = np.where(bend > 0, 0.5 * (right - left) / np.where(bend > 0, bend, 1), 0)
    left, top, right = (correlation[[0, 1], (at + k) % count] for k in (-1, 0, 1))
    bend = np.maximum(2 * top - left - right, 0)
    amplitude = np.maximum(top, 0) / template.sum()
    turned = (template > 0)[:, (np.arange(count) - at[:, None]) % count]  # (R, 2, yaws)
    fitted = amplitude[:, None, None] * np.swapaxes(turned, 0, 1)
    variance = np.mean((folded - fitted) ** 2, (1, 2))
    sharp = amplitude * bend
    sigma = np.sqrt(variance / np.where(sharp > 0, sharp, 1)) * step_rad
    return (at + offset) * step_rad, np.where(sharp > 0, sigma, np.inf)


def _check(mask, T_cam_port: Pose, camera: Camera):
    mask = np.ascontiguousarray(mask, np.float32)
    if mask.shape != (camera.height_px, camera.width_px):
        raise ValueError(f"reflector_mask: expected shape {camera.size_px[::-1]}, got {mask.shape}")
    if T_cam_port.position_m.shape != (2, 3):
        raise ValueError(f"T_cam_port: expected two poses, got shape {T_cam_port.position_m.shape[:-1]}")
    return mask
