"""Assumptions varied: each alone, by its factor, and counted by hand."""

from dataclasses import asdict

import numpy as np
import pandas as pd

from lmmap.settings import Assumptions
from lmmap_lab.studies.assumptions import COMMITTED, effects, variants


def test_each_assumption_is_changed_alone_by_its_factor():
    (_, _, assumed), *changed = variants()
    assert assumed == Assumptions() and len(changed) == 2 * len(asdict(assumed))
    for name, word, other in changed:
        was, now = asdict(assumed), asdict(other)
        assert now.pop(name) == {"halved": 0.5, "doubled": 2}[word] * was.pop(name) and now == was


def test_effects_by_hand():
    """Two images with the ring in view, of which one is found and wrong; one image without."""
    table = pd.DataFrame({
        "in_view": [True, True, False], "position_error_m": [0.03, np.nan, 0.01],
        "normal_error_deg": [4.0, np.nan, 2.0], "rotation_error_deg": [4.0, np.nan, 2.0],
    })  # fmt: skip
    first = effects([table] * len(variants())).iloc[0]
    assert (first.found_percent, first.wrong_percent, first.images) == (50, 50, 2)
    assert (first.position_mm, first.normal_deg) == (20, 3)


def test_the_committed_table_is_of_the_present_assumptions():
    table = pd.read_csv(COMMITTED).set_index(["assumption", "change"])
    for name, change, assumed in variants()[1:]:
        assert table.loc[(name, change), "value"] == asdict(assumed)[name]
