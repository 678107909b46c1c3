"""The study on made-up estimates: it goes on where it stopped, ends, and has every table."""

import ast

import numpy as np
import pandas as pd
import pytest
from conftest import facing_pose

from lmmap import results, study
from lmmap.accuracy import compare
from lmmap.core import Camera, Ellipse, Estimate, Pose, Recording, Status, Trajectory
from lmmap.trajectories import write_estimates

T = facing_pose(0.3, 0.2, 0.1, [0.0, 0.0, 0.6])
OFF = [Pose(T.rotation, T.position_m + np.array([1e-3 * k, 0, 0])) for k in range(3)]
SPREAD = np.diag([1e-3] * 3 + [1e-2] * 3) ** 2


def recorded(name, seconds, folder, report):
    t_us = np.arange(0, 3_000_001, 100_000)
    truth = Trajectory(t_us, Pose(np.repeat(T.rotation[None], 31, 0), np.repeat(T.position_m[None], 31, 0)))
    frames = np.zeros((2, 260, 346, 3), np.uint8)
    times_us = np.array([0, 50_000])
    return Recording(
        name, Camera.davis346(), np.empty(0), frames, times_us, None if "empty" in name else truth
    )


class Estimates:
    """Stands for `study._estimates`: good poses where there is a port, written and counted."""

    def __init__(self, stop_at=None):
        self.made, self.stop_at = [], stop_at

    def __call__(self, recording, modality, gap, rate_hz, folder, report):
        name = study.label(recording.name, modality, gap)
        if name == self.stop_at:
            raise KeyboardInterrupt
        self.made.append(name)
        ellipse = Ellipse([170, 130], [40, 38], 0.1)
        port = recording.truth is not None
        found = [
            Estimate(100_000 * k, Status.OK, OFF[k % 3], T, T, ellipse, covariance=SPREAD) if port
            else Estimate(100_000 * k, Status.NO_RING)
            for k in range(30)
        ]  # fmt: skip
        write_estimates(found, folder / f"estimates-{name}.csv")
        return found


@pytest.fixture
def quick(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "DERIVED", tmp_path)
    monkeypatch.setattr(study, "recorded", recorded)
    monkeypatch.setattr(study, "DRAWS", 50)
    fit = pd.DataFrame({"filter": ["ring"], "modality": "rgb", "iou": 1.0,
                        "skeleton_px": 0.0, "stray": 0.0, "missed": 0.0, "mask_px": 9})  # fmt: skip
    monkeypatch.setattr(
        study,
        "filter_quality",
        lambda recording, gaps: fit.merge(pd.Series(gaps, name="domain_gap"), how="cross"),
    )
    return tmp_path / "quick"


def test_interrupted_it_goes_on_and_a_second_run_has_nothing_to_do(quick, monkeypatch):
    first = Estimates(stop_at="test-high-rgb")
    monkeypatch.setattr(study, "_estimates", first)
    with pytest.raises(KeyboardInterrupt):
        study.reproduce("quick", lambda line: None)
    assert not (quick / "summary.csv").exists()
    second, lines = Estimates(), []
    monkeypatch.setattr(study, "_estimates", second)
    study.reproduce("quick", lines.append)
    assert lines == ["test-low: up to date", "test-medium: up to date"]
    assert not [n for n in second.made if n.startswith(("test-low", "test-medium"))]

    cells = compare(quick)
    assert len(cells) == 192 and cells.notna().all(axis=None)
    errors = cells[cells.metric == "position_error_m"]
    assert errors.ours.between(0, 2e-3).all() and errors.printed.eq(0).all()
    assert (errors.ours_low <= errors.ours + 1e-12).all() and (errors.ours <= errors.ours_high + 1e-12).all()
    counts = pd.read_csv(quick / "counts.csv").set_index(["sequence", "modality"])
    assert len(counts) == 3 * len(study.sequences_of("quick"))
    assert counts.loc[("test-low", "rgb"), "position_error_m"] == pytest.approx(1e-3)
    assert counts.loc[("empty-0", "fused"), "poses"] == 0 < counts.loc[("hard-slow", "fused"), "poses"]
    assert len(pd.read_csv(quick / "coverage.csv")) == 18
    assert len(pd.read_csv(quick / "distribution.csv")) == 18 * 101
    answers = pd.read_csv(quick / "answers.csv")
    assert set(answers.status) == {"ok"} and (answers.in_view == 30).all() and len(answers) == 18
    assert len(pd.read_csv(quick / "fusion.csv")) == 6 * 3
    fits = pd.read_csv(quick / "filters.csv")
    assert len(fits) == 3 * len(study.shipped_gaps()) and (fits.iou == 1).all() and (fits.images == 1).all()
    assert pd.read_csv(quick / "claims.csv").verdict.notna().all()

    third = Estimates()
    monkeypatch.setattr(study, "_estimates", third)
    before = (quick / "summary.csv").stat().st_mtime_ns
    study.reproduce("quick", lines.append)
    assert not third.made and (quick / "summary.csv").stat().st_mtime_ns == before


def test_estimates_are_kept_by_all_that_makes_them():
    def below(name):
        source = (results.ROOT / "lmmap" / f"{name}.py").read_text()
        modules = [n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.ImportFrom) and n.level]
        named = {x for n in modules for x in ([n.module] if n.module else [a.name for a in n.names])}
        return {name}.union(*map(below, named))

    made_of = below("pipeline") | below("trajectories")
    assert sorted(study.OF_ESTIMATES) == sorted(f"lmmap/{name}.py" for name in made_of)


def test_estimates_outlive_weights_that_did_not_make_them(tmp_path, monkeypatch):
    root, made = tmp_path / "root", []
    weights = [root / "data" / "weights" / f"ring-event-{gap}.safetensors" for gap in ("low", "robust")]
    weights[0].parent.mkdir(parents=True)
    monkeypatch.setattr(results, "ROOT", root)
    monkeypatch.setattr(study, "Estimator", lambda camera, port, modality, gap: made.append(gap))
    monkeypatch.setattr(study, "estimate", lambda *_: [Estimate(0, Status.NO_RING)])
    seen = recorded("test-low", 3, tmp_path, None)

    def count():
        study._estimates(seen, "event", "low", 10.0, tmp_path, lambda line: None)
        return len(made)

    assert [count(), count()] == [1, 1]
    weights[1].write_text("another robust set")
    assert count() == 1
    weights[0].write_text("another low gap's set")
    assert count() == 2


def test_the_paper_profile_has_three_of_each():
    names = study.sequences_of("paper")
    assert len(names) == len(set(names)) == 9 + 2 + 3
    assert set(study.sequences_of("quick")) < set(names)
