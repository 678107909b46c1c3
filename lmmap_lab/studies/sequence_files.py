"""Recordings of the bench and estimates of them, each kept in a file with a mark of what made it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from lmmap.estimation.estimates import each_image, estimate
from lmmap.estimation.images import timed_images
from lmmap.files import write_text
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import settings_for
from lmmap.pipeline.network import best_precision
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import as_row, read_estimates, write_estimates
from lmmap.settings import Settings
from lmmap.types import Estimate, Port, Recording
from lmmap_lab.unfinished import has_mark

from ..bench import sequences, simulate
from ..provenance import PINS, fingerprint, save_table
from . import ladder
from .accuracy_tables import label
from .table1 import DOMAIN_GAPS

ESTIMATING = (settings_for, Estimator, estimate, as_row)  # as they are read back, for these are fused


def bench_recording(name: str, seconds: float, folder: Path, report) -> Recording:
    """A sequence's recording in a folder, simulated unless the one there has the same bench and length."""
    path, mark_path = folder / f"{name}.h5", folder / f"{name}.simulated"
    mark = fingerprint(name, str(seconds), code=(sequences.simulate,))
    if not (path.exists() and has_mark(mark_path, mark)):
        report(f"{name}: simulating {seconds:.0f} s")
        simulate.record(name, seconds, path)
        write_text(mark_path, mark)
    return open_recording(path)


def estimates_fingerprint(modality: str, gap: str, *facts: str, code: Iterable[Callable] = ()) -> str:
    """Hash of what estimates depend on: modules, a modality's filters, pins, precision, and the given facts.

    Parameters
    ----------
    modality, gap
        Name the filters' weights; ``"*"`` names all of them.
    facts
        About the images: their recording, their rate.
    code
        Further functions that have a part in the result.
    """
    files = (f"data/weights/*-{modality}-{gap}.*", PINS)
    return fingerprint(*facts, best_precision(), code=(*ESTIMATING, *code), files=files)


def looks_of(gap: str, settings: Settings) -> Settings:
    """Settings for a set of networks: the paper's two sets do not look at a turned image."""
    return replace(settings, turned_look=False) if gap in DOMAIN_GAPS else settings


def make_estimates(
    recording: Recording, modality: str, gap: str, rate_hz: float, folder: Path
) -> list[Estimate]:
    """Estimates of a recording; of a test sequence also the ladder, whose table goes into the folder."""
    settings = looks_of(gap, settings_for(recording.camera))
    estimator = Estimator(recording.camera, Port.lm_map(), modality, gap, settings)
    if not recording.name.startswith("test") or gap not in DOMAIN_GAPS:
        return list(estimate(recording, estimator, rate_hz))
    timed = timed_images(recording, modality, estimator.settings, rate_hz)
    estimates, rungs = zip(*each_image(timed, ladder.Ladder(estimator)), strict=True)
    table = ladder.errors(recording, rungs, estimator.port)
    save_table(folder / f"ladder-{label(recording.name, modality, gap)}.csv", table, seed=recording.name)
    return list(estimates)


LADDER = (looks_of, ladder.Ladder, ladder.errors)


def kept_estimates(recording: Recording, modality: str, gap: str, rate_hz: float, folder: Path, report,
                   make: Callable[..., list[Estimate]] = make_estimates) -> list[Estimate]:  # fmt: skip
    """Estimates of a recording, made unless those in the folder are of the same estimator and filters."""
    name = label(recording.name, modality, gap)
    mark = estimates_fingerprint(modality, gap, recording.name, str(rate_hz), code=LADDER)
    path, done = folder / f"estimates-{name}.csv", folder / f"estimates-{name}.done"
    if not (path.exists() and has_mark(done, mark)):
        estimates = make(recording, modality, gap, rate_hz, folder)
        write_estimates(estimates, path)
        poses = sum(e.T_cam_port is not None for e in estimates)
        report(f"{name}: {poses} poses in {len(estimates)} images")
        write_text(done, mark)
    return read_estimates(path)
