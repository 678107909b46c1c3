"""Shared by the laboratory's tests."""

import numpy as np
import pandas as pd
import pytest

from lmmap.shipped import DATA


@pytest.fixture
def compared():
    """One quarter of the paper's table, ours twice as large with intervals, and no *certain*."""
    table = pd.read_csv(DATA / "paper" / "table1.csv").rename(columns={"value": "table1"})
    table = table.query("training == 'low-domain-gap' and outlier_filter == 'without'")
    return table.assign(ours=2 * table.table1, ours_low=table.table1, ours_high=3 * table.table1,
                        printed=table.table1, printed_low=table.table1, printed_high=table.table1,
                        fused=np.nan)  # fmt: skip
