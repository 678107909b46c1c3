"""The cases of the attack suite: which commands read a file, and what is done to the file before."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import attack_rig
import numpy as np
from attack_directed import directed_files
from attack_mutations import mutated
from attack_sound import sound_files

OF_FOLDERS = ("weights", "card", "rig.json", "hand-eye.yaml")  # what is read with the files beside it


class Case(NamedTuple):
    """A command's name, the format that it is attacked with, what is done to it, and its arguments."""

    command: str
    format: str
    attack: str
    argv: list[str]


def commands(path: Path, kind: str, folder: Path, sound: dict[str, Path]) -> dict[str, list[str]]:
    """Every command that reads a file of a kind, by its name."""
    out, recording_path = folder / "out", sound[".h5"]
    fast = ["--modality", "event", "--rate", "2", "--events", "500"]

    def estimate(recording: Path, *extra: str) -> list[str]:
        return ["estimate", str(recording), *extra, "-o", f"{out}.csv", "--overwrite"]

    if kind.startswith(("camera", "camchain")):
        return {"info": ["info", str(recording_path), "--camera", str(path)]}
    if kind == "port.json":
        return {"estimate": estimate(recording_path, *fast, "--port", str(path))}
    if kind in ("weights", "card"):
        return {"estimate": estimate(recording_path, *fast, "--weights", str(path.parent))}
    if kind.startswith("truth"):
        truth = str(sound["truth.csv"])
        return {
            "evaluate": ["evaluate", str(recording_path), "--truth", str(path), "--modality", "rgb"],
            "score": ["odometry", "score", str(path), "--reference", truth],
            "score against": ["odometry", "score", truth, "--reference", str(path)],
        }
    calibrate = ["calibrate", "-o", f"{out}.json", "--overwrite", "--rate", "20"]
    if kind == "hand-eye.yaml":
        return {
            "calibrate": [*calibrate, str(sound["rig.bag"]), "--hand-eye", str(path)],
            "dataset": ["dataset", "check", str(path.parent)],
        }
    if kind == "rig.json":
        bag = str(path.with_name(sound["rig.bag"].name))
        return {"evaluate": ["evaluate", bag, "--modality", "rgb", "--rate", "2"]}
    rig_camera = sound["rig.bag"].with_suffix(".camera.json")
    camera = ["--camera", str(rig_camera if kind == "rig.bag" else sound["camera.json"])]
    if kind == "numbered":
        camera += ["--fps", "2"]
    every = {
        "info": ["info", str(path), *camera],
        "estimate": estimate(path, *camera, *fast),
        "estimate rgb": [
            "estimate",
            str(path),
            *camera,
            "--modality",
            "rgb",
            "-o",
            f"{out}.tum",
            "--overwrite",
        ],
        "evaluate": ["evaluate", str(path), *camera, *fast, "--truth", str(sound["truth.csv"])],
        "export": ["odometry", "export", str(path), f"{out}-folder", *camera, "--overwrite"],
        "live": ["live", str(path), *camera, "--modality", "event", "--events", "500", "--seconds", "0.5"],
    }
    if kind.endswith("bag"):
        hand_eye = ["--hand-eye", str(sound["hand-eye.yaml"])]
        every["calibrate"] = [*calibrate, str(path), *camera, *hand_eye]
        every["dataset"] = ["dataset", "check", str(path.parent)]
    return every


def every_sound_file(folder: Path, rng) -> dict[str, Path]:
    """`sound_files`, and those of a laboratory."""
    recordings = sound_files(folder, rng)
    return attack_rig.write(folder, rng) | recordings


def cases(
    count: int,
    seed: int,
    folder: Path,
    directed: bool = True,
    formats: tuple[str, ...] = (),
    only: tuple[str, ...] = (),
) -> Iterator[Case]:
    """Yield the directed attacks and then mutated files, up to ``count``; each is written for its case.

    ``formats`` are those to mutate, and ``only`` the commands to run, all by default.
    """
    rng = np.random.default_rng(seed)
    for name in ("sound", "directed", "mutated"):
        (folder / name).mkdir()
    sound = every_sound_file(folder / "sound", rng)
    yielded = 0
    for name, path in (directed_files(folder / "directed") if directed else {}).items():
        kind = path.suffix or "folder"
        for which, argv in commands(path, kind, folder, sound).items():
            if which != "dataset" and which in (only or {which}) and yielded < count:
                yielded += 1
                yield Case(which, kind, f"directed: {name}", argv)
    kinds = sorted(formats or sound)
    while yielded < count:
        kind = kinds[rng.integers(len(kinds))]
        attack, target = _mutate(kind, sound[kind], folder / "mutated", rng)
        every = commands(target, kind, folder, sound)
        names = sorted({*only} & {*every} or every)
        which = names[rng.integers(len(names))]
        yielded += 1
        yield Case(which, kind, attack, every[which])


def _mutate(kind: str, path: Path, folder: Path, rng) -> tuple[str, Path]:
    """What was done, and the damaged copy; where a file belongs to a folder, the folder is copied."""
    whole = path if path.is_dir() else path.parent if kind in OF_FOLDERS else None
    if whole is not None:
        shutil.rmtree(folder / whole.name, ignore_errors=True)
        shutil.copytree(whole, folder / whole.name)
    target = folder / path.relative_to(whole.parent) if whole else folder / path.name
    damaged = target
    if path.is_dir():
        inside = sorted(target.iterdir())
        damaged = inside[rng.integers(len(inside))]
    source = path / damaged.name if path.is_dir() else path
    is_text = source.suffix in (".txt", ".csv", ".tum", ".json", ".yaml")
    attack, content = mutated(source.read_bytes(), rng, is_text)
    damaged.write_bytes(content)
    return attack + (f" in {damaged.name}" if path.is_dir() else ""), target
