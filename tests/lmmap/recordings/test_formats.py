"""Laws of recording files: what their libraries write comes back exactly; what is damaged is named."""

import os
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from library_files import WRITERS, write_recording

from lmmap.recordings.formats import open_recording, open_stream, suffixes
from lmmap.types import EVENT, Camera, InputError, Pose, Recording, Trajectory
from lmmap_readers.health import health

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


def recording(seed=0, events=2500, frames=3, truth=True) -> Recording:
    rng = np.random.default_rng(seed)
    e = np.zeros(events, EVENT)
    e["t_us"] = np.sort(rng.integers(0, 100_000, events)) + 10**15
    e["x"], e["y"] = rng.integers(0, 64, events), rng.integers(0, 48, events)
    e["p"] = rng.random(events) < 0.5
    images = rng.integers(0, 256, (frames, 48, 64, 3), np.uint8)
    t_us = 10**15 + 33_333 * np.arange(frames)
    poses = Pose(np.tile(np.eye(3), (3, 1, 1)), rng.normal(size=(3, 3)))
    track = Trajectory(10**15 + np.array([0, 50_000, 100_000]), poses) if truth else None
    return Recording("r", CAMERA, e, images, t_us, track)


@pytest.fixture(params=WRITERS)
def suffix(request):
    return request.param


def assert_same(a: Recording, b: Recording):
    np.testing.assert_array_equal(a.events, b.events)
    np.testing.assert_array_equal(a.frames, b.frames)
    np.testing.assert_array_equal(a.frames_t_us, b.frames_t_us)
    assert a.camera == b.camera


def assert_round_trip(write, original: Recording, path):
    """What is written is read again, events and frames to the last bit."""
    write(original, path)
    back = open_recording(path)
    assert_same(original, back)
    np.testing.assert_array_equal(back.truth.t_us, original.truth.t_us)
    np.testing.assert_allclose(back.truth.poses.position_m, original.truth.poses.position_m, rtol=1e-11)
    assert not (back.events.flags.writeable or back.frames.flags.writeable)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 300), st.integers(0, 3), st.sampled_from(sorted(WRITERS)))
def test_round_trip_is_exact(tmp_path_factory, seed, events, frames, suffix):
    original = recording(seed, events if events + frames else 1, frames)
    assert_round_trip(write_recording, original, tmp_path_factory.mktemp("r") / f"r{suffix}")


def assert_reads_as_dv(path, ours: Recording):
    """Oracle: iniVation's own library, which our reader does without."""
    import dv_processing as dv

    reader = dv.io.MonoCameraRecording(str(path))
    batches = [b.numpy() for b in iter(reader.getNextEventBatch, None)]
    for name, other in (("t_us", "timestamp"), ("x", "x"), ("y", "y"), ("p", "polarity")):
        np.testing.assert_array_equal(ours.events[name], np.concatenate([b[other] for b in batches]))
    frames = list(iter(reader.getNextFrame, None))
    middle_us = [f.timestamp + f.exposure.total_seconds() * 5e5 for f in frames]
    np.testing.assert_allclose(ours.frames_t_us, middle_us, atol=1)
    for mine, frame in zip(ours.frames, frames, strict=True):
        pixels = frame.image[..., ::-1] if frame.image.ndim == 3 else frame.image[..., None]
        np.testing.assert_array_equal(mine, np.broadcast_to(pixels, mine.shape))


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "LZ4_HIGH", "ZSTD", "ZSTD_HIGH"])
def test_every_compression_as_dv_processing_reads_it(tmp_path, compression):
    import dv_processing as dv

    config = dv.io.MonoCameraWriter.Config("r", getattr(dv.CompressionType, compression))
    config.addEventStream((64, 48))
    config.addFrameStream((64, 48))
    writer, r = dv.io.MonoCameraWriter(str(tmp_path / "r.aedat4"), config), recording()
    store = dv.EventStore()
    for event in r.events.tolist():
        store.push_back(*event)
    writer.writeEvents(store)
    for t_us, frame in r.timed_frames():
        writer.writeFrame(dv.Frame(t_us, 500, 0, 0, np.ascontiguousarray(frame), dv.FrameSource.SENSOR))
    del writer
    ours = open_recording(tmp_path / "r.aedat4", CAMERA)
    assert_reads_as_dv(tmp_path / "r.aedat4", ours)
    np.testing.assert_array_equal(ours.events, r.events)
    assert open_stream(tmp_path / "r.aedat4", CAMERA).source.span_us == tuple(r.events["t_us"][[0, -1]])


def test_exposure_and_gray_frames(tmp_path):
    """A library frame is stamped at the start of its exposure; ours are stamped in the middle."""
    import dv_processing as dv

    config = dv.io.MonoCameraWriter.Config("gray")
    config.addFrameStream((64, 48))
    gray = np.random.default_rng(0).integers(0, 256, (48, 64), np.uint8)
    writer = dv.io.MonoCameraWriter(str(tmp_path / "g.aedat4"), config)
    writer.writeFrame(dv.Frame(1000, 20_000, 0, 0, gray, dv.FrameSource.SENSOR))
    del writer
    back = open_recording(tmp_path / "g.aedat4", CAMERA)
    assert back.frames_t_us.tolist() == [11_000] and len(back.events) == 0
    np.testing.assert_array_equal(back.frames[0], np.repeat(gray[..., None], 3, -1))


