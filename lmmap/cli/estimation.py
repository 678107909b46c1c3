"""``lmmap estimate``: poses of a recording, on disk as they come."""

from __future__ import annotations

import hashlib
import heapq
import json
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

from lmmap_lab.studies import pose_errors

from ..drawing.overlay import Overlay
from ..drawing.rerun_log import RerunLog
from ..files import check_output
from ..pipeline import run
from ..pipeline.weights import FILTERS, weight_path
from ..recordings.journal import Journal, recording_mark
from ..recordings.pose_files import round_trip
from ..recordings.stream import Stream
from ..tracking.fusion import fuse
from ..tracking.recorded import track_between, track_images
from ..tracking.tracker import Tracker
from ..types import Estimate, InputError, Status
from .inputs import (
    check_between,
    input_files,
    make_estimator,
    network_set,
    no_images,
    open_input,
)
from .progress import Bar, summary


def estimate(a) -> None:
    """Poses of a recording, of one camera's images or of both."""
    shown = [path for path in (a.video, a.rerun) if path]
    for path in shown:
        if a.resume and path.exists():
            raise InputError(f"{path}: a drawing cannot be resumed; leave it out, and use lmmap draw")
        if a.modality == "fused" and (path == a.video or not a.track):
            raise InputError(f"{path}: a drawing shows one camera's images; give --modality rgb or event")
    if a.track and a.resume:
        raise InputError(f"{a.output}: a track cannot be resumed; leave --resume out, and give --overwrite")
    if a.between is not None:
        if not a.track:
            raise InputError("--between: a track is followed between its images; give --track as well")
        check_between(a)
    if a.between and (a.format or a.output.suffix.lstrip(".")) == "tum":
        raise InputError(f"{a.output}: TUM's format cannot mark poses between images; give a name in .csv")
    a.format = a.format or ("tum" if a.output.suffix == ".tum" else "csv")
    fused = a.modality == "fused" and not a.track
    parts = [_part(a, modality) for modality in pose_errors.MODALITIES] if fused else []
    for path in (a.output, *parts):
        check_output(path, input_files(a), overwrite=a.overwrite or a.resume)
    for path in shown:
        check_output(path, [*input_files(a), a.output], overwrite=a.overwrite)
    stream = open_input(a)
    if parts:
        _estimate_fused(a, stream)
    else:
        _estimate_single(a, stream)


def _estimate_single(a, stream: Stream) -> None:
    """One camera's estimates, or a track of one or both, each on disk as it comes."""
    modalities = pose_errors.MODALITIES if a.modality == "fused" else (a.modality,)
    estimators, stopped = {m: make_estimator(a, stream.camera, m) for m in modalities}, False
    first = estimators[modalities[0]]
    views = [view(path, first.port, stream.camera)
             for view, path in ((Overlay, a.video), (RerunLog, a.rerun)) if path]  # fmt: skip
    made_of = _made_of(a, a.modality, list(estimators.values()))
    with ExitStack() as files:
        journal = files.enter_context(Journal(a.output, a.format, a.resume, made_of))
        for view in views:
            files.enter_context(view)
        resumed, poses, between = len(journal.statuses), 0, 0
        try:
            with Bar(stream, a.modality) as bar:
                shots = [run.timed_images(stream, m, e.settings, a.rate) for m, e in estimators.items()]
                if a.track:
                    in_order = heapq.merge(*shots, key=lambda shot: shot.t_us)
                    tracker = Tracker(*estimators.values(), events=bool(a.between))
                    answers = (
                        track_between(in_order, tracker, stream.chunks(), a.between)
                        if a.between
                        else track_images(in_order, tracker)
                    )
                else:
                    left = (shot for shot in shots[0] if not journal.has(*shot.times_us))
                    answers = run.estimate_images(left, first)
                for image, e in answers:
                    journal.add(e)
                    mask = _ring_mask(estimators, image) if views and image is not None else None
                    for view in views:
                        view.add(image, e, mask)
                    if image is None:
                        between += 1
                        continue
                    poses += e.status == Status.OK
                    bar.show(e.t_us, len(journal.statuses) - resumed - between, poses)
        except KeyboardInterrupt:
            stopped = True
        if not journal.statuses and not stopped:
            raise no_images(stream, modalities[-1], estimators[modalities[-1]].settings)
    _report(a, journal, resumed, stopped, between)


