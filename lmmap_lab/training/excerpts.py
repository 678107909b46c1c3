"""Samples of recordings: the pieces of them that training sees."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lmmap.recordings.stream import Stream
from lmmap.types import EVENT, Port, Recording, concatenate_events

from .dataset import SAMPLES, SEQUENCE_SECONDS, sample_recording, write_samples

EXCERPT_EVERY_S = 4.0  # one excerpt of a long recording in this time, as neighbouring views are nearly equal


def excerpts(stream: Stream, starts_us, length_us: int) -> Iterator[Recording]:
    """Yield the pieces of a recording that begin at ``starts_us``; its truth has to be known.

    The starts are in order and the pieces do not overlap, so that one piece at a time is in memory.
    """
    chunks, frames = stream.chunks(), stream.timed_frames()
    later, last_us, frame = np.empty(0, EVENT), -np.inf, next(frames, None)
    for start_us in starts_us:
        end_us, parts, inside = start_us + length_us, [later], []
        while last_us < end_us and (chunk := next(chunks, None)) is not None:
            last_us = chunk["t_us"][-1]
            parts += [chunk] if last_us >= start_us else []
        events = concatenate_events(parts)
        first, last = np.searchsorted(events["t_us"], [start_us, end_us])
        later = events[last:].copy()
        while frame is not None and frame[0] < end_us:
            inside += [frame] if frame[0] >= start_us else []
            frame = next(frames, None)
        width, height = stream.camera.size_px
        images = np.array([image for _, image in inside], np.uint8).reshape(-1, height, width, 3)
        times_us = np.array([t_us for t_us, _ in inside], np.int64)
        yield Recording(stream.name, stream.camera, events[first:last], images, times_us, stream.truth)


def make_recording_samples(stream: Stream, label: str, folder: Path, port: Port, report=print) -> list[str]:
    """Write samples of a recording into ``folder/LABEL-0000`` and so on; returns these names.

    Masks come from the recording's truth and the CAD, as the paper's do.  Samples that are there are kept.
    """
    length_us, truth_us = int(SEQUENCE_SECONDS * 1e6), stream.truth.t_us
    starts_us = np.arange(truth_us[0], truth_us[-1] - length_us, EXCERPT_EVERY_S * 1e6).astype(np.int64)
    known = stream.truth.covers(starts_us[:, None] + np.linspace(0, length_us, 100))  # closer than any gap
    starts_us = starts_us[known.all(1)]
    names = [f"{label}-{k:04d}" for k in range(len(starts_us))]
    absent = [(name, t) for name, t in zip(names, starts_us, strict=True) if not (folder / name).is_dir()]
    pieces = excerpts(stream, [t for _, t in absent], length_us)
    for done, ((name, _), piece) in enumerate(zip(absent, pieces, strict=True), 1):
        write_samples(folder / name, sample_recording(piece, SAMPLES, port), "recordings")
        report(f"training set: {name}, {done} of {len(absent)}")
    return names
