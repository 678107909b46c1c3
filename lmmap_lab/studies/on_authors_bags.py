"""The paper's studies on a folder of the authors' bags: table, hard cases, false detections, odometry.

A folder need not hold all bags: a study runs on those that are there.  Each bag's estimates are kept as they
come, so that an interrupted run goes on.  All results lie in ``data/derived/recordings/FOLDER``.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pandas as pd

from lmmap.evaluation import error_table
from lmmap.evaluation.pose_errors import true_poses
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import settings_for
from lmmap.pipeline.weights import FILTERS, weight_path
from lmmap.recordings.formats import open_stream
from lmmap.recordings.stream import Stream
from lmmap.settings import MODALITIES, OURS
from lmmap.types import Estimate, InputError, Port, Pose
from lmmap_readers.rig import Rig

from ..provenance import DERIVED_DATA, save_json, save_table
from ..rig import authors_bags
from ..rig.authors_bags import AuthorsBag
from ..rig.truth import true_trajectory
from ..training import excerpts
from . import misalignment, odometry, table1
from .bag_estimates import bag_label, detect, folder_rig, learned_networks, resumable_file

RATE_HZ = 10.0
BY_ITSELF = ("default", "learned")  # the default networks, before and after they learned the laboratory


def survey(folder) -> tuple[list[AuthorsBag], list[str]]:
    """The bags that can be used, and a line for each that cannot."""
    rows = list(authors_bags.check_bags(folder))
    good = [authors_bags.describe_bag(Path(folder) / row["bag"]) for row in rows if not row["problem"]]
    return good, [f"{row['bag']}: {row['problem']}" for row in rows if row["problem"]]


def output(folder) -> Path:
    """Where a folder's results lie."""
    return DERIVED_DATA / "recordings" / Path(os.path.realpath(folder)).name


def reproduce(folder, report=print, adapted: bool = False) -> Path:
    """Run every study whose bags are there; returns the folder of the results.

    Parameters
    ----------
    adapted
        Whether the default networks learn the laboratory by themselves and are tested, before and after.

    Raises
    ------
    InputError
        If no bag can be used, or the rig cannot be calibrated on them.
    """
    bags, left_out = survey(folder)
    for line in left_out:
        report(f"left out: {line}")
    roles = {role: [b for b in bags if b.role == role] for role in ("train", "test", "hard", "empty")}
    if not (roles["test"] or roles["hard"] or roles["empty"]):
        raise InputError(f"{folder}: no bag for testing is usable; 'lmmap dataset check {folder}' says why")
    out = output(folder)
    out.mkdir(parents=True, exist_ok=True)
    rig = folder_rig(Path(folder), out, roles, report) if roles["test"] or roles["hard"] else None
    port = rig.port if rig else Port.lm_map()
    facts = {"recordings": out.name, "bags": len(bags), "left_out": left_out,
             "rig": rig.calibration if rig else None}  # fmt: skip
    sets, elsewhere = dict.fromkeys(table1.DOMAIN_GAPS), dict.fromkeys(table1.DOMAIN_GAPS[:1])
    if adapted and roles["test"]:
        sets |= dict(zip(BY_ITSELF, (OURS.weights, learned_networks(roles, out, port, report)), strict=True))
    tables = {name: [] for name in ("errors", "hard", "false", "odometry", "truths")}
    for bag in (*roles["test"], *roles["hard"], *roles["empty"]):
        try:
            own = sets if bag.role == "test" else elsewhere
            _studies(bag, bag_label(Path(folder), bag), rig, port, out, own, tables, report)
        except InputError as error:  # a fault in the middle; what came before it is kept
            left_out.append(str(error))
            report(f"left out: {error}")
    results = {name: pd.DataFrame(tables[name]) for name in ("hard", "false", "odometry")}
    results["summary"] = _summary(tables["errors"])
    results["misalignment"] = misalignment.misalignment(dict(tables["truths"]), port.yaw_period_rad)
    if tables["truths"]:
        report(misalignment.verdict(results["misalignment"]))
    for name, table in results.items():
        (out / f"{name}.csv").unlink(missing_ok=True)  # an earlier run's, whose bags may be gone
        if len(table):
            save_table(out / f"{name}.csv", table, **facts)
    save_json(out / "about.json", facts)
    return out


def _studies(bag: AuthorsBag, label: str, rig: Rig | None, port: Port, out: Path, sets: dict, tables: dict,
             report) -> None:  # fmt: skip
    """Estimate one bag with each camera and add its results to the tables; ``sets`` are networks by the name
    of their training, None for those of `weights_of`."""
    stream = open_stream(bag.path)
    if bag.role != "empty":
        stream = replace(stream, truth=true_trajectory(bag.path, rig))
    for gap, given in sets.items():
        for modality in MODALITIES:
            weights = given or weights_of(out, modality, gap)
            estimates = _estimates(stream, label, port, modality, gap, weights, out, report)
            _study(bag, stream, estimates, port, modality, gap, tables)


