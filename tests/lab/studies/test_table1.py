"""Intervals of the table's cells, and the paper's table beside ours."""

import numpy as np
import pandas as pd
import pytest
from test_error_table import answer, recording  # noqa: F401

from lmmap.evaluation import error_table
from lmmap.types import Port
from lmmap_lab.provenance import DATA
from lmmap_lab.studies import table1


def test_compare_has_every_cell_of_the_papers_table(tmp_path):
    paper = pd.read_csv(DATA / "paper" / "table1.csv").assign(low=0.0, high=1e3)
    twice, frames = paper.assign(variant="printed", value=2 * paper.value), paper[paper.modality == "rgb"]
    variants = [paper.assign(variant="exact"), twice, paper.assign(variant="certain"),
                frames.assign(variant="fused", modality="fused")]  # fmt: skip
    pd.concat(variants).to_csv(tmp_path / "summary.csv", index=False)
    table = table1.compare(tmp_path)
    assert len(table) == len(paper)
    assert table.ours.tolist() == pytest.approx(table.table1.tolist())
    assert table.printed.tolist() == pytest.approx((2 * table.table1).tolist())
    rgb = table[table.modality == "rgb"]
    assert rgb.fused.tolist() == pytest.approx(rgb.table1.tolist())
    assert (table.ours_low == 0).all() and (table.fused_high == 1e3).all()


def test_intervals_hold_their_value_and_two_sequences_count_as_one(recording):  # noqa: F811
    shifts_m = np.random.default_rng(0).uniform(0, 0.01, 120)
    estimates = [answer(recording, 5000 * k, shift_m) for k, shift_m in enumerate(shifts_m)]
    table = error_table.errors(recording, estimates, Port.lm_map())
    summary = table1.summary([table, table], draws=200)
    exact = summary[(summary.variant == "exact") & (summary.outlier_filter == "without")]
    assert (exact.low <= exact.value + 1e-12).all() and (exact.value <= exact.high + 1e-12).all()
    median = exact[(exact.metric == "position_error_m") & (exact.statistic == "median")].value.item()
    assert median == pytest.approx(table.position_error_m.median())
    pd.testing.assert_frame_equal(summary, table1.summary([table, table], draws=200))
