"""Calibrates what the covariances assume, on bench sequences that neither train nor test anything.

    python tuning/calibrate_uncertainty.py

Errors along a contour are correlated, so independent points would promise too much.  An inflation is the
factor of a covariance with which 95 % of the true poses lie in the 95 % region.  Its results are the settings
``ring_inflation`` (of the ring alone), ``yaw_inflation`` (the larger one), ``marker_sigma_px`` and
``joint_inflation``.  A marker's standard deviation is the one with the best logarithmic score of the true
poses under the inflated covariances, which rewards small errors and honest covariances alike.
``min_yaw_margin`` is at least the lowest margin above which at most `OTHER_PERCENT` of the poses have another
yaw than the true one (the larger of the two).  The present networks would need none on these sequences; but
of two yaws that explain a mask alike neither is known, so the margin stays.  The sequences are many and
short, for errors of one view are alike.  The table is kept in data/results/uncertainty.csv, what the
constants make of it in each light in calibration.csv beside it (so run it again once they are set), the
simulated recordings in data/derived/calibration.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.stats import chi2
from tqdm import tqdm

from lmmap.estimation.images import images
from lmmap.evaluation.pose_errors import normal_error_rad, pose_difference, position_error_m
from lmmap.geometry.port import in_view
from lmmap.pipeline import circle, refine, yaw
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import reflector_mask
from lmmap.pipeline.ring import find_ring
from lmmap.refinement import joint, uncertainty
from lmmap.refinement.contour import Contour
from lmmap.settings import OURS
from lmmap.types import Camera, Port, Pose, Recording
from lmmap_lab.bench import laboratory, sequences
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_table
from lmmap_lab.studies.between_images import kept_recording
from lmmap_lab.studies.chart_errors import chart_nees

SEQUENCES = [f"realistic-{i}" for i in range(1001, 1101)] + [f"augmented-{i}" for i in range(1001, 1019)]
SECONDS, RATE_HZ = 1.6, 5.0
MARKER_SIGMAS_PX = (0.5, 0.7, 1.0, 1.4, 1.7, 2.0, 2.8, 4.0)
YAW_MARGINS, OTHER_PERCENT = np.arange(0, 0.41, 0.05).round(2), 1.0
WORST = 50.0  # squared Mahalanobis distance beyond which a pose is wrong, and how wrong does not matter


def recording(name: str) -> Recording:
    return kept_recording(name, SECONDS, DERIVED_DATA / "calibration", sequences.OUR_SETUP)


def measured(estimator: Estimator, name: str):
    """Contours, reflector masks, yaw fits and true poses of a sequence."""
    seen, port, camera = recording(name), estimator.port, estimator.grid
    for t_us, image in images(seen, estimator.modality, rate_hz=RATE_HZ):
        truth = seen.truth.at(np.array([min(t_us, seen.truth.t_us[-1])]))[0]
        ring = find_ring(estimator.ring_network(image), estimator.setup)
        if not (isinstance(ring, Contour) and in_view(truth, port, camera)):
            continue
        circles = circle.candidates(ring.ellipse, camera, port.ring_radius_m)
        reflectors = reflector_mask(estimator.reflector_network, image, circles, port, camera)
        fit = yaw.fast_yaw(reflectors, circles[:2], port, camera)
        if fit.score >= estimator.settings.min_marker_score:
            yield ring, reflectors, fit, truth


def difference(T: Pose, truth: Pose, port: Port) -> np.ndarray:
    """`pose_difference` of one pose, (6,)."""
    return pose_difference(T[None], truth[None], port.yaw_period_rad)[0]


def errors(T: Pose, truth: Pose) -> tuple[float, float]:
    return np.rad2deg(normal_error_rad(T, truth)), 1e3 * position_error_m(T, truth)


def mahalanobis(differences, covariances) -> np.ndarray:
    """Squared distances (N,) of the truth from poses, `pose_difference` (N, 6) and covariances (N, 6, 6)."""
    return np.einsum("ni,ni->n", differences, np.linalg.solve(covariances, differences[..., None])[..., 0])


def log_scores(nees, covariances) -> np.ndarray:
    """Logarithmic scores (N,) of the truth at squared distances (N,), but for a constant."""
    return -(np.minimum(nees, WORST) + np.linalg.slogdet(covariances)[1]) / 2


def inflated(differences, covariances) -> dict:
    """Of refined poses how many true ones the 95 % region holds, the inflation that makes it 95 %, and the
    logarithmic score then."""
    nees = mahalanobis(differences, covariances)
    factor = np.quantile(nees, 0.95) / chi2.ppf(0.95, 6)
    return {"inside_percent": 100 * np.mean(nees < chi2.ppf(0.95, 6)), "joint_inflation": factor,
            "score": np.mean(log_scores(nees / factor, factor * covariances))}  # fmt: skip


def row(modality, marker_sigma_px, values, differences, covariances, marker_scores) -> dict:
    """A line of the table: errors of all images; `inflated` of the refined ones with covariances that grow
    where markers are faint, and the score of those that do not."""
    (deg, mm), (rms_deg, rms_mm) = np.median(values, 0), np.sqrt(np.mean(np.square(values), 0))
    names = ("inside_percent", "joint_inflation", "score", "score_constant")
    scores = dict.fromkeys(names, np.nan) | {"refined": len(differences)}
    if differences:
        d, C = np.array(differences), np.array(covariances)
        scores |= inflated(d, joint.inflate(C, marker_scores)) | {"score_constant": inflated(d, C)["score"]}
    return {"modality": modality, "marker_sigma_px": marker_sigma_px, "normal_deg": deg, "position_mm": mm,
            "normal_rms_deg": rms_deg, "position_rms_mm": rms_mm, **scores}  # fmt: skip


def other_yaws(margins, turned_rad, port: Port) -> tuple[float, float]:
    """The lowest of `YAW_MARGINS` above which at most `OTHER_PERCENT` of the yaws (N,) are another one than
    the true yaw, and the percentage then."""
    other = np.abs(turned_rad) > OURS.other_yaw_share * port.yaw_period_rad
    shares = [100 * np.mean(other[np.asarray(margins) >= least]) for least in YAW_MARGINS]
    at = int(np.argmax(np.array(shares) <= OTHER_PERCENT))
    return float(YAW_MARGINS[at]), float(shares[at])


def of_rings(cases: list, nearer: list[Pose], sigmas_px, port: Port, camera: Camera) -> dict:
    """The inflation of the rings' covariances, what it would be by their median, and the logarithmic score
    then, with standard deviations of a contour's point (N,)."""
    nees, charts = [], []
    for (ring, _, _, truth), T, sigma_px in zip(cases, nearer, sigmas_px, strict=True):
        chart = uncertainty.pose_uncertainty(T, ring.points_px, sigma_px, port.ring_radius_m, camera).chart
        nees.append(chart_nees(T, truth, chart, port.ring_radius_m, camera))
        charts.append(chart)
    factor = np.quantile(nees, 0.95) / chi2.ppf(0.95, 5)
    scores = log_scores(np.array(nees) / factor, factor * np.array(charts))
    return {"inflation": factor, "inflation_by_median": np.median(nees) / chi2.ppf(0.5, 5),
            "ring_score": np.mean(scores)}  # fmt: skip


