"""The commands of the quickstart run as they are printed, on small files of the names that it uses."""

import re
import shlex

import cv2
import drawn
import pytest
import test_every_format as every
from rosbags.rosbag2 import StoragePlugin

from lmmap.cli import main
from lmmap.recordings.pose_files import read_estimates, read_trajectory, write_trajectory
from lmmap.shipped import ROOT
from lmmap.types import Status

PAGE = (ROOT / "book" / "quickstart.md").read_text()
SECTIONS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE, re.M | re.S))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A drawn recording of 150 ms, under the names of the page."""
    place, r = tmp_path_factory.mktemp("quickstart"), drawn.recording(4)
    r.camera.save(place / "camera.json")
    write_trajectory(r.truth, place / "truth.csv")
    cv2.imwrite(str(place / "picture.png"), r.frames[0][..., ::-1])
    video = cv2.VideoWriter(str(place / "video.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 20, (346, 260))
    for frame in r.frames:
        video.write(frame[..., ::-1])
    video.release()
    every.packets(StoragePlugin.SQLITE3)(place / "bag", r)
    every.EVENTS["evt3.raw"](place / "recording.raw", r)
    return place


def test_every_path_is_on_the_page():
    commands = [len(re.findall(r"```(?:bash|python)", text)) for text in SECTIONS.values()]
    assert next(iter(SECTIONS)) == "Install" and sum(commands) == 5


@pytest.mark.parametrize("title", [t for t, text in SECTIONS.items() if "```bash" in text])
def test_the_commands_of_the_page_run(folder, monkeypatch, capsys, title):
    monkeypatch.chdir(folder)
    (block,) = re.findall(r"```bash\n(.*?)```", SECTIONS[title], re.S)
    for line in block.splitlines():
        program, *arguments = shlex.split(line)
        assert program == "lmmap" and main.main(arguments) == 0, capsys.readouterr().err
        output = folder / arguments[arguments.index("-o") + 1] if "-o" in arguments else None
        if output and output.suffix == ".csv":
            assert Status.OK in {e.status for e in read_estimates(output)}
        elif output:
            assert len(read_trajectory(output)) > 0


def test_the_notebook_of_the_page_runs(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.S)
    names = {}
    exec(compile(block, "quickstart.md", "exec"), names)
    assert names["estimate"].status == Status.OK and names["picture"].ndim == 3
