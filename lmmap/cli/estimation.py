"""``lmmap estimate``: poses of a recording, on disk as they come."""

from __future__ import annotations

import heapq
import json
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import asdict
from pathlib import Path

import numpy as np

from .. import plugins
from ..drawing.overlay import Overlay
from ..estimation.estimates import estimate_images, merge_by_time
from ..estimation.images import timed_images
from ..estimation.tracks import track_between, track_images
from ..files import check_output
from ..pipeline.weights import weight_hashes
from ..recordings.journal import Journal, recording_mark
from ..recordings.pose_files import round_trip
from ..recordings.stream import Stream
from ..settings import MODALITIES, Settings
from ..tracking.discord import in_accord
from ..tracking.fusion import fuse
from ..tracking.tracker import Tracker
from ..types import Estimate, InputError, Status
from .inputs import (
    as_read,
    can_be_fused,
    check_between,
    input_files,
    make_estimator,
    network_set,
    no_images,
    open_input,
    pose_bag,
)
from .progress import Bar, summary


def estimate(a) -> None:
    """Poses of a recording: of each image of one camera, of both fused, or of a track."""
    _check(a)
    stream = open_input(a)
    if a.adapt is not None:
        a.weights = _adapted(a)
    modalities = MODALITIES if a.modality == "fused" else (a.modality,)
    estimators = {m: make_estimator(a, stream.camera, m) for m in modalities}
    if a.modality == "fused":
        can_be_fused(stream, needed=True)
    first = estimators[modalities[0]]
    views = [view(path, first.port, stream.camera) for view, path in _views(a).items()]
    between, stopped = 0, False
    with ExitStack() as files:
        journal = a.bag or _journal(a, a.output, a.format, a.modality, estimators)
        files.enter_context(journal)
        resumed = len(journal.statuses)
        for view in views:
            files.enter_context(view)
        off_px: list[float] = []
        answers = files.enter_context(closing(_answers(a, stream, estimators, journal, files, off_px)))
        try:
            with Bar(stream, a.modality) as bar:
                for image, e in answers:
                    _keep(journal, e, off_px)
                    mask = None
                    if views and image is not None:
                        mask = estimators["rgb" if image.ndim == 3 else "event"].ring_mask(image)
                    for view in views:
                        view.add(image, e, mask)
                    if image is None and a.between:
                        between += 1
                    else:
                        bar.add(e)
        except KeyboardInterrupt:
            stopped = True
        if not journal.statuses and not stopped:
            raise no_images(stream, modalities[-1], estimators[modalities[-1]].settings, a.rate)
    _doubt_port(off_px, first.settings)
    _report(a, journal, resumed, stopped, between)


def _adapted(a) -> Path:
    """Networks that another package makes of the recording's first part."""
    for function in plugins.entry_points(plugins.NETWORKS).values():
        return plugins.call("--adapt", function, a)
    raise plugins.NotInstalled(f"--adapt: needs the laboratory of the book; {plugins.INSTALL}")


def _check(a) -> None:
    """Whether what is asked for goes together, and whether each output may be written."""
    shown = _views(a).values()
    for path in shown:
        if a.resume and path.exists():
            raise InputError(f"{path}: a drawing cannot be resumed; leave it out, and use lmmap draw")
        if a.modality == "fused" and (path == a.video or not a.track):
            raise InputError(f"{path}: a drawing shows one camera's images; give --modality rgb or event")
    a.bag = None if a.format else pose_bag(a)
    if a.resume and (a.track or a.bag):
        what = "track" if a.track else "bag"
        raise InputError(f"{a.output}: a {what} cannot be resumed; leave --resume out, and give --overwrite")
    a.format = a.format or ("tum" if a.output.suffix == ".tum" else "csv")
    if a.between is not None:
        if not a.track:
            raise InputError("--between: a track is followed between its images; give --track as well")
        check_between(a)
        if a.format == "tum" or a.bag:
            raise InputError(f"{a.output}: this format cannot mark poses between images; name it .csv")
    parts = [_part(a, m) for m in MODALITIES] if a.modality == "fused" and not a.track else []
    for path in (a.output, *parts):
        check_output(path, input_files(a), overwrite=a.overwrite or a.resume)
    for path in shown:
        check_output(path, [*input_files(a), a.output], overwrite=a.overwrite)


def _views(a) -> dict[type, Path]:
    """The drawings that are asked for, by what makes them."""
    rerun = plugins.needed("rerun", "--rerun") if a.rerun else None
    return {view: path for view, path in ((Overlay, a.video), (rerun, a.rerun)) if path}


