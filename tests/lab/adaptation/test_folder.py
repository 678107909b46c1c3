"""The folder of `lmmap adapt` is ours, whole and made of one thing, or it is refused; nothing is learned."""

import errno
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import places
import pytest
from strategies import line

from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.weights import BEFORE, network_paths
from lmmap.types import Camera, Estimate, InputError, Status
from lmmap_lab.adaptation import adapt as adapting
from lmmap_lab.adaptation import folder as folders
from lmmap_lab.adaptation.self_labels import Look

RECORDING = places.recording()


def adapt(folder, recording=RECORDING, modalities=("rgb",), **options):
    return adapting.adapt(recording, folder, modalities, report=lambda line: None, **options)


@pytest.fixture(autouse=True)
def nothing_to_learn(monkeypatch):
    """One look, and the old networks as new ones."""
    look = Look(0, np.zeros((1, 1)), Estimate(0, Status.NO_RING))
    monkeypatch.setattr(adapting, "looks_of", lambda *_: [look])
    outcome = folders.Outcome(True, "taught", {"min_confidence": 0.97})
    monkeypatch.setattr(adapting, "learn", lambda *a: (outcome, a[4]))


def content(folder: Path) -> dict[str, bytes | None]:
    """Names below a folder, with what the files hold."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


def put_networks(folder: Path) -> None:
    folder.mkdir()
    for path, name in zip(network_paths("robust", "rgb"), ("ring", "reflector"), strict=True):
        for suffix in (".safetensors", ".json"):
            shutil.copyfile(path.with_suffix(suffix), folder / f"{name}-rgb-low{suffix}")


def with_file(name):
    def make(path: Path) -> None:
        (path / name).parent.mkdir(parents=True)
        (path / name).write_text("mine")

    return make


FOREIGN = {
    "a file below": with_file("unfinished/notes.txt"),
    "a hidden file": with_file(".keep"),
    "a folder before": with_file("before/x"),
    "networks": put_networks,
    "a file": lambda path: path.write_text("mine"),
    "a pipe": os.mkfifo,
}


@pytest.mark.parametrize("kind", FOREIGN)
@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("end", ["", adapting.UNFINISHED])
def test_what_is_not_ours_is_left_alone(tmp_path, kind, linked, end):
    folder = tmp_path / "networks"
    FOREIGN[kind](tmp_path / f"real{end}" if linked else tmp_path / f"networks{end}")
    if linked:
        (tmp_path / f"networks{end}").symlink_to(tmp_path / f"real{end}")
    before = content(tmp_path)
    assert "is not ours to replace" in line(adapt, folder)
    assert content(tmp_path) == before


def test_the_networks_to_begin_with_are_not_replaced(tmp_path):
    put_networks(tmp_path / "mine")
    before = content(tmp_path)
    assert "mine: is not ours to replace" in line(lambda: adapt(tmp_path / "mine", weights=tmp_path / "mine"))
    assert content(tmp_path) == before


def test_an_empty_folder_is_filled_and_a_link_to_it_stays(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    assert adapt(tmp_path / "link")["rgb"].taken and (tmp_path / "link").is_symlink()
    assert {p.name for p in tmp_path.iterdir()} == {"real", "link"}
    assert adapt(tmp_path / "real")["rgb"].taken


def damages(path: Path):
    whole = path.read_bytes()
    yield "removed", path.unlink
    yield "emptied", lambda: path.write_bytes(b"")
    yield "cut", lambda: path.write_bytes(whole[:-2])
    yield "a bit", lambda: path.write_bytes(whole[:50] + bytes([whole[50] ^ 1]) + whole[51:])
    yield "a pipe", lambda: (path.unlink(), os.mkfifo(path))
    yield "endless", lambda: (path.unlink(), path.symlink_to("/proc/kmsg"))


def test_a_folder_that_is_no_longer_whole_is_refused(tmp_path):
    folder = tmp_path / "networks"
    adapt(folder)
    whole = content(folder)
    names = [name for name, data in whole.items() if data is not None]
    assert len(names) == 9  # two networks and cards, the same from before, and the list
    for name in names:
        for how, damage in damages(folder / name):
            damage()
            said = line(adapt, folder)
            assert name in said or (name == folders.MADE_OF and "networks" in said), (name, how)
            (folder / name).unlink(missing_ok=True)
            (folder / name).write_bytes(whole[name])
    assert adapt(folder)["rgb"].taken


def test_networks_that_have_learned_are_not_used_without_those_from_before(tmp_path):
    adapt(tmp_path / "networks")
    adapt(tmp_path / "more", weights=tmp_path / "networks")
    for folder in (tmp_path / "networks", tmp_path / "more"):
        shutil.rmtree(folder / BEFORE)
        assert "no networks from before" in line(Estimator, places.CAMERA, None, "rgb", folder)


@pytest.mark.parametrize(
    "text", ["", "null", "[]", "{}", "[" * 10**5, '{"made_of": {}, "outcomes": {}, "files": []}', "\ud800",
             '{"made_of": {}, "outcomes": {"rgb": {"taken": true}}, "files": {}}']
)  # fmt: skip
def test_any_text_in_place_of_the_list(tmp_path, text):
    adapt(tmp_path / "networks")
    (tmp_path / "networks" / folders.MADE_OF).write_bytes(text.encode("utf-8", "surrogatepass"))
    assert folders.MADE_OF in line(adapt, tmp_path / "networks")


def other_frames():
    frames = RECORDING.frames.copy()
    frames[-1, 0, 0, 0] ^= 1
    return replace(RECORDING, frames=frames)


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"seed": 1}, "seed"),
        ({"steps": 7, "seconds": 3.0}, "seconds and steps"),
        ({"recording": other_frames()}, "recording"),  # of the same name
        ({"recording": replace(RECORDING, frames_t_us=RECORDING.frames_t_us + 1)}, "recording"),
    ],
)
def test_what_another_call_would_make_is_refused_by_its_name(tmp_path, changed, name):
    adapt(tmp_path / "networks")
    said = line(lambda: adapt(tmp_path / "networks", **changed))
    assert f"was made with another {name}; give the same recording and settings, or another name" in said


def test_a_second_call_at_the_same_time_is_refused(tmp_path, monkeypatch):
    learn = adapting.learn

    def twice(*arguments):
        with pytest.raises(InputError, match="networks: another process writes it"):
            adapt(tmp_path / "networks")
        return learn(*arguments)

    monkeypatch.setattr(adapting, "learn", twice)
    assert adapt(tmp_path / "networks")["rgb"].taken


def test_a_disk_that_is_full_when_the_old_networks_are_copied(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(shutil, "copyfile", full)
        assert "networks: cannot write (No space left" in line(adapt, tmp_path / "networks")
    assert [p.name for p in tmp_path.iterdir()] == [f"networks{adapting.UNFINISHED}"]
    assert adapt(tmp_path / "networks")["rgb"].taken and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(("options", "said"), [({"seed": -1}, "--seed -1: "), ({"steps": 0}, "--steps 0: ")])
def test_what_cannot_be_learned_is_refused_before_the_work(tmp_path, monkeypatch, options, said):
    monkeypatch.setattr(adapting, "looks_of", None)
    assert said in line(lambda: adapt(tmp_path / "networks", **options))
    assert not list(tmp_path.iterdir())


def test_a_recording_without_images_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(adapting, "looks_of", lambda *_: [])
    assert "holds no images" in line(adapt, tmp_path / "networks")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("size_px", "crop_px"), [((64, 48), 48), ((346, 260), 96), ((95, 200), 95)])
def test_crops_fit_into_small_sensors(size_px, crop_px):
    camera = Camera(*size_px, 324.0, 324.0, size_px[0] / 2, size_px[1] / 2)
    estimator = Estimator(camera, None, "event", "robust")
    assert {r.crop_px for r in adapting._recipes(estimator, 3, 0, "x")} == {crop_px}
