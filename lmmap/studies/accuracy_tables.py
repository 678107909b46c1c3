"""The accuracy study's tables, from the results of its sequences."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pandas as pd

from ..training.mask_quality import medians
from . import error_statistics, pose_errors
from .pose_errors import DOMAIN_GAPS, TRACKS

DRAWS, SEED = 1000, 0  # of the bootstrap


def label(name: str, modality: str, gap: str) -> str:
    """Of a sequence's files; low-domain-gap weights are the default, and go without saying."""
    return f"{name}-{modality}" + ("-high-gap" if gap == "high" else "")


def tables(folder: Path, tests: dict[str, list[str]], names: list[str]) -> dict[str, pd.DataFrame]:
    """By name: what `_of_errors` has, counts and median errors by sequence, saturation, filters.

    Parameters
    ----------
    folder
        With ``errors-LABEL.csv`` and so on, as `study` writes them.
    tests : the test's sequences by light
    names : all sequences
    """
    cells = product(tests.items(), DOMAIN_GAPS)
    parts = [_of_errors(folder, some, light, gap) for (light, some), gap in cells]
    found = {name: pd.concat(part[name] for part in parts) for name in parts[0]}
    fits = [pd.read_csv(folder / f"filters-{name}.csv").assign(light=light)
            for light, some in tests.items() for name in some]  # fmt: skip
    return found | {
        "counts": pd.concat(pd.read_csv(folder / f"counts-{name}.csv") for name in names),
        "saturation": pd.concat(_saturated(folder, some, light) for light, some in tests.items()),
        "filters": medians(pd.concat(fits)),
    }


def _of_errors(folder: Path, names: list[str], light: str, gap: str) -> dict[str, pd.DataFrame]:
    """Tables of one light and domain gap: cells with intervals, what `distributions` has."""
    of = {m: [pd.read_csv(folder / f"errors-{label(n, m, gap)}.csv") for n in names] for m in TRACKS}
    cells = {m: pose_errors.summary(some, DRAWS, SEED) for m, some in of.items()}
    cells["fused"] = cells["fused"].query("variant == 'exact'").assign(variant="fused")
    every = {
        "summary": cells,
        "distribution": {m: error_statistics.distribution(some) for m, some in of.items()},
        "answers": {m: error_statistics.answers(some) for m, some in of.items()},
        "by_view": {m: error_statistics.by_view(some) for m, some in of.items()},
        "promise": {m: error_statistics.promise(some) for m, some in of.items()},
        "by_sequence": {m: _by_sequence(names, some) for m, some in of.items()},
        "coverage": {
            m: pd.DataFrame([error_statistics.coverage(some, DRAWS, SEED)]) for m, some in of.items()
        },
    }
    tables = {name: pd.concat(t.assign(modality=m) for m, t in by.items()) for name, by in every.items()}
    tables["fusion"] = error_statistics.against_better(of, DRAWS, SEED)
    return {name: t.assign(light=light, training=f"{gap}-domain-gap") for name, t in tables.items()}


def _by_sequence(names: list[str], errors: list[pd.DataFrame]) -> pd.DataFrame:
    rows = [error_statistics.of_sequence(t) for t in errors]
    return pd.DataFrame(rows).assign(sequence=names)


def _saturated(folder: Path, names: list[str], light: str) -> pd.DataFrame:
    """Mean saturation in a light, and its rank correlation with the position error over RGB frames."""
    frames = [pd.read_csv(folder / f"saturation-{n}.csv") for n in names]
    errors_of = [pd.read_csv(folder / f"errors-{n}-rgb.csv") for n in names]
    both = pd.concat([f.merge(e, on="t_us") for f, e in zip(frames, errors_of, strict=True)])
    frames = pd.concat(frames)
    rank = (both.low + both.high).corr(both.position_error_m, method="spearman")
    means = frames[["low", "high"]].mean()
    return pd.DataFrame([{"light": light, **means, "rank_correlation": rank}])
