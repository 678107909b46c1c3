"""How a claim of the paper is judged: a row of numbers, verdicts and the rule, for each estimator."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd

from ..provenance import DATA

HOLDS, PARTLY, FAILS = "holds", "partly", "does not hold"
UNTESTED, NOT_RUN = "cannot be tested here", "not run"
TRIED = "future work, tried"  # of a proposal of the paper, which claims no result
ASKED = "our question, tried"  # what the paper's claims make one ask
NO_CLAIM = (TRIED, ASKED)
ALIKE = 1.6  # the widest ratio of medians between cells that the paper calls similar
ESTIMATORS = {"as_printed": "as printed", "printed": "printed formula", "ours": "ours"}
COLUMNS = ["key", "part", "claim", "numbers", "paper", *ESTIMATORS, *(f"{e}_verdict" for e in ESTIMATORS),
           "decides", "verdict", "why"]  # fmt: skip


def row(key: str, paper: str, cells: dict, why: str, decides: str = "as_printed") -> dict:
    """A row from ``(numbers, verdict)`` by estimator; where the paper's procedure was not run, its formula on
    our ellipses decides in its place, and else ours.

    Parameters
    ----------
    key
        Of `paper_claims`: whose words these are, and whether they tell what was ``observed``, its ``cause``
        or something ``of the method``.
    paper : its numbers
    why : the rule, which is ours
    """
    cells = {e: cells.get(e, (NOT_RUN, NOT_RUN)) for e in ESTIMATORS}
    decides = next(e for e in (decides, "printed", "ours") if cells[e][1] != NOT_RUN)
    verdicts = {f"{e}_verdict": verdict for e, (_, verdict) in cells.items()}
    numbers = {e: text for e, (text, _) in cells.items()}
    return {
        "key": key,
        **paper_claims().loc[key],
        "paper": paper,
        **numbers,
        **verdicts,
        "decides": ESTIMATORS[decides],
        "verdict": verdicts[f"{decides}_verdict"],
        "why": why,
    }


@cache
def paper_claims() -> pd.DataFrame:
    """The paper's claims in its own words by ``key``: ``part``, ``claim``, and what its ``numbers`` are.

    Words in square brackets are ours.
    """
    return pd.read_csv(DATA / "paper" / "claims.csv").set_index("key")


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
