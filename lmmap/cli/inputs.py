"""What the command line names: recordings, cameras, ports, rigs and estimators."""

from __future__ import annotations

from pathlib import Path

from ..camera_files import split_name
from ..pipeline.estimator import Estimator
from ..pipeline.image_estimator import settings_for
from ..pipeline.printed import PrintedEstimator
from ..recordings.formats import open_stream
from ..recordings.pose_bags import STORES, PoseBag
from ..recordings.rig import find_rig
from ..recordings.stream import Stream
from ..types import Camera, InputError, Port
from .choices import DEFAULT_WEIGHTS, PAPER_WEIGHTS


def open_input(a, **options) -> Stream:
    """The recording of the command line."""
    return open_stream(a.recording, a.camera, fps=a.fps, **as_read(a), **options)


def as_read(a) -> dict:
    """What else the command line says of how a recording is read: only what it says."""
    named = {name: getattr(a, name, None) for name in ("time_unit", "stream")}
    return {name: value for name, value in named.items() if value is not None}


def input_files(a) -> list[Path]:
    """Files that a command reads, which no output may replace."""
    recording = getattr(a, "recording", None)
    endings = (".camera.json", ".truth.csv", ".truth.tum")
    sidecars = [recording.with_suffix(ending) for ending in endings] if recording and recording.name else []
    named = [getattr(a, name, None) for name in ("camera", "port", "truth")]
    named[0] = named[0] and split_name(named[0])[0]
    return [path for path in (recording, *sidecars, *named) if path]


def pose_bag(a) -> PoseBag | None:
    """The bag that the output's name asks for; None where it asks for a table."""
    named = {
        name: getattr(a, name) for name in ("frame_id", "child_frame_id") if getattr(a, name) is not None
    }
    if a.output.suffix.lower() in STORES:
        return PoseBag(a.output, **named)
    if named:
        raise InputError(f"{a.output}: frames have names in bags only; name it .bag or .mcap")
    return None


def network_set(a) -> str:
    """The set of networks that was asked for, or the default: for the paper's own procedure the paper's."""
    return a.domain_gap or (PAPER_WEIGHTS if getattr(a, "as_printed", False) else DEFAULT_WEIGHTS)


def make_estimator(a, camera: Camera, modality: str) -> Estimator | PrintedEstimator:
    """The estimator of one camera by the command line's arguments."""
    if a.rate is not None and not 0 < a.rate < 1e4:
        raise InputError(f"--rate {a.rate:g}: give a number of estimates per second between 0 and 10000")
    if a.events is not None and not 1 <= a.events <= 10**8:
        raise InputError(f"--events {a.events}: give the number of events in a histogram, 1 to 100 million")
    kind = PrintedEstimator if getattr(a, "as_printed", False) else Estimator
    weights, settings = a.weights or network_set(a), settings_for(camera, a.events)
    return kind(camera, find_port(a), modality, weights, settings)


def check_between(a) -> None:
    """Whether poses between images can be had as often as the command line asks."""
    if a.modality == "rgb":
        raise InputError("--between: events follow the port between images; give another --modality than rgb")
    if not 0 < a.between < 1e4:
        raise InputError(f"--between {a.between:g}: give a number of poses per second between 0 and 10000")


def find_port(a) -> Port:
    """The port of the command line, else that of the rig beside the recording, else the LM-MAP."""
    known = None if a.port else find_rig(a.recording)
    return Port.load(a.port) if a.port else known.port if known else Port.lm_map()


def no_images(stream: Stream, modality: str, settings) -> InputError:
    """The error of a recording without images of a modality."""
    what = "no frames" if modality == "rgb" else f"fewer than {settings.events_per_window} events"
    other = "--modality event" if modality == "rgb" else "--modality rgb, or fewer --events"
    return InputError(f"{stream.source.path}: holds {what}; try {other}")
