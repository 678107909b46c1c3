"""The cost of a domain gap: by hand where nothing varies, and intervals that hold both sources of chance."""

import numpy as np
import pandas as pd
import pytest

from lmmap_lab.provenance import DATA, load_table
from lmmap_lab.studies import domain_gap

COST, LIGHT = "cost of the gap", "high"


def images(of_sequence, of_seed, sequences=12, seeds=3):
    """Overlaps ``of_sequence(k) + of_seed(name, seed)`` of two images each, the same for both cameras."""
    return pd.DataFrame([
        {"place": "film", "light": LIGHT, "sequence": f"s{k}", "modality": m, "set": name, "seed": seed,
         **dict.fromkeys(domain_gap.MEASURES, of_sequence(k) + of_seed(name, seed))}
        for k in range(sequences) for m in domain_gap.CAMERAS for name in ("high", "low")
        for seed in range(seeds) for _ in range(2)
    ])  # fmt: skip


def cell(table, modality, quantity, light=LIGHT):
    return domain_gap.cell(table, "film", "mask_overlap", light, modality, quantity)


def test_without_chance_the_cost_is_the_difference():
    table = domain_gap.table(images(lambda k: 0.0, lambda name, seed: {"low": 0.9, "high": 0.6}[name]), 100)
    cost = cell(table, "rgb", COST)
    assert [cost.value, cost.low, cost.high] == pytest.approx([0.3] * 3)
    both = cell(table, domain_gap.EITHER, COST, domain_gap.ALL_LIGHTS)
    assert [both.value, both.low, both.high] == pytest.approx([0.0] * 3)


def test_sequences_that_are_hard_for_both_sets_cost_no_certainty():
    """They are drawn together, so what is common to both sets cancels in the cost, and not in the levels."""
    table = domain_gap.table(images(lambda k: 0.5 * (k % 2), lambda name, seed: 0.3 * (name == "low")), 400)
    cost, level = cell(table, "event", COST), cell(table, "event", "low")
    assert cost.high - cost.low == pytest.approx(0, abs=1e-9) and level.high - level.low > 0.1


def test_seeds_widen_the_interval_as_their_scatter_says():
    """Of three seeds with a deviation of s a set's mean has s / sqrt(3), and the cost sqrt(2) times that."""
    spread = np.array([-0.06, 0.0, 0.06])
    table = domain_gap.table(images(lambda k: 0.4, lambda name, seed: spread[seed]), 4000)
    cost = cell(table, "rgb", COST)
    expected = 1.96 * spread.std(ddof=1) / np.sqrt(3) * np.sqrt(2)
    assert (cost.high - cost.low) / 2 == pytest.approx(expected, rel=0.15)
    assert [cost.seed_0, cost.seed_1, cost.seed_2] == pytest.approx([0, 0, 0])
    assert domain_gap.extremes(table, "film", "mask_overlap", LIGHT, "rgb") == pytest.approx((-0.12, 0.12))


def test_the_committed_study_has_three_seeds_and_both_places():
    table = load_table(DATA / "results" / "domain-gap.csv")
    sets = table[table.quantity.isin(["high", "low"])]
    assert sets.filter(like="seed_").notna().all(axis=None) and set(table.place) == {"film", "second scene"}
    inside = table.value.between(table.low, table.high)
    assert inside[table.quantity.isin(domain_gap.DIFFERENCES)].mean() > 0.99
