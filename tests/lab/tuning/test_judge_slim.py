"""What is said of the set `light` beside the default one, by hand and by the committed table."""

import json

import judge_slim
import numpy as np
import pandas as pd
import pytest

from lmmap_lab.provenance import DATA
from lmmap_lab.studies.networks import set_hashes


def test_more_right_poses_by_hand():
    """Of four images one is gained and one lost: in two sequences the interval is that of two draws."""
    sequence = list("aabb")
    ours, others = (pd.DataFrame({"sequence": sequence, "right": r}) for r in ([1, 1, 0, 0], [0, 1, 0, 1]))
    found = judge_slim.more_right(ours, others)
    half = 100 * 1.96 * np.sqrt(2) / 4
    assert list(found.values()) == pytest.approx([0, -half, half])
    assert judge_slim.more_right(ours, ours)["more_right_high"] == 0


def test_images_of_one_sequence_that_err_together_are_worth_one():
    ours, others = np.array([1, 1, 0, 0]), np.array([0, 0, 1, 1])
    wide, narrow = (
        judge_slim.more_right(*(pd.DataFrame({"sequence": list(names), "right": r}) for r in (ours, others)))
        for names in ("aabb", "abcd")
    )
    assert wide["more_right_high"] == pytest.approx(np.sqrt(2) * narrow["more_right_high"])


def test_the_table_is_of_the_shipped_networks_and_counts_every_image():
    table = pd.read_csv(DATA / "results" / "slim.csv")
    facts = json.loads((DATA / "results" / "slim.provenance.json").read_text())
    assert facts["networks"] == {name: set_hashes(name) for name in judge_slim.JUDGED}
    shares = table[["right_percent", "wrong_percent", "none_percent"]]
    assert shares.sum(axis=1).to_numpy() == pytest.approx(100, abs=1e-3)
    cells = table[table.light != "all"].groupby(["set", "modality", "weights"]).images.sum()
    assert cells.equals(table[table.light == "all"].set_index(cells.index.names).images.sort_index())
