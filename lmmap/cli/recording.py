"""What the ``lmmap`` command does with a recording: estimate, evaluate, info, live."""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, nullcontext
from dataclasses import replace

import numpy as np

from ..files import beside
from ..pages.overlay import Overlay
from ..pipeline import run
from ..pipeline.estimator import Estimator, fitting
from ..recordings import live
from ..recordings.formats import health, open_stream, read_trajectory
from ..recordings.journal import Journal
from ..recordings.pose_files import as_read
from ..recordings.stream import Stream
from ..rig import rig
from ..studies import pose_errors
from ..tracking.fusion import fuse
from ..types import Camera, Estimate, InputError, Port
from .progress import GREEN, RED, Bar, coloured, summary

FAULTS = ("backward_steps", "frames_backward", "out_of_range", "hot_pixels")


def opened(a, **options) -> Stream:
    """The recording of the command line."""
    return open_stream(a.recording, Camera.load(a.camera) if a.camera else None, **options)


def _estimator(a, camera: Camera, modality: str) -> Estimator:
    if a.rate is not None and not 0 < a.rate < 1e4:
        raise InputError(f"--rate {a.rate:g}: give a number of estimates per second between 0 and 10000")
    if a.events is not None and a.events < 1:
        raise InputError(f"--events {a.events}: give the number of events in a histogram, at least 1")
    known = None if a.port else _rig_of(a.recording)
    port = Port.load(a.port) if a.port else known.port if known else Port.lm_map()
    settings = fitting(camera, a.events)
    return Estimator(camera, port, modality, a.weights or a.domain_gap, settings)


def _rig_of(recording) -> rig.Rig | None:
    """What a folder of bags says of its camera, arm and port."""
    known = beside(recording, rig.RIG_FILE) if recording and recording.suffix == ".bag" else None
    return rig.Rig.load(known) if known else None


def _none_found(stream: Stream, modality: str, settings) -> InputError:
    what = "no frames" if modality == "rgb" else f"fewer than {settings.events_per_window} events"
    other = "--modality event" if modality == "rgb" else "--modality rgb, or fewer --events"
    return InputError(f"{stream.source.path}: holds {what}; try {other}")


def estimate(a) -> None:
    """Poses of a recording, on disk as they come."""
    if a.video and a.resume and a.video.exists():
        raise InputError(f"{a.video}: a video cannot be gone on with; leave --video out, or name another one")
    stream = opened(a)
    if a.modality == "fused":
        _estimate_fused(a, stream)
        return
    estimator = _estimator(a, stream.camera, a.modality)
    settings, stopped = estimator.settings, False
    video = Overlay(a.video, estimator.port, stream.camera) if a.video else nullcontext()
    with Journal(a.output, a.format, a.resume) as journal, video:
        kept, poses = len(journal.statuses), 0
        try:
            with Bar(stream, a.modality) as bar:
                shots = run.shots(stream, a.modality, settings, a.rate)
                left = (shot for shot in shots if not journal.has(*shot.times_us))
                for image, one in run.answered(left, estimator):
                    journal.add(one)
                    if a.video:
                        video.add(image, one, estimator.ring_filter(image))
                    poses += one.T_cam_port is not None
                    bar.shown(one.t_us, len(journal.statuses) - kept, poses)
        except KeyboardInterrupt:
            stopped = True
        if not journal.statuses and not stopped:
            raise _none_found(stream, a.modality, settings)
    _told(a, journal, kept, stopped)


