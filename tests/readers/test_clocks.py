"""Laws of two clocks: what spans tell of them is said, and what is sound is not."""

import numpy as np
import pytest

from lmmap_readers.clocks import Span, doubt

US = 1_000_000
T0 = 1_700_000_000 * US


def span(first_s, last_s, rate_hz):
    return Span(T0 + round(first_s * US), T0 + round(last_s * US), round((last_s - first_s) * rate_hz) + 1)


@pytest.mark.parametrize(
    "frames",
    [
        (0, 30, 30), (0.02, 29.97, 30), (0, 29, 1), (0.9, 30, 25), (0, 29.6, 15), (0, 32, 30),
        (0.2, 30.2, 30),  # a quarter of a second is what two drivers take
    ],
)  # fmt: skip
@pytest.mark.parametrize("stretch", [1, 10])
def test_cameras_that_run_together_are_not_noted(frames, stretch):
    first_s, last_s, rate_hz = frames
    events = span(0, 30 * stretch, 1e6)
    assert doubt(events, span(first_s, last_s + 30 * (stretch - 1), rate_hz)) == ("", False)


@pytest.mark.parametrize("events_s", [0.549, 0.3, 0.05])
def test_short_recordings_are_not_noted(events_s):
    """Frames every 50 ms, events from their first to their last."""
    assert doubt(span(0, events_s, 1e6), span(0, np.floor(events_s * 20) / 20, 20)) == ("", False)
    assert doubt(span(0, events_s, 1e6), span(0, 0, 20)) == ("", False)
    assert doubt(span(0.01, events_s, 1e6), span(0, 0, 20)) == ("", False)


@pytest.mark.parametrize(
    "first_s, last_s, apart",
    [
        (0, 60, False),  # start + 2 x elapsed
        (0, 15, False), (0, 45, False),  # half of it, and half as much again
        (0.7, 30.7, False), (-2, 28, False), (5, 35, False),  # seconds off
        (3600, 3630, True), (-3600, -3570, True), (-1.7e9, -1.7e9 + 30, True), (31, 61, True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("rate_hz", [10, 30])
def test_clocks_that_differ_are_noted(first_s, last_s, apart, rate_hz):
    text, is_apart = doubt(span(0, 30, 1e6), span(first_s, last_s, rate_hz))
    assert is_apart == apart and ("do not overlap" in text) == apart
    assert f"frames lie at {T0 / US + first_s:.3f} to" in text and f"events at {T0 / US:.3f} to" in text
