"""What the ``lmmap`` command does on the bench: simulate, photometry, train, reproduce."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from itertools import product

from tqdm import tqdm

from lmmap.cli.inputs import leave_out
from lmmap.files import check_output
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import FILTERS, SETS
from lmmap.types import Camera, InputError

from ..bench import laboratory, photometry, sequences
from ..bench.simulate import record, record_all
from ..bench.writers import WRITERS
from ..provenance import CHECKOUT, DERIVED_DATA, save_json
from ..studies import accuracy_run
from ..training.recipe import Recipe
from . import authors


def simulate(a: Namespace) -> None:
    """Write sequences of the bench to files."""
    if a.as_published:
        text = "--as-published: stand-ins have sequences of their own"
        leave_out(a, text, "sequence", "output", "overwrite", "camera", "jobs", "scheduler", "profile")
        authors.simulate(a)
        return
    if not (a.sequence and a.output):
        raise InputError("simulate: give --sequence NAME and -o FILE, or --as-published FOLDER")
    if a.output.suffix not in WRITERS:
        raise InputError(f"{a.output}: cannot write '{a.output.suffix}'; name it {', '.join(WRITERS)}")
    if len(a.sequence) > 1 and "{}" not in a.output.name:
        raise InputError(f"{a.output}: one name for {len(a.sequence)} sequences; put {{}} where theirs goes")
    if len(set(a.sequence)) < len(a.sequence):
        raise InputError(f"--sequence {' '.join(a.sequence)}: names one twice; give each once")
    paths = [a.output.with_name(a.output.name.replace("{}", name)) for name in a.sequence]
    for path in paths:
        for written in (path, path.with_suffix(".camera.json"), path.with_suffix(".truth.csv")):
            check_output(written, [a.camera], overwrite=a.overwrite)
    camera = Camera.load(a.camera) if a.camera else None
    jobs = [(name, sequences.duration_s(laboratory.sequence(name), a.seconds, a.profile),
             path) for name, path in zip(a.sequence, paths, strict=True)]  # fmt: skip
    if a.jobs > 1 or a.scheduler:
        if camera:
            leave_out(a, f"{a.camera}: another camera records one sequence at a time", "jobs", "scheduler")
        for path, events, frames in tqdm(
            record_all(jobs, a.jobs, a.scheduler), "simulate", len(jobs), disable=None
        ):
            tqdm.write(f"{path}: {events} events, {frames} frames")
        return
    for name, seconds, path in jobs:
        form = "{desc} {percentage:3.0f}% {bar} {elapsed}"
        with tqdm(total=seconds, desc=name, bar_format=form, disable=None) as bar:
            events, frames = record(name, seconds, path, lambda s, bar=bar: bar.update(s - bar.n), camera)
            bar.update(seconds - bar.n)
        print(f"{path}: {events} events, {frames} frames, {seconds:g} s")


def calibrate_lamps(a: Namespace) -> None:
    """Calibrate exposure and lamps."""
    if a.output:
        check_output(a.output, overwrite=a.overwrite)
    result = photometry.calibrate_lamps(lambda line: print(line, file=sys.stderr))
    if a.output:
        save_json(a.output, result, command=f"lmmap photometry -o {a.output.name}")
    print(json.dumps(result, indent=1))


def train(a: Namespace) -> None:
    """Train the filters that were asked for, one after the other."""
    if a.data:
        authors.train(a)
        return
    from ..training import train

    gaps = [a.networks] if a.networks else SETS
    names = [a.filter] if a.filter else FILTERS
    modalities = [a.modality] if a.modality else CHANNELS
    for gap, name, modality in product(gaps, names, modalities):
        asked = {"seed": a.seed, "steps": a.steps, "start_from": a.start_from}
        changes = {key: value for key, value in asked.items() if value is not None}
        recipe = Recipe.of_shipped(name, modality, gap, **changes)
        path = train.train(recipe, DERIVED_DATA / "training", lambda line: print(line, flush=True))
        print(f"{path}: written")


def reproduce(a: Namespace) -> None:
    """Run the accuracy study of a profile, or that of a folder of bags."""
    if not CHECKOUT:
        raise InputError("reproduce: an installed package has no book and no pins; run it in a checkout")
    paper = a.profile == "paper"
    if a.go_on and (a.data or not paper):
        raise InputError("--go-on: only the paper profile's results on the bench are packed; "
                         "give --profile paper and no --data, or leave it out")  # fmt: skip
    if a.adapt and not a.data:
        raise InputError("--adapt: networks learn a laboratory from its bags; give --data FOLDER as well")
    if a.data:
        leave_out(a, "--data: its bags are read one after the other", "jobs")
        authors.reproduce(a)
        return
    if not paper:
        accuracy_run.reproduce(a.profile, jobs=a.jobs)
        return
    from ..pages import gallery

    changed = accuracy_run.reproduce(a.profile, jobs=a.jobs, pictures=gallery.save_tiles, go_on=a.go_on)
    if changed or not (accuracy_run.COMMITTED / "worst.jpg").exists():
        labels, empty = accuracy_run.labels_of(a.profile), accuracy_run.empty_labels(a.profile)
        gallery.save_sheets(DERIVED_DATA / a.profile, accuracy_run.COMMITTED, labels, empty)


def check(a: Namespace) -> None:
    """Compare results and pages with the committed ones."""
    if a.carry:
        from ..studies.carry import carry

        carry(lambda line: print(line, flush=True), beside=a.beside)
        return
    leave_out(a, "check: carries nothing over without --carry", "beside")
    from ..pages import reference

    reference.check(a.update)
