"""From a recording to networks of its own: what is written, what a killed run does, what must not teach."""

import json
from contextlib import nullcontext
from dataclasses import replace
from shutil import copytree

import moving
import numpy as np
import places
import pytest
from strategies import PORT, line

from lmmap.estimation.estimates import estimate
from lmmap.evaluation.error_table import errors, is_wrong
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.weights import BEFORE, FILTERS, load_filter, weight_path
from lmmap.settings import OURS
from lmmap.types import Recording
from lmmap_lab.adaptation import adapt as adapting
from lmmap_lab.adaptation import learning, self_labels
from lmmap_lab.training import batches

STEPS = 80
FIRST = "slim"  # a quarter of the other sets' arithmetic
NAMES = [weight_path(name, "rgb", "low").name for name in FILTERS]


def adapt(recording, folder, **options):
    options = {"weights": FIRST, "steps": STEPS, "report": lambda line: None} | options
    return adapting.adapt(recording, folder, ("rgb",), **options)["rgb"]


def right_and_wrong(recording: Recording, weights, port=PORT) -> tuple[int, int]:
    estimator = Estimator(recording.camera, port, "rgb", weights)
    table = errors(recording, list(estimate(recording, estimator)), port)
    wrong = is_wrong(table)
    return int((table.position_error_m.notna() & ~wrong).sum()), int(wrong.sum())


@pytest.fixture(scope="module", autouse=True)
def small_batches():
    """Crops that are learned from in seconds."""
    original = learning.recipe_for
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(learning, "recipe_for",
                      lambda *facts: replace(original(*facts), batch=4, crop_px=64, rate=1e-3))  # fmt: skip
        yield


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    """The folder of networks that learned the place, and what became of them."""
    folder = tmp_path_factory.mktemp("learned")
    return folder, adapt(places.recording(), folder)


def same_networks(folder) -> bool:
    """Whether a folder holds the shipped networks."""
    pairs = [(folder / name, weight_path(f, "rgb", FIRST)) for f, name in zip(FILTERS, NAMES, strict=True)]
    both = [[load_filter(path, "rgb").state_dict() for path in pair] for pair in pairs]
    return all((new[k] == old[k]).all() for new, old in both for k in old)


def test_networks_that_learned_find_more_and_nothing_wrong(learned):
    folder, outcome = learned
    assert outcome.taken and not same_networks(folder)
    before, after = (right_and_wrong(places.recording(), weights) for weights in (FIRST, folder))
    assert after[0] > before[0] and after[1] <= before[1]


def test_a_sure_pose_stays(learned):
    old, both = (Estimator(places.CAMERA, PORT, "rgb", weights) for weights in (FIRST, learned[0]))
    before, after = (list(estimate(places.recording(), e)) for e in (old, both))
    assert both.learned and not old.learned
    added = [b.T_cam_port is None and a.T_cam_port is not None for b, a in zip(before, after, strict=True)]
    sure = [b.T_cam_port is not None and b.confidence >= OURS.sure_confidence for b in before]
    assert any(added) and any(sure)
    assert all(repr(a) == repr(b) for kept, a, b in zip(sure, after, before, strict=True) if kept)
    assert min(a.confidence for more, a in zip(added, after, strict=True) if more) >= self_labels.SURE


def test_cards_say_what_networks_were_made_of_and_the_limit_holds(learned, tmp_path):
    folder = copytree(learned[0], tmp_path / "learned")
    card = json.loads((folder / NAMES[0]).with_suffix(".json").read_text())
    assert card["adapted"] and card["labels"] >= self_labels.LEAST_LABELS == len(card["confidences"][:8])
    assert card["made_of"]["recording"]["name"] == "place" and card["made_of"]["steps"] == STEPS
    assert not (folder / adapting.UNFINISHED).exists()
    path = (folder / NAMES[0]).with_suffix(".json")
    path.write_text(json.dumps(card | {"min_confidence": 0.97}))
    assert Estimator(places.CAMERA, weights=folder).learned.settings.min_confidence["rgb"] == 0.97
    for bad in ("0.9", True, 1.7, 3, float("nan")):
        path.write_text(json.dumps(card | {"min_confidence": bad}))
        assert "min_confidence" in line(Estimator, places.CAMERA, None, "rgb", folder)


