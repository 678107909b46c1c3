"""The paper's studies on whatever bags are there: table, hard cases, false detections, odometry.

Each bag's estimates are kept as they come, so that an interrupted run goes on.  Everything lies in
``data/derived/recordings/FOLDER``, marked with the folder's name.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd
from tqdm import tqdm

from ..pipeline.estimator import Estimator, settings_for
from ..pipeline.run import estimate_images, timed_images
from ..pipeline.weights import FILTERS, weight_path
from ..provenance import DERIVED_DATA, fingerprint, save_json, save_table
from ..recordings.formats import open_stream
from ..recordings.journal import Journal
from ..recordings.pose_files import read_estimates
from ..recordings.stream import Stream
from ..rig import authors_bags, calibration, tf
from ..rig.authors_bags import AuthorsBag
from ..rig.rig import RIG_FILE, Rig, read_hand_eye
from ..training import dataset
from ..types import Estimate, InputError, Port
from . import odometry, pose_errors

RATE_HZ, CALIBRATION_BAGS = 10.0, 4
CALIBRATED_ON = 1000  # detections, spread over the bags; of short ones every frame


def detect(stream: Stream, estimator: Estimator, rate_hz: float, kept: Path) -> list[Estimate]:
    """Estimates of a bag's images, each on disk as it comes; an interrupted call goes on."""
    with Journal(kept, resume=True) as journal:
        every = timed_images(stream, estimator.modality, estimator.settings, rate_hz)
        left = (shot for shot in every if not journal.has(*shot.times_us))
        try:
            for _, one in tqdm(estimate_images(left, estimator), kept.stem, unit=" images", disable=None):
                journal.add(one)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"{kept} keeps what was estimated, the same command goes on") from None
    return read_estimates(kept) if journal.statuses else []


def survey(folder) -> tuple[list[AuthorsBag], list[str]]:
    """The bags that can be used, and a line for each that cannot."""
    rows = list(authors_bags.check_bags(folder))
    good = [authors_bags.describe_bag(Path(folder) / row["bag"]) for row in rows if not row["problem"]]
    return good, [f"{row['bag']}: {row['problem']}" for row in rows if row["problem"]]


def output(folder) -> Path:
    """Where a folder's results lie."""
    return DERIVED_DATA / "recordings" / Path(folder).resolve().name


def reproduce(folder, report=print) -> Path:
    """Run every study whose bags are there; returns the folder of the results.

    Raises
    ------
    InputError
        If no bag can be used, or no rig comes of them.
    """
    bags, left_out = survey(folder)
    for line in left_out:
        report(f"left out: {line}")
    roles = {role: [b for b in bags if b.role == role] for role in ("train", "test", "hard", "empty")}
    if not (roles["test"] or roles["hard"] or roles["empty"]):
        raise InputError(f"{folder}: no bag for testing is usable; 'lmmap dataset check {folder}' says why")
    out = output(folder)
    out.mkdir(parents=True, exist_ok=True)
    rig = _rig(Path(folder), out, roles, report) if roles["test"] or roles["hard"] else None
    port = rig.port if rig else Port.lm_map()
    facts = {"recordings": out.name, "bags": len(bags), "left_out": left_out,
             "rig": rig.calibration if rig else None}  # fmt: skip
    tables = {name: [] for name in ("errors", "hard", "false", "odometry")}
    for bag in (*roles["test"], *roles["hard"], *roles["empty"]):
        try:
            _studies(bag, _label(Path(folder), bag), rig, port, out, tables, report)
        except InputError as error:  # a fault in the middle; what came before it is kept
            left_out.append(str(error))
            report(f"left out: {error}")
    results = {name: pd.DataFrame(tables[name]) for name in ("hard", "false", "odometry")}
    results["summary"] = _summary(tables["errors"])
    for name, table in results.items():
        (out / f"{name}.csv").unlink(missing_ok=True)  # an earlier run's, whose bags may be gone
        if len(table):
            save_table(out / f"{name}.csv", table, **facts)
    save_json(out / "about.json", facts)
    return out


def _studies(
    bag: AuthorsBag, label: str, rig: Rig | None, port: Port, out: Path, tables: dict, report
) -> None:
    """Add one bag to the tables."""
    stream = open_stream(bag.path)
    if bag.role != "empty":
        stream = replace(stream, truth=rig.truth(bag.path))
    for gap in pose_errors.DOMAIN_GAPS if bag.role == "test" else pose_errors.DOMAIN_GAPS[:1]:
        for modality in pose_errors.MODALITIES:
            found = _estimates(stream, label, port, modality, gap, out, report)
            _study(bag, stream, found, port, modality, gap, tables)


def training_set(folder, domain_gap: str, report=print) -> tuple[list[str], Path]:
    """Samples of a folder's training bags, made where they are absent: their names, and where they lie.

    The high domain gap's are the bags with textured covers; the low one's are all.  Raises `InputError`.
    """
    bags, left_out = survey(folder)
    for line in left_out:
        report(f"left out: {line}")
    roles = {"train": [b for b in bags if b.role == "train"], "test": [], "hard": []}
    some = [b for b in roles["train"] if b.textured or domain_gap != "high"]
    if not some:
        raise InputError(
            f"{folder}: no usable training bag for the {domain_gap} domain gap; see lmmap dataset"
        )
    out = output(folder)
    (out / "training").mkdir(parents=True, exist_ok=True)
    rig = _rig(Path(folder), out, roles, report)
    names = []
    for bag in some:
        stream = replace(open_stream(bag.path), truth=rig.truth(bag.path))
        names += dataset.make_recording_samples(
            stream, _label(Path(folder), bag), out / "training", rig.port, report
        )
    if len(names) < 5:
        raise InputError(f"{folder}: {len(names)} pieces of training bags, 5 are needed; give longer bags")
    return names, out / "training"


