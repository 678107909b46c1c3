"""Of many images' errors: each law on made-up tables."""

import numpy as np
import pandas as pd
import pytest

from lmmap_lab.studies import error_statistics


def test_coverage_counts_the_poses_inside():
    nees, normal_deg = [0.0, 1.0, 100.0, 50.0, np.nan], [1.0, 9.0, 9.0, 1.0, 9.0]
    table = pd.DataFrame({"nees": nees, "normal_error_deg": normal_deg, "rotation_error_deg": 10.0})
    shares = error_statistics.coverage([table, table], draws=100)
    assert (shares["poses"], shares["inside_95_percent"], shares["wrong_percent"]) == (8, 50, 25)
    turned = error_statistics.coverage([table.assign(rotation_error_deg=60.0)], draws=100)
    assert turned["wrong_percent"] == 50
    assert 0 <= shares["low"] <= shares["inside_95_percent"] <= shares["high"] <= 100


def test_a_sequence_alone():
    errors = {metric: [1.0, 3.0, np.nan, 5.0] for metric in error_statistics.METRICS}
    table = pd.DataFrame({"in_view": [True, True, True, False], "nees": [0.0, 99.0, np.nan, 1.0], **errors})
    summary = error_statistics.sequence_summary(table)
    assert [summary[name] for name in ("found_percent", "inside_95_percent")] == pytest.approx([200 / 3] * 2)
    assert summary["position_error_m"] == summary["rotation_error_deg"] == 3


def test_a_ring_cut_by_the_edge_counts_apart():
    errors = {metric: [3.0, 4.0, np.nan, 7.0] for metric in error_statistics.METRICS}
    table = pd.DataFrame({"in_view": [True, True, True, False], **errors})
    by_view = error_statistics.by_view([table, table]).set_index("in_view")
    assert by_view.poses.to_dict() == {True: 4, False: 2}
    assert by_view.position_error_m.to_dict() == pytest.approx({True: 12.5**0.5, False: 7})


def test_versus_is_a_paired_difference():
    t_us = np.arange(60) * 100_000
    error = np.random.default_rng(2).uniform(0, 1, 60)
    base = pd.DataFrame({"t_us": t_us, "e": error})
    shifted = pd.DataFrame({"t_us": t_us + 20_000, "e": error + 0.25})
    same, apart = (
        error_statistics.median_difference([base], [base], "e", 100),
        error_statistics.median_difference([shifted], [base], "e", 100),
    )
    assert (same["difference"], same["low"], same["high"]) == (0, 0, 0)
    assert [apart[k] for k in ("difference", "low", "high")] == pytest.approx([0.25] * 3)
    late = shifted.assign(t_us=shifted.t_us + 10**9)
    nothing = error_statistics.median_difference([base], [late], "e", 100)
    assert nothing["images"] == 0 and np.isnan(nothing["low"])


def test_versus_pairs_within_a_sequence():
    t_us = np.arange(60) * 100_000
    low, high = (pd.DataFrame({"t_us": t_us, "e": e}) for e in (0.0, 1.0))
    together = error_statistics.median_difference([low, high], [high, low], "e", 100)
    assert together["images"] == 120 and together["difference"] == 0
    assert error_statistics.median_difference([low, low], [high, high], "e", 100)["difference"] == -1
    half = error_statistics.median_difference([low, low], [high, high.assign(t_us=t_us + 10**9)], "e", 100)
    assert (half["images"], half["difference"]) == (60, -1)


def of_errors(offset: float, images: int = 100) -> pd.DataFrame:
    columns = ["position_error_m", "normal_error_deg", "rotation_error_deg"]
    ours = {name: np.linspace(0, 1, images) + offset for name in columns}
    printed = {f"paper_{name}": 2 * values for name, values in ours.items()}
    return pd.DataFrame({"t_us": 100_000 * np.arange(images), **ours, **printed, "nees": np.nan})


def test_fusion_is_set_against_the_better_camera_of_each_error():
    rgb, event = of_errors(0.2), of_errors(0.3)
    event["normal_error_deg"] -= 0.2
    tables = {"rgb": [rgb, rgb], "event": [event, event], "fused": [of_errors(0.15)] * 2}
    compared = error_statistics.against_better(tables, draws=20).set_index("metric")
    assert compared.better.to_dict() == {"position_error_m": "rgb", "normal_error_deg": "event",
                                         "rotation_error_deg": "rgb"}  # fmt: skip
    assert compared.difference.tolist() == pytest.approx([-0.05, 0.05, -0.05])
    assert (compared.images == 200).all()


def test_a_distribution_is_that_of_all_sequences_together():
    first, second = of_errors(0.0, 101), of_errors(1.0, 101)
    alone = error_statistics.distribution([first]).set_index("percent")
    assert alone.position_error_m.to_numpy() == pytest.approx(alone.index / 100)
    assert alone.paper_normal_error_deg.to_numpy() == pytest.approx(alone.index / 50)
    assert alone.nees.isna().all()
    both = error_statistics.distribution([first, second]).set_index("percent").position_error_m
    assert (both[0], both[100]) == (0, 2) and both[50] == pytest.approx(1)
    assert both.is_monotonic_increasing


def test_answers_are_of_images_with_the_ring_in_view():
    table = pd.DataFrame({"status": ["ok", "no_ring", "ok", "no_ring"], "in_view": [True, True, True, False]})
    counts = error_statistics.answers([table, table])
    assert dict(zip(counts.status, counts.in_view, strict=True)) == {"ok": 4, "no_ring": 2}


def test_a_promise_is_by_groups_of_what_was_predicted():
    sigma = np.repeat([1.0, 2.0, 4.0, 8.0], 50)
    error = sigma * np.tile(np.linspace(0, 2, 50), 4)
    table = pd.DataFrame({"position_sigma_m": sigma, "position_error_m": error,
                          "normal_sigma_deg": sigma[::-1], "normal_error_deg": np.nan})  # fmt: skip
    mixed = table.sample(frac=1, random_state=0)
    by_group = error_statistics.promise([mixed[:90], mixed[90:]], groups=4)
    assert set(by_group.what) == {"position_m"} and by_group.predicted.tolist() == [1, 2, 4, 8]
    assert (by_group.error / by_group.predicted).tolist() == pytest.approx([1] * 4)
    assert (by_group.most / by_group.predicted).tolist() == pytest.approx([1.9] * 4)
