"""The table of the chapter on networks: each number where it belongs."""

from itertools import product

import numpy as np
import pandas as pd
from strategies import facing_pose

from lmmap_lab.bench.labels import label_masks
from lmmap_lab.pages import networks_page


def test_networks_stand_by_light_each_with_its_own_numbers():
    of = product(("low", "high"), ("ring", "reflector"), ("rgb", "event"))
    rows = [(light, f, m, "low", 0.1 * k, 1.0 * k) for k, (light, f, m) in enumerate(of)]
    table = pd.DataFrame(rows, columns=["light", "filter", "modality", "domain_gap", "iou", "skeleton_px"])
    wide = networks_page.mask_table(table).data
    assert wide.shape == (4, 4)
    words = {"rgb": "frames", "event": "events", "ring": "ring", "reflector": "markers", "low": "low-gap"}
    for light, f, m, gap, iou, skeleton_px in rows:
        assert wide.loc[(words[gap], words[f], words[m]), ("overlap", light)] == iou
        assert wide.loc[(words[gap], words[f], words[m]), ("skeleton error (px)", light)] == skeleton_px


def test_each_input_stands_with_what_it_gains():
    names = list(networks_page.INPUTS)[::-1]
    rows = pd.DataFrame({"network": names, "right_percent": 10.0 * np.arange(len(names))})
    rows = rows.assign(gain=rows.right_percent - 60, gain_low=-70.0, gain_high=np.arange(len(names)))
    table = networks_page.inputs_table(rows)
    assert table.loc["counts"].tolist() == ["60.0", ""]
    assert table.loc["counts of each polarity"].tolist() == ["40.0", "-20.0 (-70.0 to 4.0)"]
    assert table.loc["robust, trained further"].tolist() == ["0.0", "-60.0 (-70.0 to 0.0) over robust"]


def test_a_mask_is_judged_against_the_true_pose(port, camera):
    T = facing_pose(0.4, 0.2, 0.1, [0.0, 0.0, 0.45])
    ring, markers = label_masks(T, port, camera)
    exact = {
        ("ring", "rgb"): lambda _: ring.astype(np.float32),
        ("reflector", "rgb"): lambda _: markers * 1.0,
    }
    empty = {key: lambda _: np.zeros(ring.shape, np.float32) for key in exact}
    perfect = networks_page.judge_masks(None, "rgb", T, exact, port)
    missed = networks_page.judge_masks(None, "rgb", T, empty, port)
    assert len(np.unique(perfect.reshape(-1, 3), axis=0)) == 2  # right, and background
    assert not np.array_equal(perfect[ring > 0][0], missed[ring > 0][0])