def _ring_mask(estimators: dict, image):
    """The ring's mask (H, W) of a frame or a histogram, by its modality's estimator."""
    return estimators["rgb" if image.ndim == 3 else "event"].ring_mask(image)


def _estimate_fused(a, stream: Stream) -> None:
    """Both cameras' estimates, each on disk as it comes beside the output, and what is fused of them."""
    estimators = {m: make_estimator(a, stream.camera, m) for m in pose_errors.MODALITIES}
    period_rad, stopped = estimators["rgb"].port.yaw_period_rad, False
    with ExitStack() as files:
        made_of = _made_of(a, a.modality, list(estimators.values()))
        journal = files.enter_context(Journal(a.output, a.format, a.resume, made_of))
        parts = {m: files.enter_context(Journal(_part(a, m), "csv", a.resume, _made_of(a, m, [estimator])))
                 for m, estimator in estimators.items()}  # fmt: skip
        resumed, poses = len(journal.statuses), 0
        both = {m: _estimate_part(stream, estimator, a.rate, parts[m]) for m, estimator in estimators.items()}
        try:
            with Bar(stream, a.modality) as bar:
                for e in fuse(run.merge_by_time(both), period_rad, a.rate):
                    if journal.has(e.t_us):
                        continue
                    journal.add(e)
                    poses += e.T_cam_port is not None
                    bar.show(e.t_us, len(journal.statuses) - resumed, poses)
        except KeyboardInterrupt:
            stopped = True
        if not journal.statuses and not stopped:
            raise no_images(stream, "event", estimators["event"].settings)
    _report(a, journal, resumed, stopped)


def _part(a, modality: str) -> Path:
    """Where one camera's estimates are written that are fused."""
    return a.output.with_suffix(f".{modality}.csv")


def _estimate_part(stream: Stream, estimator, rate_hz: float | None, journal: Journal) -> Iterator[Estimate]:
    """One camera's estimates, each on disk before the next; those on disk already are not made again."""
    shots = run.timed_images(stream, estimator.modality, estimator.settings, rate_hz)
    yield from journal.done.values()
    left = (shot for shot in shots if not journal.has(*shot.times_us))
    for _, e in run.estimate_images(left, estimator):
        journal.add(e)
        yield round_trip(e)


def _made_of(a, modality: str, estimators: list) -> dict:
    """What estimates depend on, for `Journal`: by it a file is known as this command's own."""
    first = estimators[0]
    weights = {}
    for e in estimators:
        paths = [weight_path(f, e.modality, "low" if a.weights else network_set(a)) for f in FILTERS]
        for path in [Path(a.weights) / p.name if a.weights else p for p in paths]:
            weights[path.name] = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    return {
        "recording": recording_mark(a.recording), "fps": a.fps, "modality": modality, "rate": a.rate,
        "format": a.format,
        "camera": asdict(first.camera), "port": asdict(first.port), "settings": asdict(first.settings),
        "weights": weights, **({"track": True, "between": a.between} if a.track else {}),
    }  # fmt: skip


def _report(a, journal: Journal, resumed: int, stopped: bool, between: int = 0) -> None:
    """Print the summary of what was estimated, ``between`` poses between images apart; `KeyboardInterrupt` if
    it was stopped."""
    counts = Counter(journal.statuses) - Counter({Status.PREDICTED: between})
    if a.json:
        facts = {"output": str(a.output), "images": counts.total(), "statuses": dict(sorted(counts.items()))}
        print(json.dumps(facts | ({"between": between} if a.between else {})))
    else:
        before = f" ({resumed} from before)" if resumed else ""
        also = f"; {between} poses between them" if a.between else ""
        print(f"{a.output}: {summary(list(counts.elements()))}{also}{before}")
    if stopped:
        raise KeyboardInterrupt(f"{a.output} keeps what was estimated, --resume goes on")