def training_set(folder, domain_gap: str, report=print) -> tuple[list[str], Path]:
    """Make the samples of a folder's training bags where they are absent.

    The high domain gap takes the bags with textured covers, the low one all bags.

    Returns
    -------
    tuple
        The samples' names and their folder.

    Raises
    ------
    InputError
        If there is no such bag, or too little of it.
    """
    bags, left_out = survey(folder)
    for line in left_out:
        report(f"left out: {line}")
    roles = {"train": [b for b in bags if b.role == "train"], "test": [], "hard": []}
    chosen = [b for b in roles["train"] if b.textured or domain_gap != "high"]
    if not chosen:
        raise InputError(
            f"{folder}: no usable training bag for the {domain_gap} domain gap; see lmmap dataset"
        )
    out = output(folder)
    (out / "training").mkdir(parents=True, exist_ok=True)
    rig = folder_rig(Path(folder), out, roles, report)
    names = []
    for bag in chosen:
        stream = replace(open_stream(bag.path), truth=true_trajectory(bag.path, rig))
        names += excerpts.make_recording_samples(
            stream, bag_label(Path(folder), bag), out / "training", rig.port, report
        )
    if len(names) < 5:
        raise InputError(f"{folder}: {len(names)} pieces of training bags, 5 are needed; give longer bags")
    return names, out / "training"


def weights_of(out: Path, modality: str, gap: str) -> Path | str:
    """The folder of the filters trained on these recordings if it has both, else the bench's domain gap."""
    own = out / f"weights-{gap}"
    there = all((own / weight_path(f, modality, "low").name).exists() for f in FILTERS)
    return own if there else gap


def _estimates(stream, label, port, modality, gap, weights, out, report) -> list[Estimate]:
    settings = replace(settings_for(stream.camera), rate_hz=RATE_HZ)
    estimator = Estimator(stream.camera, port, modality, weights, settings)
    label = f"{label}-{modality}-{gap}"
    own = [p.stat().st_mtime_ns for p in sorted(weights.glob("*"))] if isinstance(weights, Path) else gap
    path = resumable_file(out / f"estimates-{label}.csv", stream.source.path, port, stream.camera, own)
    estimates = detect(stream, estimator, RATE_HZ, path)
    poses = sum(e.T_cam_port is not None for e in estimates)
    report(f"{label}: {poses} poses in {len(estimates)} images")
    return estimates


def _study(bag: AuthorsBag, stream: Stream, estimates: list[Estimate], port: Port, modality: str, gap: str,
           tables: dict) -> None:  # fmt: skip
    """Add a bag's results to the rows of the study that it serves."""
    row = {"bag": bag.path.name, "light": bag.light, "modality": modality, "images": len(estimates)}
    poses = sum(e.T_cam_port is not None for e in estimates)
    rings = sum(e.ellipse is not None for e in estimates)
    if bag.role == "empty":
        tables["false"].append(row | {"poses": poses, "ellipses": rings})
        return
    errors = error_table.errors(stream, estimates, port)
    if bag.role == "hard":
        share = 100 / max(len(estimates), 1)
        medians = {name: errors[name].median() for name in ("position_error_m", "normal_error_deg")}
        rates = {"ellipse_percent": share * rings, "pose_percent": share * poses}
        tables["hard"].append(row | rates | medians)
        return
    training = gap if gap in BY_ITSELF else f"{gap}-domain-gap"
    tables["errors"].append(errors.assign(light=bag.light, modality=modality, training=training))
    if gap == "low":
        posed, truth = true_poses(stream, [e for e in estimates if e.T_cam_port is not None])
        pair = Pose.stack([e.T_cam_port for e in posed]), truth
        tables["truths"].append((f"{bag.path.name}, {modality}", pair))
    if bag.light == "high" and gap == "low":
        try:
            scored = odometry.score([odometry.camera_track(estimates, port)], stream.truth)
            tables["odometry"] += [row | line for line in odometry.by_length(scored).to_dict("records")]
        except odometry.NotScored as error:
            tables["odometry"].append(row | {"not_scored": str(error)})


def _summary(errors: list[pd.DataFrame]) -> pd.DataFrame:
    """`table1.summary` for each light, modality and set of filters, all bags of it together."""
    keys, none = ["light", "modality", "training"], pd.DataFrame()
    cells = pd.concat(errors).groupby(keys) if errors else ()
    return pd.concat([none, *(table1.summary(cell).assign(**dict(zip(keys, names, strict=True)))
                              for names, cell in cells)])  # fmt: skip
