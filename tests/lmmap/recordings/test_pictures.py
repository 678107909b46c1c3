"""Laws of pictures as recordings, and of sensors by name."""

import os
import re
import struct
import warnings
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from PIL import Image

from lmmap.cli import main
from lmmap.recordings.formats import open_recording, open_stream
from lmmap.recordings.images import IMAGE_SUFFIXES, decode
from lmmap.types import Camera, InputError
from lmmap_readers import sensors
from lmmap_readers.depth import LOOKED_AT

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


def some_picture(seed=0):
    return np.random.default_rng(seed).integers(0, 256, (48, 64, 3), np.uint8)


def test_one_picture_is_one_frame_at_time_zero(tmp_path):
    cv2.imwrite(str(tmp_path / "p.png"), some_picture()[..., ::-1])
    back = open_recording(tmp_path / "p.png", CAMERA)
    np.testing.assert_array_equal(back.frames, some_picture()[None])
    assert back.frames_t_us.tolist() == [0] and not len(back.events)


def test_a_jpeg_is_close_to_what_was_written(tmp_path):
    smooth = np.broadcast_to(np.arange(64, dtype=np.uint8)[None, :, None] * 3, (48, 64, 3))
    cv2.imwrite(str(tmp_path / "p.JPG"), np.ascontiguousarray(smooth))
    np.testing.assert_allclose(open_recording(tmp_path / "p.JPG", CAMERA).frames[0], smooth, atol=6)


def test_a_folder_of_pictures_has_the_rate_that_is_given(tmp_path):
    for k in (2, 0, 1):
        cv2.imwrite(str(tmp_path / f"{k:03d}.png"), some_picture(k)[..., ::-1])
    back = open_recording(tmp_path, CAMERA, fps=30)
    assert back.frames_t_us.tolist() == [0, 33_333, 66_667]
    np.testing.assert_array_equal(back.frames, [some_picture(k) for k in range(3)])
    with pytest.raises(InputError, match=r"--fps"):
        open_recording(tmp_path, CAMERA)


@pytest.mark.parametrize("fps", [0, -1, np.nan, np.inf])
def test_rates_that_are_none(tmp_path, fps):
    cv2.imwrite(str(tmp_path / "0.png"), some_picture())
    with pytest.raises(InputError, match="pictures per second"):
        open_recording(tmp_path, CAMERA, fps=fps)


def test_a_rate_is_for_folders_of_pictures(tmp_path):
    cv2.imwrite(str(tmp_path / "p.png"), some_picture())
    with pytest.raises(InputError, match=r"p\.png: --fps 30 is for a folder of pictures; leave it out"):
        open_recording(tmp_path / "p.png", CAMERA, fps=30)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no \.png, [^\n]*;"):
        open_recording(tmp_path / "empty", CAMERA, fps=30)


