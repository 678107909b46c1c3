"""The study on made-up estimates: it goes on where it stopped, ends, and has every table."""

import re
from functools import cache
from shutil import copytree

import numpy as np
import pandas as pd
import pytest
from strategies import facing_pose

from lmmap.recordings.pose_files import write_estimates
from lmmap.types import (
    EVENT,
    Camera,
    Ellipse,
    Estimate,
    InputError,
    Port,
    Pose,
    Recording,
    Status,
    Trajectory,
)
from lmmap_lab import provenance
from lmmap_lab.studies import accuracy_run, carry, ladder, sequence_files
from lmmap_lab.studies.archive import carry_over, pack, provenance_of, unpack
from lmmap_lab.studies.table1 import compare

T = facing_pose(0.3, 0.2, 0.1, [0.0, 0.0, 0.6])
OFF = [Pose(T.rotation, T.position_m + np.array([1e-3 * k, 0, 0])) for k in range(3)]
IMAGES = 15  # of each sequence
SPREAD = np.diag([1e-3] * 3 + [1e-2] * 3) ** 2


def recorded(name, seconds, folder, report):
    t_us = 100_000 * np.arange(IMAGES + 1)
    truth = Trajectory(t_us, Pose.stack([T] * len(t_us)))
    frames = np.full((2, 260, 346, 3), 128 * name.endswith("1"), np.uint8)
    times_us = np.array([0, 50_000])
    return Recording(
        name, Camera.davis346(), np.empty(0, EVENT), frames, times_us, None if "empty" in name else truth
    )


class Estimates:
    """Stands for `kept_estimates`: good poses where there is a port, written and counted."""

    def __init__(self, stop_at=None):
        self.made, self.stop_at = [], stop_at

    def __call__(self, recording, modality, gap, rate_hz, folder, report):
        name = accuracy_run.label(recording.name, modality, gap)
        if name == self.stop_at:
            raise KeyboardInterrupt
        self.made.append(name)
        estimates, rungs = estimated(recording.name, recording.truth is not None)
        write_estimates(estimates, folder / f"estimates-{name}.csv")
        if recording.name.startswith("test"):
            rungs.to_csv(folder / f"ladder-{name}.csv", index=False)
        return estimates


@cache
def estimated(name: str, port: bool) -> tuple[list[Estimate], pd.DataFrame | None]:
    """A sequence's estimates, and what the ladder has of them."""
    ellipse, turn = Ellipse([170, 130], [40, 38], 0.1), len(name) % 3
    off = OFF[turn:] + OFF[:turn]
    estimates = [
        Estimate(100_000 * k, Status.OK, off[k % 3], T, T, ellipse, covariance=SPREAD,
                 confidence=0.95) if port
        else Estimate(100_000 * k, Status.NO_RING)
        for k in range(IMAGES)
    ]  # fmt: skip
    rungs = [dict.fromkeys(ladder.MEASURED, e) for e in estimates]
    return estimates, ladder.errors(recorded(name, 3, None, None), rungs, Port.lm_map()) if port else None


def perfect_masks(recording, gaps, modalities=None):
    fit = pd.DataFrame({"filter": ["ring"], "modality": "rgb", "iou": 1.0,
                        "skeleton_px": 0.0, "stray": 0.0, "missed": 0.0, "mask_px": 9})  # fmt: skip
    return fit.merge(pd.Series(gaps, name="domain_gap"), how="cross")


def made_up(folder, estimates=None, **parts):
    """A study of made-up estimates in a folder."""
    return accuracy_run.Study(
        folder,
        recording=recorded,
        estimates=estimates or Estimates(),
        mask_quality=perfect_masks,
        draws=50,
        **parts,
    )


