"""How well the filters' masks fit the true ones: overlap, and the distance of their skeletons."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from ..bench import labels
from ..bench.renderer import ray_grid
from ..geometry.port import circle_points_m, in_view
from ..geometry.projection import project
from ..pipeline import run
from ..pipeline.estimator import markers_box_px
from ..pipeline.ring import binarise
from ..pipeline.weights import FILTERS, load_filter, weight_path
from ..settings import OURS, Settings
from ..types import Camera, Port, Pose, Recording

FITS = ["iou", "skeleton_px", "stray", "missed"]
COLUMNS = ["t_us", "filter", "modality", "domain_gap", *FITS, "mask_px", "truth_px"]
NEAR_PX = 2.0  # skeleton farther from the true line is astray; true line farther from the mask is missed
LINE_POINTS = 2400  # of a middle line: a few to each pixel


def iou(mask, truth) -> float:
    """Intersection over union of two boolean masks; 1 if both are empty."""
    union = (mask | truth).sum()
    return float((mask & truth).sum() / union) if union else 1.0


def skeleton_distance(mask, line_px) -> tuple[float, float]:
    """How far (pixels, median) the mask's skeleton lies from the true middle line, points (M, 2) such as
    `middle_lines_px` has, and the share of it that lies astray; NaN of an empty mask.  Ellipses are fitted
    to the skeleton: this is the error that they see.  The line is no mask's skeleton, which would be off by
    half a pixel itself."""
    rows, columns = np.nonzero(skeletonize(mask))
    if not len(rows):
        return np.nan, np.nan
    away_px, _ = cKDTree(line_px).query(np.column_stack([columns, rows]))
    return float(np.median(away_px)), float(np.mean(away_px > NEAR_PX))


def middle_lines_px(T_cam_port: Pose, port: Port, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Dense points (M, 2) on the ring's centre-line, and on the markers' middle lines along the tangent."""
    corners = port.marker_corners_m()
    ends = (corners[:, 0] + corners[:, 1]) / 2, (corners[:, 2] + corners[:, 3]) / 2
    markers = np.linspace(*ends, LINE_POINTS // port.symmetry).reshape(-1, 3)
    of = (circle_points_m(port.ring_radius_m, LINE_POINTS), markers)
    return tuple(project(T_cam_port @ points, camera) for points in of)


def missed_share(mask, truth) -> float:
    """Share of the true skeleton that has no found pixel near; NaN without truth."""
    true = skeletonize(truth)
    if not true.any():
        return np.nan
    away_px = distance_transform_edt(~mask) if mask.any() else np.full(mask.shape, np.inf)
    return float((away_px[true] > NEAR_PX).mean())


def filter_quality(recording: Recording, domain_gaps=("low",), modalities=("rgb", "event"),
                   most: int = 30, port: Port | None = None, settings: Settings = OURS,
                   precision: str = "auto") -> pd.DataFrame:  # fmt: skip
    """Every filter of some sets on a recording whose truth is known, on images with the ring in view; the
    reflectors' where the pipeline asks it, in the box that the (here: true) pose's markers can be in.

    Parameters
    ----------
    recording : with truth
    most : images per modality, spread evenly over those in view

    Returns
    -------
    DataFrame
        A row per image and filter: ``t_us, filter, modality, domain_gap, iou, skeleton_px, stray,
        missed, mask_px, truth_px``.  A mask that is empty where it should not be has IoU 0 and stays in.
    """
    if recording.truth is None:
        raise ValueError("filter_quality: expected a recording with truth, got one without")
    port, rows = port or Port.lm_map(), []
    rays = ray_grid(recording.camera, 4)
    for modality in modalities:
        nets = {(gap, name): load_filter(weight_path(name, modality, gap), modality, precision)
                for gap in domain_gaps for name in FILTERS}  # fmt: skip
        for t_us, image, pose in _seen(recording, modality, port, settings, most):
            truth = dict(zip(FILTERS, labels.label_masks(pose, port, recording.camera, rays), strict=True))
            lines = dict(zip(FILTERS, middle_lines_px(pose, port, recording.camera), strict=True))
            for (gap, name), net in nets.items():
                values, true = net(image), truth[name]
                if name == "ring":
                    mask = binarise(values, settings.mask_threshold)
                else:  # the pipeline asks it only there
                    mask = (values > settings.mask_threshold) & _around(pose, port, recording.camera)
                fit = iou(mask, true), *skeleton_distance(mask, lines[name]), missed_share(mask, true)
                rows.append((t_us, name, modality, gap, *fit, mask.sum(), true.sum()))
    return pd.DataFrame(rows, columns=COLUMNS)


def _around(T_cam_port: Pose, port: Port, camera: Camera) -> np.ndarray:
    """Boolean image of the box in which the pipeline looks for the markers of a pose."""
    low, high = markers_box_px(T_cam_port[None], port, camera)
    u, v = np.arange(camera.width_px), np.arange(camera.height_px)
    return np.outer((v >= low[1]) & (v <= high[1]), (u >= low[0]) & (u <= high[0]))


def _seen(recording, modality, port, settings, most) -> list:
    """``(t_us, image, true pose)`` of images in which the whole ring is in view."""
    times_us = np.array([t_us for t_us, _ in run.images(recording, modality, settings)], np.int64)
    times_us = times_us[(times_us >= recording.truth.t_us[0]) & (times_us <= recording.truth.t_us[-1])]
    poses = recording.truth.at(times_us)
    among = np.flatnonzero(in_view(poses, port, recording.camera))
    pick = among[np.unique(np.linspace(0, len(among) - 1, min(most, len(among))).astype(int))]
    wanted = {int(times_us[k]): poses[k] for k in pick}
    shots = run.images(recording, modality, settings)
    return [(t_us, image, wanted[t_us]) for t_us, image in shots if t_us in wanted]


def medians(table: pd.DataFrame) -> pd.DataFrame:
    """Medians over images, and the share of images in which nothing was found (percent)."""
    by = [c for c in ("light", "filter", "modality", "domain_gap") if c in table]
    groups = table.assign(empty_percent=100.0 * (table.mask_px == 0)).groupby(by, sort=False)
    out = groups[FITS].median()
    out["empty_percent"], out["images"] = groups.empty_percent.mean(), groups.size()
    return out.reset_index()