def test_bad_pictures_are_one_line_and_those_before_are_kept(tmp_path):
    for suffix in (".jpg", ".png"):
        cv2.imwrite(str(tmp_path / f"0{suffix}"), some_picture()[..., ::-1])
        whole = (tmp_path / f"0{suffix}").read_bytes()
        for content in (b"", b"no picture", whole[: len(whole) // 2], whole[:-8]):
            (tmp_path / f"bad{suffix}").write_bytes(content)
            with pytest.raises(InputError, match=r"bad\....: cannot read this picture \([^\n]*\); [^\n]*$"):
                open_recording(tmp_path / f"bad{suffix}", CAMERA)
    (tmp_path / "0.jpg").unlink()
    (tmp_path / "bad.jpg").unlink()
    frames = open_stream(tmp_path, CAMERA, fps=1).timed_frames()
    np.testing.assert_array_equal(next(frames)[1], some_picture())
    with pytest.raises(InputError, match=r"bad\.png"):
        next(frames)


def test_a_size_suggests_its_sensors(tmp_path):
    cv2.imwrite(str(tmp_path / "p.png"), np.zeros((720, 1280, 3), np.uint8))
    with pytest.raises(InputError, match=r"1280 x 720 px \(as of .*EVK4.*\); give one with --camera"):
        open_recording(tmp_path / "p.png")
    assert sensors.of_size((640, 480)) == ("iniVation's DVXplorer, DVXplorer Micro; Prophesee's Gen3 VGA")
    assert sensors.of_size((123, 456)) == ""


def test_nominal_cameras_are_asked_for_by_name(tmp_path):
    """8 mm over 4.86 um are 1646.1 px; the bench's own camera is 6 mm over 18.5 um."""
    camera = sensors.nominal("EVK4", 8)
    assert camera.size_px == (1280, 720) and camera.distortion == ()
    np.testing.assert_allclose(camera.K, [[1646.091, 0, 639.5], [0, 1646.091, 359.5], [0, 0, 1]], atol=1e-3)
    bench = Camera.davis346()
    np.testing.assert_allclose(sensors.nominal("davis346", 6).K, bench.K, atol=0.5)
    cv2.imwrite(str(tmp_path / "p.png"), np.zeros((720, 1280, 3), np.uint8))
    assert open_recording(tmp_path / "p.png", "imx636:8mm").camera == camera
    for text in ("evk9:8mm", "evk4:0mm"):
        with pytest.raises(InputError, match=r"give one of davis346, .*, as evk4:8mm"):
            open_recording(tmp_path / "p.png", text)


def test_the_command_takes_names_and_rates(tmp_path, capsys):
    folder = tmp_path / "pictures"
    folder.mkdir()
    for k in range(3):
        cv2.imwrite(str(folder / f"{k}.png"), np.zeros((240, 320, 3), np.uint8))
    assert main.main(["info", str(folder), "--fps", "10", "--camera", "dvxplorer-lite:6mm", "--json"]) == 0
    assert '"frame_rate_hz": 10.0' in capsys.readouterr().out


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tiff"])
@pytest.mark.parametrize("shape", [(48, 64, 3), (48, 64)])
def test_images_come_as_rgb(suffix, shape):
    """Oracle: OpenCV's blue first, turned round."""
    image = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    content = cv2.imencode(suffix, image)[1]
    expected = cv2.cvtColor(cv2.imdecode(content, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    np.testing.assert_array_equal(decode(content.tobytes()), expected)


@pytest.mark.parametrize("name", ["frame_{}", "{}", "left {} of 200", "1468941032.{}", "cam2-{:04d}"])
@pytest.mark.parametrize("timed", [False, True])
def test_pictures_come_in_the_order_of_their_numbers(tmp_path, name, timed):
    numbers = [0, 1, 2, 3, 10, 11, 20, 100] if "." not in name else [0, 1, 15, 2, 25, 9]  # as decimals
    for number in numbers:
        cv2.imwrite(str(tmp_path / f"{name.format(number)}.png"), np.full((48, 64, 3), number, np.uint8))
    if timed:
        times = "".join(f"{k / 30:.6f}\n" for k in range(len(numbers)))
        (tmp_path / "timestamps.txt").write_text(times)
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        frames = open_recording(tmp_path, CAMERA, fps=None if timed else 30).frames
    assert frames[:, 0, 0, 0].tolist() == numbers
    assert ["numbers" in str(note.message) for note in notes] == ([] if timed else [True])


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
@pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm"])
def test_pictures_of_16_bits_are_scaled_alike_by_the_bits_in_use(tmp_path, suffix, bits):
    """The dark one, too, which comes first."""
    bright = np.random.default_rng(0).integers(0, 1 << bits, (48, 64), np.uint16)
    bright[0, 0] = (1 << bits) - 1
    images = [bright // 8, bright]
    for k, deep in enumerate(images):
        cv2.imwrite(str(tmp_path / f"{k}{suffix}"), deep)
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        back = open_recording(tmp_path, CAMERA, fps=30).frames[..., 0]
    np.testing.assert_array_equal(back, [deep >> bits - 8 for deep in images])
    assert [f"take {bits} of them" in str(note.message) for note in notes] == ([True] if bits < 16 else [])


def test_bits_that_come_late_change_no_frame_before_them(tmp_path):
    """Behind those that are looked at first; and every pass has the same frames."""
    deep = [np.full((48, 64), 1000 if k < LOOKED_AT + 4 else 4000, np.uint16) for k in range(LOOKED_AT + 6)]
    for k, image in enumerate(deep):
        cv2.imwrite(str(tmp_path / f"{k}.png"), image)
    stream = open_stream(tmp_path, CAMERA, fps=30)
    for _ in range(2):
        with pytest.warns(UserWarning, match="take 1"):
            values = [int(frame[0, 0, 0]) for _, frame in stream.timed_frames()]
        assert values == [250] * (LOOKED_AT + 4) + [250, 250]


@pytest.mark.parametrize("suffix", sorted({*IMAGE_SUFFIXES} - {".pbm"}))  # which has no grey
def test_other_pictures_alone(tmp_path, suffix):
    smooth = np.ascontiguousarray(np.broadcast_to(np.arange(64, dtype=np.uint8)[:, None] * 3, (48, 64, 3)))
    cv2.imwrite(str(tmp_path / f"p{suffix}"), smooth[..., 0] if suffix == ".pgm" else smooth)
    np.testing.assert_allclose(open_recording(tmp_path / f"p{suffix}", CAMERA).frames[0], smooth, atol=6)


def turned_video(path):
    """A video of 64 x 48 px whose header turns it, by another matrix of its track."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 20, (64, 48))
    for k in range(3):
        writer.write(some_picture(k))
    writer.release()
    straight, turned = (struct.pack(">9i", *values, 1 << 30) for values in (
        (65536, 0, 0, 0, 65536, 0, 0, 0), (0, 65536, 0, -65536, 0, 0, 48 << 16, 0)))  # fmt: skip
    content = path.read_bytes()
    at = content.index(straight, content.index(b"tkhd"))
    path.write_bytes(content[:at] + turned + content[at + len(turned) :])


def turned_picture(path):
    picture = Image.fromarray(some_picture())
    exif = picture.getexif()
    exif[0x0112] = 6
    picture.save(path, exif=exif)


@pytest.mark.parametrize("name, write", [("v.mp4", turned_video), ("p.jpg", turned_picture)])
def test_metadata_that_turn_an_image_are_named(tmp_path, name, write):
    """A calibration of the image as it is shown fits without a word."""
    write(tmp_path / name)
    text = "recorded at 48 x 64 px, turned by 90 degrees as its metadata ask, but"
    with pytest.raises(InputError, match=text):
        open_recording(tmp_path / name, CAMERA)
    upright = Camera(48, 64, 60.0, 60.0, 23.5, 31.5)
    assert open_recording(tmp_path / name, upright).frames[0].shape == (64, 48, 3)


# --- what else a folder holds -------------------------------------------------------------------------


def folder_of(path, names, times=None):
    path.mkdir(exist_ok=True)
    for k, name in enumerate(names):
        cv2.imwrite(str(path / name), np.full((48, 64, 3), k, np.uint8))
    if times:
        (path / "timestamps.txt").write_text("".join(f"{t}\n" for t in times))
    return path


TIMES_US = [1_000_000, 1_033_333, 1_066_667, 1_100_000]


@pytest.mark.parametrize("unit, factor", [("ns", 1000), ("ms", 1e-3), ("s", 1e-6), ("us", 1)])
@pytest.mark.parametrize("form", [int, float])
def test_a_list_s_unit_is_doubted_and_settled_by_a_word(tmp_path, unit, factor, form):
    """Whole numbers are taken as microseconds and others as seconds; whole seconds say too little."""
    stored = [form(t * factor) for t in TIMES_US]
    folder = folder_of(tmp_path / "f", [f"{k}.png" for k in range(4)], stored)
    atol = {"ms": 1000, "s": 10**6}.get(unit, 1) if form is int else 1
    np.testing.assert_allclose(
        open_recording(folder, CAMERA, time_unit=unit).frames_t_us, TIMES_US, atol=atol
    )
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        open_stream(folder, CAMERA)
    expected = unit != {int: "us", float: "s"}[form]
    assert [f"--time-unit {unit}" in str(n.message) or unit == "s" for n in notes] == [True] * expected


def test_times_of_a_list_have_one_unit(tmp_path):
    folder = folder_of(tmp_path / "f", ["0.png", "1.png", "2.png"], ["0", "0.05", "1e-1"])
    assert open_recording(folder, CAMERA).frames_t_us.tolist() == [0, 50_000, 100_000]
    content = (folder / "timestamps.txt").read_bytes()
    (folder / "timestamps.txt").write_bytes(b"\xef\xbb\xbf" + content.replace(b"\n", b"\r\n"))  # of Windows
    assert open_recording(folder, CAMERA).frames_t_us.tolist() == [0, 50_000, 100_000]


def test_a_rate_and_a_list_are_one_too_many(tmp_path):
    folder = folder_of(tmp_path / "f", ["0.png", "1.png"], [0, 50_000])
    with pytest.warns(UserWarning, match=r"the times in its timestamps\.txt are not used"):
        assert open_recording(folder, CAMERA, fps=10).frames_t_us.tolist() == [0, 100_000]
    with pytest.raises(InputError, match="--fps makes the times, so they have no --time-unit; leave one out"):
        open_recording(folder, CAMERA, fps=10, time_unit="ns")


@pytest.mark.parametrize(
    "numbers, places, said",
    [
        ((0, 1, 2, 12, 13, 14), (0, 1, 2, 12, 13, 14), "9 numbers are missing .* after frame000002"),
        ((5, 15, 25, 45), (0, 1, 2, 4), "1 numbers are missing"),
        ((7, 8, 9), (0, 1, 2), None),
        ((10, 20, 30), (0, 1, 2), None),
        ((3, 17, 18, 40), (0, 1, 2, 3), "irregular, and not used"),
    ],
)
def test_times_follow_the_numbers(tmp_path, numbers, places, said):
    folder = folder_of(tmp_path / "f", [f"frame{k:06d}.png" for k in numbers])
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        t_us = open_recording(folder, CAMERA, fps=20).frames_t_us.tolist()
    assert t_us == [50_000 * k for k in places]
    assert [bool(re.search(said, str(n.message))) for n in notes] == [True] if said else not notes


def test_what_a_file_browser_adds_is_no_picture(tmp_path):
    folder = folder_of(tmp_path / "f", ["a1.png", "a2.PNG", "a3.png"])
    for name in ("._a1.png", ".DS_Store", "Thumbs.db", "desktop.ini", ".hidden.jpg", "a1.png.xmp"):
        (folder / name).write_bytes(b"\0\5\x16\7 not a picture")
    (folder / "thumbnails.png").mkdir()
    assert open_recording(folder, CAMERA, fps=1).frames[:, 0, 0, 0].tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    "more", [["a1 (1).png", "a2 (1).png"], ["a1 copy.png"], ["b1.png", "b2.png"], ["thumb_a1.png"]]
)
def test_copies_and_second_cameras_are_named(tmp_path, more):
    folder = folder_of(tmp_path / "f", ["a1.png", "a2.png", "a3.png", *more])
    with pytest.warns(UserWarning, match="are named in 2 ways, a# .3.*; keep one camera's, and no copies"):
        open_stream(folder, CAMERA, fps=1)


def test_one_picture_in_two_formats(tmp_path):
    folder = folder_of(tmp_path / "f", ["a1.png", "a1.jpg", "a2.png"])
    with pytest.raises(InputError, match=r"in several formats, a1\.(jpg|png), a1\.(jpg|png): keep one"):
        open_stream(folder, CAMERA, fps=1)


# --- videos -----------------------------------------------------------------------------------------


def video(path, code, count=12):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 20, (64, 48))
    for k in range(count):
        writer.write(some_picture(k))
    writer.release()
    return bytearray(path.read_bytes())


@pytest.mark.parametrize(
    "name, code",
    [("v.avi", "MJPG"), ("v.avi", "XVID"), ("v.mkv", "MJPG"), ("v.mkv", "VP90"), ("v.mp4", "vp09")],
)
def test_a_video_that_lost_images_says_so(tmp_path, name, code):
    path, seen = tmp_path / name, []
    content = video(path, code)
    assert len(open_recording(path, CAMERA).frames) == 12  # without a word
    cut, hole = content[: int(0.6 * len(content))], bytearray(content)
    hole[len(hole) // 2 : len(hole) // 2 + 900] = bytes(900)
    for damaged in (cut, hole):
        path.write_bytes(damaged)
        if damaged is cut and name == "v.mp4":  # whose index lies at its end
            with pytest.raises(InputError, match="no frame can be decoded"):
                open_recording(path, CAMERA)
            continue
        with pytest.warns(UserWarning, match=r"holds \d+ of the 12 images that its header promises"):
            seen.append(len(open_recording(path, CAMERA).frames))
    assert all(0 < n < 12 for n in seen)


def test_threads_that_read_videos_leave_stderr_as_it_is(tmp_path):
    for k in range(4):
        video(tmp_path / f"{k}.avi", "MJPG")
    before = os.fstat(2)
    with ThreadPoolExecutor(4) as threads:
        counts = threads.map(
            lambda k: len(open_recording(tmp_path / f"{k % 4}.avi", CAMERA).frames), range(8)
        )
        assert [*counts] == [12] * 8
    assert os.path.samestat(before, os.fstat(2))
