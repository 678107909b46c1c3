"""Results: whole or absent, with provenance, and out of date when what made them changes."""

import json
import subprocess

import grimp
import numpy as np
import pandas as pd
import pytest

from lmmap.settings import OURS
from lmmap_lab import provenance as results
from lmmap_lab.studies.networks import set_hashes


def test_json_round_trip_with_provenance(tmp_path):
    values = {"median": np.float64(1.5), "counts": np.arange(3), "name": "x"}
    path = results.save_json(tmp_path / "new" / "a.json", values, profile="quick", seed=7)
    assert results.load_json(path) == {"median": 1.5, "counts": [0, 1, 2], "name": "x"}
    provenance = json.loads(path.read_text())["provenance"]
    assert (provenance["profile"], provenance["seed"]) == ("quick", 7)
    assert set(results.PACKAGES) <= set(provenance) and provenance["commit"]


def test_two_writes_are_byte_identical(tmp_path):
    first, second = (results.save_json(tmp_path / n, {"b": 1, "a": 2}).read_bytes() for n in "ab")
    assert first == second


def test_table_round_trip(tmp_path):
    table = pd.DataFrame({"a": [1, 2], "b": [0.5, np.nan]})
    path = results.save_table(tmp_path / "t.csv", table, profile="quick")
    pd.testing.assert_frame_equal(results.load_table(path), table)
    assert json.loads((tmp_path / "t.provenance.json").read_text())["profile"] == "quick"


def test_nothing_half_written_remains(tmp_path):
    with pytest.raises(TypeError):
        results.save_json(tmp_path / "a.json", {("tuple", "key"): 1})
    assert list(tmp_path.iterdir()) == []


def test_fingerprint_follows_the_code_the_weights_and_the_pins(tmp_path, monkeypatch):
    monkeypatch.setattr(results, "ROOT", tmp_path)
    for folder in ("lmmap", "lmmap_lab", "data/weights"):
        (tmp_path / folder).mkdir(parents=True)
    for name in ("lmmap/types.py", "lmmap_lab/bench.py", "data/weights/v.json", "environment.txt"):
        (tmp_path / name).write_text("0")
    seen = {results.fingerprint()}
    for name in ("lmmap/a.py", "data/weights/w.safetensors", "environment.txt"):
        (tmp_path / name).write_text("1")
        seen.add(results.fingerprint())
    (tmp_path / "lmmap" / "a.py").write_text("2")
    seen.add(results.fingerprint())
    (tmp_path / "lmmap_lab" / "bench.py").write_text("1")
    seen |= {results.fingerprint(), results.fingerprint("paper")}
    assert len(seen) == 7
    (tmp_path / "book.md").write_text("prose")
    assert results.fingerprint() in seen


def test_a_pattern_without_a_file_is_an_error():
    with pytest.raises(ValueError, match="no_such"):
        results.fingerprint(patterns=("lmmap/no_such.py",))


def test_a_module_is_made_by_all_that_it_imports():
    files = {"lmmap/calibrations.py", "lmmap/camera_files.py", "lmmap/documents.py", "lmmap/files.py"}
    assert files < set(results.source_files("lmmap.camera_files"))
    files = results.source_files("lmmap.estimation.estimates")
    assert {"lmmap/types/pose.py", "lmmap/pipeline/network.py", "lmmap/refinement/joint.py"} < set(files)
    assert not any(name.startswith(("lmmap_lab", "lmmap/cli")) for name in files)
    files = results.source_files("lmmap_lab.bench.simulate")
    assert {"lmmap_lab/bench/shading.py", "lmmap/types/pose.py"} < set(files)
    graph = grimp.build_graph("lmmap", "lmmap_lab", cache_dir=None)
    below = {"lmmap_lab.bench.simulate", *graph.find_upstream_modules("lmmap_lab.bench.simulate")}
    paths = [results.ROOT / name.replace(".", "/") for name in below]
    expected = [path / "__init__.py" if path.is_dir() else path.with_suffix(".py") for path in paths]
    assert files == tuple(sorted(path.relative_to(results.ROOT).as_posix() for path in expected))


def test_profile_is_the_makefiles(monkeypatch):
    monkeypatch.delenv("PROFILE", raising=False)
    assert results.profile() == "quick"
    monkeypatch.setenv("PROFILE", "paper")
    assert results.profile() == "paper"


def test_a_commit_is_marked_where_what_makes_results_differs_from_it(tmp_path, monkeypatch):
    monkeypatch.setattr(results, "ROOT", tmp_path)
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@y"]
    module, table = tmp_path / "a.py", tmp_path / "data" / "results" / "a.csv"
    table.parent.mkdir(parents=True)
    module.write_text("1"), table.write_text("1")
    for what in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "x"]):
        subprocess.run([*git, *what], check=True)
    head = results.commit()
    table.write_text("2")
    assert len(head) == 12 and results.commit() == head
    module.write_text("2")
    assert results.commit() == head + "+"


def test_results_that_are_not_made_yet_are_one_line_with_the_command(tmp_path, monkeypatch):
    monkeypatch.setenv("PROFILE", "quick")
    monkeypatch.setattr(results, "DERIVED_DATA", tmp_path)
    with pytest.raises(results.InputError, match="run 'make reproduce'") as error:
        results.made_results()
    (shown,) = error.value._render_traceback_()  # what a notebook shows
    assert shown == f"InputError: {error.value}" and "\n" not in shown
    (tmp_path / "quick").mkdir()
    (tmp_path / "quick" / "summary.csv").touch()
    assert results.made_results() == tmp_path / "quick"


def test_every_result_is_of_the_present_port():
    """But for those that no port of ours takes part in."""
    of_no_port = {"attacks", "formats", "port", "port-outlines", "evo-scenes"}
    present = results.port_mark()
    kept = (results.DATA / "results").rglob("*.json")
    documents = {path: json.loads(path.read_text()) for path in sorted(kept)}
    facts = {path: made if path.name.endswith(".provenance.json") else made.get("provenance")
             for path, made in documents.items()}  # fmt: skip
    told = {path: made for path, made in facts.items() if made and path.name.split(".")[0] not in of_no_port}
    assert len(told) > 50 and [path.name for path, made in told.items() if made.get("port") != present] == []


def test_every_result_that_names_its_networks_is_of_the_present_ones():
    kept = (results.DATA / "results").rglob("*.provenance.json")
    named = {path.name: json.loads(path.read_text()).get("networks") for path in kept}
    of_one_set = {name: mark for name, mark in named.items() if isinstance(mark, str)}
    assert len(of_one_set) >= 4 and set(of_one_set.values()) == {set_hashes(OURS.weights)}, of_one_set
