"""``lmmap adapt``, and what ``lmmap estimate --adapt`` asks for: networks that have learned a recording's
place."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path

from lmmap.cli.inputs import find_port, network_set, open_input
from lmmap.settings import MODALITIES
from lmmap.types import InputError

from ..adaptation.adapt import adapt


def run(a) -> None:
    """A folder of networks."""
    outcomes = _adapt(a, a.output, a.seconds, steps=a.steps, seed=a.seed)
    if a.json:
        print(json.dumps({m: asdict(o) for m, o in outcomes.items()}))
    else:
        print(
            f"{a.output}: {', '.join(m + (' new' if o.taken else ' as before') for m, o in outcomes.items())}"
        )


def for_estimate(a) -> Path:
    """Networks that learned the first part of a recording, in a folder beside the poses."""
    folder = a.output.with_suffix(".networks")
    if folder == a.output:
        raise InputError(f"{a.output}: so the folder of its networks is called; name the poses .csv")
    _adapt(a, folder, a.adapt)
    return folder


def _adapt(a, folder: Path, seconds: float | None, **options):
    if seconds is not None and not 0 < seconds < 1e6:
        raise InputError(f"{seconds:g} s: give how much of the recording to learn from, over 0 s")
    modalities = (a.modality,) if a.modality in MODALITIES else MODALITIES
    stream, weights = open_input(a), a.weights or network_set(a)
    return adapt(stream, folder, modalities, weights, find_port(a), seconds=seconds,
                 report=lambda line: print(line, file=sys.stderr), **options)  # fmt: skip
