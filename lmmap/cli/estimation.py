"""``lmmap estimate``: poses of a recording, written to disk one by one."""

from __future__ import annotations

import json
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import ExitStack, closing
from dataclasses import asdict
from pathlib import Path

from .. import plugins
from ..drawing.overlay import Overlay
from ..estimation.estimates import estimate_rest, fuse_rest
from ..estimation.tracks import track
from ..files import check_output
from ..pipeline.weights import weight_hashes
from ..recordings.journal import Journal
from ..recordings.stream import Stream
from ..settings import MODALITIES
from ..types import InputError, Status
from .inputs import (
    can_be_fused,
    check_between,
    input_files,
    made_of,
    make_estimator,
    network_set,
    no_images,
    open_input,
    pose_bag,
    table_format,
)
from .progress import Bar, summary


def estimate(a: Namespace) -> None:
    """Estimate the poses of a recording: of each image of one camera, of both fused, or of a track."""
    bag = _check(a)
    stream = open_input(a)
    weights = network_set(a) if a.adapt is None else plugins.first("--adapt", plugins.NETWORKS, a)
    modalities = MODALITIES if a.modality == "fused" else (a.modality,)
    estimators = {m: make_estimator(a, stream.camera, m, weights) for m in modalities}
    if a.modality == "fused":
        can_be_fused(stream, needed=True)
    port = estimators[modalities[0]].port
    views = [view(path, port, stream.camera) for view, path in _views(a).items()]
    parts = {m: _journal(a, path, "csv", {m: estimators[m]}, weights) for m, path in _parts(a).items()}
    journal = bag or _journal(a, a.output, table_format(a), estimators, weights)
    between, stopped = 0, False
    with ExitStack() as files:
        for file in (journal, *parts.values()):
            files.enter_context(file)
        resumed = len(journal.statuses)
        if resumed and views:
            remedy = "leave it out, and use lmmap draw"
            raise InputError(f"{a.video or a.rerun}: a drawing cannot be resumed; {remedy}")
        for view in views:
            files.enter_context(view)
        answers = files.enter_context(closing(_answers(a, stream, estimators, journal, parts)))
        try:
            with Bar(stream, a.modality) as bar:
                for image, e in answers:
                    journal.add(e)
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
            for table in (*parts.values(), *([] if bag else [journal])):
                table.is_whole = False
        if not journal.statuses and not stopped:
            raise no_images(stream, modalities[-1], estimators[modalities[-1]].settings, a.rate)
    _report(a, journal, resumed, between)
    if stopped:
        remedy = "" if a.track or bag else ", --resume continues"
        raise KeyboardInterrupt(f"{journal.kept_in} keeps what was estimated{remedy}")


def _check(a: Namespace):
    """The bag that is asked for, if one is; `InputError` where options do not go together, or an output may
    not be written."""
    shown = _views(a).values()
    for path in shown:
        if a.modality == "fused" and (path == a.video or not a.track):
            raise InputError(f"{path}: a drawing shows one camera's images; give --modality rgb or event")
    bag = pose_bag(a)
    if a.resume and (a.track or bag):
        what = "track" if a.track else "bag"
        raise InputError(f"{a.output}: a {what} cannot be resumed; leave --resume out, and give --overwrite")
    if a.between is not None:
        if not a.track:
            raise InputError("--between: only a track can be followed between images; give --track as well")
        check_between(a)
        if bag or table_format(a) == "tum":
            raise InputError(f"{a.output}: this format cannot mark poses between images; name it .csv")
    for path in (a.output, *_parts(a).values()):
        check_output(path, input_files(a), overwrite=a.overwrite or a.resume)
    for path in shown:
        check_output(path, [*input_files(a), a.output], overwrite=a.overwrite)
    return bag


def _views(a: Namespace) -> dict[Callable, Path]:
    """The drawings that are asked for, by what makes them."""
    views: dict[Callable, Path] = {Overlay: a.video} if a.video else {}
    return views | ({plugins.needed("rerun", "--rerun"): a.rerun} if a.rerun else {})


def _parts(a: Namespace) -> dict[str, Path]:
    """Where each camera's own estimates are written, if they are fused."""
    fused = a.modality == "fused" and not a.track
    return {m: a.output.with_suffix(f".{m}.csv") for m in MODALITIES} if fused else {}


def _answers(a: Namespace, stream: Stream, estimators: dict, journal, parts: dict) -> Generator[tuple]:
    """``(image, estimate)`` in the order of time, of what is not in the journal yet; no image where a pose is
    between images, or of both cameras."""
    if a.track:
        return track(stream, estimators, a.rate, a.between, str(a.recording))
    if parts:
        return fuse_rest(stream, estimators, a.rate, journal, parts, str(a.recording))
    return estimate_rest(stream, estimators[a.modality], a.rate, journal)


def _journal(a: Namespace, path: Path, form: str, estimators: dict, networks: str | Path) -> Journal:
    """A table of some estimators' answers, which is known as this command's own by what they depend on."""
    first = next(iter(estimators.values()))
    weights: dict[str, str] = {}
    for modality in estimators:
        weights |= weight_hashes(networks, modality)
    modality = first.modality if len(estimators) == 1 else a.modality
    more = {"modality": modality, "format": table_format(a), "settings": asdict(first.settings),
            "weights": weights} | ({"track": True, "between": a.between} if a.track else {})  # fmt: skip
    return Journal(path, form, a.resume, made_of(a, first.camera, first.port, **more))


def _report(a: Namespace, journal, resumed: int, between: int) -> None:
    """Print the summary of what was estimated, ``between`` poses between images apart."""
    counts = Counter(journal.statuses) - Counter({Status.PREDICTED: between})
    if a.json:
        facts = {"output": str(a.output), "images": counts.total(), "statuses": dict(sorted(counts.items()))}
        print(json.dumps(facts | ({"between": between} if a.between else {})))
    else:
        before = f" ({resumed} from before)" if resumed else ""
        also = f"; {between} poses between them" if a.between else ""
        print(f"{a.output}: {summary(counts)}{also}{before}")
