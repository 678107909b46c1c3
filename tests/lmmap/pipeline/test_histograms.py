import warnings
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import cut, seeds

from lmmap.estimation.windows import windows_at, windows_of
from lmmap.pipeline.histograms import histogram, window_histograms, windows, windows_before
from lmmap.settings import OURS, PAPER, scaled_count
from lmmap.types import EVENT


@given(seeds(), st.integers(0, 3000), st.integers(1, 60), st.integers(1, 60))
def test_a_histogram_counts_every_event_where_it_happened(seed, count, width, height):
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, width, count).astype("i2"), rng.integers(0, height, count).astype("i2")
    counts = histogram(x, y, (width, height))
    assert counts.shape == (height, width)
    assert counts.dtype == np.uint16
    assert counts.sum() == count
    slow = np.zeros((height, width), int)
    np.add.at(slow, (y, x), 1)
    np.testing.assert_array_equal(counts, slow)


def test_large_coordinates_do_not_overflow_the_index():
    # 300 * 500 is beyond int16, in which cameras store coordinates
    assert histogram(np.array([499], "i2"), np.array([299], "i2"), (500, 300))[299, 499] == 1


def test_counts_saturate_instead_of_wrapping():
    zero = np.zeros(70_000, int)
    assert histogram(zero, zero, (1, 1))[0, 0] == 65_535


@pytest.mark.parametrize(("x", "y", "name"), [(-1, 0, "x"), (346, 0, "x"), (0, -1, "y"), (0, 260, "y")])
def test_coordinates_outside_the_image_are_refused(x, y, name):
    with pytest.raises(ValueError, match=f"^{name}: expected"):
        histogram(np.array([0, x]), np.array([0, y]), (346, 260))


@given(st.integers(0, 500), st.integers(1, 90))
def test_windows_are_full_consecutive_and_drop_only_the_tail(length, count):
    slices = windows(np.zeros(length, EVENT), count)
    covered = [i for s in slices for i in range(s.start, s.stop)]
    assert all(s.stop - s.start == count for s in slices)
    assert covered == list(range(count * len(slices)))
    assert 0 <= length - len(covered) < count


def test_windows_before_end_strictly_before_their_time():
    events = np.zeros(6, EVENT)
    events["t_us"] = [0, 10, 10, 20, 30, 40]
    assert windows_before(events, [5, 10, 11, 41], 2) == [None, None, slice(1, 3), slice(4, 6)]
    assert windows_before(events[:0], [5], 2) == [None]


@pytest.mark.parametrize("count", [0, -3, 1.5, 3.0, True, "3"])
def test_windows_need_an_event(count):
    with pytest.raises(ValueError, match="count: expected "):
        windows(np.zeros(5, EVENT), count)
    with pytest.raises(ValueError, match="count: expected "):
        windows_before(np.zeros(5, EVENT), [1], count)


# --- streams --------------------------------------------------------------------------------------


def some_events(rng, count):
    e = np.zeros(count, EVENT)
    e["t_us"] = np.sort(rng.integers(0, 40 * max(count, 1), count))
    e["x"] = np.arange(count)
    return e


@given(st.integers(0, 400), st.integers(1, 60), st.integers(0, 99))
def test_windows_of_a_stream_do_not_depend_on_its_chunks(total, count, seed):
    rng = np.random.default_rng(seed)
    e = some_events(rng, total)
    for times in (1, 2, 3):
        streamed = list(windows_of(cut(e, rng), count, times))
        assert len(streamed) == len(windows(e, count))
        for got, s in zip(streamed, windows(e, count), strict=True):
            np.testing.assert_array_equal(got, e[max(0, s.stop - times * count) : s.stop])


@given(st.integers(1, 400), st.integers(1, 60), st.sampled_from([60.0, 997.0, 25_000.0]), st.integers(0, 99))
def test_windows_at_ticks_are_the_last_events_before_each(total, count, rate_hz, seed):
    rng = np.random.default_rng(seed)
    e = some_events(rng, total)
    first, last = int(e["t_us"][0]), int(e["t_us"][-1])
    ticks = [first + int(k * 1e6 / rate_hz) for k in range(1, int((last - first) * rate_hz / 1e6) + 2)]
    windows_at_ticks = windows_before(e, [t for t in ticks if t < last], count)
    expected = [s for s, _ in groupby(s for s in windows_at_ticks if s is not None)]  # each window once
    for times in (1, 2, 3):
        streamed = list(windows_at(cut(e, rng), rate_hz, count, times))
        assert len(streamed) == len(expected)
        for got, s in zip(streamed, expected, strict=True):
            np.testing.assert_array_equal(got, e[max(0, s.stop - times * count) : s.stop])


def test_looks_are_the_last_events_and_as_many_more():
    assert OURS.second_look_factor == 2
    e = np.zeros(8, EVENT)
    e["t_us"], e["x"] = 10 * np.arange(8), np.arange(8)
    (first_us, few), (wider_us, many) = window_histograms(e, 4, (8, 1))
    assert (first_us, wider_us) == (55, 35)
    assert few.tolist() == [[0, 0, 0, 0, 1, 1, 1, 1]] and many.tolist() == [[1] * 8]
    assert len(window_histograms(e, 4, (8, 1), after_us=34)) == 2
    assert [t for t, _ in window_histograms(e, 4, (8, 1), after_us=35)] == [55]  # times only rise
    assert [t for t, _ in window_histograms(e, 6, (8, 1))] == [45]  # not yet so many


def test_the_papers_count_is_kept_per_pixel():
    assert scaled_count((346, 260)) == PAPER.events_per_window
    assert scaled_count((2 * 346, 260)) == 2 * PAPER.events_per_window
    assert scaled_count((1, 1)) >= 1


@pytest.mark.parametrize("gap_us", [3_600_000_000, 1_700_000_000_000_000, 2**60])
def test_a_gap_is_passed_over_in_one_step_and_named(gap_us):
    e = np.zeros(200, EVENT)
    e["t_us"] = 10_000 * np.arange(200)
    e["t_us"][100:] += gap_us
    with pytest.warns(UserWarning, match="no events for"):
        windows = list(windows_at([e], 100.0, 10))
    assert 170 < len(windows) <= 190  # a window a tick on both sides, and none between


@pytest.mark.parametrize("rate_hz, said", [(999.0, True), (5000.0, True), (50.0, False)])
def test_more_images_than_events_are_said_before_they_are_made(rate_hz, said):
    e = np.zeros(3000, EVENT)
    e["t_us"] = 3333 * np.arange(3000)
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        next(windows_at([e], rate_hz, 10))
    assert ["about as many as the events" in str(note.message) for note in notes] == [True] * said


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, 1e-310, 1e-300, np.nan, np.inf])
def test_rates_that_are_none(rate_hz):
    with pytest.raises(ValueError, match="rate_hz: expected"):
        next(windows_at([np.zeros(30, EVENT)], rate_hz, 10))
