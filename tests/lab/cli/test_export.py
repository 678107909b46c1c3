"""`lmmap export`: the folder holds what an integrator needs, and what cannot be exported is one line."""

import hashlib
import importlib
import inspect
import json
import re
import shutil
import sys
from dataclasses import replace

import drawn
import onnxruntime
import pytest

from lmmap.cli import main
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.histograms import histogram
from lmmap.pipeline.joint_network import apart
from lmmap.pipeline.network import FilterNet
from lmmap.pipeline.weights import BEFORE, FILTERS, save_weights, weight_path
from lmmap.settings import OURS
from lmmap.types import Port
from lmmap_lab.cli.export import DOCUMENT, STEPS

NAMES = {f"{part}-{camera}.onnx" for part in ("ring", "reflector") for camera in ("rgb", "event")}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "onnx"
    assert main.main(["export", "low", "-o", str(path)]) == 0
    return path


def test_every_network_is_there_and_the_document_says_what_else_is_needed(folder):
    assert {p.name for p in folder.iterdir()} == NAMES | {DOCUMENT}
    told = json.loads((folder / DOCUMENT).read_text())
    assert told["networks"].keys() == NAMES
    for name, facts in told["networks"].items():
        assert facts["sha256"] == hashlib.sha256((folder / name).read_bytes()).hexdigest()
        meta = onnxruntime.InferenceSession(folder / name).get_modelmeta().custom_metadata_map
        assert facts["image"] == meta["image"] and facts["mask"] == meta["mask"] and meta["weights"] == "low"
        assert float(meta["mask_threshold"]) == told["settings"]["mask_threshold"] == OURS.mask_threshold
        assert float(meta["trained_focal_px"]) == told["settings"]["trained_focal_px"]
    assert (
        Port(**{k: tuple(v) if isinstance(v, list) else v for k, v in told["port"].items()}) == Port.lm_map()
    )


def test_the_steps_are_the_estimators_in_its_order(folder):
    steps = [step["function"] for step in json.loads((folder / DOCUMENT).read_text())["steps"]]
    assert steps == list(STEPS)
    modules = [
        (importlib.import_module(module), name) for module, _, name in (s.partition(":") for s in steps)
    ]
    codes, called = [inspect.unwrap(getattr(module, name)).__code__ for module, name in modules], []
    r = drawn.recording(4)
    longer = replace(r.camera, fx_px=2 * r.camera.fx_px, fy_px=2 * r.camera.fy_px)
    estimator, e = Estimator(longer, modality="event"), r.events[: OURS.events_per_window]
    sys.setprofile(lambda frame, event, _: event == "call" and called.append(frame.f_code))
    try:
        image = histogram(e["x"], e["y"], r.camera.size_px)
        answer = estimator(image)
    finally:
        sys.setprofile(None)
    assert answer.found is not None
    assert sorted(codes, key=called.index) == codes


def test_the_same_weights_give_the_same_bytes(folder, tmp_path, lmmap):
    assert lmmap("export", "low", "-o", tmp_path / "again")[0] == 0
    assert all((tmp_path / "again" / p.name).read_bytes() == p.read_bytes() for p in folder.iterdir())


def test_a_folder_of_weights_may_be_of_one_camera(tmp_path, lmmap):
    (tmp_path / "own").mkdir()
    for name in ("ring", "reflector"):
        path = weight_path(name, "event", "high")
        for suffix in (".safetensors", ".json"):
            shutil.copy(path.with_suffix(suffix), tmp_path / "own" / f"{name}-event-low{suffix}")
    code, out, _ = lmmap("export", tmp_path / "own", "-o", tmp_path / "onnx")
    assert code == 0 and "ring-event.onnx, reflector-event.onnx" in out
    assert {p.name for p in (tmp_path / "onnx").iterdir()} == {n for n in NAMES if "event" in n} | {DOCUMENT}


