"""Laws of pictures as recordings, and of sensors by name."""

import cv2
import numpy as np
import pytest

from lmmap.cli import main
from lmmap.recordings import sensors
from lmmap.recordings.formats import open_recording, open_stream
from lmmap.recordings.images import decode
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
