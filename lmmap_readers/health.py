"""What to know about a recording before using it."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter

from lmmap.recordings.stream import Stream
from lmmap.settings import scaled_count
from lmmap.types import InputError, Recording, on_sensor

from . import clocks

MAX_SENSOR_PIXELS = 2**23  # where no calibration says the size; the largest event cameras have 0.9 million


def health(recording: Recording | Stream) -> dict:
    """Counts, rates, gaps and a window size; for an unchecked stream, also the number of faults.

    ``hot_pixels`` fire at least 20 times and 5 times as often as any neighbour: edges excite
    neighbours, defects don't.  ``suggested_window`` is the paper's N per pixel on this sensor.
    """
    width, height = recording.camera.size_px if recording.camera else _size_px(recording)
    count = np.zeros(height * width, np.int64)
    events = on = within = gaps = backward = largest_us = 0
    last_us = low_us = high_us = None
    for e in recording.chunks():
        if not len(e):
            continue
        t_us = e["t_us"]
        steps = np.diff(t_us) if last_us is None else np.diff(t_us, prepend=last_us)
        last_us = t_us[-1]
        low_us, high_us = _span(low_us, high_us, t_us.min(), t_us.max())
        largest_us = max(largest_us, steps.max(initial=0))
        gaps, backward = gaps + np.sum(steps > 10_000), backward + np.sum(steps < 0)
        events, on = events + len(e), on + np.count_nonzero(e["p"])
        good = e[on_sensor(e, (width, height))]
        within += len(good)
        count += np.bincount(good["y"].astype(np.intp) * width + good["x"], minlength=len(count))
    frames_t_us = np.array([t_us for t_us, _ in recording.timed_frames()], np.int64)
    both = (
        (int(low_us), int(high_us), events) if events else None,
        (int(frames_t_us.min()), int(frames_t_us.max()), len(frames_t_us)) if len(frames_t_us) else None,
    )
    if not events and len(frames_t_us):
        low_us, high_us = frames_t_us.min(), frames_t_us.max()
    duration_s = float(high_us - low_us) * 1e-6 if high_us is not None else 0.0
    window = scaled_count((width, height))
    return {
        "events": events, "frames": len(frames_t_us), "width_px": width, "height_px": height,
        "duration_s": duration_s, **clocks.facts(*both),
        "event_rate_hz": events / duration_s if duration_s else 0.0,
        "frame_rate_hz": _rate_hz(frames_t_us), "on_fraction": on / events if events else 0.0,
        "largest_gap_ms": float(largest_us) * 1e-3, "gaps_over_10_ms": int(gaps),
        "backward_steps": int(backward), "frames_backward": int(np.sum(np.diff(frames_t_us) < 0)),
        "out_of_range": events - within, "hot_pixels": _hot_pixels(count.reshape(height, width)),
        "suggested_window": window, "windows": events // window, "truth": recording.truth is not None,
    }  # fmt: skip


def _size_px(stream: Stream) -> tuple[int, int]:
    """Width and height as the file states them, else as far as its events lie; raises `InputError`."""
    width, height = stream.source.size_px or (0, 0)
    if stream.source.size_px is None:
        for e in stream.chunks():
            width, height = max(width, int(e["x"].max()) + 1), max(height, int(e["y"].max()) + 1)
    if width * height > MAX_SENSOR_PIXELS:
        path = stream.source.path
        raise InputError(f"{path}: a sensor of {width} x {height} px; give its calibration with --camera")
    return max(width, 1), max(height, 1)


def _span(low, high, first, last):
    return (first, last) if low is None else (min(low, first), max(high, last))


def _hot_pixels(count: np.ndarray) -> int:
    ring = np.ones((3, 3), bool)
    ring[1, 1] = False
    neighbours = maximum_filter(count, footprint=ring, mode="constant")
    return int(np.sum((count >= 20) & (count > 5 * neighbours)))


def _rate_hz(t_us) -> float:
    return (len(t_us) - 1) * 1e6 / float(t_us[-1] - t_us[0]) if len(t_us) > 1 and t_us[-1] > t_us[0] else 0.0