def test_a_joint_network_is_one_file_with_both_masks(tmp_path, lmmap):
    (tmp_path / "own").mkdir()
    pair = apart(FilterNet(3, (0.5, 0.5), (4, 6, 8)), "rgb")
    for name, net in zip(FILTERS, pair, strict=True):
        save_weights(net, tmp_path / "own" / weight_path(name, "rgb", "low").name, {"min_confidence": 0.0})
    code, out, err = lmmap("export", tmp_path / "own", "-o", tmp_path / "onnx")
    assert (code, err) == (0, "") and "both-rgb.onnx" in out
    (mask,) = onnxruntime.InferenceSession(tmp_path / "onnx" / "both-rgb.onnx").get_outputs()
    assert mask.shape == ["N", 2, "H", "W"]


def test_bad_input_is_one_line_and_makes_no_folder(folder, tmp_path, lmmap):
    (tmp_path / "empty").mkdir()
    before, estimate = set(tmp_path.iterdir()), ("estimate", drawn.file(4), "--modality", "rgb")
    for words, answer in (
        (("export", "nonsense", "-o", tmp_path / "x"), "nonsense: no readable weights.*high, low"),
        (
            ("export", tmp_path / "empty", "-o", tmp_path / "x"),
            "ring-rgb-low.safetensors: no readable weights",
        ),
        (("export", "low", "-o", tmp_path / "empty"), "empty: exists; give the name of a folder to make"),
        (("export", "low", "-o", tmp_path / "no" / "x"), "no folder .*no; make it first"),
        (("export", folder, "-o", tmp_path / "x"), "holds networks in ONNX; name the weights"),
        (
            (*estimate, "--weights", folder, "-o", tmp_path / "p.csv"),
            "holds networks in ONNX; name the weights",
        ),
    ):
        code, out, err = lmmap(*words)
        assert code == 1 and out == "" and err.count("\n") == 1
        assert re.search(answer, err), err
    assert set(tmp_path.iterdir()) == before


def test_without_onnx_it_says_what_to_install(tmp_path, lmmap, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    code, out, err = lmmap("export", "low", "-o", tmp_path / "x")
    assert (code, out) == (1, "") and err == "lmmap: export: no package onnx; pip install 'lmmap[export]'\n"


def test_networks_that_have_learned_go_with_those_from_before_and_their_own_limit(tmp_path, lmmap):
    own = tmp_path / "own"
    for folder, more in ((own, {"adapted": True, "min_confidence": 0.97}), (own / BEFORE, {})):
        folder.mkdir()
        for name in ("ring", "reflector"):
            path = weight_path(name, "rgb", "low")
            shutil.copy(path, folder / path.name)
            card = json.loads(path.with_suffix(".json").read_text()) | more
            (folder / path.name).with_suffix(".json").write_text(json.dumps(card))
    code, _, err = lmmap("export", own, "-o", tmp_path / "onnx")
    assert code == 0, err
    names = ["ring-rgb.onnx", "reflector-rgb.onnx"]
    told = json.loads((tmp_path / "onnx" / DOCUMENT).read_text())
    assert told["networks"].keys() == {*names, *(f"{BEFORE}-{name}" for name in names)}
    assert told["settings"]["min_confidence"] == vars(OURS.min_confidence)
    both = told["second_opinion"]["rgb"]
    assert both["learned"] == names and both["before"] == [f"before-{name}" for name in names]
    estimator = Estimator(None, None, "rgb", own)
    assert both["min_confidence"] == estimator.learned.settings.min_confidence.rgb == 0.97
    named = set(re.findall(r"\b[a-z]+(?:_[a-z]+)+\b", both["joined"])) - {"second_opinion"}
    assert named <= {*vars(OURS), "second_opinion"}
    module, name = both["joined"].split(": ")[0].split(":")
    assert getattr(importlib.import_module(module), name) in {
        look.join.func for look in estimator.further if look.see is estimator.learned
    }
    for lost in (own / f"ring-rgb-low{suffix}" for suffix in (".safetensors", ".json")):
        lost.rename(tmp_path / "lost")
        assert lmmap("export", own, "-o", tmp_path / "again")[0] == 1 and not (tmp_path / "again").exists()
        (tmp_path / "lost").rename(lost)
    shutil.rmtree(own / BEFORE)
    code, _, err = lmmap("export", own, "-o", tmp_path / "again")
    assert code == 1 and "no networks from before" in err and not (tmp_path / "again").exists()