def _part(a, modality: str) -> Path:
    """Where one camera's estimates are written that are fused."""
    return a.output.with_suffix(f".{modality}.csv")


def _answers(
    a, stream: Stream, estimators: dict, journal: Journal, files: ExitStack, off_px
) -> Iterator[tuple]:
    """``(image, estimate)`` in the order of time, of what is not in the journal yet; no image where a pose is
    between images, or of both cameras.  Journals of cameras that are fused are opened in ``files``, and
    ``off_px`` takes how far their estimates' markers are off."""
    if a.track:
        shots = [timed_images(stream, m, e.settings, a.rate) for m, e in estimators.items()]
        in_order = heapq.merge(*shots, key=lambda shot: shot.t_us)
        tracker = Tracker(*estimators.values(), events=bool(a.between))
        if a.between:
            answers = track_between(in_order, tracker, stream.chunks(), a.between)
        else:
            answers = track_images(in_order, tracker)
        return in_accord(answers, tracker.discord, a.recording)
    if a.modality != "fused":
        return _estimate_rest(stream, estimators[a.modality], a.rate, journal)
    parts = {}
    for m, estimator in estimators.items():
        part = files.enter_context(_journal(a, _part(a, m), "csv", m, {m: estimator}))
        parts[m] = _estimate_part(stream, estimator, a.rate, part, off_px)
    period_rad = estimators["rgb"].port.yaw_period_rad
    answers = fuse(merge_by_time(parts), period_rad, a.rate, name=str(a.recording))
    return ((None, e) for e in answers if not journal.has(e.t_us))


def _estimate_rest(stream: Stream, estimator, rate_hz: float | None, journal: Journal) -> Iterator[tuple]:
    """``(image, estimate)`` of one camera's images that are not in the journal yet."""
    shots = timed_images(stream, estimator.modality, estimator.settings, rate_hz)
    return estimate_images((shot for shot in shots if not journal.has(*shot.times_us)), estimator)


def _estimate_part(stream, estimator, rate_hz: float | None, journal: Journal, off_px) -> Iterator[Estimate]:
    """One camera's estimates, each on disk before the next; those on disk already are not made again."""
    yield from journal.done.values()
    for _, e in _estimate_rest(stream, estimator, rate_hz, journal):
        _keep(journal, e, off_px)
        yield round_trip(e)


def _keep(journal: Journal, e: Estimate, off_px: list[float]) -> None:
    """Put an estimate on disk, and how far its markers are off, if that is known, to the others."""
    journal.add(e)
    if e.markers_off_px is not None:
        off_px.append(e.markers_off_px)


def _journal(a, path: Path, form: str, modality: str, estimators: dict) -> Journal:
    """A table of some estimators' answers, which is known as this command's own by what they depend on."""
    first, weights = next(iter(estimators.values())), {}
    for e in estimators.values():
        weights |= weight_hashes(a.weights or network_set(a), e.modality)
    made_of = {
        "recording": recording_mark(a.recording), "fps": a.fps, "modality": modality, "rate": a.rate,
        "format": a.format, "camera": asdict(first.camera), "port": asdict(first.port),
        "settings": asdict(first.settings), "weights": weights,
        **as_read(a), **({"track": True, "between": a.between} if a.track else {}),
        **({"flip": a.flip} if a.flip else {}),
    }  # fmt: skip
    return Journal(path, form, a.resume, made_of)


def _doubt_port(markers_off_px: list[float], settings: Settings) -> None:
    """Say so if in most poses the markers are not where the port has them."""
    if len(markers_off_px) < settings.port_off_poses:
        return
    if (off_px := np.median(markers_off_px)) > settings.port_off_px:
        warnings.warn(
            f"the markers lie {off_px:.1f} px from where the port has them: measure the port with "
            "lmmap calibrate --port",
            stacklevel=2,
        )


def _report(a, journal: Journal, resumed: int, stopped: bool, between: int) -> None:
    """Print the summary of what was estimated, ``between`` poses between images apart; `KeyboardInterrupt` if
    it was stopped."""
    counts = Counter(journal.statuses) - Counter({Status.PREDICTED: between})
    if a.json:
        facts = {"output": str(a.output), "images": counts.total(), "statuses": dict(sorted(counts.items()))}
        print(json.dumps(facts | ({"between": between} if a.between else {})))
    else:
        before = f" ({resumed} from before)" if resumed else ""
        also = f"; {between} poses between them" if a.between else ""
        print(f"{a.output}: {summary(counts)}{also}{before}")
    if stopped:
        remedy = "" if a.track or a.bag else ", --resume goes on"
        raise KeyboardInterrupt(f"{a.output} keeps what was estimated{remedy}")
