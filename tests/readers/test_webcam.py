"""A camera of OpenCV; a queue or a video stands in for the device."""

import queue
import re
import time

import cv2
import drawn
import numpy as np
import pytest

from lmmap.types import InputError, Status
from lmmap_readers import attached, webcam
from lmmap_readers.webcam import Webcam, assumed

BLACK = np.zeros((48, 64, 3), np.uint8)


class Device:
    """A camera that sends what is put into its queue, and a failed read for None."""

    opens, frames = True, 0

    def __init__(self, name):
        self.queue = queue.Queue()
        self.queue.put(BLACK)
        Device.last, Device.name = self, name

    def isOpened(self):
        return self.opens

    def read(self):
        frame = self.queue.get()
        return frame is not None, frame

    def get(self, _):
        return self.frames


@pytest.fixture
def device(monkeypatch):
    monkeypatch.setattr(webcam.cv2, "VideoCapture", Device)
    return Device


def test_the_newest_image_is_taken_and_the_others_are_counted(device):
    camera = Webcam("0", {"rgb": "x"})
    assert device.name == 0 and camera.size_px == (64, 48) and camera.running()
    before_us = camera.now_us()
    for red in (50, 100, 200):
        frame = np.zeros((48, 64, 3), np.uint8)
        frame[:, 0, 2] = red  # BGR, in the first column
        device.last.queue.put(frame)
    until = time.monotonic() + 5
    while len(camera._times_us) < 4 and time.monotonic() < until:
        time.sleep(0.01)
    pending = camera.pending("rgb")
    times_us = [t_us for t_us, _ in pending]
    assert len(pending) == 4 and sorted(times_us) == times_us and times_us[-1] >= before_us
    assert tuple(pending[-1][1][7, -1]) == (200, 0, 0) and not pending[-1][1][:, 0].any()
    assert camera.pending("rgb") == []


def test_bad_cameras_are_one_line_each(device, monkeypatch, tmp_path):
    monkeypatch.setattr(webcam, "FIRST_IMAGE_S", 0.05)
    monkeypatch.setattr(webcam, "SILENCE_S", 0.05)
    camera = Webcam("rtsp://camera/stream")
    assert device.name == "rtsp://camera/stream"
    with pytest.raises(InputError, match=r"stream: is no event camera; give --modality rgb"):
        camera.pending("event")
    assert len(camera.pending("rgb")) == 1
    device.last.queue.put(None)
    time.sleep(0.06)
    with pytest.raises(InputError, match=r"stream: the camera sent no image for 0 s; check"):
        camera.pending("rgb")
    monkeypatch.setattr(device, "read", lambda _: (False, None))
    with pytest.raises(InputError, match=r"^0: the camera sends no image; close other programs"):
        Webcam("0")
    monkeypatch.setattr(device, "opens", False)
    with pytest.raises(InputError, match=r"^97: no such camera, there is .+; attach one"):
        Webcam("97")
    with pytest.raises(InputError, match=r"^http://x/y: nothing can be read from this address"):
        Webcam("http://x/y")
    (tmp_path / "video0").touch()
    with pytest.raises(InputError, match=r"video0: cannot open this camera; close other programs"):
        Webcam(str(tmp_path / "video0"))


def test_an_assumed_camera_sees_sixty_degrees():
    with pytest.warns(UserWarning, match=r"^x: .*60 degrees.*distances are off.*--focal"):
        camera = assumed((1280, 720), "x")
    left, right = (np.arctan2(u - camera.cx_px, camera.fx_px) for u in (-0.5, 1279.5))
    assert np.degrees(right - left) == pytest.approx(60)
    with pytest.warns(UserWarning, match="60 degrees"):
        assert assumed((720, 1280), "x").fx_px == camera.fx_px  # a phone held upright


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip.avi"
    r = drawn.recording(4)
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 20, (692, 520))
    for frame in r.frames:
        video.write(cv2.resize(frame, (692, 520))[..., ::-1])
    video.release()
    return path


def test_live_from_a_camera_without_a_calibration(clip, monkeypatch, lmmap):
    """OpenCV opens a video in place of the camera; it is over when its last image has been read."""
    opened = cv2.VideoCapture
    monkeypatch.setattr(webcam.cv2, "VideoCapture", lambda name: opened(str(clip)))
    code, out, err = lmmap("live", "0", "--json")
    notes = [line for line in err.splitlines() if "0: no calibration; assuming 60 degrees" in line]
    assert code == 0 and len(notes) == 1 and "images; " in err and '"status"' in out
    code, _, err = lmmap("live", "/dev/video3", "--modality", "event")
    assert code == 1 and re.fullmatch(r"lmmap: .*no event camera.*\n", err)


def test_live_plays_a_clip_without_a_calibration(clip, lmmap):
    code, out, err = lmmap("live", clip)
    assert code == 0 and "60 degrees" in err and f" {Status.OK} " in out
    code, _, err = lmmap("live", clip, "--modality", "event")
    assert code == 1 and "no calibration for 692 x 520 px" in err


@pytest.mark.parametrize("stop, code", [(KeyboardInterrupt(), 0), (InputError("0: no more"), 1)])
def test_live_ends_with_its_summary_however_it_ends(device, monkeypatch, lmmap, stop, code):
    images = iter([[(0, drawn.recording(4).frames[0])]])

    def pending(self, modality):
        if image := next(images, None):
            return image
        raise stop

    monkeypatch.setattr(Webcam, "pending", pending)
    monkeypatch.setattr(webcam, "Webcam", Webcam)
    monkeypatch.setitem(globals(), "BLACK", np.zeros((260, 346, 3), np.uint8))
    ended, out, err = lmmap("live", "0")
    assert ended == code and out.count("\n") == 1 and "1 images; 1 " in err
    assert ("no more" in err.splitlines()[-1]) == (code == 1)


@pytest.mark.skipif(bool(attached.dv.io.camera.discover()), reason="a camera is attached here")
def test_no_event_camera_is_said():
    with pytest.raises(InputError, match="no camera found; attach one"):
        attached.Attached()


def test_a_number_that_no_camera_has_is_one_line():
    with pytest.raises(InputError, match=r"^99999999999: "):
        webcam.Webcam("99999999999")
