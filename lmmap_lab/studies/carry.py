"""Archives carried over to code that has changed: a sample of each is made anew, and has to be equal.

Events depend on all images before them, so their sample is the beginning of a sequence.  Frames do not, so
theirs are also drawn from the rest.  What follows images in order, tracks and the paper's outlier filter, is
compared at the beginning only.  A gallery's pictures and a whole sequence's counts are not compared, and all
numbers to the six digits of the tables, the last of which two runs of one code round either way.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from lmmap.pipeline.estimator import Estimator
from lmmap.recordings.columns import CERTAINTY, SCORES
from lmmap.settings import MODALITIES
from lmmap.types import InputError, Recording

from ..bench import sequences
from ..provenance import processor, save_table
from . import tracks
from .accuracy_run import Study, marks, run_sequence, seconds_of
from .archive import carry_over, provenance_of, unpack

MARKS = "made-of.json"  # the fingerprints of the code that made a sample
BEGINNING, LEAST_S, ELSEWHERE = 0.02, 2.0, 0.01  # shares of a sequence
# Of the twelve digits of a pose the last are others in each run, where arrays lie otherwise in memory.
SIX_DIGITS = ["t_us", "status", *SCORES, *CERTAINTY]
SETTLED_US = 500_000  # before the end of the beginning: a track there may have missed its last window
OURS = Study()
REMEDY = "make it again: 'lmmap reproduce --profile paper --go-on'"


def carry(report=print, study: Study = OURS, beside: Path | None = None) -> None:
    """Give archives of earlier code the present fingerprint if their samples are equal, digit by digit.

    Parameters
    ----------
    beside
        A checkout of the code that made the archives.  Its samples, made here and now, are compared with, so
        that it does not matter on which processor the archives were made.

    Raises
    ------
    InputError
        If a sample differs; if another kind of processor made an archive, which rounds otherwise, and there
        is nothing beside; if what is beside did not make an archive.
    """
    refused = []
    for name, mark in marks("paper", study).items():
        present = {study.archive(part): m for part, m in (parts(name) | {name: mark}).items()}
        made = {path: told for path in present if (told := provenance_of(path))}
        old = [path for path, told in made.items() if told["made_of"] != present[path]]
        for path in old:
            made_on = made[path]["processor"]
            if not beside and made_on != processor() and not made_on.startswith("unknown"):
                raise InputError(f"{path}: a {made_on} made it, this is a {processor()}, which rounds "
                                 f"otherwise; give --beside a checkout of its code, or {REMEDY}")  # fmt: skip
        if not old:
            report(f"{name}: up to date")
            continue
        with TemporaryDirectory() as temporary:
            known, new, seed = Path(temporary, "known"), Path(temporary, "new"), int(mark[:8], 16)
            for path in made:
                unpack(path, known / path.stem / "paper")
            until_us = make_sample(name, known, new, seed, study)
            if beside:
                known = _made_beside(name, beside, known, seed, {path: made[path]["made_of"] for path in old})
            for path in old:
                rows, different = compare(new / path.stem / "paper", known / path.stem / "paper", until_us)
                if different or not rows:
                    refused.append(path.stem)
                    example = (different or ["there is none to compare"])[0]
                    report(f"{path.stem}: {len(different)} of {rows} rows differ: {example}")
                else:
                    facts = {"seed": seed, "rows": rows, "beginning_s": until_us * 1e-6}
                    carry_over(
                        path, present[path], **facts, compared="with its code" if beside else "with it"
                    )
                    report(f"{path.stem}: {rows} rows are equal, carried over")
    if refused:
        raise InputError(f"{', '.join(refused)}: of other code, which gives other results; {REMEDY}")


def parts(name: str) -> dict[str, str]:
    """Fingerprints of the archives of a sequence's tracks, by their names."""
    cameras = MODALITIES if name.startswith("test") else ()
    return {f"tracked-{name}-{m}": tracks.mark(name, m, seconds_of(name, "paper")) for m in cameras}


