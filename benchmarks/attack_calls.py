"""Valid calls of every command, with the arguments that the parser lists for it."""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import torch

from lmmap.cli.arguments import parser
from lmmap.files import write_text
from lmmap.pipeline.network import CHANNELS
from lmmap.types import EVENT, Camera, Recording

SMALL = Camera(64, 48, 324.0, 324.0, 31.5, 23.5)
BLANK = np.empty(0, EVENT), np.zeros((1, 48, 64, 3), np.uint8), np.zeros(1, np.int64)

# commands without a line are called with their required arguments, from `VALUES`
LINES = """
info r.h5
info rig/normal__train.bag --camera camchain.yaml --json
info ros2 --camera camera.yaml
info f.txt --time-unit s --camera camera.json
info pictures --camera camera.json
estimate r.h5 --modality rgb -o out.csv
estimate r.aedat4 --modality event --events 200 --rate 20 -o out.tum
estimate r.h5 --modality fused --events 200 --rate 20 -o out.csv
estimate r.h5 --modality fused --track --between 10 --events 200 -o out.csv
estimate r.bag --modality rgb --port port.json -o out.bag
estimate r.h5 --modality rgb --rate 10 -o out.mcap
estimate r.h5 --modality event --events 200 --weights weights --video out.avi -o out.csv
estimate r.h5 --modality rgb --weights adapted -o out.csv
estimate r.h5 --modality rgb --adapt 0.3 -o out.csv
draw r.h5 poses.csv --modality rgb -o out.mp4
draw r.h5 poses.csv --modality rgb -o out.avi
evaluate r.h5 --modality rgb --truth truth.tum --json
evaluate rig/normal__train.bag --rate 2 --modality rgb
live r.h5 --modality rgb --seconds 0.2 -o out.csv
live r.h5 --modality rgb --seconds 0.2 -o out.mcap --json
completion bash
adapt r.h5 --modality rgb --steps 2 -o out
adapt r.h5 --modality rgb --steps 2 --weights adapted -o out
calibrate rig/normal__train.bag --hand-eye rig/hand-eye.yaml --rate 20 -o out.json
calibrate board.bag --camera board.json --board 8x5 -o out.json
calibrate rig/normal__train.bag --port -o out.json
check
dataset
dataset check rig
export weights -o out
odometry export r.h5 out
odometry score truth.tum --reference truth.csv
photometry -o out.json
print -o out.pdf
pictures one --modality rgb -o out
reproduce --profile quick
simulate --sequence realistic-7 --seconds 0.2 --camera small.json -o out.h5
simulate --sequence realistic-7 --seconds 0.2 --camera small.json -o out.bag
simulate --sequence realistic-7 --seconds 0.2 --camera small.json -o out.aedat4
simulate --as-published out --seconds 0.2
train --filter ring --modality event --networks low --steps 1
"""
VALUES = {"recording": "r.h5", "modality": "rgb", "output": "out.csv"}


class Call(NamedTuple):
    """A command's name, its parser's arguments, and the values given to them."""

    name: str
    actions: list[argparse.Action]
    given: list[tuple[argparse.Action, list[str]]]

    def argv(self, *more: tuple[argparse.Action, list[str]]) -> list[str]:
        """The call's words, with the values of ``more`` replacing or joining those given."""
        changed = {id(action) for action, _ in more}
        given = [(a, values) for a, values in self.given if id(a) not in changed] + [*more]
        options = [word for a, values in given if a.option_strings for word in _words(a, values)]
        order = [a.dest for a in self.actions]
        places = sorted((g for g in given if not g[0].option_strings), key=lambda g: order.index(g[0].dest))
        return [*self.name.split(), *(value for _, values in places for value in values), *options]

    def value(self, action: argparse.Action) -> str | None:
        """An argument's first value in the call."""
        return next((values[0] for a, values in self.given if a is action and values), None)

    def action(self, dest: str) -> argparse.Action | None:
        return next((a for a in self.actions if a.dest == dest), None)

    @property
    def output(self) -> str | None:
        """The output that the call names."""
        named = (vs[0] for a, vs in self.given if a.dest in ("output", "folder", "as_published") and vs)
        return next((v for v in named if v.startswith("out")), None)

    @property
    def suffix(self) -> str:
        return Path(self.output or "").suffix


