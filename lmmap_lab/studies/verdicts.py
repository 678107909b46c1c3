"""How a claim of the paper is judged: a row of numbers, verdicts and the rule, for each estimator."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..provenance import DATA

HOLDS, PARTLY, FAILS = "holds", "partly", "does not hold"
UNTESTED, NOT_RUN = "cannot be tested here", "not run"
TRIED = "future work, tried"  # of a proposal of the paper, which claims no result
ESTIMATORS = {"as_printed": "as printed", "printed": "printed formula", "ours": "ours"}
COLUMNS = ["claim", "paper", *ESTIMATORS, *(f"{e}_verdict" for e in ESTIMATORS), "decides", "verdict", "why"]


def row(claim: str, paper: str, cells: dict, why: str, decides: str = "as_printed") -> dict:
    """A row from ``(numbers, verdict)`` by estimator; where the paper's procedure was not run, its formula on
    our ellipses decides in its place, and else ours."""
    cells = {e: cells.get(e, (NOT_RUN, NOT_RUN)) for e in ESTIMATORS}
    decides = next(e for e in (decides, "printed", "ours") if cells[e][1] != NOT_RUN)
    verdicts = {f"{e}_verdict": verdict for e, (_, verdict) in cells.items()}
    numbers = {e: text for e, (text, _) in cells.items()}
    return {
        "claim": claim,
        "paper": paper,
        **numbers,
        **verdicts,
        "decides": ESTIMATORS[decides],
        "verdict": verdicts[f"{decides}_verdict"],
        "why": why,
    }


def verdict(holds) -> str:
    """Of one condition, or of several that must all hold."""
    holds = np.atleast_1d(holds)
    return HOLDS if holds.all() else PARTLY if holds.any() else FAILS


def short(value: float) -> str:
    """A whole number from ten on, a tenth below."""
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}"


def other_results() -> pd.DataFrame:
    """What the paper states besides its Table I."""
    return pd.read_csv(DATA / "paper" / "other_results.csv")
