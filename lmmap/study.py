"""The accuracy study itself: the bench's test, hard and empty sequences recorded, estimated and tabulated."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import joblib
import pandas as pd

from . import accuracy, distributions, sequences, simulation
from .accuracy import BLOCK_S, DOMAIN_GAPS, LIGHTS, MODALITIES, TRACKS
from .claims import claims
from .core import PAPER, Estimate, Port, Recording
from .dataset import BENCH
from .estimator import Estimator
from .filters import shipped_gaps
from .fusion import fuse
from .pipeline import estimate, in_time
from .quality import filter_quality, medians
from .recordings import open_recording, read_estimates
from .results import DATA, DERIVED, fingerprint, save_json, save_table
from .trajectories import write_estimates

OF_ESTIMATES = [  # what `pipeline` and `trajectories` are made of
    f"lmmap/{name}.py"
    for name in ("calibration", "core", "geometry", "conics", "events", "ellipse", "contour", "circle", "yaw",
                 "uncertainty", "joint", "filters", "streams", "estimator", "pipeline", "trajectories")
]  # fmt: skip
TRAJECTORIES = {"quick": 1, "paper": 3}  # of the test, each under every light
EMPTY = {"quick": 1, "paper": 3}  # sequences without a port, which share the profile's seconds
PUBLISHED = DATA / "results" / "accuracy"  # the paper profile's tables
DRAWS, SEED = 1000, 0  # of the bootstrap


def sequences_of(profile: str) -> list[str]:
    """The names of a profile's sequences."""
    tests = [
        f"test-{light}" + (f"-{k}" if k else "") for k in range(TRAJECTORIES[profile]) for light in LIGHTS
    ]
    return [*tests, "hard-slow", "hard-reflect", *(f"empty-{k}" for k in range(EMPTY[profile]))]


def _print(line: str) -> None:
    print(line, flush=True)


def reproduce(profile: str, report=_print, jobs: int = 1) -> bool:
    """Simulate and estimate every sequence of a profile, and tabulate errors, intervals and claims.

    Each recording, each modality's estimates and each sequence's results are kept as soon as they are done,
    under a fingerprint of what made them, so that an interrupted run goes on and a second run has nothing to
    do.  The paper profile's tables are copied to `PUBLISHED`.

    Parameters
    ----------
    jobs
        Sequences at once.  One of 210 s asks for up to 12 GB of memory.

    Returns
    -------
    bool
        Whether anything was to be done.
    """
    folder, mark = DERIVED / profile, fingerprint(profile)
    folder.mkdir(parents=True, exist_ok=True)
    names = sequences_of(profile)
    waiting = [name for name in names if not _holds(folder / f"{name}.done", mark)]
    for name in names:
        if name not in waiting:
            report(f"{name}: up to date")
    tasks = (joblib.delayed(_sequence)(name, profile, folder, mark, report) for name in waiting)
    for _ in joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")(tasks):
        pass
    if not waiting and _holds(folder / "tables.done", mark):
        return False
    _tabulate(profile, folder)
    (folder / "tables.done").write_text(mark)
    return True


def _tests(profile: str, light: str) -> list[str]:
    return [name for name in sequences_of(profile) if name.startswith(f"test-{light}")]


def labels_of(profile: str) -> dict[str, tuple[str, str]]:
    """``(sequence, modality)`` by label, of the test with low-domain-gap weights."""
    names = [name for light in LIGHTS for name in _tests(profile, light)]
    return {label(name, m, "low"): (name, m) for name in names for m in MODALITIES}


def label(name: str, modality: str, gap: str) -> str:
    """Of a sequence's files; low-domain-gap weights are the default, and go without saying."""
    return f"{name}-{modality}" + ("-high-gap" if gap == "high" else "")


def _sequence(name: str, profile: str, folder: Path, mark: str, report) -> None:
    seconds = sequences.SECONDS[profile][kind := name.split("-")[0]]
    recording = recorded(name, seconds / EMPTY[profile] if kind == "empty" else seconds, folder, report)
    facts = {"profile": profile, "seed": name}
    port, rate_hz = Port.lm_map(), float(sequences.FRAME_HZ) if kind == "empty" else PAPER.rate_hz
    for gap in DOMAIN_GAPS if kind == "test" else DOMAIN_GAPS[:1]:
        found = {m: _estimates(recording, m, gap, rate_hz, folder, report) for m in MODALITIES}
        found["fused"] = list(fuse(in_time(found), port.yaw_period_rad, rate_hz))
        write_estimates(found["fused"], folder / f"estimates-{label(name, 'fused', gap)}.csv")
        for modality, some in found.items():
            if recording.truth is not None:
                table = accuracy.errors(recording, some, port)
                save_table(folder / f"errors-{label(name, modality, gap)}.csv", table, **facts)
    if kind == "test":
        fits = filter_quality(recording, shipped_gaps())
        save_table(folder / f"filters-{name}.csv", fits, **facts)
    if recording.truth is not None:
        shares_percent = accuracy.saturation(recording, port)
        save_table(folder / f"saturation-{name}.csv", shares_percent, **facts)
        values = shares_percent[["low", "high"]].mean().to_dict()
        save_json(folder / f"saturation-{name}.json", values, **facts)
    (folder / f"{name}.done").write_text(mark)