def make_sample(name: str, kept: Path, folder: Path, seed: int, study: Study = OURS) -> int:
    """Make the results of a sequence's sample, a folder an archive; returns where its beginning ends (us)."""
    recording, until_us = sample(name, kept / name / "paper", seed)
    of_frames = partial(study.mask_quality, modalities=("rgb",))  # of events, images of the whole are chosen
    (folder / name / "paper").mkdir(parents=True)
    here = {"derived": folder / name, "committed": folder / name}
    part = replace(study, **here, recording=lambda *_: recording, mask_quality=of_frames)
    run_sequence(name, "paper", part, "", lambda line: None)
    for archive in parts(name):
        if (kept / archive).exists():
            estimator = Estimator(recording.camera, modality=archive.rpartition("-")[2])
            table = tracks.errors_tracked(recording, estimator)
            save_table(folder / archive / "paper" / f"{archive}.csv", table)
    present = parts(name) | {name: marks("paper", study)[name]}
    (folder / MARKS).write_text(json.dumps(present))
    return until_us


def _made_beside(name: str, checkout: Path, kept: Path, seed: int, made_of: dict[Path, str]) -> Path:
    """The folder of a sample by another checkout's code; `InputError` if that did not make the archives."""
    folder = kept.with_name("beside")
    command = [sys.executable, "-m", __spec__.name, name, kept, folder, str(seed)]
    subprocess.run(
        command, cwd=checkout, env=os.environ | {"PYTHONPATH": str(checkout.resolve())}, check=True
    )
    for path, mark in made_of.items():
        if json.loads((folder / MARKS).read_text())[path.stem] != mark:
            raise InputError(
                f"{path}: was not made by the code of {checkout}; check out the commit that made it"
            )
    return folder


def sample(name: str, kept: Path, seed: int) -> tuple[Recording, int]:
    """The beginning of a sequence and some later frames, simulated; and where the beginning ends (us)."""
    table = next(path for kind in ("errors", "estimates") for path in kept.glob(f"{kind}-{name}-rgb.csv"))
    times_us, seconds = pd.read_csv(table).t_us.to_numpy(), seconds_of(name, "paper")
    until_us = int(1e6 * max(BEGINNING * seconds, LEAST_S))
    later = times_us[times_us > until_us]
    drawn = np.random.default_rng(seed).choice(later, round(ELSEWHERE * len(times_us)), replace=False)
    chosen = {*times_us[times_us <= until_us].tolist(), *drawn.tolist()}
    recording = sequences.simulate(
        name, seconds, keep=lambda view: view.t_us in chosen if view.is_frame else view.t_us <= until_us
    )
    return recording, until_us


def compare(made: Path, kept: Path, until_us: int) -> tuple[int, list[str]]:
    """How many rows of tables were compared, and those that the kept tables do not have, as texts."""
    count, different = 0, []
    for path in sorted(made.glob("*.csv")):
        if not (kept / path.name).exists():
            continue
        new, old = (pd.read_csv(p / path.name, dtype=str, keep_default_na=False) for p in (made, kept))
        if "t_us" not in new:
            continue
        if path.stem.startswith("estimates"):  # their errors judge the poses
            new, old = new[SIX_DIGITS], old[SIX_DIGITS]
        if path.stem.startswith("filters"):  # of images that are spread over the recording
            new = new[new.t_us.isin(old.t_us)]
        t_us, in_order = new.t_us.astype(int), "fused" in path.stem or "tracked" in path.stem
        begins = t_us <= until_us - SETTLED_US if in_order else t_us <= until_us
        lone = [column for column in new if not column.endswith("kept")]  # does not follow others
        for rows, columns in ((new[begins], list(new)), (new[~begins & (not in_order)], lone)):
            known = set(old[columns].itertuples(index=False, name=None))
            every = list(rows[columns].itertuples(index=False, name=None))
            unequal = [row for row in every if row not in known and not any(alike(row, k) for k in known)]
            different += [f"{path.stem}: {', '.join(row)}" for row in unequal]
            count += len(every)
    return count, different


def alike(row: tuple[str, ...], other: tuple[str, ...]) -> bool:
    """Whether two rows are equal but for the last of six digits, which may be rounded either way."""
    return all(a == b or _is_rounded(a, b) for a, b in zip(row, other, strict=True))


def _is_rounded(a: str, b: str) -> bool:
    try:
        return "." in a and bool(np.isclose(float(a), float(b), rtol=1.1e-5, atol=0))
    except ValueError:
        return False


if __name__ == "__main__":
    make_sample(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]))
