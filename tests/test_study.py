"""The study on made-up estimates: it goes on where it stopped, ends, and has every table."""

import ast

import numpy as np
import pandas as pd
import pytest
from conftest import facing_pose

from lmmap import results, study, tabulation
from lmmap.accuracy import compare
from lmmap.core import Camera, Ellipse, Estimate, InputError, Pose, Recording, Status, Trajectory
from lmmap.kept import pack, unpack
from lmmap.trajectories import write_estimates

T = facing_pose(0.3, 0.2, 0.1, [0.0, 0.0, 0.6])
OFF = [Pose(T.rotation, T.position_m + np.array([1e-3 * k, 0, 0])) for k in range(3)]
SPREAD = np.diag([1e-3] * 3 + [1e-2] * 3) ** 2


def recorded(name, seconds, folder, report):
    t_us = np.arange(0, 3_000_001, 100_000)
    truth = Trajectory(t_us, Pose(np.repeat(T.rotation[None], 31, 0), np.repeat(T.position_m[None], 31, 0)))
    frames = np.full((2, 260, 346, 3), 128 * name.endswith("1"), np.uint8)
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
        port, turn = recording.truth is not None, len(recording.name) % 3
        off = OFF[turn:] + OFF[:turn]
        found = [
            Estimate(100_000 * k, Status.OK, off[k % 3], T, T, ellipse, covariance=SPREAD) if port
            else Estimate(100_000 * k, Status.NO_RING)
            for k in range(30)
        ]  # fmt: skip
        write_estimates(found, folder / f"estimates-{name}.csv")
        return found


@pytest.fixture
def quick(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "DERIVED", tmp_path)
    monkeypatch.setattr(study, "recorded", recorded)
    monkeypatch.setattr(tabulation, "DRAWS", 50)
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


@pytest.fixture
def paper(quick, monkeypatch):
    monkeypatch.setattr(study, "PUBLISHED", quick.parent / "published")
    monkeypatch.setattr(study, "_estimates", Estimates())
    study.reproduce("paper", print, pictures=picture)
    return study.PUBLISHED


def picture(recording, folder, labels, rate_hz):
    path = folder / f"picture-{recording.name}.jpg"
    path.write_text(" ".join(labels))
    return [path]


def test_on_another_machine_a_study_goes_on_from_what_is_packed(paper, quick, monkeypatch):
    assert sorted(p.stem for p in (paper / "sequences").glob("*")) == sorted(study.sequences_of("paper"))
    tables = {p.name: p.read_text() for p in paper.glob("*.csv")}
    assert len(tables) == 12
    other, left, lines = quick.parent / "other", Estimates(), []
    monkeypatch.setattr(study, "DERIVED", other)
    monkeypatch.setattr(study, "_estimates", left)
    (paper / "sequences" / "test-low-1.zip").unlink()
    assert study.reproduce("paper", lines.append, pictures=picture, go_on=True)
    assert {name.split("-rgb")[0].split("-event")[0] for name in left.made} == {"test-low-1"}
    assert {p.name: p.read_text() for p in paper.glob("*.csv")} == tables
    assert (other / "paper" / "picture-empty-0.jpg").read_text() == "empty-0-rgb empty-0-event"
    assert not (other / "paper" / "picture-hard-slow.jpg").exists()
    assert not study.reproduce("paper", lines.append, go_on=True)


def test_what_is_packed_is_not_taken_unasked_nor_of_another_version(paper, quick, monkeypatch):
    made = Estimates()
    monkeypatch.setattr(study, "_estimates", made)
    study.reproduce("paper", print)
    assert not made.made  # in the folder all is up to date
    monkeypatch.setattr(study, "DERIVED", quick.parent / "repeated")
    study.reproduce("paper", print)
    everything = len(made.made)
    assert everything == 9 * 4 + (2 + 3) * 2
    monkeypatch.setattr(study, "OF_RESULTS", ["lmmap/core.py"])
    monkeypatch.setattr(study, "DERIVED", quick.parent / "changed")
    study.reproduce("paper", print, go_on=True)
    assert len(made.made) == 2 * everything


def test_damaged_packed_results_are_one_clear_error(paper, quick, monkeypatch):
    path = paper / "sequences" / "test-low.zip"
    path.write_bytes(path.read_bytes()[:200])
    monkeypatch.setattr(study, "DERIVED", quick.parent / "other")
    with pytest.raises(InputError, match=r"test-low.zip: no readable results .* restore it or delete it"):
        study.reproduce("paper", print, go_on=True)


def test_equal_results_pack_to_equal_bytes(tmp_path):
    files = [tmp_path / name for name in ("b.csv", "a.csv")]
    for file in files:
        file.write_text(f"of {file.name}")
    first = pack(tmp_path / "x.zip", files, tmp_path, "mark").read_bytes()
    assert pack(tmp_path / "y.zip", files[::-1], tmp_path, "mark").read_bytes() == first
    assert unpack(tmp_path / "y.zip", tmp_path / "out", "mark")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["a.csv", "b.csv"]
    assert not unpack(tmp_path / "y.zip", tmp_path / "none", "another")
    assert not unpack(tmp_path / "z.zip", tmp_path / "none", "mark") and not (tmp_path / "none").exists()


def below(name):
    """A module and all that it imports."""
    source = (results.ROOT / "lmmap" / f"{name}.py").read_text()
    modules = [n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.ImportFrom) and n.level]
    named = {x for n in modules for x in ([n.module] if n.module else [a.name for a in n.names])}
    return {name}.union(*map(below, named))


def test_results_are_kept_by_all_that_makes_them():
    """But for the bootstrap, which comes after, and for how files are written."""
    made_of = set().union(*map(below, ("accuracy", "fusion", "quality", "pipeline", "sequences")))
    listed = {path[6:-3] for path in study.OF_RESULTS if path.startswith("lmmap/")}
    assert made_of - listed == {"resampling", "results"} and listed <= made_of
    assert len(set(study.OF_RESULTS)) == len(study.OF_RESULTS)


def test_estimates_are_kept_by_all_that_makes_them():
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
