"""Laws of the journal: it holds what `write_estimates` or `write_trajectory` would, and goes on anywhere."""

import os
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import facing_pose

from lmmap.recordings.journal import Journal
from lmmap.recordings.pose_files import read_estimates, trajectory_of, write_estimates, write_trajectory
from lmmap.types import Estimate, InputError, Status


def some_estimates(count: int, seed: int) -> list[Estimate]:
    rng = np.random.default_rng(seed)
    poses = [facing_pose(*rng.uniform(0, 1, 3), rng.uniform(0.1, 1, 3)) for _ in range(count)]
    t_us = np.cumsum(rng.integers(1, 10**6, count)) + 1_600_000_000_000_000
    answers = [(Status.OK, T) if rng.random() < 0.7 else (Status.NO_RING, None) for T in poses]
    return [Estimate(int(t), status, T) for t, (status, T) in zip(t_us, answers, strict=True)]


def write_whole(estimates, path, form):
    if form == "csv":
        write_estimates(estimates, path)
    else:
        write_trajectory(trajectory_of(estimates), path, "tum")


@given(st.integers(1, 12), st.integers(0, 99), st.sampled_from(["csv", "tum"]), st.data())
def test_cut_anywhere_and_resumed_it_is_the_whole_file(tmp_path_factory, count, seed, form, data):
    folder = tmp_path_factory.mktemp("journal")
    estimates = some_estimates(count, seed)
    write_whole(estimates, folder / "whole", form)
    whole = (folder / "whole").read_bytes()
    (folder / "cut").write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    with Journal(folder / "cut", form, resume=True) as journal:
        for e in estimates:
            if not journal.has(e.t_us + 1, e.t_us):  # it might have been estimated at another time
                journal.add(e)
    assert (folder / "cut").read_bytes() == whole


def test_each_estimate_is_on_disk_when_added(tmp_path):
    estimates = some_estimates(5, 0)
    with Journal(tmp_path / "p.csv") as journal:
        assert not (tmp_path / "p.csv").exists()
        for k, e in enumerate(estimates):
            journal.add(e)
            assert (tmp_path / "p.csv").read_text().count("\n") == k + 2
    assert journal.statuses == [str(e.status) for e in estimates]


@pytest.mark.parametrize("end", ["well", "by an error", "cut short", "by a kill"])
@pytest.mark.parametrize("made_of", [None, {"recording": "r"}])
def test_an_older_file_stays_until_the_new_one_is_whole(tmp_path, end, made_of):
    path, part, estimates = tmp_path / "p.csv", tmp_path / "p.csv.lmmap-part", some_estimates(4, 0)
    path.write_text("old\n")
    with suppress(KeyError), Journal(path, made_of=made_of) as journal:
        for k, e in enumerate(estimates[:2]):
            journal.add(e)
            assert path.read_text() == "old\n" and part.read_text().count("\n") == k + 2
        journal.is_whole = end == "well"
        if end == "by an error":
            raise KeyError
        if end == "by a kill":  # what a kill may leave between any two writes
            cut = part.read_bytes()
    if end == "by a kill":
        part.write_bytes(cut[:-30])
    assert part.exists() == (end != "well") and (path.read_text() == "old\n") == part.exists()
    if end == "well":
        assert len(read_estimates(path)) == 2
    with Journal(path, resume=True, made_of=made_of) as journal:
        assert journal.done_us == [e.t_us for e in estimates[: 1 if end == "by a kill" else 2]]
        for e in estimates:
            if not journal.has(e.t_us):
                journal.add(e)
    assert [e.t_us for e in read_estimates(path)] == [e.t_us for e in estimates]
    assert {p.name for p in tmp_path.iterdir()} == {"p.csv"} | ({"p.csv.made-of"} if made_of else set())


def test_what_an_interrupted_run_left_goes_with_the_next_that_does_not_resume(tmp_path):
    path = tmp_path / "p.csv"
    for old in (True, False):
        path.write_text("old\n")
        with Journal(path, made_of={}) as journal:
            journal.add(some_estimates(1, 0)[0])
            journal.is_whole = False
        if not old:
            path.unlink()
        with Journal(path, made_of={}):
            pass
        assert path.exists() == old  # nothing came, so nothing is replaced
        with Journal(path, made_of={}) as journal:
            journal.add(some_estimates(1, 1)[0])
        assert [e.t_us for e in read_estimates(path)] == [some_estimates(1, 1)[0].t_us]
        assert {p.name for p in tmp_path.iterdir()} == {"p.csv", "p.csv.made-of"}


def test_what_cannot_be_gone_on_with(tmp_path):
    (tmp_path / "p.csv").write_text("time,pose\n1,2\n")
    with pytest.raises(InputError, match=r"p\.csv: has other columns"):
        Journal(tmp_path / "p.csv", resume=True).__enter__()
    write_estimates(some_estimates(3, 1), tmp_path / "p.csv")
    with Journal(tmp_path / "p.csv", resume=True) as journal, pytest.raises(InputError, match="other images"):
        journal.has(1_600_000_000_000_000)
    with pytest.raises(InputError, match="no folder"):
        Journal(tmp_path / "no" / "p.csv")
    with pytest.raises(ValueError, match="format"):
        Journal(tmp_path / "p.csv", "json")


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir])
@pytest.mark.parametrize("name", ["p.csv.made-of", "p.csv.lmmap-part", "p.csv.lmmap-part.made-of"])
def test_what_is_no_file_stays_beside_the_output(tmp_path, name, make):
    (tmp_path / "p.csv").write_text("older")
    make(tmp_path / name)
    journal, refused = Journal(tmp_path / "p.csv", made_of={}), f"{name}: is no file of ours"
    with pytest.raises(InputError, match=refused), journal:
        journal.add(Estimate(1, Status.NO_RING))
    assert not (tmp_path / name).is_file() and (tmp_path / "p.csv").read_text() == "older"


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize("older", [False, True])
def test_what_kills_leave_beside_the_marks_goes_with_the_next_run(tmp_path, resume, older):
    path = tmp_path / "out.csv"
    if older:
        with Journal(path, made_of={"of": 1}) as journal:
            journal.add(some_estimates(1, 0)[0])
    before = {p.name for p in tmp_path.iterdir()} | {"out.csv", "out.csv.made-of"}
    for kept_in in ("out.csv", "out.csv.lmmap-part"):
        (tmp_path / f".{kept_in}.made-of.writing").touch()
        (tmp_path / f".{kept_in}.lmmap.made-of").touch()
    with Journal(path, resume=resume, made_of={"of": 1}) as journal:
        if not (older and resume):
            journal.add(some_estimates(1, 0)[0])
    assert {p.name for p in tmp_path.iterdir()} == before
