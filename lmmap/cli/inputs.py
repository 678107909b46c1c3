"""Recordings, cameras, ports, rigs and estimators, as the command line names them."""

from __future__ import annotations

import warnings
from argparse import Namespace
from dataclasses import asdict, replace
from pathlib import Path

from .. import plugins
from ..camera_files import split_name
from ..pipeline.estimator import Estimator
from ..pipeline.image_estimator import settings_for
from ..pipeline.printed import PrintedEstimator
from ..recordings.formats import open_stream
from ..recordings.journal import recording_mark
from ..recordings.stream import Stream
from ..settings import Settings
from ..tracking.fusion import LEAST_HZ
from ..types import Camera, InputError, Port
from .choices import DEFAULT_WEIGHTS, PAPER_WEIGHTS, POSE_BAGS


def open_input(a: Namespace, **options) -> Stream:
    """Open the recording that the command line names; raises `InputError`."""
    stream = open_stream(a.recording, a.camera, fps=a.fps, **as_read(a), **options)
    return replace(stream, flips=flips_of(a))


def flips_of(a: Namespace) -> dict[str, str]:
    """How each camera's images are flipped."""
    return plugins.needed("flips", "--flip")(a.flip) if getattr(a, "flip", None) else {}


def leave_out(a: Namespace, why: str, *names: str) -> None:
    """Raise `InputError` if one of these options was given, although what is asked for does not use it."""
    for name in names:
        if name in getattr(a, "given", ()) or getattr(a, name) is True:
            raise InputError(f"{why}; leave --{name.replace('_', '-')} out")


def as_read(a: Namespace) -> dict:
    """The command line's further options for reading a recording, those that were given only."""
    named = {name: getattr(a, name, None) for name in ("time_unit", "stream")}
    return {name: value for name, value in named.items() if value is not None}


def read_from(a: Namespace) -> Path | None:
    """The recording that is named; None if a camera is named, or the command takes no recording."""
    return named if isinstance(named := getattr(a, "recording", None), Path) else None


def made_of(a: Namespace, camera: Camera, port: Port, **more) -> dict:
    """What estimates and drawings of a recording depend on, in addition to ``more``."""
    flip = {"flip": a.flip} if a.flip else {}
    return {"recording": recording_mark(a.recording), "fps": a.fps, "rate": a.rate,
            "camera": asdict(camera), "port": asdict(port)} | more | as_read(a) | flip  # fmt: skip


def input_files(a: Namespace) -> list[Path]:
    """Files that a command reads, which no output may replace."""
    recording = read_from(a)
    endings = (".camera.json", ".truth.csv", ".truth.tum")
    sidecars = [recording.with_suffix(ending) for ending in endings] if recording and recording.name else []
    named = [getattr(a, name, None) for name in ("camera", "port", "truth")]
    named[0] = named[0] and split_name(named[0])[0]
    return [path for path in (recording, *sidecars, *named) if path]


def pose_bag(a: Namespace):
    """The bag that the output's name asks for; None if it asks for a table."""
    names = "frame_id", "child_frame_id"
    if a.output.suffix.lower() in POSE_BAGS and not getattr(a, "format", None):
        named = {name: getattr(a, name) for name in names if getattr(a, name) is not None}
        return plugins.needed("poses", a.output)(a.output, **named)
    leave_out(a, f"{a.output}: frames have names in bags only, in .bag or .mcap", *names)
    return None


def table_format(a: Namespace) -> str:
    """The format of the output's table, as asked for or by its name."""
    return getattr(a, "format", None) or ("tum" if a.output.suffix == ".tum" else "csv")


def network_set(a: Namespace) -> str:
    """The networks that were asked for, else the default set, or the paper's set for its own procedure."""
    default = PAPER_WEIGHTS if getattr(a, "as_printed", False) else DEFAULT_WEIGHTS
    return a.weights or a.networks or default


def can_be_fused(stream: Stream, needed: bool) -> bool:
    """Whether frames and events overlap in time, as far as the installed readers can tell.

    Warns if their clocks seem to differ; raises `InputError` if fusion is ``needed`` and they do not overlap.
    """
    doubt = plugins.reader("one_clock")
    reason, apart = doubt(stream) if doubt else ("", False)
    text = f"{stream.source.path}: {reason}"
    if apart and needed:
        raise InputError(f"{text}, so their clocks differ; give --modality rgb or event")
    if apart:
        warnings.warn(f"{text}, so their clocks differ; they are not fused", stacklevel=2)
    elif reason:
        warnings.warn(f"{text}; unless one camera was on for longer, their clocks differ", stacklevel=2)
    return not apart


def make_estimator(
    a: Namespace, camera: Camera, modality: str, weights: str | Path | None = None
) -> Estimator | PrintedEstimator:
    """Make one camera's estimator from the command line, which also gives the default ``weights``."""
    kind = PrintedEstimator if getattr(a, "as_printed", False) else Estimator
    return kind(camera, find_port(a), modality, weights or network_set(a), find_settings(a, camera))


def find_settings(a: Namespace, camera: Camera) -> Settings:
    """The settings for a camera from the command line; raises `InputError`."""
    check_rate("--rate", getattr(a, "rate", None), "estimates")
    if a.modality == "rgb":
        leave_out(a, "--modality rgb: has no histograms", "events")
    if a.events is not None and not 1 <= a.events <= 10**8:
        raise InputError(f"--events {a.events}: give the number of events in a histogram, 1 to 100 million")
    return settings_for(camera, a.events)


def check_between(a: Namespace) -> None:
    """Raise `InputError` unless poses between images are possible at the rate that is asked for."""
    if a.modality == "rgb":
        raise InputError("--between: events follow the port between images; give a --modality other than rgb")
    check_rate("--between", a.between, "poses")


def check_rate(name: str, rate_hz: float | None, what: str) -> None:
    """Raise `InputError` for a rate (Hz) that the tracker cannot deliver."""
    if rate_hz is not None and not LEAST_HZ <= rate_hz < 1e4:
        raise InputError(
            f"{name} {rate_hz:g}: give a number of {what} per second between {LEAST_HZ:g} and 1e4"
        )


def find_rig(a: Namespace):
    """The rig beside the named recording, or None if no rig is there or its reader is not installed."""
    return find(read_from(a)) if (find := plugins.reader("rig")) else None


def find_port(a: Namespace) -> Port:
    """The port that the command line names, else that of the rig beside the recording, else the LM-MAP."""
    known = None if a.port else find_rig(a)
    return Port.load(a.port) if a.port else known.port if known else Port.lm_map()


def no_images(stream: Stream, modality: str, settings, rate_hz: float | None = None) -> InputError:
    """The error to raise for a recording that yields no image of a modality; for events, at a rate (Hz)."""
    path, count = stream.source.path, settings.events_per_window
    if modality == "rgb":
        return InputError(f"{path}: holds no frames; try --modality event")
    runs = [(len(e), *e["t_us"][[0, -1]]) for e in stream.chunks()] if rate_hz else []
    if sum(n for n, *_ in runs) >= count:
        seconds = (runs[-1][2] - runs[0][1]) * 1e-6
        text = f"lasts {seconds:.3g} s, and no tick of --rate {rate_hz:g} is after {count} events"
        return InputError(f"{path}: {text}; give a higher --rate, or none")
    return InputError(f"{path}: holds fewer than {count} events; try --modality rgb, or fewer --events")
