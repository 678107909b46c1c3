"""Whether frames and events of a recording share one clock, as far as their time spans tell."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from lmmap.recordings.stream import Stream
from lmmap.types import InputError

# two cameras begin, and end, so far apart: seconds and periods of the frames
ALIKE_S, ALIKE_PERIODS = 0.25, 1.5
DAY_US = 86_400_000_000  # no recording is longer
ALIKE = 0.1  # and one camera may be on alone for this share of the longer span


class Span(NamedTuple):
    """First and last time of ``count`` frames or events."""

    first_us: int
    last_us: int
    count: int

    @property
    def seconds(self) -> float:
        return (self.last_us - self.first_us) * 1e-6

    def __str__(self) -> str:
        return f"{self.first_us * 1e-6:.3f} to {self.last_us * 1e-6:.3f} s"


def spans(stream: Stream) -> tuple[Span | None, Span | None]:
    """Spans of a stream's events and of its frames; reads them up to the first fault."""
    events = ((int(e["t_us"][0]), int(e["t_us"][-1]), len(e)) for e in stream.chunks())
    frames = ((int(t_us), int(t_us), 1) for t_us, _ in stream.timed_frames())
    return _span(events), _span(frames)


def _span(pieces: Iterable[tuple[int, int, int]]) -> Span | None:
    span = None
    with suppress(InputError):
        for first_us, last_us, count in pieces:
            span = Span(span.first_us if span else first_us, last_us, count + (span.count if span else 0))
    return span


def facts(events: tuple | None, frames: tuple | None) -> dict:
    """When events and frames were recorded, given the values of a `Span` each; with both, also how long they
    overlap and what speaks against a common clock."""
    events, frames = (span and Span(*span) for span in (events, frames))
    named = {"events_at_s": events, "frames_at_s": frames}
    ends_s = {name: [span.first_us * 1e-6, span.last_us * 1e-6] for name, span in named.items() if span}
    if len(ends_s) < 2:
        return ends_s
    text, _ = doubt(events, frames)
    return ends_s | {"overlap_s": max(0.0, overlap_s(events, frames)), "clocks": text or "may be one"}


def overlap_s(events: Span, frames: Span) -> float:
    """How long (s) both cameras are on; negative if a gap lies between them."""
    return (min(events.last_us, frames.last_us) - max(events.first_us, frames.first_us)) * 1e-6


def doubt(events: Span | None, frames: Span | None) -> tuple[str, bool]:
    """What speaks against a common clock, in words or empty, and whether frames and events do not overlap.

    Cameras that run together begin and end together.  Either may be switched on later, or off earlier; but if
    frames both begin and end later than events, or earlier, or if one camera is on alone for long, the clocks
    may differ.
    """
    if not events or not frames:
        return "", False
    both_s, longer_s = overlap_s(events, frames), max(events.seconds, frames.seconds)
    slack_s = ALIKE_S + ALIKE_PERIODS * frames.seconds / max(frames.count - 1, 1)
    late_s = [(frames[k] - events[k]) * 1e-6 for k in (0, 1)]
    shifted = min(late_s) > slack_s or max(late_s) < -slack_s
    alone = longer_s - both_s > max(slack_s, ALIKE * longer_s)
    apart = both_s < -slack_s
    if not apart and (frames.count == 1 or not (shifted or alone)):
        return "", False
    they = f"overlap for {both_s:.3f} s" if both_s > 0 else "do not overlap"
    return f"frames lie at {frames}, events at {events}, and {they}", apart


def doubt_stream(stream: Stream) -> tuple[str, bool]:
    """`doubt` of a stream's events and frames."""
    return doubt(*spans(stream))


def check_truth(stream: Stream, name: Path) -> None:
    """Raise `InputError` if the truth lies outside the recording's time; ``name`` is the file that the truth
    is from."""
    firsts = [next((int(e["t_us"][0]) for e in stream.chunks() if len(e)), None)]
    starts_us = [t for t in (*firsts, next((t for t, _ in stream.timed_frames()), None)) if t is not None]
    if not starts_us:
        return
    known, (first_us, last_us) = stream.source.span_us, stream.truth.t_us[[0, -1]].tolist()
    begin_us, end_us = min(starts_us), known[1] if known else min(starts_us) + DAY_US
    if last_us < begin_us or first_us > max(end_us, *starts_us):
        span = f"{first_us * 1e-6:.3f} to {last_us * 1e-6:.3f} s"
        found = f"the truth's times are {span}, and the recording begins at {begin_us * 1e-6:.3f} s"
        remedy = f"if both began together, add {(begin_us - first_us) * 1e-6:.6f} s to the truth's times"
        if (guessed := stream.source.guessed) and (why := guessed.doubt(stream.camera.size_px)):
            remedy = f"the recording's are taken as {guessed.unit}, but {why}"
        raise InputError(f"{name}: {found}; {remedy}")
