"""`make vo`: whatever happens in a run's process, crash and time-out included, is a row of the log."""

import importlib.util
import json
import sys

import pandas as pd
import pytest

from lmmap.types import InputError
from lmmap_lab.provenance import ROOT

RUNNER = """
import os, sys, time
track, how = open(sys.argv[4], "w"), {how!r}
print("# track 1\\n0.1 0 0 0 0 0 0 1", file=track, flush=True)
print("chatter")
if how == "crash":
    os.abort()
if how == "hang":
    time.sleep(60)
if how == "raise":
    raise RuntimeError("no")
print('SUMMARY {{"frames": 5, "initialising": 1, "tracked": 3, "lost": 1, "resets": 0, "tracks": 1}}')
"""


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks" / "vo")
    spec = importlib.util.spec_from_file_location("vo_run", ROOT / "benchmarks" / "vo" / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "PYTHON", sys.executable)
    monkeypatch.setattr(module, "HERE", tmp_path)
    monkeypatch.setattr(module, "TIMEOUT_S", 2.0)
    (tmp_path / "tracks").mkdir()
    return module


@pytest.mark.parametrize(
    ("how", "outcome", "tracked"),
    [("well", "finished", 3), ("crash", "crashed, signal 6", None), ("raise", "ended with code 1", None),
     ("hang", "timed out after 2 s", None)],
)  # fmt: skip
def test_a_run_ends_in_a_row(bench, tmp_path, how, outcome, tracked):
    (tmp_path / "svo.py").write_text(RUNNER.format(how=how))
    row = bench.run("SVO", "event", "test-high", 1.5, 7, tmp_path, 1.5)
    assert (row["outcome"], row["tracked"]) == (outcome, tracked)
    assert row["run"] == 7 and row["start_s"] == 1.5 and row["file"] == "SVO-event-test-high-07.tum"
    assert (tmp_path / "tracks" / row["file"]).read_text().startswith("# track 1")


def test_what_is_made_is_not_made_again(bench, tmp_path):
    made = []
    for mark in ("a", "a", "b"):
        bench.kept(tmp_path / "thing", mark, lambda: made.append(1))
    assert len(made) == 2


def test_an_interrupted_making_is_repeated(bench, tmp_path):
    def broken():
        raise KeyboardInterrupt

    bench.kept(tmp_path / "thing", "a", lambda: None)
    with pytest.raises(KeyboardInterrupt):
        bench.kept(tmp_path / "thing", "b", broken)
    assert bench.kept(tmp_path / "thing", "a", lambda: None)


def test_one_method_keeps_the_rows_and_the_commits_of_the_others(bench, tmp_path, monkeypatch):
    rows = {"method": ["lmmap", "SVO", "EVO"], "tracked": [1, 2, 3]}
    before = {"profile": "quick", "commit": "c", "commits": {"lmmap": "a", "SVO": "b", "EVO": "c"}}
    monkeypatch.setattr(bench.odometry, "FOLDER", tmp_path)
    (tmp_path / "runs.provenance.json").write_text(json.dumps(before))
    pd.DataFrame(rows).to_csv(tmp_path / "runs.csv", index=False)
    kept_rows, facts = bench.published.kept_rows(["lmmap"], {"profile": "quick", "commits": {}})
    assert kept_rows == [{"method": "SVO", "tracked": 2}, {"method": "EVO", "tracked": 3}]
    assert facts["commits"] == before["commits"]
    with pytest.raises(InputError, match="profile quick"):
        bench.published.kept_rows(["lmmap"], {"profile": "paper"})