def _estimate_fused(a, stream: Stream) -> None:
    """Both cameras' estimates, each on disk as it comes beside the output, and what is fused of them."""
    if a.video:
        raise InputError(f"{a.video}: a video shows one camera's images; give --modality rgb or event")
    estimators = {m: _estimator(a, stream.camera, m) for m in pose_errors.MODALITIES}
    period_rad, stopped = estimators["rgb"].port.yaw_period_rad, False
    with ExitStack() as files:
        journal = files.enter_context(Journal(a.output, a.format, a.resume))
        parts = {m: files.enter_context(Journal(a.output.with_suffix(f".{m}.csv"), "csv", a.resume))
                 for m in estimators}  # fmt: skip
        kept, poses = len(journal.statuses), 0
        both = {m: _kept(stream, estimator, a.rate, parts[m]) for m, estimator in estimators.items()}
        try:
            with Bar(stream, a.modality) as bar:
                for one in fuse(run.in_time(both), period_rad, a.rate):
                    if journal.has(one.t_us):
                        continue
                    journal.add(one)
                    poses += one.T_cam_port is not None
                    bar.shown(one.t_us, len(journal.statuses) - kept, poses)
        except KeyboardInterrupt:
            stopped = True
        if not journal.statuses and not stopped:
            raise _none_found(stream, "event", estimators["event"].settings)
    _told(a, journal, kept, stopped)


def _kept(stream: Stream, estimator, rate_hz: float | None, journal: Journal) -> Iterator[Estimate]:
    """One camera's estimates, each on disk before the next; those on disk already are not made again."""
    shots = run.shots(stream, estimator.modality, estimator.settings, rate_hz)
    yield from journal.done.values()
    left = (shot for shot in shots if not journal.has(*shot.times_us))
    for _, one in run.answered(left, estimator):
        journal.add(one)
        yield as_read(one)


def _told(a, journal: Journal, kept: int, stopped: bool) -> None:
    """The summary of what was estimated; `KeyboardInterrupt` if it was stopped."""
    if a.json:
        counts = dict(sorted(Counter(journal.statuses).items()))
        print(json.dumps({"output": str(a.output), "images": len(journal.statuses), "statuses": counts}))
    else:
        resumed = f" ({kept} from before)" if kept else ""
        print(f"{a.output}: {summary(journal.statuses)}{resumed}")
    if stopped:
        raise KeyboardInterrupt(f"{a.output} keeps what was estimated, --resume goes on")


def evaluate(a) -> None:
    """Errors and detection rates of one recording, as the paper's table has them."""
    stream = opened(a)
    if a.truth:
        stream = replace(stream, truth=read_trajectory(a.truth))
    elif stream.truth is None and (known := _rig_of(a.recording)):
        stream = replace(stream, truth=known.truth(a.recording))
    if stream.truth is None:
        name = f"{a.recording.stem}.truth.csv"
        also = "; or from its arm, with lmmap calibrate" if a.recording.suffix == ".bag" else ""
        raise InputError(f"{a.recording}: no ground truth beside it; name it by --truth, or as {name}{also}")
    report, tables, found = {}, {}, {}
    for modality in [a.modality] if a.modality in pose_errors.MODALITIES else pose_errors.MODALITIES:
        estimator = _estimator(a, stream.camera, modality)
        some = found[modality] = []
        with Bar(stream, modality) as bar:
            for one in run.estimate(stream, estimator, a.rate):
                some.append(one)
                bar.shown(one.t_us, len(some), sum(e.T_cam_port is not None for e in some))
    if all(found.values()) and a.modality not in pose_errors.MODALITIES:
        found["fused"] = list(fuse(run.in_time(found), estimator.port.yaw_period_rad, a.rate))
    for modality in [a.modality] if a.modality else found:
        table = pose_errors.errors(stream, found.get(modality, []), estimator.port)
        if len(table):
            report[modality], tables[modality] = pose_errors.report(table), pose_errors.summary(table)
        elif a.modality:
            raise InputError(f"{a.recording}: holds no {modality} data that its truth covers; try the other")
        else:
            warnings.warn(f"{a.recording}: holds no {modality} data that its truth covers", stacklevel=2)
    if not report:
        raise InputError(f"{a.recording}: holds no data that its truth covers; check the truth's times")
    if a.json:
        keys = ["outlier_filter", "metric", "variant", "statistic"]
        rows = {m: t.set_index(keys)["value"].replace({np.nan: None}) for m, t in tables.items()}
        named = {m: {"/".join(k): v for k, v in values.items()} for m, values in rows.items()}
        known = {m: {k: None if np.isnan(v) else v for k, v in report[m].items()} for m in report}
        print(json.dumps({m: known[m] | {"table": named[m]} for m in report}, indent=1))
        return
    print(f"{'':40}" + "".join(f"{m:>10}" for m in report))
    for name in next(iter(report.values())):
        print(f"{name.replace('_', ' '):40}" + "".join(_cell(report[m][name]) for m in report))
    wanted = next(iter(tables.values())).query("variant == 'exact' and outlier_filter == 'with'")
    for k, line in wanted.iterrows():
        scale, unit = (1e3, "mm") if line.metric.endswith("_m") else (1, line.metric.rsplit("_", 1)[1])
        name = f"with outlier filter: {line.metric.rsplit('_', 1)[0]} {line.statistic} {unit}"
        cells = "".join(_cell(scale * tables[m].value[k]) for m in tables)
        print(f"{name.replace('_', ' '):40}" + cells)


