"""The folder that ``lmmap adapt`` makes: networks, those from before, and what they were made of."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from lmmap.documents import read_json
from lmmap.files import read_text, regular_file
from lmmap.marks import check_same
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import FilterNet
from lmmap.pipeline.weights import (
    FILTERS,
    MAX_BYTES,
    load_card,
    network_paths,
    save_weights,
    weight_hashes,
    weight_path,
)
from lmmap.recordings.journal import recording_mark
from lmmap.recordings.stream import Stream
from lmmap.types import AnyRecording, InputError

from . import learning, self_labels

MADE_OF = "made-of.json"


@dataclass(frozen=True)
class Outcome:
    """What became of one camera's networks.

    Attributes
    ----------
    taken
        Whether new ones are written, or those that were there before.
    why
        Why, in a line.
    facts
        What their cards say of labels and guard; ``min_confidence`` is the limit of new ones.
    """

    taken: bool
    why: str
    facts: dict = field(default_factory=dict)


def copy_networks(weights, modality: str, folder: Path) -> None:
    """A camera's networks and their cards, into a folder of such."""
    folder.mkdir(exist_ok=True)
    for name, path in zip(FILTERS, network_paths(weights, modality), strict=True):
        copy = folder / weight_path(name, modality, "low").name
        shutil.copyfile(path, copy)
        shutil.copyfile(path.with_suffix(".json"), copy.with_suffix(".json"))


def write_networks(folder: Path, nets: list[FilterNet], recipes, outcome: Outcome, facts: dict,
                   old: Sequence[Path]) -> None:  # fmt: skip
    """A camera's networks with their cards; ``old`` are the files of those from before."""
    for recipe, net, path in zip(recipes, nets, old, strict=True):
        card = {"recipe": asdict(recipe)} if outcome.taken else load_card(path)
        learned = outcome.taken or card.get("adapted", False)
        card |= {"made_of": facts, "adapted": learned, "why": outcome.why, **outcome.facts}
        save_weights(net, folder / weight_path(recipe.filter, recipe.modality, "low").name, card)


def made_of(recording, estimators: Mapping[str, Estimator], weights, seconds, steps: int, seed: int,
            always: bool) -> dict:  # fmt: skip
    """All that the networks depend on, as JSON has it."""
    first = next(iter(estimators.values()))
    how = {"steps": steps, "seed": seed, "rate": learning.RATE, "learned": learning.LEARNED,
           "labels": self_labels.MOST_LABELS, **({"always": True} if always else {})}  # fmt: skip
    if isinstance(recording, Stream):
        mark, how["flips"] = recording_mark(recording.source.path), dict(recording.flips)
    else:
        mark = {"name": recording.name, "sha256": _content_hash(recording)}
    base = {name: hashed for m in estimators for name, hashed in weight_hashes(weights, m).items()}
    facts = {"recording": mark, "seconds": seconds, "base": base, **how,
             "camera": asdict(first.camera), "port": asdict(first.port),
             "settings": asdict(first.settings)}  # fmt: skip
    return json.loads(json.dumps(facts))


def _digest(kept: dict) -> str:
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


def _sha256(path: Path) -> str:
    return hashlib.sha256(regular_file(path, MAX_BYTES).read_bytes()).hexdigest()


def _content_hash(recording: AnyRecording) -> str:
    """The hash of a recording's events, frames and times."""
    digest = hashlib.sha256()
    for chunk in recording.chunks():
        digest.update(np.ascontiguousarray(chunk).data)
    for t_us, frame in recording.timed_frames():
        digest.update(f"{t_us} {frame.shape}".encode())
        digest.update(np.ascontiguousarray(frame).data)
    return digest.hexdigest()


def write_made_of(folder: Path, facts: dict, outcomes: Mapping[str, Outcome]) -> None:
    """Write `MADE_OF`: what the networks depend on, what became of them, and the hash of each file."""
    files = {str(path.relative_to(folder)): _sha256(path) for path in sorted(folder.rglob("*.*"))}
    kept = {"made_of": facts, "outcomes": {m: asdict(o) for m, o in outcomes.items()}, "files": files}
    kept = json.loads(json.dumps(kept))
    (folder / MADE_OF).write_text(json.dumps(kept | {"sha256": _digest(kept)}, indent=1) + "\n")


def finished(folder: Path, facts: dict) -> dict[str, Outcome] | None:
    """What became of the networks in a finished folder; None where there is none, or an empty one.

    Raises
    ------
    InputError
        If it is not ours, not whole, or made of something else.
    """
    if not os.path.lexists(folder) or (folder.is_dir() and not any(folder.iterdir())):
        return None
    if not os.path.lexists(folder / MADE_OF):
        raise InputError(
            f"{folder}: is not ours to replace; give the name of a new folder, or of an empty one"
        )
    kept = check_whole(folder)
    check_same(folder, kept["made_of"], facts)
    return {m: Outcome(**outcome) for m, outcome in kept["outcomes"].items()}


def check_whole(folder: Path) -> dict:
    """What `MADE_OF` in a finished folder says; `InputError` unless the folder's files are those it lists."""
    try:
        kept = read_json(read_text(folder / MADE_OF, MAX_BYTES))
        if kept.pop("sha256") != _digest(kept):
            raise ValueError("its hash is another")
    except (ValueError, TypeError, AttributeError, LookupError):
        remedy = "delete the folder, or give another one"
        raise InputError(f"{folder / MADE_OF}: damaged, or of another version; {remedy}") from None
    for name, expected in kept["files"].items():
        if _sha256(folder / name) != expected:
            raise InputError(f"{folder / name}: has changed; restore it, or delete the folder")
    return kept
