"""Laws of pictures as recordings, and of sensors by name."""

import struct
import warnings

import cv2
import numpy as np
import pytest
from PIL import Image

from lmmap.cli import main
from lmmap.recordings import sensors
from lmmap.recordings.depth import LOOKED_AT
from lmmap.recordings.formats import open_recording, open_stream
from lmmap.recordings.images import IMAGE_SUFFIXES, decode
from lmmap.types import Camera, InputError

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
    with pytest.raises(InputError, match=r"pictures per second.*;"):
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
    frames = open_recording(tmp_path, CAMERA, fps=None if timed else 30).frames
    assert frames[:, 0, 0, 0].tolist() == numbers


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
