"""``lmmap adapt`` and ``lmmap estimate --adapt``: networks adapted to the place that a recording shows."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

from lmmap.cli.inputs import find_port, network_set, open_input
from lmmap.settings import MODALITIES
from lmmap.types import InputError

from ..adaptation.adapt import adapt


def run(a: Namespace) -> None:
    """Adapt networks, and write them to a folder."""
    outcomes = _adapt(a, a.output, "seconds", steps=a.steps, seed=a.seed, always=a.always)
    if a.json:
        print(json.dumps({m: asdict(o) for m, o in outcomes.items()}))
    else:
        print(
            f"{a.output}: {', '.join(m + (' new' if o.taken else ' as before') for m, o in outcomes.items())}"
        )


def for_estimate(a: Namespace) -> Path:
    """Adapt networks to the first part of a recording, in a folder beside the poses; return the folder."""
    folder = a.output.with_suffix(".networks")
    if folder == a.output:
        raise InputError(f"{a.output}: so the folder of its networks is called; name the poses .csv")
    _adapt(a, folder, "adapt")
    return folder


def _adapt(a: Namespace, folder: Path, option: str, **options):
    """Adapt networks by as much of the recording as an option says."""
    seconds = getattr(a, option)
    if seconds is not None and not 0 < seconds < 1e6:
        raise InputError(f"--{option} {seconds:g}: give the seconds to learn from, over 0 and below 1e6")
    modalities = (a.modality,) if a.modality in MODALITIES else MODALITIES
    stream, weights = open_input(a), network_set(a)
    return adapt(stream, folder, modalities, weights, find_port(a), seconds=seconds,
                 report=lambda line: print(line, file=sys.stderr), **options)  # fmt: skip