def calibrate(estimator: Estimator, cases: list) -> pd.DataFrame:
    """Rows without (NaN) and with joint refinement, for each standard deviation of a marker's edge."""
    modality, camera, port, setup = estimator.modality, estimator.camera, estimator.port, estimator.setup
    yaw_ratio, right, nearer, margins, turned = [], [], [], [], []
    for _, _, fit, truth in cases:
        right.append(normal_error_rad(fit.T_cam_port, truth) <= normal_error_rad(fit.rival, truth))
        nearer.append(T := fit.T_cam_port if right[-1] else fit.rival)
        if right[-1]:
            margins.append(fit.yaw_margin)
            turned.append(difference(T, truth, port)[3:] @ T.normal)
            if fit.yaw_margin >= OURS.min_yaw_margin:
                yaw_ratio.append(abs(turned[-1]) * OURS.yaw_inflation / fit.sigma_rad)
    inflated_px = np.array([refine.sigma_px(ring, setup) for ring, *_ in cases])
    sigma_px = inflated_px / np.sqrt(OURS.ring_inflation[modality])
    rings = of_rings(cases, nearer, sigma_px, port, camera)
    constant = of_rings(cases, nearer, [ring.sigma_px for ring, *_ in cases], port, camera)
    rows = [row(modality, np.nan, [errors(fit.T_cam_port, truth) for _, _, fit, truth in cases], [], [], [])]
    for marker_px in MARKER_SIGMAS_PX:
        differences, covariances, faintness, after = [], [], [], []
        for (ring, reflectors, fit, truth), known_px in zip(cases, sigma_px, strict=True):
            ring_px = known_px * np.sqrt(rings["inflation"])
            scale = ring_px / refine.sigma_px(ring, setup)
            edges = [edge._replace(sigma_px=scale * edge.sigma_px)
                     for edge in refine.ring_edges(ring, setup)]  # fmt: skip
            refined = fit.yaw_margin >= OURS.min_yaw_margin and joint.refine(
                fit.T_cam_port, edges, reflectors, port, camera, marker_px
            )
            T = refined.T_cam_port if refined else fit.T_cam_port
            after.append(errors(T, truth))
            if refined:
                differences.append(difference(T, truth, port))
                covariances.append(refined.covariance[:6, :6])
                faintness.append(fit.score)
        rows.append(row(modality, marker_px, after, differences, covariances, faintness))
    margin, other_percent = other_yaws(margins, turned, port)
    return pd.DataFrame(rows).assign(
        images=len(cases), normal_right_percent=100 * np.mean(right), **rings,
        ring_score_constant=constant["ring_score"], yaw_inflation=np.quantile(yaw_ratio, 0.95) / 1.96,
        yaw_margin=margin, other_yaw_percent=other_percent)  # fmt: skip