def _cell(value: float) -> str:
    return f"{'-':>10}" if np.isnan(value) else f"{value:10.2f}"


def info(a) -> None:
    """What is in a recording, and its health; faults are counted here and errors elsewhere."""
    facts = health(opened(a, checked=False))
    if not facts["events"] and not facts["frames"]:
        raise InputError(f"{a.recording}: holds neither events nor frames; record again")
    if a.json:
        print(json.dumps(facts, indent=1))
        return
    for name, value in facts.items():
        text = f"{value:.6g}" if isinstance(value, float) else str(value)
        text = coloured(text, RED) if name in FAULTS and value else text
        print(f"{name.replace('_', ' '):18} {text}")


def live_(a) -> None:
    """Poses as images come."""
    stream = opened(a) if a.recording else None
    if stream is None and not a.camera:
        raise InputError("live: no calibration; give the attached camera's with --camera")
    device = live.Played(stream) if stream else live.Attached()
    camera = stream.camera if stream else Camera.load(a.camera)
    if camera.size_px != device.size_px:
        width, height = device.size_px
        raise InputError(f"{a.camera}: for {camera.width_px} x {camera.height_px} px, but the camera has "
                         f"{width} x {height} px; give its own calibration")  # fmt: skip
    estimator = _estimator(a, camera, a.modality)
    statuses, late_ms, skipped, began = [], [], 0, time.monotonic()
    with Journal(a.output) if a.output else nullcontext() as journal:
        try:
            for shot in live.newest(device, a.modality, estimator.settings.events_per_window):
                _, one = run.looked(estimator, shot)
                late_ms.append((device.now_us() - shot.newest_us) * 1e-3)
                statuses.append(str(one.status))
                skipped += shot.skipped
                if journal:
                    journal.add(one)
                print(_line(one, late_ms[-1], a.json), flush=True)
                if a.seconds and time.monotonic() - began >= a.seconds:
                    break
        except KeyboardInterrupt:
            pass
    if not statuses:
        if stream:
            raise _none_found(stream, a.modality, estimator.settings)
        raise InputError("live: the camera sent no image; check its cable and its lens cap")
    rate = len(statuses) / (time.monotonic() - began)
    print(f"lmmap: {summary(statuses)}; {rate:.1f} images/s, {skipped} skipped, "
          f"{np.median(late_ms):.0f} ms late", file=sys.stderr)  # fmt: skip


def _line(one, late_ms: float, as_json: bool) -> str:
    T = one.T_cam_port
    if as_json:
        pose = {} if T is None else {
            "position_m": T.position_m.tolist(), "quaternion_xyzw": T.quaternion_xyzw.tolist()
        }  # fmt: skip
        return json.dumps({"t_us": one.t_us, "status": str(one.status), "late_ms": round(late_ms, 1), **pose})
    status = coloured(f"{one.status:10}", GREEN if T is not None else RED)
    place = "" if T is None else "  x {:7.1f}  y {:7.1f}  z {:7.1f} mm".format(*1e3 * T.position_m)
    return f"{one.t_us * 1e-6:10.3f} s  {status}{place}  {late_ms:5.0f} ms late"
