"""How well a filter's masks fit the true ones: their overlap, and how far their skeletons are off."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from lmmap.estimation.images import images
from lmmap.geometry.port import circle_points_m, in_view
from lmmap.geometry.projection import project
from lmmap.pipeline.masks import markers_box_px
from lmmap.pipeline.ring import binarise
from lmmap.pipeline.weights import FILTERS, load_network, weight_path
from lmmap.settings import OURS, Settings
from lmmap.types import Camera, Port, Pose, Recording

from ..bench import labels
from ..bench.renderer import ray_grid

FITS = ["iou", "skeleton_px", "stray", "missed"]
COLUMNS = ["t_us", "filter", "modality", "domain_gap", *FITS, "mask_px", "truth_px"]
NEAR_PX = 2.0  # a skeleton is astray this far from the true line, a line is missed this far from the mask
LINE_POINTS = 2400  # of a centre line, several to a pixel


def iou(mask, truth) -> float:
    """Intersection over union of two boolean masks; 1 if both are empty."""
    union = (mask | truth).sum()
    return float((mask & truth).sum() / union) if union else 1.0


def skeleton_distance(mask, line_px) -> tuple[float, float]:
    """How far the mask's skeleton is from the true centre line: this is the error that ellipse fits see.

    Parameters
    ----------
    line_px : points (M, 2) of `middle_lines_px`; the true mask's skeleton itself would be off by half a pixel

    Returns
    -------
    median distance (pixels), share of the skeleton that is astray; both NaN for an empty mask
    """
    rows, columns = np.nonzero(skeletonize(mask))
    if not len(rows):
        return np.nan, np.nan
    away_px, _ = cKDTree(line_px).query(np.column_stack([columns, rows]))
    return float(np.median(away_px)), float(np.mean(away_px > NEAR_PX))


def middle_lines_px(T_cam_port: Pose, port: Port, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Dense points (M, 2) on the ring's centre line, and on the markers' tangential centre lines."""
    corners = port.marker_corners_m()
    ends = (corners[:, 0] + corners[:, 1]) / 2, (corners[:, 2] + corners[:, 3]) / 2
    markers = np.linspace(*ends, LINE_POINTS // port.symmetry).reshape(-1, 3)
    lines = (circle_points_m(port.ring_radius_m, LINE_POINTS), markers)
    return tuple(project(T_cam_port @ points, camera) for points in lines)


def missed_share(mask, truth) -> float:
    """Share of the true mask's skeleton with no pixel of ``mask`` near it; NaN if the true mask is empty."""
    skeleton = skeletonize(truth)
    if not skeleton.any():
        return np.nan
    away_px = distance_transform_edt(~mask) if mask.any() else np.full(mask.shape, np.inf)
    return float((away_px[skeleton] > NEAR_PX).mean())


def filter_quality(recording: Recording, domain_gaps=("low",), modalities=("rgb", "event"),
                   most: int = 30, port: Port | None = None, settings: Settings = OURS,
                   precision: str = "auto") -> pd.DataFrame:  # fmt: skip
    """Fits of the filters' masks on the images of a recording that have the whole ring in view.

    The reflector filter is judged where the pipeline uses it: in the box in which a pose's markers can be,
    here the true pose's.

    Parameters
    ----------
    recording : its truth has to be known
    most : images of each modality, spread evenly over those in view

    Returns
    -------
    DataFrame
        A row per image and filter: ``t_us, filter, modality, domain_gap, iou, skeleton_px, stray,
        missed, mask_px, truth_px``.  A mask that is empty where it should not be has IoU 0 and counts.
    """
    if recording.truth is None:
        raise ValueError("filter_quality: expected a recording with truth, got one without")
    port, rows = port or Port.lm_map(), []
    rays = ray_grid(recording.camera, 4)
    for modality in modalities:
        nets = {(gap, name): load_network(weight_path(name, modality, gap), modality, precision)
                for gap in domain_gaps for name in FILTERS}  # fmt: skip
        for t_us, image, pose in images_in_view(recording, modality, port, settings, most):
            truth = dict(zip(FILTERS, labels.label_masks(pose, port, recording.camera, rays), strict=True))
            lines = dict(zip(FILTERS, middle_lines_px(pose, port, recording.camera), strict=True))
            for (gap, name), net in nets.items():
                values = net(image)
                if name == "ring":
                    mask = binarise(values, settings.mask_threshold)
                else:
                    mask = (values > settings.mask_threshold) & _markers_box(pose, port, recording.camera)
                true = truth[name]
                fit = iou(mask, true), *skeleton_distance(mask, lines[name]), missed_share(mask, true)
                rows.append((t_us, name, modality, gap, *fit, mask.sum(), true.sum()))
    return pd.DataFrame(rows, columns=COLUMNS)


def _markers_box(T_cam_port: Pose, port: Port, camera: Camera) -> np.ndarray:
    """Mask (H, W) of the box in which the pipeline looks for the markers of a pose."""
    lower, upper = markers_box_px(T_cam_port[None], port, camera)
    u, v = np.arange(camera.width_px), np.arange(camera.height_px)
    return np.outer((v >= lower[1]) & (v <= upper[1]), (u >= lower[0]) & (u <= upper[0]))


def images_in_view(recording, modality, port, settings, most) -> list:
    """``(t_us, image, true pose)`` of images in which the whole ring is in view."""
    times_us = np.array([t_us for t_us, _ in images(recording, modality, settings)], np.int64)
    times_us = times_us[recording.truth.covers(times_us)]
    poses = recording.truth.at(times_us)
    visible = np.flatnonzero(in_view(poses, port, recording.camera))
    chosen = visible[np.unique(np.linspace(0, len(visible) - 1, min(most, len(visible))).astype(int))]
    pose_at = {int(times_us[k]): poses[k] for k in chosen}
    shots = images(recording, modality, settings)
    return [(t_us, image, pose_at[t_us]) for t_us, image in shots if t_us in pose_at]


def medians(table: pd.DataFrame) -> pd.DataFrame:
    """Medians over images, and the percentage of images whose mask is empty."""
    by = [c for c in ("light", "filter", "modality", "domain_gap") if c in table]
    groups = table.assign(empty_percent=100.0 * (table.mask_px == 0)).groupby(by, sort=False)
    out = groups[FITS].median()
    out["empty_percent"], out["images"] = groups.empty_percent.mean(), groups.size()
    return out.reset_index()