# --- cameras --------------------------------------------------------------------------------------


def test_camera_argument_wins_over_the_file_beside(tmp_path):
    write_recording(recording(), tmp_path / "r.h5")
    other = replace(CAMERA, fx_px=71.0)
    assert open_recording(tmp_path / "r.h5", other).camera == other
    other.save(tmp_path / "other.json")
    assert open_recording(tmp_path / "r.h5", tmp_path / "other.json").camera == other


def test_no_camera_is_asked_for_or_nominal(tmp_path):
    write_recording(recording(), tmp_path / "r.h5")
    (tmp_path / "r.camera.json").unlink()
    with pytest.raises(InputError, match="--camera"):
        open_recording(tmp_path / "r.h5")
    davis = Camera.davis346()
    wide = replace(recording(frames=0), camera=davis, frames=np.zeros((0, 260, 346, 3), np.uint8))
    write_recording(wide, tmp_path / "r.h5")
    (tmp_path / "r.camera.json").unlink()
    with pytest.warns(UserWarning, match="nominal DAVIS 346"):
        assert open_recording(tmp_path / "r.h5").camera == davis


def test_camera_of_another_size(tmp_path):
    write_recording(recording(), tmp_path / "r.h5")
    with pytest.raises(InputError, match=r"64 x 48.*346 x 260"):
        open_recording(tmp_path / "r.h5", Camera.davis346())


# --- bad input: one line that names the file ------------------------------------------------------


def one_line(path, camera=CAMERA) -> str:
    with pytest.raises(InputError) as caught:
        open_recording(path, camera)
    message = str(caught.value)
    assert "\n" not in message and str(path) in message and ";" in message and len(message) < 400
    return message


def test_no_recording_at_all(tmp_path, suffix):
    assert "no such file" in one_line(tmp_path / f"absent{suffix}")
    assert "not a folder of images" in one_line(tmp_path)
    for name, content in (("empty", ""), ("text", "a text, not a recording\n" * 50)):
        (tmp_path / f"{name}{suffix}").write_text(content)
        one_line(tmp_path / f"{name}{suffix}")
    (tmp_path / "sound.wav").write_bytes(b"x")
    assert ", ".join(suffixes()) in one_line(tmp_path / "sound.wav")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("damage")
    for suffix in WRITERS:
        write_recording(recording(truth=False), folder / f"r{suffix}")
    return {suffix: folder / f"r{suffix}" for suffix in WRITERS}


@settings(max_examples=150, deadline=None)
@given(st.data(), st.sampled_from(sorted(WRITERS)))
def test_every_truncation_is_named(files, tmp_path_factory, data, suffix):
    whole = files[suffix].read_bytes()
    path = tmp_path_factory.getbasetemp() / f"cut{suffix}"
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    one_line(path)


def test_truncation_in_the_last_bytes_is_named(files, tmp_path, suffix):
    """Where indexes and tables lie, of which a random cut rarely takes a part."""
    whole = files[suffix].read_bytes()
    for cut in range(1, min(200, len(whole))):
        (tmp_path / f"cut{suffix}").write_bytes(whole[:-cut])
        one_line(tmp_path / f"cut{suffix}")


@settings(max_examples=200, deadline=None)
@given(st.data(), st.sampled_from(sorted(WRITERS)))
@pytest.mark.filterwarnings("ignore:.*out of the order of time")
def test_damaged_bytes_give_an_error_or_a_checked_recording(files, tmp_path_factory, data, suffix):
    whole = bytearray(files[suffix].read_bytes())
    # magic, header with its XML, and the first packet's head; the body has no checksum to fail on
    last = 1520 if suffix == ".aedat4" else len(whole)
    for at in data.draw(st.lists(st.integers(0, last - 1), min_size=1, max_size=3)):
        whole[at] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.getbasetemp() / f"damaged{suffix}"
    path.write_bytes(whole)
    try:
        back = open_recording(path, CAMERA)
    except InputError as error:
        assert str(path) in str(error) and "\n" not in str(error)
    else:
        assert np.all(np.diff(back.events["t_us"]) >= 0) and back.events["x"].max(initial=0) < 64


def interrupted(whole: bytes) -> tuple[bytes, int]:
    """The same file as if recording had been cut off: no table (position -1); and where it was."""
    at = next(k for k in range(18, 120) if 0.9 < int.from_bytes(whole[k : k + 8], "little") / len(whole) < 1)
    end = int.from_bytes(whole[at : at + 8], "little")
    return whole[:at] + b"\xff" * 8 + whole[at + 8 : end], end


