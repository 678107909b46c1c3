"""The accuracy study: the bench's sequences are simulated and estimated, and their errors tabulated."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import joblib
import pandas as pd

from lmmap.allocator import tune_allocator
from lmmap.estimation.estimates import merge_by_time
from lmmap.evaluation import error_table
from lmmap.files import write_text
from lmmap.pipeline.network import best_precision
from lmmap.pipeline.weights import shipped_sets
from lmmap.recordings.pose_files import write_estimates
from lmmap.settings import MODALITIES, OURS, PAPER
from lmmap.tracking.fusion import fuse
from lmmap.types import Port
from lmmap_lab.unfinished import has_mark

from ..bench import laboratory, sequences
from ..provenance import DATA, DERIVED_DATA, PINS, fingerprint, load_table, save_json, save_table
from ..training.mask_quality import filter_quality
from . import accuracy_tables, reliability, table1
from .accuracy_tables import DRAWS, PACKED, SEED, label
from .archive import mark_of, pack, unpack
from .claims import claims
from .sequence_files import ESTIMATING, LADDER, bench_recording, kept_estimates
from .table1 import BLOCK_S, DOMAIN_GAPS, LIGHTS, TRACKS

CODE = (sequences.simulate, *ESTIMATING, *LADDER, merge_by_time, fuse, error_table.errors, filter_quality,
        reliability.confidences, table1.saturation)  # fmt: skip
WEIGHTS = {  # sets of networks by kind of sequence: the paper's two, and ours where poses may not be wrong
    "test": (*DOMAIN_GAPS, OURS.weights, "slim"), "hard": ("low",),
    "empty": ("low", OURS.weights, "slim"),
}  # fmt: skip
EMPTY = {"quick": 1, "paper": 3}  # sequences without a port, which divide the profile's seconds among them
COMMITTED = DATA / "results" / "accuracy"  # the paper profile's tables


@dataclass(frozen=True)
class Study:
    """Where the study keeps its results, and what makes them; a test puts smaller parts in their place."""

    derived: Path = DERIVED_DATA  # recordings, estimates and results of sequences, a folder a profile
    committed: Path = COMMITTED  # the paper profile's tables and packed results
    recording: Callable = bench_recording
    estimates: Callable = kept_estimates
    mask_quality: Callable = filter_quality
    code: Iterable[Callable] = CODE  # functions and classes that make a sequence's results
    draws: int = DRAWS  # of the bootstrap

    def archive(self, name: str) -> Path:
        """The packed results of a sequence."""
        return self.committed / "sequences" / f"{name}.zip"


def sequences_of(profile: str) -> list[str]:
    """The names of a profile's sequences."""
    tests = (f"test-{light}" for light in LIGHTS)
    return [*tests, "hard-slow", "hard-reflect", *(f"empty-{k}" for k in range(EMPTY[profile]))]


def run_before(profile: str, study: Study = Study()) -> list[str]:
    """The sequences whose packed results are not of the present estimator, networks and environment."""
    present = marks(profile, study)
    return [name for name, mark in present.items() if mark_of(study.archive(name)) != mark]


def marks(profile: str, study: Study) -> dict[str, str]:
    """For each sequence of a profile the fingerprint of all that its results depend on."""
    found = {}
    for name in sequences_of(profile):
        files = [f"data/weights/*-{gap}.*" for gap in WEIGHTS[name.split("-")[0]]]
        found[name] = fingerprint(name, profile, best_precision(), code=study.code, files=[*files, PINS])
    return found


def _print(line: str) -> None:
    print(line, flush=True)


def reproduce(profile: str, report=_print, jobs: int = 1, pictures=None, go_on: bool = False,
              study: Study = Study()) -> bool:  # fmt: skip
    """Simulate and estimate every sequence of a profile, and tabulate errors, intervals and claims.

    Recordings, estimates and results of a sequence are kept as soon as they are done, with a fingerprint of
    what made them.  So an interrupted run goes on, and a second run has nothing to do.  The paper profile's
    tables are also written to ``study.committed``, and each sequence's results are packed there.

    Parameters
    ----------
    jobs
        Number of sequences at once.  A sequence of 210 s needs up to 12 GB of memory.
    pictures
        Function that draws a sequence's pictures, as `gallery.save_tiles`; by default none are drawn.
    go_on
        Begin with those packed results that have the same fingerprint.

    Returns
    -------
    bool
        Whether there was anything to do.
    """
    folder = study.derived / profile
    tables_mark = fingerprint(profile, code=(_tabulate,), files=("data/paper/*.csv", PINS))
    folder.mkdir(parents=True, exist_ok=True)
    waiting = {}
    for name, mark in marks(profile, study).items():
        if has_mark(folder / f"{name}.done", mark):
            report(f"{name}: up to date")
        elif go_on and unpack(study.archive(name), folder, mark):
            write_text(folder / f"{name}.done", mark)
            report(f"{name}: results as packed")
        else:
            waiting[name] = mark
    tasks = (joblib.delayed(run_sequence)(n, profile, study, m, report, pictures) for n, m in waiting.items())
    each = {"return_as": "generator_unordered", "initializer": tune_allocator}  # of other processes
    for _ in joblib.Parallel(n_jobs=jobs, **each)(tasks):
        pass
    if not waiting and has_mark(folder / "tables.done", tables_mark):
        return False
    _tabulate(profile, study)
    write_text(folder / "tables.done", tables_mark)
    return True


