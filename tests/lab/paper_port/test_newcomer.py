"""The three commands of the quickstart and the README, with the traced clip in place of a webcam."""

import re
import shlex
import shutil
import time

import cv2
import numpy as np
import pytest

from lmmap.types import Camera
from lmmap_lab.provenance import DATA, ROOT
from lmmap_readers import webcam

CLIP = DATA / "mini" / "paper-port.mp4"
COMMANDS = ["lmmap print -o port.pdf", "lmmap live 0 --view", "lmmap calibrate clip.mp4 --focal"]


@pytest.mark.parametrize("page", ["README.md", "book/quickstart.md"])
def test_three_commands_are_all_it_takes(page):
    block = next(
        b for b in re.findall(r"```console\n(.*?)```", (ROOT / page).read_text(), re.S) if "print" in b
    )
    assert [line[2:].split("#")[0].strip() for line in block.splitlines()] == COMMANDS


class Camera0:
    """OpenCV's capture; the camera 0 sends a second of the clip, twenty images a second."""

    opened = cv2.VideoCapture

    def __init__(self, name, *options):
        self._wait_s, self._left = (0.05, 20) if name == 0 else (0.0, np.inf)
        self._capture = self.opened(str(CLIP) if name == 0 else name, *options)

    def read(self):
        time.sleep(self._wait_s)
        self._left -= 1
        return self._capture.read() if self._left >= 0 else (False, None)

    def __getattr__(self, name):
        return getattr(self._capture, name)


def test_they_run(tmp_path, monkeypatch, lmmap):
    """The lens that the clip gives is the one that it was traced with."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(CLIP, tmp_path / "clip.mp4")
    monkeypatch.setattr(webcam.cv2, "VideoCapture", Camera0)
    said = [lmmap(*shlex.split(command)[1:]) for command in COMMANDS]
    assert [code for code, _, _ in said] == [0, 0, 0], said
    assert (tmp_path / "port.pdf").exists()
    _, out, err = said[1]
    assert " ok " in out and "60 degrees" in err and "http://127.0.0.1:" in err
    found, true = (
        Camera.load(path) for path in (tmp_path / "clip.camera.json", CLIP.with_suffix(".camera.json"))
    )
    assert abs(found.fx_px / true.fx_px - 1) < 0.03
