"""The page on other runtimes: its commands and its program run as they are printed, and give our poses."""

import re
import shlex

import cv2
import drawn
import numpy as np
import pytest
from test_book import BOOK

import lmmap
from lmmap.cli import main
from lmmap.estimation.images import images
from lmmap.pipeline.weights import load_network, weight_path
from lmmap.types import Status

PAGE = BOOK / "models.md"


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """What the program leaves behind, in a folder with the picture and the calibration that it names."""
    place, r = tmp_path_factory.mktemp("hardware"), drawn.recording(4)
    r.camera.save(place / "camera.json")
    cv2.imwrite(str(place / "picture.png"), r.frames[0][..., ::-1])
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(place)
        (commands,) = re.findall(r"```bash\n(.*?)```", PAGE.read_text(), re.S)
        for line in commands.splitlines():
            program, *arguments = shlex.split(line)
            assert program == "lmmap" and main.main(arguments) == 0
        (block,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)
        exec(compile(block, PAGE.name, "exec"), found := {})
        yield found


def test_the_program_finds_the_pose_that_the_package_finds(names):
    known = lmmap.Estimator("camera.json", modality="rgb", precision="float32")(names["image"])
    assert names["estimate"].status == known.status == Status.OK
    np.testing.assert_allclose(
        names["estimate"].T_cam_port.position_m, known.T_cam_port.position_m, atol=1e-5
    )
    np.testing.assert_allclose(names["estimate"].T_cam_port.rotation, known.T_cam_port.rotation, atol=1e-4)


def test_its_function_takes_histograms_as_well(names):
    _, image = next(images(drawn.recording(4), "event"))
    ours = load_network(weight_path("ring", "event", "robust"), "event", "float32")
    np.testing.assert_allclose(names["network"]("onnx/ring-event.onnx")(image), ours(image), atol=1e-4)