def _rig(folder: Path, out: Path, roles: dict, report) -> Rig:
    """The folder's rig; without one, that of its training bags, or for want of them of the tests."""
    if (folder / RIG_FILE).exists():
        report(f"rig: {RIG_FILE} of {folder.name}")
        return Rig.load(folder / RIG_FILE)
    some = sorted(roles["train"], key=lambda b: b.textured)[:CALIBRATION_BAGS]
    if not some:
        some = (roles["test"] or roles["hard"])[:CALIBRATION_BAGS]
        report("rig: no training bag; calibrating on bags that are tested on, which flatters the errors")
    path = authors_bags.hand_eye_file(folder)
    hand_eye, port = read_hand_eye(path) if path else None, Port.lm_map()
    ends = hand_eye.ends if hand_eye else tf.arm_ends(some[0].path)
    camera = open_stream(some[0].path).camera
    dates = [b.path.stat().st_mtime_ns for b in some]
    made = kept_in(out / RIG_FILE, some[0].path, dates, camera, path and path.read_text())
    if made.exists():
        report("rig: as calibrated before")
        return Rig.load(made)
    parts, seconds = [], sum(authors_bags.bag_contents(bag.path)["seconds"] for bag in some)
    for bag in some:
        motion, stream = tf.arm_motion(bag.path, *ends), open_stream(bag.path, camera)
        estimator = Estimator(camera, port, "rgb", "low", settings_for(camera))
        kept = kept_in(out / f"rig-{_label(folder, bag)}.csv", bag.path, camera)
        parts.append(
            calibration.collect_detections(detect(stream, estimator, CALIBRATED_ON / seconds, kept), motion)
        )
    rig = calibration.calibrate_rig(parts, port, ends, hand_eye.T_frame_cam.inverse if hand_eye else None)
    rig.calibration["recordings"] = [bag.path.name for bag in some]
    rig.save(made)
    report(f"rig: calibrated on {', '.join(rig.calibration['recordings'])}")
    return rig


def _label(folder: Path, bag: AuthorsBag) -> str:
    return str(bag.path.relative_to(folder).with_suffix("")).replace("/", "--")


def kept_in(path: Path, bag: Path, *made_of) -> Path:
    """The file of a bag's estimates, emptied if it was made of something else."""
    facts, beside = bag.stat(), path.with_suffix(".made-of")
    mark = fingerprint(path.name, *map(str, (facts.st_size, facts.st_mtime_ns, *made_of)))
    try:
        if not (beside.exists() and beside.read_text() == mark):
            path.unlink(missing_ok=True)
            beside.write_text(mark)
    except OSError as error:
        raise InputError(f"{path}: cannot write ({error.strerror}); choose another place for it") from None
    return path


def weights_of(out: Path, modality: str, gap: str) -> Path | str:
    """Filters trained on these recordings where there are some, else the bench's."""
    own = out / f"weights-{gap}"
    there = all((own / weight_path(f, modality, "low").name).exists() for f in FILTERS)
    return own if there else gap


def _estimates(stream, label, port, modality, gap, out, report) -> list[Estimate]:
    weights = weights_of(out, modality, gap)
    settings = replace(settings_for(stream.camera), rate_hz=RATE_HZ)
    estimator = Estimator(stream.camera, port, modality, weights, settings)
    label = f"{label}-{modality}-{gap}"
    own = [p.stat().st_mtime_ns for p in sorted(weights.glob("*"))] if isinstance(weights, Path) else gap
    kept = kept_in(out / f"estimates-{label}.csv", stream.source.path, port, stream.camera, own)
    found = detect(stream, estimator, RATE_HZ, kept)
    poses = sum(e.T_cam_port is not None for e in found)
    report(f"{label}: {poses} poses in {len(found)} images")
    return found


def _study(bag: AuthorsBag, stream: Stream, found, port: Port, modality: str, gap: str, tables: dict) -> None:
    """Add what one bag says, to the rows of its study."""
    row = {"bag": bag.path.name, "light": bag.light, "modality": modality, "images": len(found)}
    poses, rings = (sum(x is not None for x in some) for some in
                    ([e.T_cam_port for e in found], [e.ellipse for e in found]))  # fmt: skip
    if bag.role == "empty":
        tables["false"].append(row | {"poses": poses, "ellipses": rings})
        return
    errors = pose_errors.errors(stream, found, port)
    if bag.role == "hard":
        share = 100 / max(len(found), 1)
        medians = {name: errors[name].median() for name in ("position_error_m", "normal_error_deg")}
        rates = {"ellipse_percent": share * rings, "pose_percent": share * poses}
        tables["hard"].append(row | rates | medians)
        return
    training = f"{gap}-domain-gap"
    tables["errors"].append(errors.assign(light=bag.light, modality=modality, training=training))
    if bag.light == "high" and gap == "low":
        try:
            scored = odometry.score([odometry.camera_track(found, port)], stream.truth)
            tables["odometry"] += [row | line for line in odometry.by_length(scored).to_dict("records")]
        except odometry.NotScored as error:
            tables["odometry"].append(row | {"not_scored": str(error)})


def _summary(errors: list[pd.DataFrame]) -> pd.DataFrame:
    """`accuracy.summary` for each light, modality and set of filters, all bags of it together."""
    keys, none = ["light", "modality", "training"], pd.DataFrame()
    cells = pd.concat(errors).groupby(keys) if errors else ()
    return pd.concat([none, *(pose_errors.summary(some).assign(**dict(zip(keys, names, strict=True)))
                              for names, some in cells)])  # fmt: skip