@pytest.fixture(scope="module", autouse=True)
def one_commit():
    """Git is asked once, not for each of several hundred tables."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(provenance, "commit", cache(provenance.commit))
        yield


@pytest.fixture
def quick(tmp_path):
    return tmp_path / "quick"


def test_interrupted_it_goes_on_and_a_second_run_has_nothing_to_do(quick):
    first = Estimates(stop_at="test-high-rgb")
    with pytest.raises(KeyboardInterrupt):
        accuracy_run.reproduce("quick", lambda line: None, study=made_up(quick.parent, first))
    assert not (quick / "summary.csv").exists()
    second, lines = Estimates(), []
    accuracy_run.reproduce("quick", lines.append, study=made_up(quick.parent, second))
    assert lines == ["test-low: up to date", "test-medium: up to date"]
    assert not [n for n in second.made if n.startswith(("test-low", "test-medium"))]

    cells = compare(quick)
    stated = cells[cells.metric != "wrong_percent"]
    assert len(stated) == 192 and stated.notna().all(axis=None)
    wrong = cells[cells.metric == "wrong_percent"].drop(columns="table1")
    assert len(wrong) == 24 and (wrong.ours == 0).all() and wrong.notna().all(axis=None)
    rungs = pd.read_csv(quick / "ladder.csv")
    assert len(rungs) == 3 * 2 * 2 * len(ladder.RUNGS) * 2 * 9 and rungs.value.notna().all()
    errors = cells[cells.metric == "position_error_m"]
    assert errors.ours.between(0, 2e-3).all() and errors.printed.eq(0).all()
    assert (errors.ours_low <= errors.ours + 1e-12).all() and (errors.ours <= errors.ours_high + 1e-12).all()
    counts = pd.read_csv(quick / "counts.csv").set_index(["sequence", "modality"])
    assert len(counts) == 3 * len(accuracy_run.sequences_of("quick"))
    assert counts.loc[("test-low", "rgb"), "position_error_m"] == pytest.approx(1e-3)
    assert counts.loc[("empty-0", "fused"), "poses"] == 0 < counts.loc[("hard-slow", "fused"), "poses"]
    assert len(pd.read_csv(quick / "coverage.csv")) == 18
    assert len(pd.read_csv(quick / "distribution.csv")) == 18 * 101
    answers = pd.read_csv(quick / "answers.csv")
    assert set(answers.status) == {"ok"} and (answers.in_view == IMAGES).all() and len(answers) == 18
    assert len(pd.read_csv(quick / "fusion.csv")) == 6 * 3
    fits = pd.read_csv(quick / "filters.csv")
    assert (
        len(fits) == 3 * len(accuracy_run.shipped_sets())
        and (fits.iou == 1).all()
        and (fits.images == 1).all()
    )
    assert pd.read_csv(quick / "claims.csv").verdict.notna().all()

    third = Estimates()
    before = (quick / "summary.csv").stat().st_mtime_ns
    accuracy_run.reproduce("quick", lines.append, study=made_up(quick.parent, third))
    assert not third.made and (quick / "summary.csv").stat().st_mtime_ns == before


@pytest.fixture(scope="module")
def whole_study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    study = made_up(folder / "derived", committed=folder / "committed")
    accuracy_run.reproduce("paper", print, pictures=picture, study=study)
    return folder


@pytest.fixture
def paper(whole_study, tmp_path):
    """The committed folder of a whole study, whose results are in "derived" beside it."""
    copytree(whole_study, tmp_path, dirs_exist_ok=True)
    return tmp_path / "committed"


def picture(recording, folder, labels, rate_hz):
    path = folder / f"picture-{recording.name}.jpg"
    path.write_text(" ".join(labels))
    return [path]


def test_on_another_machine_a_study_goes_on_from_what_is_packed(paper, tmp_path):
    assert sorted(p.stem for p in (paper / "sequences").glob("*")) == sorted(
        accuracy_run.sequences_of("paper")
    )
    tables = {p.name: p.read_text() for p in paper.glob("*.csv")}
    assert len(tables) == 19
    other, left, lines = tmp_path / "other", Estimates(), []
    study = made_up(other, left, committed=paper)
    (paper / "sequences" / "test-low.zip").unlink()
    assert accuracy_run.reproduce("paper", lines.append, pictures=picture, go_on=True, study=study)
    assert {name.split("-rgb")[0].split("-event")[0] for name in left.made} == {"test-low"}
    assert {p.name: p.read_text() for p in paper.glob("*.csv")} == tables
    assert (other / "paper" / "picture-empty-0.jpg").read_text() == "empty-0-rgb-robust empty-0-event-robust"
    assert not (other / "paper" / "picture-hard-slow.jpg").exists()
    assert not accuracy_run.reproduce("paper", lines.append, go_on=True, study=study)


def test_what_is_packed_is_not_taken_unasked_nor_of_another_version(paper, tmp_path, monkeypatch):
    made = Estimates()
    monkeypatch.setattr(accuracy_run, "_tabulate", lambda profile, study: None)  # tables are not asked for

    def run(folder, **options):
        go_on = options.pop("go_on", False)
        study = made_up(tmp_path / folder, made, committed=paper, **options)
        accuracy_run.reproduce("paper", print, go_on=go_on, study=study)
        return len(made.made)

    assert run("derived") == 0  # in the folder all is up to date
    everything = run("repeated")
    assert everything == 2 * (3 * 4 + 2 * 1 + 3 * 3)  # cameras, sequences, sets of networks
    assert run("changed", go_on=True, code=[Port]) == 2 * everything


def test_sequences_that_another_version_ran_are_named(paper, tmp_path):
    study = made_up(tmp_path / "other", committed=paper)
    assert accuracy_run.run_before("paper", study) == []
    (paper / "sequences" / "test-low.zip").unlink()
    assert accuracy_run.run_before("paper", study) == ["test-low"]
    changed = made_up(tmp_path / "other", committed=paper, code=[Port])
    assert accuracy_run.run_before("paper", changed) == accuracy_run.sequences_of("paper")


@pytest.fixture
def of_earlier_code(paper, monkeypatch):
    """Archives that other code made, which gave the results of the present code; what is sampled of them."""

    def beginning(name, kept, seed):
        return recorded(name, 3, None, None), 1_000_000

    monkeypatch.setattr(carry, "sample", beginning)
    for path in (paper / "sequences").glob("*.zip"):
        carry_over(path, "of earlier code")
    return made_up(paper.parent / "carried", committed=paper)


def test_archives_of_other_code_are_carried_over_where_a_sample_is_equal(of_earlier_code):
    lines, study = [], of_earlier_code
    assert len(accuracy_run.run_before("paper", study)) == 8
    carry.carry(lines.append, study)
    assert len(lines) == 8 and all("rows are equal, carried over" in line for line in lines)
    assert accuracy_run.run_before("paper", study) == []
    *_, last = provenance_of(study.archive("test-low"))["carried_over"]
    assert last["from"] == "of earlier code" and last["rows"] > 200 and last["beginning_s"] == 1.0
    assert last["processor"] == provenance.processor() and last["commit"] == provenance.commit()
    lines.clear()
    carry.carry(lines.append, study)
    assert set(lines) == {f"{name}: up to date" for name in accuracy_run.sequences_of("paper")}


def test_an_archive_with_other_numbers_is_not_carried_over(of_earlier_code, tmp_path):
    study, folder = of_earlier_code, tmp_path / "unpacked"
    path = study.archive("test-low")
    unpack(path, folder)
    for table in ("confidence-test-low-rgb-robust", "errors-test-low-fused", "ladder-test-low-event"):
        rows = (folder / f"{table}.csv").read_text().splitlines()
        rows[3] = rows[3].replace("0.", "0.0", 1)
        (folder / f"{table}.csv").write_text("\n".join(rows) + "\n")
    pack(path, folder.iterdir(), folder, "of earlier code")
    before, lines = path.read_bytes(), []
    with pytest.raises(InputError, match=r"^test-low: of other code.*make it again"):
        carry.carry(lines.append, study)
    assert path.read_bytes() == before and accuracy_run.run_before("paper", study) == ["test-low"]
    assert re.fullmatch(
        r"test-low: 3 of \d+ rows differ: confidence-test-low-rgb-robust: 200000, .*", lines[0]
    )


def test_nothing_is_carried_over_between_kinds_of_processors(of_earlier_code, monkeypatch):
    monkeypatch.setattr(carry, "processor", lambda: "m68000")
    with pytest.raises(InputError, match=r"test-low.zip: a \w+ made it, this is a m68000"):
        carry.carry(print, of_earlier_code)
    assert len(accuracy_run.run_before("paper", of_earlier_code)) == 8


def test_damaged_packed_results_are_one_clear_error(paper, tmp_path):
    path = paper / "sequences" / "test-low.zip"
    path.write_bytes(path.read_bytes()[:200])
    study = made_up(tmp_path / "other", committed=paper)
    with pytest.raises(InputError, match=r"test-low.zip: no readable results .* restore it or delete it"):
        accuracy_run.reproduce("paper", print, go_on=True, study=study)
    with pytest.raises(InputError, match=r"test-low.zip: no readable results .* restore it or delete it"):
        accuracy_run.run_before("paper", study)


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


def test_estimates_outlive_weights_that_did_not_make_them(tmp_path, monkeypatch):
    root, made = tmp_path / "root", []
    weights = [root / "data" / "weights" / f"ring-event-{gap}.safetensors" for gap in ("low", "robust")]
    weights[0].parent.mkdir(parents=True)
    for path in (*weights, root / "environment.txt"):
        path.write_text("at first")
    monkeypatch.setattr(provenance, "ROOT", root)
    recording = recorded("hard-slow", 3, tmp_path, None)

    def make(*of):
        made.append(of)
        return [Estimate(0, Status.NO_RING)]

    def count():
        sequence_files.kept_estimates(recording, "event", "low", 10.0, tmp_path, lambda line: None, make)
        return len(made)

    assert [count(), count()] == [1, 1]
    weights[1].write_text("another robust set")
    assert count() == 1
    weights[0].write_text("another low gap's set")
    assert count() == 2


def test_the_paper_profile_has_the_same_tests_and_more_without_a_port():
    names = accuracy_run.sequences_of("paper")
    assert len(names) == len(set(names)) == 3 + 2 + 3
    assert set(accuracy_run.sequences_of("quick")) < set(names)


def test_rows_are_alike_up_to_their_last_digit():
    row = ("97408000", "ok", "True", "0.00504362", "")
    for other, equal in (("0.00504361", True), ("0.00504382", False), ("0.0050", False), ("", False)):
        assert carry.alike(row, (*row[:3], other, "")) is equal
    assert not carry.alike(row, ("97408001", *row[1:])) and not carry.alike(row, (row[0], "unsure", *row[2:]))
