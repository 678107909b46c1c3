"""Laws of streams: chunks carry the same events in the same order, checked across their borders."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from library_files import WRITERS, write_recording
from strategies import cut

from lmmap.recordings.formats import open_recording, open_stream
from lmmap.recordings.order import checked_events, checked_frames
from lmmap.recordings.stream import Source, Stream, in_chunks
from lmmap.types import EVENT, Camera, InputError

SIZE_PX = 64, 48


def events(count: int, rng) -> np.ndarray:
    e = np.zeros(count, EVENT)
    e["t_us"] = np.sort(rng.integers(0, 1000, count))
    e["x"], e["y"] = rng.integers(0, 64, count), rng.integers(0, 48, count)
    return e


@given(st.integers(0, 500), st.integers(1, 100), st.integers(0, 99))
def test_rechunking_keeps_events_and_fills_chunks(total, count, seed):
    rng = np.random.default_rng(seed)
    e = events(total, rng)
    chunks = list(in_chunks(cut(e, rng), count))
    np.testing.assert_array_equal(np.concatenate([e[:0], *chunks]), e)
    assert all(len(chunk) >= count for chunk in chunks[:-1])


@given(st.integers(2, 300), st.integers(0, 99), st.data())
def test_a_fault_is_found_wherever_chunks_end(total, seed, data):
    rng = np.random.default_rng(seed)
    e = events(total, rng)
    e["t_us"] += 10
    np.testing.assert_array_equal(np.concatenate(list(checked_events(cut(e, rng), SIZE_PX))), e)
    k = data.draw(st.integers(1, total - 1))
    late, outside = e.copy(), e.copy()
    late["t_us"][k] = late["t_us"][k - 1] - 5
    with pytest.raises(ValueError, match=f"backward by 5 us after number {k - 1};"):
        list(checked_events(cut(late, rng), SIZE_PX))
    outside[data.draw(st.sampled_from(["x", "y"]))][k] = data.draw(st.sampled_from([-1, -32_768, 64, 32_767]))
    with pytest.raises(ValueError, match=f"event outside 64 x 48 px, number {k} at"):
        list(checked_events(cut(outside, rng), SIZE_PX))


def test_frames_are_checked_for_time_and_size():
    good = np.zeros((48, 64, 3), np.uint8)
    assert len(list(checked_frames([(5, good), (5, good), (9, good)], SIZE_PX))) == 3
    with pytest.raises(ValueError, match="frames runs backward by 2 us after number 0"):
        list(checked_frames([(5, good), (3, good)], SIZE_PX))
    with pytest.raises(ValueError, match="frame number 1 of shape"):
        list(checked_frames([(5, good), (6, good[:-1])], SIZE_PX))


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_stream_yields_what_the_recording_holds_again_and_again(tmp_path, suffix):
    rng, camera = np.random.default_rng(0), Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    whole = Stream(
        "r", camera,
        Source(tmp_path, SIZE_PX, lambda: iter([events(700, rng)]),
               lambda: ((k, rng.integers(0, 256, (48, 64, 3), np.uint8)) for k in range(3))),
    ).collect()  # fmt: skip
    write_recording(whole, tmp_path / f"r{suffix}")
    stream = open_stream(tmp_path / f"r{suffix}")
    for _ in range(2):
        np.testing.assert_array_equal(np.concatenate(list(stream.chunks())), whole.events)
        frames = list(stream.timed_frames())
        assert [t for t, _ in frames] == whole.frames_t_us.tolist()
        np.testing.assert_array_equal([f for _, f in frames], whole.frames)
    np.testing.assert_array_equal(open_recording(tmp_path / f"r{suffix}").events, whole.events)


def test_an_unchecked_stream_passes_faults_on(tmp_path):
    e = np.zeros(3, EVENT)
    e["t_us"] = 5, 3, 9
    source = Source(tmp_path / "r", SIZE_PX, lambda: iter([e]))
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    (same,) = Stream("r", camera, source, checked=False).chunks()
    assert same["t_us"].tolist() == [5, 3, 9]
    with pytest.raises(InputError, match=r"r: time of the events runs backward by 2 us"):
        list(Stream("r", camera, source).chunks())
