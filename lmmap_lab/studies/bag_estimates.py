"""Estimates of the authors' bags, kept as they come, their rig, and the networks that learn from them."""

from __future__ import annotations

import os
from pathlib import Path

from tqdm import tqdm

from lmmap.disk import is_there
from lmmap.estimation.estimates import estimate_images
from lmmap.estimation.images import timed_images
from lmmap.files import write_text, writes
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import settings_for
from lmmap.recordings.formats import open_stream
from lmmap.recordings.journal import Journal
from lmmap.recordings.pose_files import read_estimates
from lmmap.recordings.stream import Stream
from lmmap.types import Estimate, InputError, Port
from lmmap_lab.unfinished import has_mark
from lmmap_readers.rig import RIG_FILE, Rig

from ..adaptation.adapt import adapt
from ..provenance import PINS, fingerprint
from ..rig import authors_bags, calibration, tf
from ..rig.authors_bags import AuthorsBag
from ..rig.hand_eye_file import read_hand_eye

CALIBRATION_BAGS = 4
CALIBRATED_ON = 1000  # detections, spread over the bags; of short bags every frame


def detect(stream: Stream, estimator: Estimator, rate_hz: float, path: Path) -> list[Estimate]:
    """Estimates of a bag's images, each written to ``path`` as it comes; a second call goes on from there."""
    with Journal(path, resume=True) as journal:
        every = timed_images(stream, estimator.modality, estimator.settings, rate_hz)
        left = (shot for shot in every if not journal.has(*shot.times_us))
        try:
            for _, result in tqdm(estimate_images(left, estimator), path.stem, unit=" images", disable=None):
                journal.add(result)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"{path} keeps what was estimated, the same command goes on") from None
    return read_estimates(path) if journal.statuses else []


def folder_rig(folder: Path, out: Path, roles: dict, report) -> Rig:
    """The rig of a folder of bags, from its file or calibrated on the folder's bags.

    Training bags serve for the calibration; where there are none, those of the tests do.  The result is
    written to ``out``, and a second call reads it there.

    Parameters
    ----------
    roles : bags by ``train``, ``test`` and ``hard``
    """
    if (folder / RIG_FILE).exists():
        report(f"rig: {RIG_FILE} of {folder.name}")
        return Rig.load(folder / RIG_FILE)
    bags = sorted(roles["train"], key=lambda b: b.textured)[:CALIBRATION_BAGS]
    if not bags:
        bags = (roles["test"] or roles["hard"])[:CALIBRATION_BAGS]
        report("rig: no training bag; calibrating on bags that are tested on, which flatters the errors")
    hand_eye_path = authors_bags.hand_eye_file(folder)
    hand_eye, port = read_hand_eye(hand_eye_path) if hand_eye_path else None, Port.lm_map()
    ends = hand_eye.ends if hand_eye else tf.arm_ends(bags[0].path)
    camera = open_stream(bags[0].path).camera
    dates = [b.path.stat().st_mtime_ns for b in bags]
    hand_eye_text = hand_eye_path and hand_eye_path.read_text()
    rig_path = resumable_file(out / RIG_FILE, bags[0].path, dates, camera, hand_eye_text)
    if rig_path.exists():
        report("rig: as calibrated before")
        return Rig.load(rig_path)
    parts, seconds = [], sum(authors_bags.bag_contents(bag.path)["seconds"] for bag in bags)
    for bag in bags:
        motion, stream = tf.arm_motion(bag.path, *ends), open_stream(bag.path, camera)
        estimator = Estimator(camera, port, "rgb", "low", settings_for(camera))
        path = resumable_file(out / f"rig-{bag_label(folder, bag)}.csv", bag.path, camera)
        parts.append(
            calibration.collect_detections(detect(stream, estimator, CALIBRATED_ON / seconds, path), motion)
        )
    rig = calibration.calibrate_rig(parts, port, ends, hand_eye.T_frame_cam.inverse if hand_eye else None)
    rig.calibration["recordings"] = [bag.path.name for bag in bags]
    rig.save(rig_path)
    report(f"rig: calibrated on {', '.join(rig.calibration['recordings'])}")
    return rig


def learned_networks(roles: dict, out: Path, port: Port, report) -> Path:
    """The folder of networks that learned the laboratory by themselves, without any truth, from its longest
    training bag, if there is one with a realistic cover.

    Parameters
    ----------
    roles : bags by ``train`` and ``test``
    """
    bags = sorted(roles["train"], key=lambda b: b.textured) or roles["test"]
    alike = [b for b in bags if b.textured == bags[0].textured]
    bag = max(alike, key=lambda b: authors_bags.bag_contents(b.path)["seconds"])
    stream = open_stream(bag.path)
    report(f"learned: from {bag.path.name}{'' if roles['train'] else ', which is tested on'}")
    folder = out / f"learned-{_mark(bag.path.name, bag.path, port, stream.camera)[:12]}"
    adapt(stream, folder, port=port, report=report)
    return folder


def bag_label(folder: Path, bag: AuthorsBag) -> str:
    """A bag's path below its folder as one name, for the names of files."""
    return str(bag.path.relative_to(folder).with_suffix("")).replace("/", "--")


def resumable_file(path: Path, bag: Path, *made_of) -> Path:
    """``path`` for a bag's results; what lies there is removed if it was made of something else.

    Raises
    ------
    InputError
        If the folder cannot be written, or if what lies there has no mark: it is not ours to remove.
    """
    mark, mark_path = _mark(path.name, bag, *made_of), path.with_suffix(".made-of")
    if os.path.lexists(path) and not mark_path.exists():
        raise InputError(f"{path}: is not ours to replace; move it away, or give another output")
    if not (is_there(mark_path) and has_mark(mark_path, mark)):
        with writes(path):
            path.unlink(missing_ok=True)
        write_text(mark_path, mark)
    return path


def _mark(name: str, bag: Path, *made_of) -> str:
    """The fingerprint of a bag's results by that name."""
    facts = bag.stat()
    made_of = map(str, (facts.st_size, facts.st_mtime_ns, *made_of))
    return fingerprint(name, *made_of, code=(detect, folder_rig, adapt), files=("data/weights/*", PINS))
