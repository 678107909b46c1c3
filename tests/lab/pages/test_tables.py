"""Tables of pages: each number where it belongs, and the same bytes each time."""

import re
from itertools import product

import numpy as np
import pandas as pd
import pytest

from lmmap.recordings.columns import TABLE
from lmmap.types import Status
from lmmap_lab.pages import tables


def test_a_table_says_in_words_what_the_numbers_say(compared):
    estimators = {**tables.ESTIMATORS, "printed": "printed", "certain": "certain"}
    table = tables.accuracy_table(compared, estimators=estimators)
    stated = [words for (metric, _), words in tables.WORDS.items() if metric != "wrong_percent"]
    assert table.index.tolist() == list(product(stated, estimators.values()))
    for (metric, statistic, light, camera), row in compared.groupby(
        ["metric", "statistic", "light", "modality"]
    ):
        of = table[tables.LIGHTS[light], tables.CAMERAS[camera]].loc[tables.WORDS[metric, statistic]]
        scale = 1e3 if metric == "position_error_m" else 1
        value, low_high = of.ours.rstrip(")").split(" (")
        ends = [float(end) for end in low_high.split(" to ")]
        stated, rounding = scale * row.table1.item(), 0.5 * 10.0 ** -tables.DIGITS.get(metric, 2) + 1e-9
        assert [float(value), *ends] == pytest.approx(stated * np.array([2, 1, 3]), abs=rounding)
        assert float(of.printed) == pytest.approx(stated, abs=rounding)  # its interval has no width
        assert of.paper == (f"{stated:.0f}" if metric == "position_error_m" else of.printed)
        assert of.fused == of.certain == "none"


def test_no_name_of_the_code_is_left(compared):
    page = tables.to_html(tables.small_intervals(tables.accuracy_table(compared)))
    shown = re.sub(r"<[^>]*>", "", page)
    assert "found, ring in view" in shown and "_" not in shown


def test_a_styled_table_has_the_same_bytes_each_time_and_identifiers_of_its_own():
    first, second = pd.DataFrame({"a": [1.0, 2.0]}), pd.DataFrame({"a": [1.0, 3.0]})
    assert first.style.to_html() != first.style.to_html()  # pandas draws a new identifier
    assert tables.to_html(first.style) == tables.to_html(first.style)
    identifiers = [tables.to_html(t.style).split('<table id="')[1].split('"')[0] for t in (first, second)]
    assert len(set(identifiers)) == 2


def test_every_status_has_its_words():
    assert set(tables.ANSWERS) == {str(status) for status in Status}


def test_facts_are_told_in_words_and_units():
    facts = {"events": 1234, "largest_gap_ms": 0.136, "gaps_over_10_ms": 0, "event_rate_hz": 401948.15,
             "events_at_s": [0.0, 1.4], "truth": True, "clocks": "may be one"}  # fmt: skip
    assert tables.facts_in_words(facts) == {
        "events": "1,234", "largest gap (ms)": "0.14", "gaps over 10 ms": "0", "event rate (Hz)": "401,948",
        "events at (s)": "0.00 to 1.40", "truth": "yes", "clocks": "may be one"}  # fmt: skip


def test_a_table_for_people_names_every_group():
    rows = tables.estimate_columns()
    assert len(rows) == len(TABLE)
    assert rows[0][:3] == ("t_us", "us", "the recording's clock")
    assert "cov_x_x … cov_rz_rz" in [row[0] for row in rows]