def _tests(profile: str, light: str) -> list[str]:
    return [name for name in sequences_of(profile) if name.startswith(f"test-{light}")]


def labels_of(profile: str) -> dict[str, tuple[str, str]]:
    """``(sequence, modality)`` by label, of the test sequences with the default networks."""
    return _labels([name for light in LIGHTS for name in _tests(profile, light)])


def empty_labels(profile: str) -> dict[str, tuple[str, str]]:
    """As `labels_of`, for the sequences without a port."""
    return _labels([name for name in sequences_of(profile) if name.startswith("empty")])


def _labels(names: list[str]) -> dict[str, tuple[str, str]]:
    return {label(name, m, OURS.weights): (name, m) for name in names for m in MODALITIES}


def seconds_of(name: str, profile: str) -> float:
    """How long a sequence is."""
    kind = name.split("-")[0]
    return laboratory.SECONDS[profile][kind] / (EMPTY[profile] if kind == "empty" else 1)


def run_sequence(name: str, profile: str, study: Study, mark: str, report, pictures=None) -> None:
    """Estimate a sequence's images, and write its results into the profile's folder."""
    folder, kind = study.derived / profile, name.split("-")[0]
    recording = study.recording(name, seconds_of(name, profile), folder, report)
    facts = {"profile": profile, "seed": name}
    port, rate_hz = Port.lm_map(), float(sequences.FRAME_HZ) if kind == "empty" else PAPER.rate_hz
    counts, files = [], []
    for gap in WEIGHTS[kind]:
        tracks = {m: study.estimates(recording, m, gap, rate_hz, folder, report) for m in MODALITIES}
        tracks["fused"] = list(fuse(merge_by_time(tracks), port.yaw_period_rad, rate_hz))
        write_estimates(tracks["fused"], folder / f"estimates-{label(name, 'fused', gap)}.csv")
        for modality, estimates in tracks.items():
            medians = {}
            if recording.truth is not None:
                table = error_table.errors(recording, estimates, port)
                path = folder / f"errors-{label(name, modality, gap)}.csv"
                files.append(save_table(path, table, **facts))
                medians = table[list(error_table.METRICS)].median()
            if kind == "test" and gap == OURS.weights:
                path = folder / f"confidence-{label(name, modality, gap)}.csv"
                files.append(save_table(path, reliability.confidences(recording, estimates, port), **facts))
            counts.append({
                "sequence": name, "weights": PACKED.get(gap, gap), "modality": modality,
                "images": len(estimates), "ellipses": sum(e.ellipse is not None for e in estimates),
                "poses": sum(e.T_cam_port is not None for e in estimates), **medians,
            })  # fmt: skip
    files.append(save_table(folder / f"counts-{name}.csv", pd.DataFrame(counts), **facts))
    if kind == "test":
        cells = product(MODALITIES, DOMAIN_GAPS)
        files += [folder / f"ladder-{label(name, modality, gap)}.csv" for modality, gap in cells]
        fits = study.mask_quality(recording, shipped_sets()).replace({"domain_gap": PACKED})
        files.append(save_table(folder / f"filters-{name}.csv", fits, **facts))
    else:  # the page on hard cases draws these few
        files += [folder / f"estimates-{label(name, m, 'low')}.csv" for m in TRACKS]
    if recording.truth is not None:
        shares_percent = table1.saturation(recording, port)
        files.append(save_table(folder / f"saturation-{name}.csv", shares_percent, **facts))
        values = shares_percent[["low", "high"]].mean().to_dict()
        files.append(save_json(folder / f"saturation-{name}.json", values, **facts))
    if pictures and kind != "hard":
        files += pictures(recording, folder, _labels([name]), rate_hz)
    if profile == "paper":
        pack(study.archive(name), files, folder, mark, **facts)
    write_text(folder / f"{name}.done", mark)


def _tabulate(profile: str, study: Study) -> None:
    """Write a profile's tables and claims into its folder, the paper profile's also to the committed ones."""
    folder = study.derived / profile
    tests = {light: _tests(profile, light) for light in LIGHTS}
    tables = accuracy_tables.tables(folder, tests, sequences_of(profile), study.draws)
    facts = {"profile": profile, "seed": SEED, "draws": study.draws, "block_s": BLOCK_S}
    for name, table in tables.items():
        save_table(folder / f"{name}.csv", table, **facts)
    tables["claims"] = claims_of(folder)
    save_table(folder / "claims.csv", tables["claims"], **facts)
    for name, table in tables.items() if profile == "paper" else ():
        save_table(study.committed / f"{name}.csv", table, **facts)


def claims_of(folder: Path) -> pd.DataFrame:
    """`claims.claims` of a profile's tables."""
    judged = (load_table(folder / f"{name}.csv") for name in ("counts", "saturation", "filters"))
    return claims(table1.compare(folder), *judged)