def test_the_same_call_again_does_nothing_and_another_is_refused(learned, monkeypatch):
    folder, outcome = learned
    monkeypatch.setattr(self_labels, "look_at", None)
    assert adapt(places.recording(), folder) == outcome
    assert "another seed" in line(lambda: adapt(places.recording(), folder, seed=1))


def test_networks_that_go_on_learning_keep_the_first_ones(learned, tmp_path):
    adapt(places.recording(port=False), tmp_path / "none", weights=learned[0])
    adapt(places.recording(), tmp_path / "more", weights=learned[0], steps=20)
    for folder in (tmp_path / "none", tmp_path / "more"):
        assert same_networks(folder / BEFORE)
        both = Estimator(places.CAMERA, PORT, "rgb", folder)
        assert both.learned.settings.min_confidence.rgb >= self_labels.SURE
    assert (tmp_path / "none" / NAMES[0]).read_bytes() == (learned[0] / NAMES[0]).read_bytes()
    before, after = (right_and_wrong(places.recording(), w) for w in (learned[0], tmp_path / "more"))
    assert after[0] >= before[0] and after[1] <= before[1]


def test_a_place_where_all_seems_well_teaches_if_one_asks(tmp_path, monkeypatch):
    monkeypatch.setattr(adapting, "ENOUGH", 1.0)  # any place is such a one
    told = adapt(places.recording(), tmp_path / "asked-nothing")
    assert not told.taken and "--always" in told.why
    told = adapt(places.recording(), tmp_path / "asked", always=True, steps=20)
    assert told.facts["guard"]["images"] and "taught" in told.why


def test_an_interrupted_run_ends_as_an_unbroken_one(learned, tmp_path, monkeypatch):
    class Killed(Exception):
        pass

    original, calls = batches.take_step, []

    def step(*arguments):
        calls.append(arguments)
        if len(calls) == 15:
            raise Killed
        return original(*arguments)

    monkeypatch.setattr(learning, "CHECKPOINT_STEPS", 10)
    monkeypatch.setattr(batches, "take_step", step)
    with pytest.raises(Killed):
        adapt(places.recording(), tmp_path)
    monkeypatch.setattr(self_labels, "estimate_image", None)  # every image is looked at already ...
    with pytest.raises(TypeError):  # ... but by the new networks
        adapt(places.recording(), tmp_path)
    monkeypatch.undo()
    assert adapt(places.recording(), tmp_path) == learned[1]
    assert all((tmp_path / name).read_bytes() == (learned[0] / name).read_bytes() for name in NAMES)


def test_a_place_without_the_port_teaches_nothing(tmp_path):
    outcome = adapt(places.recording(port=False), tmp_path)
    assert not outcome.taken and outcome.why.startswith("0 images can teach") and same_networks(tmp_path)


def test_no_images_are_one_line(tmp_path):
    nothing = replace(
        places.recording(), frames=np.empty((0, 136, 184, 3), np.uint8), frames_t_us=np.empty(0, np.int64)
    )
    assert "holds no images of rgb" in line(lambda: adapt(nothing, tmp_path))


def decoy(patch):
    return places.recording(decoy=True), PORT


def higher_plate(patch):
    return places.recording(), replace(PORT, plate_height_m=1.2 * PORT.plate_height_m)


def wrong_on_purpose(patch):
    original, rng = self_labels.estimate_image, np.random.default_rng(1)

    def lying(estimator, shot):
        image, e = original(estimator, shot)
        if e.T_cam_port is not None and rng.random() < 0.3:
            e = replace(e, T_cam_port=moving.wrong(e.T_cam_port, rng))
        return image, e

    patch.setattr(self_labels, "estimate_image", lying)
    return places.recording(), PORT


@pytest.mark.parametrize("hostile", [decoy, higher_plate, wrong_on_purpose])
def test_what_must_not_teach_makes_no_more_poses_wrong(hostile, tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        recording, port = hostile(patch)
        adapt(recording, tmp_path, port=port)
    said = nullcontext() if port == PORT else pytest.warns(UserWarning, match="measure the port")
    with said:
        before, after = [right_and_wrong(recording, weights, port) for weights in (FIRST, tmp_path)]
    assert after[1] <= before[1] and after[0] >= before[0]
