"""The accuracy study: the bench's sequences are simulated and estimated, and their errors tabulated."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import joblib
import pandas as pd

from ..bench import laboratory, sequences, simulate
from ..files import has_mark, tune_allocator, write_text
from ..pipeline.estimator import Estimator
from ..pipeline.network import best_precision
from ..pipeline.run import each_image, estimate, merge_by_time, timed_images
from ..pipeline.weights import shipped_gaps
from ..provenance import DATA, DERIVED_DATA, fingerprint, save_json, save_table, source_files
from ..recordings.formats import open_recording, read_estimates
from ..recordings.pose_files import write_estimates
from ..settings import OURS, PAPER
from ..tracking.fusion import fuse
from ..training.dataset import BENCH
from ..training.mask_quality import filter_quality
from ..types import Estimate, Port, Recording
from . import accuracy_tables, ladder, pose_errors
from .accuracy_tables import DRAWS, SEED, label
from .archive import pack, unpack
from .claims import claims
from .pose_errors import BLOCK_S, DOMAIN_GAPS, LIGHTS, MODALITIES, TRACKS

ESTIMATE_SOURCES = source_files("pipeline.run", "recordings.pose_files")
LADDER_SOURCES = source_files("studies.ladder")
RESULT_SOURCES = (
    *source_files("bench.sequences", "pipeline.run", "recordings.pose_files", "tracking.fusion",
             "training.mask_quality", "studies.pose_errors", "studies.ladder"),
    "data/weights/*", "environment.txt",
)  # fmt: skip
TRAJECTORIES = {"quick": 1, "paper": 3}  # test trajectories, each under every light
WEIGHTS = {  # sets of networks by kind of sequence: the paper's two, and ours where poses may not be wrong
    "test": (*DOMAIN_GAPS, OURS.weights), "hard": ("low",), "empty": ("low", OURS.weights),
}  # fmt: skip
EMPTY = {"quick": 1, "paper": 3}  # sequences without a port, which divide the profile's seconds among them
COMMITTED = DATA / "results" / "accuracy"  # the paper profile's tables


def sequences_of(profile: str) -> list[str]:
    """The names of a profile's sequences."""
    tests = [
        f"test-{light}" + (f"-{k}" if k else "") for k in range(TRAJECTORIES[profile]) for light in LIGHTS
    ]
    return [*tests, "hard-slow", "hard-reflect", *(f"empty-{k}" for k in range(EMPTY[profile]))]


def _print(line: str) -> None:
    print(line, flush=True)


def reproduce(profile: str, report=_print, jobs: int = 1, pictures=None, go_on: bool = False) -> bool:
    """Simulate and estimate every sequence of a profile, and tabulate errors, intervals and claims.

    Recordings, estimates and results of a sequence are kept as soon as they are done, with a fingerprint of
    what made them.  So an interrupted run goes on, and a second run has nothing to do.  The paper profile's
    tables are also written to `COMMITTED`, and each sequence's results are packed there.

    Parameters
    ----------
    jobs
        Number of sequences at once.  A sequence of 210 s needs up to 12 GB of memory.
    pictures
        Function that draws a sequence's pictures, as `gallery.save_tiles`; by default none are drawn.
    go_on
        Begin with those packed results in `COMMITTED` that have the same fingerprint.

    Returns
    -------
    bool
        Whether there was anything to do.
    """
    folder, tables_mark = DERIVED_DATA / profile, fingerprint(profile)
    folder.mkdir(parents=True, exist_ok=True)
    waiting = {}
    for name in sequences_of(profile):
        mark = fingerprint(name, profile, best_precision(), patterns=RESULT_SOURCES)
        if has_mark(folder / f"{name}.done", mark):
            report(f"{name}: up to date")
        elif go_on and unpack(_packed(name), folder, mark):
            write_text(folder / f"{name}.done", mark)
            report(f"{name}: results as packed")
        else:
            waiting[name] = mark
    tasks = (joblib.delayed(_sequence)(n, profile, folder, m, report, pictures) for n, m in waiting.items())
    for _ in joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")(tasks):
        pass
    if not waiting and has_mark(folder / "tables.done", tables_mark):
        return False
    _tabulate(profile, folder)
    write_text(folder / "tables.done", tables_mark)
    return True


def _packed(name: str) -> Path:
    return COMMITTED / "sequences" / f"{name}.zip"


def _tests(profile: str, light: str) -> list[str]:
    return [name for name in sequences_of(profile) if name.startswith(f"test-{light}")]


def labels_of(profile: str) -> dict[str, tuple[str, str]]:
    """``(sequence, modality)`` by label, of the test sequences with the low domain gap's filters."""
    return _labels([name for light in LIGHTS for name in _tests(profile, light)])


def empty_labels(profile: str) -> dict[str, tuple[str, str]]:
    """As `labels_of`, for the sequences without a port."""
    return _labels([name for name in sequences_of(profile) if name.startswith("empty")])


def _labels(names: list[str]) -> dict[str, tuple[str, str]]:
    return {label(name, m, "low"): (name, m) for name in names for m in MODALITIES}