def by_light(estimator: Estimator, cases: list, lights: list) -> pd.DataFrame:
    """Of the poses that the module gives, by light: how many true ones lie inside the 95 % region."""
    rows = []
    for (ring, reflectors, fit, truth), light in zip(cases, lights, strict=True):
        T, _, covariance, _ = refine.on_masks(fit, ring, reflectors, estimator.setup)
        d = difference(T, truth, estimator.port)
        (nees,) = mahalanobis(d[None], covariance[None, :6, :6])
        inside = nees < chi2.ppf(0.95, 6)
        rows.append({"modality": estimator.modality, "light": light, "inside_percent": 100 * inside})
    inside_percent = pd.DataFrame(rows).groupby(["modality", "light"]).inside_percent
    return inside_percent.agg(poses="size", inside_percent="mean").reset_index()


def main() -> None:
    tables, reached = [], []
    for modality in ("rgb", "event"):
        estimator = Estimator(modality=modality)
        of = {name: list(measured(estimator, name)) for name in tqdm(SEQUENCES, modality, disable=None)}
        cases = [case for group in of.values() for case in group]
        lights = [laboratory.sequence(name).light for name, group in of.items() for _ in group]
        tables.append(calibrate(estimator, cases))
        reached.append(by_light(estimator, cases, lights))
    table, lit = pd.concat(tables, ignore_index=True), pd.concat(reached, ignore_index=True)
    print(table.round(2).T.to_string(), lit.round(1).to_string(), sep="\n")
    save_table(DATA / "results" / "uncertainty.csv", table, sequences=SEQUENCES)
    save_table(DATA / "results" / "calibration.csv", lit, sequences=SEQUENCES)


if __name__ == "__main__":
    main()
