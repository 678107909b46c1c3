"""Networks that have learned are asked only where those from before have no sure pose."""

import shutil
from argparse import Namespace
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from strategies import CAMERA, PORT, pose

from lmmap.cli.inputs import make_estimator
from lmmap.geometry.port import ideal_masks
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.looks import look_again
from lmmap.pipeline.weights import BEFORE, FILTERS, weight_hashes, weight_path
from lmmap.settings import OURS, PerCamera
from lmmap.tracking.crop import expected_ring
from lmmap.tracking.motion_model import MotionState
from lmmap.types import Estimate, Status

MASKS = ideal_masks(pose((180, 120), 0.6, 0.5, 0.8), PORT, CAMERA)
OTHER = ideal_masks(pose((150, 130), 0.7, 0.4, 2.0), PORT, CAMERA)
TRUE, OFF = pose((180, 120), 0.6, 0.5, 0.8), pose((180, 120), 0.6, 0.7, 0.8)
NOTHING, NONE = np.zeros_like(MASKS[0]), Estimate(7, Status.NO_MARKERS)
IMAGE = np.zeros((CAMERA.height_px, CAMERA.width_px, 3), np.uint8)
EVERY_POSE = replace(OURS, min_confidence=PerCamera(0.0, 0.0), sure_confidence=0.0)  # the image is blank


def networks(ring, markers):
    return {"ring_network": lambda image: ring, "reflector_network": lambda image: markers}


@pytest.fixture
def folder(tmp_path):
    """Networks of frames that have learned, and those from before; of events those from before alone."""
    for target, gap, cameras in ((tmp_path / BEFORE, "robust", ["rgb"]), (tmp_path, "low", ["rgb", "event"])):
        target.mkdir(exist_ok=True)
        for name, camera in product(FILTERS, cameras):
            for ending in (".safetensors", ".json"):
                own = weight_path(name, camera, "low").with_suffix(ending).name
                shutil.copyfile(weight_path(name, camera, gap).with_suffix(ending), target / own)
    return tmp_path


@pytest.mark.parametrize("first, second, answer", [
    (MASKS, OTHER, MASKS), (MASKS, (NOTHING, NOTHING), MASKS), ((NOTHING, NOTHING), OTHER, OTHER),
    ((MASKS[0], NOTHING), OTHER, OTHER), ((MASKS[0], NOTHING), (NOTHING, NOTHING), (MASKS[0], NOTHING)),
])  # fmt: skip
def test_the_answer_is_the_first_that_has_a_pose(folder, first, second, answer):
    both = Estimator(CAMERA, PORT, "rgb", folder, EVERY_POSE)
    vars(both).update(networks(*first))
    vars(both.learned).update(networks(*second))
    alone = Estimator(CAMERA, PORT, "rgb", tuple(networks(*answer).values()), EVERY_POSE)(IMAGE, 7)
    told = both(IMAGE, 7)
    assert told.status == alone.status != Status.NO_RING and told.t_us == 7
    if alone.T_cam_port is not None:
        assert np.array_equal(told.T_cam_port.rotation, alone.T_cam_port.rotation)
        assert np.array_equal(told.T_cam_port.position_m, alone.T_cam_port.position_m)


@pytest.fixture
def both(folder):
    """What becomes of an estimator's answer by that of its networks that have learned, and whether they were
    not asked."""

    def answer(first, second):
        estimator, told = Estimator(CAMERA, PORT, "rgb", folder), [second]
        estimator.learned.settings = replace(estimator.learned.settings, min_confidence=PerCamera(0.9, 0.9))
        opinion = next(look for look in estimator.further if look.expected)
        estimator.further = [opinion._replace(see=lambda *_: told.pop())]
        return look_again(estimator, first, IMAGE, 7, None, None), bool(told)

    return answer


def estimate(T, confidence):
    return Estimate(7, Status.OK, T).judged(confidence, 0.5)


def test_a_sure_pose_is_not_asked_about(both):
    sure = estimate(TRUE, OURS.sure_confidence)
    assert both(sure, estimate(OFF, 1.0)) == (sure, True)


@pytest.mark.parametrize("second, pose, reported", [
    ((TRUE, 0.9), TRUE, True), ((TRUE, 0.6), TRUE, True), ((OFF, 0.6), TRUE, True),
    ((OFF, 0.78), TRUE, False), ((OFF, 0.9), OFF, False), ((OFF, 0.999), OFF, True),
])  # fmt: skip
def test_a_pose_in_doubt_is_confirmed_contradicted_or_replaced(both, second, pose, reported):
    told, unasked = both(estimate(TRUE, 0.8), estimate(*second))
    assert not unasked and told.found is pose
    assert (told.T_cam_port is not None) == reported
    assert (told.confidence >= max(0.8, second[1])) == (second[0] is TRUE)


def test_what_an_estimator_would_not_report_contradicts_nothing(both):
    doubted = estimate(TRUE, 0.6)
    assert both(doubted, estimate(OFF, 0.49))[0] is doubted
    assert both(doubted, estimate(OFF, 0.5))[0].T_cam_port is None


def test_only_a_folder_that_keeps_networks_from_before_has_a_second_opinion(folder, monkeypatch):
    assert Estimator(CAMERA, PORT, "rgb", folder).learned is not None
    assert Estimator(CAMERA, PORT, "event", folder).learned is None
    assert Estimator(CAMERA, PORT, "rgb", tuple(networks(*MASKS).values())).learned is None
    marks = weight_hashes(folder, "rgb")
    assert [Path(name).parent.name for name in marks] == [""] * 2 + [BEFORE] * 2
    changed = folder / list(marks)[-1]
    changed.write_bytes(changed.read_bytes() + b" ")
    now = weight_hashes(folder, "rgb")
    assert [name for name in marks if now[name] != marks[name]] == [f"{BEFORE}/{changed.name}"]
    assert len(weight_hashes(folder, "event")) == 2
    (folder / BEFORE).rename(folder / "low")
    monkeypatch.chdir(folder)  # a set of networks is meant, whatever lies here
    (folder / "low" / BEFORE).mkdir()
    shutil.copy(folder / "low" / weight_path("ring", "rgb", "low").name, folder / "low" / BEFORE)
    assert Estimator(CAMERA, PORT, "rgb", "low").learned is None


def test_the_command_line_asks_both(folder):
    asked = {"modality": "event", "rate": None, "events": None, "port": None}
    a = Namespace(weights=folder, recording=folder / "run.h5", **asked)
    assert make_estimator(a, CAMERA, "rgb").learned is not None


def test_where_a_ring_is_expected_only_those_that_learned_are_asked_again(folder):
    """A second opinion, and neither a turned nor an enlarged image nor one of more events."""
    estimator, seen = Estimator(CAMERA, PORT, "rgb", folder), []
    estimator.further = [
        look._replace(see=lambda *shot: seen.append(shot) or NONE) for look in estimator.further
    ]
    assert len(estimator.further) == 2  # the turned one
    near = expected_ring(MotionState.start(0, TRUE, 1e-6 * np.eye(6)), estimator.setup)
    assert look_again(estimator, NONE, IMAGE, 7, near, None) is NONE and seen == [(IMAGE, 7, near)]
