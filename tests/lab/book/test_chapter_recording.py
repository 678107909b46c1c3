"""The chapter "Your own recording" runs on the reader's file: here a bag without truth and without a port."""

import re

import matplotlib
import numpy as np
import pytest
from test_book import BOOK, cells

from lmmap.types import EVENT, Camera, Recording
from lmmap_lab.bench.writers import write_recording

matplotlib.use("Agg")


@pytest.mark.parametrize("modality", ["rgb", "event"])
def test_the_file_can_be_swapped(tmp_path, modality, capsys):
    rng, camera = np.random.default_rng(0), Camera(120, 90, 324.0, 324.0, 59.5, 44.5)
    e = np.zeros(30_000, EVENT)
    e["t_us"] = np.sort(rng.integers(0, 600_000, len(e))) + 10**9
    e["x"], e["y"] = rng.integers(0, 120, len(e)), rng.integers(0, 90, len(e))
    frames = rng.integers(0, 60, (6, 90, 120, 3), np.uint8)
    recording = Recording("mine", camera, e, frames, 10**9 + 100_000 * np.arange(6))
    write_recording(recording, tmp_path / "mine.bag")
    code = "\n".join(cells(BOOK / "your-recording.md"))
    code, swaps = re.subn(r"^path, camera, modality = .*", "path, camera, modality = MINE", code, flags=re.M)
    assert swaps == 1
    exec(compile(code, "your-recording.md", "exec"), {"MINE": (tmp_path / "mine.bag", None, modality)})
    capsys.readouterr()
    matplotlib.pyplot.close("all")