def _sequence(name: str, profile: str, folder: Path, mark: str, report, pictures=None) -> None:
    tune_allocator()
    seconds = laboratory.SECONDS[profile][kind := name.split("-")[0]]
    seconds = seconds / EMPTY[profile] if kind == "empty" else seconds
    recording = bench_recording(name, seconds, folder, report)
    facts = {"profile": profile, "seed": name}
    port, rate_hz = Port.lm_map(), float(sequences.FRAME_HZ) if kind == "empty" else PAPER.rate_hz
    counts, files = [], []
    for gap in WEIGHTS[kind]:
        tracks = {m: _estimates(recording, m, gap, rate_hz, folder, report) for m in MODALITIES}
        tracks["fused"] = list(fuse(merge_by_time(tracks), port.yaw_period_rad, rate_hz))
        write_estimates(tracks["fused"], folder / f"estimates-{label(name, 'fused', gap)}.csv")
        for modality, estimates in tracks.items():
            medians = {}
            if recording.truth is not None:
                table = pose_errors.errors(recording, estimates, port)
                path = folder / f"errors-{label(name, modality, gap)}.csv"
                files.append(save_table(path, table, **facts))
                medians = table[list(pose_errors.METRICS)].median()
            counts.append({
                "sequence": name, "weights": gap, "modality": modality, "images": len(estimates),
                "ellipses": sum(e.ellipse is not None for e in estimates),
                "poses": sum(e.T_cam_port is not None for e in estimates), **medians,
            })  # fmt: skip
    files.append(save_table(folder / f"counts-{name}.csv", pd.DataFrame(counts), **facts))
    if kind == "test":
        cells = product(MODALITIES, DOMAIN_GAPS)
        files += [folder / f"ladder-{label(name, modality, gap)}.csv" for modality, gap in cells]
        fits = filter_quality(recording, shipped_gaps())
        files.append(save_table(folder / f"filters-{name}.csv", fits, **facts))
    else:  # the page on hard cases draws these few
        files += [folder / f"estimates-{label(name, m, 'low')}.csv" for m in TRACKS]
    if recording.truth is not None:
        shares_percent = pose_errors.saturation(recording, port)
        files.append(save_table(folder / f"saturation-{name}.csv", shares_percent, **facts))
        values = shares_percent[["low", "high"]].mean().to_dict()
        files.append(save_json(folder / f"saturation-{name}.json", values, **facts))
    if pictures and kind != "hard":
        files += pictures(recording, folder, _labels([name]), rate_hz)
    if profile == "paper":
        pack(_packed(name), files, folder, mark)
    write_text(folder / f"{name}.done", mark)


def bench_recording(name: str, seconds: float, folder: Path, report) -> Recording:
    """A sequence's recording in a folder, simulated unless the one there has the same bench and length."""
    path, mark_path = folder / f"{name}.h5", folder / f"{name}.simulated"
    mark = fingerprint(name, str(seconds), patterns=BENCH)
    if not (path.exists() and has_mark(mark_path, mark)):
        report(f"{name}: simulating {seconds:.0f} s")
        simulate.record(name, seconds, path)
        write_text(mark_path, mark)
    return open_recording(path)


def estimates_fingerprint(modality: str, gap: str, *facts: str, sources: Sequence[str] = ()) -> str:
    """Hash of what estimates depend on: modules, a modality's filters, pins, precision, and the given facts.

    Parameters
    ----------
    modality, gap
        Name the filters' weights; ``"*"`` names all of them.
    facts
        About the images: their recording, their rate.
    sources
        Further files that have a part in the result, as patterns relative to the checkout.
    """
    patterns = (*ESTIMATE_SOURCES, *sources, f"data/weights/*-{modality}-{gap}.*", "environment.txt")
    return fingerprint(*facts, best_precision(), patterns=patterns)


def _estimates(recording: Recording, modality: str, gap: str, rate_hz: float, folder: Path,
               report) -> list[Estimate]:  # fmt: skip
    """Estimates of a recording, made unless those in the folder are of the same estimator and filters."""
    name = label(recording.name, modality, gap)
    mark = estimates_fingerprint(modality, gap, recording.name, str(rate_hz), sources=LADDER_SOURCES)
    path, done = folder / f"estimates-{name}.csv", folder / f"estimates-{name}.done"
    if not (path.exists() and has_mark(done, mark)):
        estimator = Estimator(recording.camera, Port.lm_map(), modality, gap)
        if recording.name.startswith("test") and gap in DOMAIN_GAPS:
            timed = timed_images(recording, modality, estimator.settings, rate_hz)
            estimates, rungs = zip(*each_image(timed, ladder.Ladder(estimator)), strict=True)
            table = ladder.errors(recording, rungs, estimator.port)
            save_table(folder / f"ladder-{name}.csv", table, seed=recording.name)
        else:
            estimates = list(estimate(recording, estimator, rate_hz))
        write_estimates(estimates, path)
        poses = sum(e.T_cam_port is not None for e in estimates)
        report(f"{name}: {poses} poses in {len(estimates)} images")
        write_text(done, mark)
    return read_estimates(path)


def _tabulate(profile: str, folder: Path) -> None:
    """Write a profile's tables and claims into its folder, the paper profile's also into `COMMITTED`."""
    tests = {light: _tests(profile, light) for light in LIGHTS}
    tables = accuracy_tables.tables(folder, tests, sequences_of(profile))
    facts = {"profile": profile, "seed": SEED, "draws": DRAWS, "block_s": BLOCK_S}
    for target in [folder, COMMITTED] if profile == "paper" else [folder]:
        for name, table in tables.items():
            save_table(target / f"{name}.csv", table, **facts)
        judged = (tables[name] for name in ("counts", "saturation", "filters"))
        rows = claims(pose_errors.compare(target), *judged)
        save_table(target / "claims.csv", rows, **facts)
