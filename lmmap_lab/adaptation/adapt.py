"""Networks for one place: from its recording, without any truth, to a folder that ``--weights`` takes.

1. looks: some hundred images are estimated;
2. labels: those that can be believed become images with masks, but for a part that is kept for the guard;
3. learning: both networks of a camera are trained on for some hundred steps;
4. guard: the new networks are asked, where the old ones are not sure, only if they explain the part that was
   kept as well as those do.

Work that is done lies in ``FOLDER.unfinished`` until all is; the same call then goes on from there.  A folder
that has its name is whole.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from lmmap.estimation.images import timed_images
from lmmap.files import atomic, lock, temporary, writes
from lmmap.marks import as_mark, check_mark
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import FilterNet, MaskNetwork
from lmmap.pipeline.weights import BEFORE, FILTERS, before, network_paths
from lmmap.recordings.journal import Journal
from lmmap.recordings.pose_files import round_trip
from lmmap.settings import MODALITIES, OURS
from lmmap.types import AnyRecording, InputError, Port
from lmmap_lab.unfinished import MARK, begin_folder, check_own, remove_folder

from ..training.recipe import Recipe
from . import learning, self_labels
from .folder import Outcome, copy_networks, finished, made_of, write_made_of, write_networks
from .guard import Guard
from .self_labels import Look
from .smooth_track import SmoothTrack

LOOKS, LOOKS_A_SECOND, MOST_LOOKS = 120, 2.5, 600  # of each camera: at least, of long recordings, at most
PIECES, GUARDED = 8, (2, 6)  # of a recording, and which of them teach nothing
ENOUGH = 0.05  # share of images that may lack a sure pose, with nothing to learn
UNFINISHED = ".unfinished"  # how the name of the folder of unfinished work ends


def adapt(recording: AnyRecording, folder, modalities: Sequence[str] = MODALITIES, weights=OURS.weights,
          port: Port | None = None, *, seconds: float | None = None, steps: int = learning.STEPS,
          seed: int = 0, always: bool = False,
          report: Callable[[str], None] = print) -> dict[str, Outcome]:  # fmt: skip
    """Train networks on, with a recording's own images and poses, and write them.

    Parameters
    ----------
    folder
        Where the networks go, named as `Estimator` expects them of a folder.  Where nothing could be learned,
        they are those from before; else these lie in it as well, for `Estimator`.
    modalities
        Cameras to look at.  Each teaches the others, since they look at one port.
    weights, port
        As `Estimator`.
    seconds
        Learn from the recording's first seconds; by default from all of it.
    always
        Learn even if the networks are sure of nearly all images: the place may become harder later.
    report
        Called with a line for each camera.

    Raises
    ------
    InputError
        For a recording without images, and for a folder that holds anything but the networks of this call.
    """
    folder = Path(os.path.realpath(folder))
    estimators = {m: Estimator(recording.camera, port, m, weights) for m in modalities}
    recipes = {m: _recipes(e, steps, seed, recording.name) for m, e in estimators.items()}
    facts = made_of(recording, estimators, weights, seconds, steps, seed, always)
    with writes(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
    with lock(folder):
        unfinished = folder.with_name(folder.name + UNFINISHED)
        check_own(unfinished)
        outcomes = finished(folder, facts)
        if outcomes is None:
            if unfinished.exists():
                check_mark(unfinished, unfinished / MARK, facts)
            else:
                begin_folder(unfinished, as_mark(facts))
            outcomes = _adapt(recording, folder, unfinished, estimators, recipes, weights, facts, report)
        with temporary(folder):  # and what a run left that was killed at its end
            remove_folder(unfinished)
    return outcomes


def _recipes(estimator: Estimator, steps: int, seed: int, recording: str) -> list[Recipe]:
    """How an estimator's two networks learn, by crops that its images can hold."""
    recipes = [learning.recipe_for(name, estimator.modality, steps, seed, recording) for name in FILTERS]
    return [replace(r, crop_px=min(r.crop_px, *estimator.grid.size_px)) for r in recipes]


