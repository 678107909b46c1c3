"""What made five degrees: hypotheses, fitted to the numbers of the paper's Table I on normal and rotation.

Of the table's 48 numbers with the outlier filter, 37 go to unknowns that all hypotheses have: the noise of
the 12 cells, two numbers of the yaw in each (`yaw_of`), and a share of gross outliers in `OUTLYING`.  They
leave `FREEDOM`, from which a hypothesis' own numbers are taken.  Its *misfit* is the root of the log ratios'
sum of squares over what is left.  This is the penalty for free numbers, because there are hardly more numbers
than unknowns, and criteria with logarithms of their count do not hold there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..provenance import DATA
from .five_degrees import EXACT, NOISE_PX, Scene, draws, predictions

CELL = ["training", "light", "modality"]
OUTLYING = ("high-domain-gap", "high", "rgb")  # RMSE of three medians; of the others one and a half at most
FREEDOM = 11
FINER = 4  # parts of a grid's step, between which predictions are interpolated
TILTS_DEG = np.array([0, 1.5, 3, 4, 5, 6])
GRIDS = {  # nu over Z in units of the bench's, and misalignments of the truth
    EXACT: ([1.0], TILTS_DEG),
    "printed": ([0.45, 0.55, 0.65, 0.75, 0.85, 1.0], TILTS_DEG),
    "ends": ([0.6, 0.8, 1.0, 1.3, 1.6], TILTS_DEG),
    "four": ([0.7, 0.85, 1.0, 1.15], TILTS_DEG),
    "true centre": ([0.6, 1.0, 1.4], [0.0]),
}


@dataclass(frozen=True)
class Hypothesis:
    """By which reading a normal is made, and what is free: nu over Z, a misalignment of the truth."""

    name: str
    reading: str
    any_lens: bool = False
    any_tilt: bool = False

    @property
    def free(self) -> int:
        return self.any_lens + self.any_tilt

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        ratios, tilts_deg = GRIDS[self.reading]
        return np.array(ratios if self.any_lens else [1.0]), np.array(tilts_deg if self.any_tilt else [0.0])

    def of(self, predicted) -> np.ndarray:
        """This hypothesis' part of its reading's predictions (..., ratios, tilts, noise, 3)."""
        ratios, tilts_deg = map(list, GRIDS[self.reading])
        predicted = predicted if self.any_lens else predicted[..., [ratios.index(1.0)], :, :, :]
        return predicted if self.any_tilt else predicted[..., [tilts_deg.index(0.0)], :, :]


NOISE, LITERAL = "noise alone", "printed, any lens"
FOUR, ASKEW = "four roots, our lens", "misaligned truth"
HYPOTHESES = (
    Hypothesis(NOISE, EXACT),
    Hypothesis("printed, our lens", "printed"), Hypothesis(LITERAL, "printed", True),
    Hypothesis("two ends, our lens", "ends"), Hypothesis("two ends, any lens", "ends", True),
    Hypothesis(FOUR, "four"), Hypothesis("four roots, any lens", "four", True),
    Hypothesis("true centre, our lens", "true centre"),
    Hypothesis("true centre, any lens", "true centre", True),
    Hypothesis(ASKEW, EXACT, False, True),
    Hypothesis("two ends, our lens, misaligned truth", "ends", False, True),
    Hypothesis("four roots, our lens, misaligned truth", "four", False, True),
    Hypothesis("printed, any lens, misaligned truth", "printed", True, True),
)  # fmt: skip
VARIED = tuple(h for h in HYPOTHESES if h.name in (NOISE, LITERAL, FOUR, ASKEW))


@dataclass(frozen=True)
class Fit:
    """The best values of a hypothesis' numbers, each cell's noise (C,) px and share that is kept (C,), the
    log ratios (C, 2) of predictions to a table, and where all that is on the finer grids."""

    misfit: float
    ratio: float
    tilt_deg: float
    noise_px: np.ndarray
    kept: np.ndarray
    gap: np.ndarray
    at: tuple


def finer(grid, axis: int = 0) -> np.ndarray:
    """An array with linear interpolations between neighbours along an axis."""
    grid = np.moveaxis(np.asarray(grid, float), axis, 0)
    at = np.arange((len(grid) - 1) * FINER + 1) / FINER
    low = np.minimum(at.astype(int), max(len(grid) - 2, 0))
    share = (at - low).reshape(-1, *[1] * (grid.ndim - 1))
    both = (1 - share) * grid[low] + share * grid[np.minimum(low + 1, len(grid) - 1)]
    return np.moveaxis(both, 0, axis)


def finest(predicted) -> np.ndarray:
    """Predictions (..., ratios, tilts, noise, 3), finer along each of the three."""
    for axis in (-4, -3, -2):
        predicted = finer(predicted, axis)
    return predicted


def fit(h: Hypothesis, predicted, table, more: float = 0.0) -> Fit:
    """The best fit of `finest` predictions (ratios, tilts, noise, 3) to a table (C, 2) of medians and RMSE.

    ``more`` is the sum of squares of other numbers, at these values.
    """
    gap = predicted[..., None, :2] - np.log(table)  # (ratios, tilts, noise, C, 2)
    cost = np.sum(gap**2, -1)
    noise = cost.argmin(2)
    total = np.take_along_axis(cost, noise[:, :, None], 2)[:, :, 0].sum(-1)
    i, j = np.unravel_index(total.argmin(), total.shape)
    k = noise[i, j]
    ratios, tilts_deg = map(finer, h.grid)
    misfit = np.sqrt((total[i, j] + more) / (FREEDOM - h.free))
    return Fit(float(misfit), float(ratios[i]), float(tilts_deg[j]), finer(NOISE_PX)[k],
               predicted[i, j, k, 2], gap[i, j, k, np.arange(len(k))], (i, j, k))  # fmt: skip


def paper_cells(metric: str = "normal_error_deg", outlier_filter: str = "with") -> pd.DataFrame:
    """Median and RMSE of Table I, ``median`` and ``rmse``, in all cells but `OUTLYING`."""
    rows = pd.read_csv(DATA / "paper" / "table1.csv")
    rows = rows[(rows.metric == metric) & (rows.outlier_filter == outlier_filter)]
    return rows.pivot_table(index=CELL, columns="statistic", values="value", sort=False).drop(OUTLYING)


def fits(scene: Scene, hypotheses: Sequence[Hypothesis] = HYPOTHESES, counts=None, **options) -> dict:
    """By name, the `Fit` to Table I and the predictions (draws, ratios, tilts, noise, 3) of `draws`, by
    default of all poses once.  ``options`` are those of `errors_deg`."""
    counts = draws(scene, 0) if counts is None else counts
    table, predicted = paper_cells().to_numpy(), {}
    for reading in GRIDS:
        own = [h for h in hypotheses if h.reading == reading]
        if own:
            chosen = max(h.any_lens for h in own), max(h.any_tilt for h in own)
            whole = Hypothesis("", reading, *chosen)
            found = predictions(scene, reading, *whole.grid, counts, **options)
            predicted |= {h.name: _part(found, whole, h) for h in own}
    return {h.name: (fit(h, finest(predicted[h.name][0]), table), predicted[h.name]) for h in hypotheses}


def _part(found, whole: Hypothesis, h: Hypothesis) -> np.ndarray:
    """Of predictions on one hypothesis' grid those on another's."""
    rows, columns = (np.searchsorted(a, b) for a, b in zip(whole.grid, h.grid, strict=True))
    return found[:, rows][:, :, columns]
