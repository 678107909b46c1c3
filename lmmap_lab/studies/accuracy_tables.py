"""The accuracy study's tables, from the results of its sequences."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pandas as pd

from lmmap.evaluation import error_table
from lmmap.settings import MODALITIES, OURS

from ..training.mask_quality import medians
from . import error_statistics, ladder, reliability, table1, tolerances
from .right_and_wrong import by_limit, right_and_wrong
from .table1 import DOMAIN_GAPS, TRACKS

DRAWS, SEED = 1000, 0  # of the bootstrap
PACKED = {"slim": "light"}  # what the packed results call a set


def label(name: str, modality: str, gap: str) -> str:
    """Name of a sequence's files for a modality and a set of networks; low needs no mention."""
    return f"{name}-{modality}" + {"low": "", "high": "-high-gap"}.get(gap, f"-{PACKED.get(gap, gap)}")


def tables(
    folder: Path, tests: dict[str, list[str]], names: list[str], draws: int = DRAWS
) -> dict[str, pd.DataFrame]:
    """The study's tables by the names of their files.

    Parameters
    ----------
    folder
        The sequences' results, as `accuracy_run` writes them.
    tests : the test's sequences by light
    names : all sequences
    draws : of the bootstrap
    """
    cells = product(tests.items(), DOMAIN_GAPS)
    parts = [_error_tables(folder, sequences, light, gap, draws) for (light, sequences), gap in cells]
    whole = {name: pd.concat(part[name] for part in parts) for name in parts[0]}
    fits = [pd.read_csv(folder / f"filters-{name}.csv").assign(light=light)
            for light, sequences in tests.items() for name in sequences]  # fmt: skip
    counts = pd.concat(pd.read_csv(folder / f"counts-{name}.csv") for name in names)
    return whole | {
        "counts": counts[counts.weights == "low"].drop(columns="weights"),
        "default": of_networks(folder, tests, counts, OURS.weights, draws),
        "slim": of_networks(folder, tests, counts, "slim", draws),
        **_default_confidence(folder, tests),
        "saturation": pd.concat(_saturation(folder, sequences, light) for light, sequences in tests.items()),
        "filters": medians(pd.concat(fits).replace({"domain_gap": {v: k for k, v in PACKED.items()}})),
    }


def of_networks(
    folder: Path, tests: dict[str, list[str]], counts: pd.DataFrame, weights: str, draws: int = DRAWS
) -> pd.DataFrame:
    """What a set of networks does: a row for each track in each light, and on images without a port.

    Returns
    -------
    DataFrame
        ``light`` (or ``no port``), ``modality``; ``right_percent``, ``wrong_percent`` and ``none_percent`` of
        the ``images`` with the ring in view; median errors; ``inside_95_percent`` of the poses in their
        region.  Without a port, ``poses`` of all ``images``.
    """
    rows = []
    for (light, names), track in product(tests.items(), TRACKS):
        errors = _errors(folder, names, track, weights)
        answers = right_and_wrong(errors).query("estimator == 'ours'").drop(columns="estimator").iloc[0]
        medians = pd.concat(errors)[list(error_table.METRICS)].median()
        inside = error_statistics.coverage(errors, draws, SEED)["inside_95_percent"]
        rows.append({"light": light, "modality": track, **answers, **medians, "inside_95_percent": inside})
    empty = counts[counts.sequence.str.startswith("empty") & (counts.weights == PACKED.get(weights, weights))]
    empty = empty.groupby("modality")[["images", "poses"]].sum()
    return pd.concat([pd.DataFrame(rows), empty.reset_index().assign(light="no port")])


def _default_confidence(folder: Path, tests: dict[str, list[str]]) -> dict[str, pd.DataFrame]:
    """`reliability.of_sequences` of each track with the default networks, and `right_and_wrong.by_limit` of
    each camera, by ``light`` and ``modality``."""
    parts, limits = [], []
    for (light, names), modality in product(tests.items(), TRACKS):
        labels = [label(name, modality, OURS.weights) for name in names]
        confidences = [pd.read_csv(folder / f"confidence-{each}.csv") for each in labels]
        errors = _errors(folder, names, modality, OURS.weights)
        cell = {"light": light, "modality": modality}
        parts.append(reliability.of_sequences(errors, confidences).assign(**cell))
        if modality in MODALITIES:  # the fused track's poses depend on the cameras' limit
            limits.append(by_limit(errors, confidences).assign(**cell))
    return {"reliability": pd.concat(parts), "limits": pd.concat(limits)}


def _errors(folder: Path, names: list[str], track: str, weights: str) -> list[pd.DataFrame]:
    """Errors of each sequence, of one track with one set of networks."""
    return [pd.read_csv(folder / f"errors-{label(name, track, weights)}.csv") for name in names]


def _error_tables(folder: Path, names: list[str], light: str, gap: str, draws: int) -> dict:
    """Tables of one light and domain gap: cells with intervals, and what `error_statistics` has."""
    errors = {m: _errors(folder, names, m, gap) for m in TRACKS}
    cells = {m: table1.summary(errors[m], draws, SEED) for m in TRACKS}
    cells["fused"] = cells["fused"].query("variant == 'exact'").assign(variant="fused")
    by_modality = {
        "summary": cells,
        "distribution": {m: error_statistics.distribution(errors[m]) for m in TRACKS},
        "answers": {m: error_statistics.answers(errors[m]) for m in TRACKS},
        "by_view": {m: error_statistics.by_view(errors[m]) for m in TRACKS},
        "promise": {m: error_statistics.promise(errors[m]) for m in TRACKS},
        "by_sequence": {m: _by_sequence(names, errors[m]) for m in TRACKS},
        "right_wrong": {m: right_and_wrong(errors[m]) for m in TRACKS},
        "coverage": {m: pd.DataFrame([error_statistics.coverage(errors[m], draws, SEED)]) for m in TRACKS},
    }
    tables = {
        name: pd.concat(table.assign(modality=m) for m, table in parts.items())
        for name, parts in by_modality.items()
    }
    tables["fusion"] = error_statistics.against_better(errors, draws, SEED)
    measured = {
        m: [pd.read_csv(folder / f"ladder-{label(name, m, gap)}.csv") for name in names] for m in MODALITIES
    }
    tracked = {m: {"confident": errors[m], "fused": errors["fused"]} for m in MODALITIES}
    tables["ladder"] = pd.concat(
        ladder.summary(measured[m], *tracked[m].values(), draws, SEED).assign(modality=m) for m in MODALITIES
    )
    tables["tolerances"] = pd.concat(
        tolerances.table(measured[m], tracked[m]).assign(modality=m) for m in MODALITIES
    )
    return {name: t.assign(light=light, training=f"{gap}-domain-gap") for name, t in tables.items()}


def _by_sequence(names: list[str], errors: list[pd.DataFrame]) -> pd.DataFrame:
    rows = [error_statistics.sequence_summary(table) for table in errors]
    return pd.DataFrame(rows).assign(sequence=names)


def _saturation(folder: Path, names: list[str], light: str) -> pd.DataFrame:
    """Mean saturation in a light, and its rank correlation with the position error over RGB frames."""
    frames = [pd.read_csv(folder / f"saturation-{n}.csv") for n in names]
    errors = _errors(folder, names, "rgb", "low")
    both = pd.concat([f.merge(e, on="t_us") for f, e in zip(frames, errors, strict=True)])
    rank = (both.low + both.high).corr(both.position_error_m, method="spearman")
    means = pd.concat(frames)[["low", "high"]].mean()
    return pd.DataFrame([{"light": light, **means, "rank_correlation": rank}])