def test_a_recording_cut_off_anywhere_keeps_its_whole_packets_and_says_so(files, tmp_path):
    content, end = interrupted(files[".aedat4"].read_bytes())
    original, path, kept = recording(truth=False), tmp_path / "r.aedat4", []
    for length in (*range(0, end, end // 25), end - 9000, end - 300, end - 5, end - 1, end):
        path.write_bytes(content[:length])
        with warnings.catch_warnings(record=True) as notes:
            warnings.simplefilter("always")
            try:
                back = open_recording(path, CAMERA)
            except InputError as refused:
                assert str(path) in str(refused) and not kept  # before its first whole packet
                continue
        assert [str(n.message) for n in notes if "r.aedat4: its recording was cut off" in str(n.message)]
        kept.append((len(back.events), len(back.frames)))
        np.testing.assert_array_equal(back.events, original.events[: len(back.events)])
        np.testing.assert_array_equal(back.frames, original.frames[: len(back.frames)])
    assert kept == sorted(kept) and len(set(kept)) > 2
    assert kept[-1] == (len(original.events), len(original.frames)) and kept[-2] != kept[-1]


def broken(**columns) -> Recording:
    r = recording()
    events = r.events.copy()
    for name, (index, value) in columns.items():
        events[name][index] = value
    return replace(r, events=events)


@pytest.mark.parametrize(
    "fault, words",
    [
        (dict(t_us=(slice(100, None), 0)), "runs backward by .* after number 99"),
        (dict(x=(7, 64)), "event outside 64 x 48 px, number 7 at \\(64"),
        (dict(y=(7, -1)), "outside 64 x 48 px"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*no sensor has")
def test_backward_time_and_foreign_pixels(tmp_path, fault, words):
    bad = broken(**fault)
    write_recording(bad, tmp_path / "r.h5")
    with pytest.raises(InputError, match=words):
        open_recording(tmp_path / "r.h5", CAMERA)


# --- health ---------------------------------------------------------------------------------------


def test_health_by_hand():
    e = np.zeros(45, EVENT)
    e["t_us"] = np.arange(45) * 1000
    e["x"], e["y"] = 5, 6
    e["p"][:9] = True
    e["x"][40:] = [20, 21, 22, 64, -1]
    e["t_us"][42:] = [61_000, 60_000, 89_000]
    h = health(replace(recording(frames=0), events=e))
    expected = dict(
        events=45, frames=0, duration_s=0.089, on_fraction=0.2, largest_gap_ms=29.0, gaps_over_10_ms=2,
        backward_steps=1, out_of_range=2, hot_pixels=1, windows=0, frame_rate_hz=0.0, truth=True,
    )  # fmt: skip
    assert {k: h[k] for k in expected} == pytest.approx(expected)
    assert h["event_rate_hz"] == pytest.approx(45 / 0.089)
    assert h["suggested_window"] == round(35_000 * 64 * 48 / (346 * 260))


def test_an_edge_is_no_hot_pixel():
    e = np.zeros(60, EVENT)
    e["x"], e["y"] = 5, 6 + np.arange(60) // 30  # two neighbours, 30 events each
    assert health(replace(recording(), events=e))["hot_pixels"] == 0


# --- the real recording ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real():
    """A DAVIS 346 recording that is not ours to distribute: LMMAP_REAL_RECORDING names it."""
    beside = Path(__file__).parents[4] / "shared/recordings/newtons-cradle-davis346.aedat4"
    path = Path(os.environ.get("LMMAP_REAL_RECORDING", beside))
    if not path.exists():
        pytest.skip("real recording absent: set LMMAP_REAL_RECORDING to its path")
    return path


def test_real_davis346_recording(real):
    with pytest.warns(UserWarning, match="nominal"):
        h = health(open_recording(real))
    assert (h["events"], h["frames"], h["backward_steps"], h["out_of_range"]) == (319_512, 13, 0, 0)
    assert h["duration_s"] == pytest.approx(0.51, abs=0.005)
    assert h["frame_rate_hz"] == pytest.approx(25.0)


def test_real_recording_as_dv_processing_reads_it(real):
    assert_reads_as_dv(real, open_recording(real, Camera.davis346()))


def test_real_recording_as_aedat_reads_it(real):
    """Oracle: PyPI's aedat, an independent decoder in Rust."""
    import aedat

    ours, packets = open_recording(real, Camera.davis346()), list(aedat.Decoder(real))
    theirs = np.concatenate([p["events"] for p in packets if "events" in p])
    for name, other in (("t_us", "t"), ("x", "x"), ("y", "y"), ("p", "on")):
        np.testing.assert_array_equal(ours.events[name], theirs[other])
    frames = [p["frame"] for p in packets if "frame" in p]
    middle_us = [(f["exposure_begin_t"] + f["exposure_end_t"]) // 2 for f in frames]
    np.testing.assert_allclose(ours.frames_t_us, middle_us, atol=1)
    pixels = [np.atleast_3d(f["pixels"])[..., ::-1] for f in frames]  # BGR
    np.testing.assert_array_equal(ours.frames, np.broadcast_to(pixels, ours.frames.shape))