def recorded(name: str, seconds: float, folder: Path, report) -> Recording:
    """The sequence's recording, simulated unless the one kept is of the same bench and length."""
    path, made_of = folder / f"{name}.npz", folder / f"{name}.simulated"
    mark = fingerprint(name, str(seconds), patterns=BENCH)
    if not (path.exists() and _holds(made_of, mark)):
        report(f"{name}: simulating {seconds:.0f} s")
        simulation.record(name, seconds, path)
        made_of.write_text(mark)
    return open_recording(path)


def _estimates(recording: Recording, modality: str, gap: str, rate_hz: float, folder: Path,
               report) -> list[Estimate]:  # fmt: skip
    """Those kept, if the estimator and its two filters are still the ones that made them."""
    name = label(recording.name, modality, gap)
    own = (*OF_ESTIMATES, f"data/weights/*-{modality}-{gap}.*", "environment.txt")
    mark = fingerprint(recording.name, str(rate_hz), patterns=own)
    path, done = folder / f"estimates-{name}.csv", folder / f"estimates-{name}.done"
    if not (path.exists() and _holds(done, mark)):
        estimator = Estimator(recording.camera, Port.lm_map(), modality, gap)
        write_estimates(found := list(estimate(recording, estimator, rate_hz)), path)
        poses = sum(e.T_cam_port is not None for e in found)
        report(f"{name}: {poses} poses in {len(found)} images")
        done.write_text(mark)
    return read_estimates(path)


def _tabulate(profile: str, folder: Path) -> None:
    """Tables of the whole profile: what `_of_errors` has, counts and median errors by sequence, saturation,
    filters, claims."""
    parts = [_of_errors(profile, folder, light, gap) for light, gap in product(LIGHTS, DOMAIN_GAPS)]
    tables = {name: pd.concat(part[name] for part in parts) for name in parts[0]}
    counted = []
    for name in sequences_of(profile):
        for modality in TRACKS:
            found = read_estimates(folder / f"estimates-{name}-{modality}.csv")
            known = folder / f"errors-{name}-{modality}.csv"
            errors = pd.read_csv(known)[list(accuracy.METRICS)].median() if known.exists() else {}
            counted.append({
                "sequence": name, "modality": modality, "images": len(found),
                "ellipses": sum(e.ellipse is not None for e in found),
                "poses": sum(e.T_cam_port is not None for e in found), **errors,
            })  # fmt: skip
    facts = {"profile": profile, "seed": SEED, "draws": DRAWS, "block_s": BLOCK_S}
    fits = pd.concat(pd.read_csv(folder / f"filters-{name}.csv").assign(light=light)
                     for light in LIGHTS for name in _tests(profile, light))  # fmt: skip
    saturated = pd.concat(_saturated(profile, folder, light) for light in LIGHTS)
    tables |= {"counts": pd.DataFrame(counted), "saturation": saturated, "filters": medians(fits)}
    for target in [folder, PUBLISHED] if profile == "paper" else [folder]:
        for name, table in tables.items():
            save_table(target / f"{name}.csv", table, **facts)
        rows = claims(accuracy.compare(target), tables["counts"], tables["saturation"])
        save_table(target / "claims.csv", rows, **facts)


def _of_errors(profile: str, folder: Path, light: str, gap: str) -> dict[str, pd.DataFrame]:
    """Tables of one light and domain gap: cells with intervals, what `distributions` has."""
    of = {m: [pd.read_csv(folder / f"errors-{label(n, m, gap)}.csv") for n in _tests(profile, light)]
          for m in TRACKS}  # fmt: skip
    cells = {m: accuracy.summary(some, DRAWS, SEED) for m, some in of.items()}
    cells["fused"] = cells["fused"].query("variant == 'exact'").assign(variant="fused")
    every = {
        "summary": cells,
        "distribution": {m: distributions.distribution(some) for m, some in of.items()},
        "answers": {m: distributions.answers(some) for m, some in of.items()},
        "promise": {m: distributions.promise(some) for m, some in of.items()},
        "coverage": {m: pd.DataFrame([distributions.coverage(some, DRAWS, SEED)]) for m, some in of.items()},
    }
    tables = {name: pd.concat(t.assign(modality=m) for m, t in by.items()) for name, by in every.items()}
    tables["fusion"] = distributions.against_better(of, DRAWS, SEED)
    return {name: t.assign(light=light, training=f"{gap}-domain-gap") for name, t in tables.items()}


def _saturated(profile: str, folder: Path, light: str) -> pd.DataFrame:
    """Mean saturation in a light, and its rank correlation with the position error over RGB frames."""
    names = _tests(profile, light)
    frames = [pd.read_csv(folder / f"saturation-{n}.csv") for n in names]
    errors_of = [pd.read_csv(folder / f"errors-{n}-rgb.csv") for n in names]
    both = pd.concat([f.merge(e, on="t_us") for f, e in zip(frames, errors_of, strict=True)])
    frames = pd.concat(frames)
    rank = (both.low + both.high).corr(both.position_error_m, method="spearman")
    means = frames[["low", "high"]].mean()
    return pd.DataFrame([{"light": light, **means, "rank_correlation": rank}])


def _holds(path: Path, mark: str) -> bool:
    return path.exists() and path.read_text() == mark