def _adapt(recording, folder: Path, unfinished: Path, estimators: dict, recipes: dict, weights, facts: dict,
           report) -> dict[str, Outcome]:  # fmt: skip
    """As `adapt`, in a folder that no other process writes, going on with what is unfinished."""
    modalities, seconds = list(estimators), facts["seconds"]
    looks = {m: list(looks_of(recording, e, seconds, unfinished, facts)) for m, e in estimators.items()}
    if not any(looks.values()):
        remove_folder(unfinished)
        raise InputError(f"{recording.name}: holds no images of {' or '.join(modalities)}; try the other")
    seen = [(m, look.estimate) for m, each in looks.items() for look in each]
    track, outcomes, nets = SmoothTrack(seen, estimators[modalities[0]].port.yaw_period_rad), {}, {}
    for m, estimator in estimators.items():
        old = [learning.network_of(path, m) for path in network_paths(weights, m)]
        how = recipes[m], unfinished, facts.get("always", False)
        outcomes[m], nets[m] = learn(recording, looks[m], track, estimator, old, *how)
        report(f"{m}: {outcomes[m].why}")
    with atomic(folder) as new:
        new.mkdir()
        for m in modalities:
            # networks that go on learning keep the first ones
            if first := before(weights, m) or (weights if outcomes[m].taken else None):
                copy_networks(first, m, new / BEFORE)
            write_networks(new, nets[m], recipes[m], outcomes[m], facts, network_paths(weights, m))
        write_made_of(new, facts, outcomes)
    return outcomes


def looks_of(recording: AnyRecording, estimator: Estimator, seconds: float | None, unfinished: Path,
             facts: dict) -> Iterator[Look]:  # fmt: skip
    """Estimates of images that are spread evenly over a recording, each on disk before the next."""
    shots = timed_images(recording, estimator.modality, estimator.settings)
    times_us = np.array([shot.t_us for shot in shots], np.int64)
    if seconds is not None:
        times_us = times_us[times_us < times_us.min(initial=2**62) + 1e6 * seconds]
    if not len(times_us):
        return
    most = int(np.clip(1e-6 * LOOKS_A_SECOND * np.ptp(times_us), LOOKS, MOST_LOOKS))
    chosen = times_us[np.unique(np.linspace(0, len(times_us) - 1, most).astype(int))]
    with Journal(unfinished / f"looks-{estimator.modality}.csv", "csv", True, facts) as journal:
        looks = self_labels.look_at(recording, estimator, set(chosen.tolist()), journal.done)
        for look in tqdm(looks, f"looks, {estimator.modality}", len(chosen), unit=" images", disable=None):
            if look.estimate.t_us not in journal.done:
                journal.add(look.estimate)
            yield look._replace(estimate=round_trip(look.estimate))


def guarded(times_us: Sequence[int]) -> np.ndarray:
    """Which of a recording's images (N,) teach nothing, since the guard asks them: pieces that are spread in
    time, for neighbours are nearly equal."""
    share = (np.asarray(times_us) - times_us[0]) / max(times_us[-1] - times_us[0], 1)
    return np.isin((PIECES * share).astype(int), GUARDED)


def learn(recording: AnyRecording, own: Sequence[Look], track: SmoothTrack, estimator: Estimator,
          old: list[FilterNet], recipes, unfinished: Path,
          always: bool = False) -> tuple[Outcome, list[FilterNet]]:  # fmt: skip
    """What becomes of one camera's networks by its looks and the track of all cameras, and the networks, old
    or new."""
    modality = estimator.modality
    kept = guarded([look.t_us for look in own]) if own else []
    free = [look for look, k in zip(own, kept, strict=True) if not k]
    poses = [self_labels.label_pose(look.estimate, track, estimator) for look in free]
    chosen = self_labels.choose(free, poses)
    facts = {"labels": len(chosen), "confidences": [round(free[i].estimate.confidence, 3) for i in chosen]}
    if len(chosen) < self_labels.LEAST_LABELS:
        why = f"{len(chosen)} images can teach, {self_labels.LEAST_LABELS} are needed; networks as before"
        return Outcome(False, why, facts), old
    guard = Guard([look.estimate for look in own], kept, track, estimator)
    if guard.lacking() <= ENOUGH and not always:
        why = f"sure poses of at least {1 - ENOUGH:.0%} of images with the port in view; networks as before"
        why += " (--always would learn from them)"
        return Outcome(False, why, facts), old
    samples = self_labels.labelled([free[i].image for i in chosen], [poses[i] for i in chosen], estimator)
    trained = learning.train_both([deepcopy(net) for net in old], samples, recipes, unfinished)
    new = [learning.mean(*pair) for pair in zip(old, trained, strict=True)]
    networks = tuple(MaskNetwork(net, modality) for net in new)
    learned = Estimator(estimator.camera, estimator.port, modality, networks, estimator.settings)
    asked = {look.t_us for look, ask in zip(own, guard.asked, strict=True) if ask}
    again = self_labels.look_at(recording, learned, asked)
    verdict = guard.judge([look.estimate for look in again], for_later=always)
    facts["guard"] = json.loads(json.dumps(asdict(verdict)))
    if not verdict.taken:
        return Outcome(False, f"{verdict}; networks as before", facts), old
    facts["min_confidence"] = verdict.min_confidence
    return Outcome(True, f"{len(chosen)} images taught; {verdict}", facts), new