def _words(action, values: list[str]) -> list[str]:
    """An option and its values; a single value is joined to it, since it could look like an option."""
    name = action.option_strings[-1]
    return [f"{name}={values[0]}"] if len(values) == 1 else [name, *values]


def calls() -> list[Call]:
    """Every line of `LINES`, and a minimal call of each remaining command."""
    parsers = dict(_commands(parser(), ""))
    found = [_parsed(shlex.split(line), parsers) for line in LINES.strip().splitlines()]
    lacking = sorted(parsers.keys() - {call.name for call in found})
    return found + [_required(name, _arguments(parsers[name])) for name in lacking]


def _commands(of: argparse.ArgumentParser, name: str) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    below = [a for a in of._actions if isinstance(a, argparse._SubParsersAction)]
    if not below:
        yield name, of
    for action in below:
        for word, each in action.choices.items():
            yield from _commands(each, f"{name} {word}".strip())


def _arguments(of: argparse.ArgumentParser) -> list[argparse.Action]:
    return [a for a in of._actions if not isinstance(a, argparse._HelpAction)]


def _parsed(words: list[str], parsers: dict) -> Call:
    name = next(n for n in (" ".join(words[:2]), words[0]) if n in parsers)
    actions, words = _arguments(parsers[name]), words[len(name.split()) :]
    places, given = [a for a in actions if not a.option_strings], []
    while words:
        word = words.pop(0)
        action = next((a for a in actions if word in a.option_strings), None)
        if action is None:
            given.append((places.pop(0), [word]))
        else:
            given.append((action, [words.pop(0)] if action.nargs != 0 else []))
    return Call(name, actions, given)


def _required(name: str, actions: list[argparse.Action]) -> Call:
    needed = [a for a in actions if a.required]
    return Call(name, actions, [(a, [(a.choices or [VALUES.get(a.dest, "r.h5")])[0]]) for a in needed])


def stub() -> None:
    """Replace what takes minutes by something short, and accept whatever networks learn."""
    from test_accuracy_run import made_up

    from lmmap_lab.adaptation import adapt, guard, learning, self_labels
    from lmmap_lab.bench import photometry, sequences
    from lmmap_lab.cli import authors, bench
    from lmmap_lab.pages import gallery, reference
    from lmmap_lab.rig import standin
    from lmmap_lab.studies import accuracy_run, carry, on_authors_bags
    from lmmap_lab.training import dataset, train

    here = Path("derived")  # of the folder that a command runs in
    bench.DERIVED_DATA = authors.DERIVED_DATA = reference.DERIVED_DATA = here
    on_authors_bags.DERIVED_DATA = here
    reference.BUILD, reference.DATA = Path("_build"), Path("data")
    photometry.calibrate_lamps = lambda _: {"gain": 1.0}
    accuracy_run.sequences_of = lambda _: ["hard-slow", "empty-0"]
    accuracy_run._tabulate = lambda profile, study: write_text(study.derived / profile / "summary.csv", "a")
    accuracy_run.reproduce = partial(
        accuracy_run.reproduce, study=made_up(here, committed=here / "committed")
    )
    gallery.save_sheets = lambda *_: None  # of sequences that are not among these
    carry.carry = lambda report, beside=None: report(f"as beside {beside}")
    os.cpu_count = lambda: 1  # processes of joblib's would outlive ours
    standin.STAND_INS = standin.STAND_INS[:1]
    standin.sequences = SimpleNamespace(simulate=partial(sequences.simulate, camera=SMALL))
    standin.simulate_checkerboard = lambda _: Recording("board", SMALL, *BLANK)
    names = [f"augmented-{i}" for i in range(10)]
    dataset.SETS = dict.fromkeys(dataset.SETS, names)
    train.make_batch = learning.make_batch = lambda samples, recipe, *_: (
        torch.zeros(1, CHANNELS[recipe.modality], 32, 32),
        torch.zeros(1, 1, 32, 32),
    )
    train.weight_path = lambda *_: Path("derived/out.safetensors")
    recipe_for = learning.recipe_for
    learning.recipe_for = lambda *facts: replace(r := recipe_for(*facts), steps=min(r.steps, 2))
    self_labels.LEAST_LABELS, learning.CHECKPOINT_STEPS, adapt.ENOUGH = 1, 1, -1.0
    self_labels.label_pose = lambda estimate, *_: estimate.T_cam_port
    guard.Guard.judge = lambda *_, **_options: guard.Verdict(True, 0.9, (1, 0), (1, 0), 1, 1)
