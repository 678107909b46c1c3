"""Laws of the order of time: a few events out of it cost no recording; a clock that was set back is named."""

import re
import warnings

import numpy as np
import pytest

from lmmap.recordings.order import in_order
from lmmap.recordings.stream import Source, Stream
from lmmap.types import EVENT, Camera, InputError

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


def some_events(count=20_000, step_us=100):
    """Each has its number in x and y."""
    e = np.zeros(count, EVENT)
    e["t_us"] = 5_000_000 + step_us * np.arange(count)
    e["x"], e["y"] = np.arange(count) % 64, np.arange(count) // 64 % 48
    return e


def read(e, size=3000):
    """What a stream yields of events that lie in chunks, and its notes."""
    source = Source("e", (64, 48), lambda: (e[i : i + size] for i in range(0, len(e), size)))
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        chunks = list(Stream("e", CAMERA, source).chunks())
    return np.concatenate(chunks), [str(note.message) for note in notes]


@pytest.mark.parametrize(
    "by_us, at",
    [
        (-999_000, (7, 100, 2999, 3000, 9500)), (-60_000, (3001, 3002, 8999, 17_999)),
        (700_000, (7, 100, 2998, 3000, 9500)),
    ],
)  # fmt: skip
def test_isolated_events_are_left_out_and_counted(by_us, at):
    """Early or late, also where a chunk begins and ends."""
    e = some_events()
    e["t_us"][list(at)] += by_us
    back, notes = read(e)
    np.testing.assert_array_equal(back, np.delete(e, at))
    assert len(notes) == 1 and f": {len(at)} left out" in notes[0]


@pytest.mark.parametrize("first, by_us", [(3001, 8), (6700, 350), (4711, 1000)])
def test_packets_that_overlap_are_sorted(first, by_us):
    """All events are there; a later packet begins before its neighbour ends."""
    e = some_events(step_us=5)
    e["t_us"][first:] -= by_us
    back, notes = read(e)
    np.testing.assert_array_equal(back, e[np.argsort(e["t_us"], kind="stable")])
    assert len(notes) == 1 and re.search(rf"up to {by_us - 5} us out of .*: \d+ sorted$", notes[0])


@pytest.mark.parametrize("by_us", [8, 350])
def test_where_a_chunk_begins_what_overlaps_is_left_out(by_us):
    e = some_events(step_us=5)
    e["t_us"][3000:] -= by_us
    back, notes = read(e)
    count = -(-by_us // 5) - 1
    np.testing.assert_array_equal(back, np.delete(e, np.arange(3000, 3000 + count)))
    assert len(notes) == 1 and notes[0].endswith(f": {count} left out")


@pytest.mark.parametrize("at, by_us", [(10_000, 3_000_000), (19_500, 900_000), (3000, 20_000), (1000, 9000)])
def test_a_clock_that_was_set_back_is_an_error_behind_what_was_read(at, by_us):
    e = some_events(step_us=10)
    e["t_us"][at:] -= by_us
    stream = Stream("e", CAMERA, Source("e", (64, 48), lambda: iter(np.array_split(e, 10))))
    got, message = [], rf"e: .* by {by_us - 10} us after number {at - 1}; the clock was set back"
    with pytest.raises(InputError, match=message):
        got.extend(stream.chunks())
    assert sum(map(len, got)) > at - 2001
    np.testing.assert_array_equal(np.concatenate([e[:0], *got]), e[: sum(map(len, got))])


def test_disorder_throughout_is_an_error():
    e = some_events()
    e["t_us"] = np.random.default_rng(0).permutation(e["t_us"])
    with pytest.raises(InputError, match=r"such steps are too many, so write the events in the order"):
        read(e)


def test_what_is_in_order_passes_as_it_is():
    chunks = np.split(some_events(), [1, 1, 5000])
    passed = list(in_order(chunks, "e"))
    assert all(a is b for a, b in zip(passed, [c for c in chunks if len(c)], strict=True))
