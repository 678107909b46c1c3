"""What a domain gap costs each camera, by networks whose trainings were equal, with several seeds.

An interval is a percentile bootstrap of two sources of chance.  Sequences are drawn again, the same ones for
all networks and cameras.  So are the seeds of each set of networks; a mean of n drawn ones scatters too
little by sqrt((n - 1) / n), which is put right.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd

from .bootstrap import interval

MEASURES = ("mask_overlap", "ring_right", "pose_right", "pose_wrong")  # columns of an image
CAMERAS, EITHER = ("rgb", "event"), "rgb minus event"
DIFFERENCES = {"cost of the gap": ("low", "high"), "robust adds": ("robust", "low")}
ALL_LIGHTS = "mean"
DRAWS, SEED = 4000, 0


def table(images: pd.DataFrame, draws: int = DRAWS) -> pd.DataFrame:
    """Means and differences of sets of networks, with 95 % intervals.

    Parameters
    ----------
    images
        A row an image and network: ``place, light, sequence, modality, set, seed`` and `MEASURES`.

    Returns
    -------
    DataFrame
        ``place, measure, light, modality, quantity``: of each set of networks, and `DIFFERENCES`, also those
        that frames have and events have not; ``value`` with its interval ``low, high``; ``seed_0`` and so on,
        by seed.
    """
    rows = []
    for place, of_place in images.groupby("place", sort=False):
        for measure in MEASURES:
            rows += [
                {"place": place, "measure": measure, **row} for row in _of_measure(of_place, measure, draws)
            ]
    return pd.DataFrame(rows)


def _of_measure(images: pd.DataFrame, measure: str, draws: int) -> list[dict]:
    lights = list(images.light.unique())
    by_seed, drawn, rng = {}, {}, np.random.default_rng(SEED)
    turns = {
        key: rng.integers(0, (n := group.seed.nunique()), (draws, n))
        for key, group in images.groupby(["modality", "set"])
    }
    for light, of_light in images.groupby("light", sort=False):
        names = of_light.sequence.unique()
        counts = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), draws)
        for key, cell in of_light.groupby(["modality", "set"]):
            sums, sizes = (_wide(cell, measure, f, names) for f in ("sum", "size"))
            by_seed[light, *key] = (sums.sum(0) / sizes.sum(0))[:, None]
            with np.errstate(invalid="ignore"):
                drawn[light, *key] = _seeds_too((counts @ sums / (counts @ sizes)).T, turns[key])
    for key in turns:
        for values in (by_seed, drawn):
            values[ALL_LIGHTS, *key] = np.mean([values[light, *key] for light in lights], 0)
    _add_differences(by_seed), _add_differences(drawn)
    return [_row(*key, by_seed[key][:, 0], drawn[key]) for key in by_seed]


def _wide(cell: pd.DataFrame, measure: str, what: str, names) -> np.ndarray:
    """Sums or numbers of images, (sequences, seeds)."""
    sums = cell.groupby(["sequence", "seed"])[measure].agg(what).unstack("seed")
    return sums.reindex(names).fillna(0.0).to_numpy(float)


def _seeds_too(values: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Means (1, draws) over drawn seeds, of values (seeds, draws)."""
    count = len(values)
    mean = values.mean(0)
    again = np.take_along_axis(values, turns.T, 0).mean(0)
    return (mean + np.sqrt(count / max(count - 1, 1)) * (again - mean))[None]


def _add_differences(values: dict) -> None:
    """Add `DIFFERENCES` between sets, where there are both, and what frames have of them beyond events."""
    lights = dict.fromkeys(light for light, *_ in values)
    for light, (name, (more, less)) in product(lights, DIFFERENCES.items()):
        for m in CAMERAS:
            if (light, m, more) in values and (light, m, less) in values:
                values[light, m, name] = values[light, m, more] - values[light, m, less]
        if all((light, m, name) in values for m in CAMERAS):
            values[light, EITHER, name] = values[light, CAMERAS[0], name] - values[light, CAMERAS[1], name]


def _row(light: str, modality: str, quantity: str, by_seed: np.ndarray, drawn: np.ndarray) -> dict:
    low, high = interval(np.clip(drawn.ravel(), -1.0 if quantity in DIFFERENCES else 0.0, 1.0))
    return {"light": light, "modality": modality, "quantity": quantity, "value": by_seed.mean(), "low": low,
            "high": high, **{f"seed_{k}": value for k, value in enumerate(by_seed)}}  # fmt: skip


def cell(
    table: pd.DataFrame, place: str, measure: str, light: str, modality: str, quantity: str
) -> pd.Series:
    """One row of `table`."""
    keys = {"place": place, "measure": measure, "light": light, "modality": modality, "quantity": quantity}
    (row,) = table[(table[list(keys)] == pd.Series(keys)).all(axis=1)].itertuples(index=False)
    return pd.Series(row._asdict())


def extremes(table: pd.DataFrame, place: str, measure: str, light: str, modality: str) -> tuple[float, float]:
    """Least and largest cost of the gap over all pairs of a seed of one set and a seed of the other."""
    low, high = (
        cell(table, place, measure, light, modality, quantity).filter(like="seed_").dropna()
        for quantity in DIFFERENCES["cost of the gap"]
    )
    return low.min() - high.max(), low.max() - high.min()
