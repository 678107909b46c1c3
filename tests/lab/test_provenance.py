"""Results: whole or absent, with provenance, and out of date when what made them changes."""

import json
import re
import subprocess

import numpy as np
import pandas as pd
import pytest

from lmmap.settings import OURS
from lmmap_lab import provenance as results
from lmmap_lab.studies import archive
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


def test_fingerprint_follows_facts_code_weights_and_pins(tmp_path, monkeypatch):
    monkeypatch.setattr(results, "ROOT", tmp_path)
    weights = tmp_path / "data" / "weights"
    weights.mkdir(parents=True)
    (weights / "v.json").write_text("0")
    pins = tmp_path / "environment.txt"
    pins.write_text("# Pins.\n\n# the module\nnumpy==1\n\n# development\nruff==1\n\n# indirect\nsix==1\n")

    def mark(*facts, code=(results.port_mark,)):
        return results.fingerprint(*facts, code=code, files=("data/weights/*", results.PINS))

    seen = {mark(), mark("paper"), mark(code=(results.profile,))}
    (weights / "v.json").write_text("1")
    seen.add(mark())
    (weights / "w.json").write_text("1")
    seen.add(mark())
    for package in ("numpy", "six"):
        pins.write_text(pins.read_text().replace(f"{package}==1", f"{package}==2"))
        seen.add(mark())
    assert len(seen) == 7
    pins.write_text(pins.read_text().replace("ruff==1", "ruff==2").replace("# Pins", "# Exact pins"))
    (tmp_path / "book.md").write_text("prose")
    weights.rename(tmp_path / "data" / "sets")
    again = results.fingerprint(code=(results.port_mark,), files=("data/sets/*", results.PINS))
    assert again in seen


def test_a_pattern_without_a_file_is_an_error():
    with pytest.raises(ValueError, match="no_such"):
        results.fingerprint(files=("lmmap/no_such.py",))


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
    (tmp_path / "b.py").write_text("new")
    assert results.commit() == head + "+"
    (tmp_path / "b.py").unlink()
    module.write_text("2")
    assert results.commit() == head + "+"


def test_a_result_of_edited_files_is_warned_of_where_it_would_be_committed(tmp_path, monkeypatch):
    monkeypatch.setattr(results, "DATA", tmp_path / "data")
    monkeypatch.setattr(results, "DERIVED_DATA", tmp_path / "data" / "derived")
    monkeypatch.setattr(results, "commit", lambda: "0123456789ab+")
    with pytest.warns(UserWarning, match=r"a\.json: made by edited files.*commit them and make it again"):
        results.save_json(tmp_path / "data" / "results" / "a.json", {})
    with pytest.warns(UserWarning, match="made by edited files"):
        results.save_table(tmp_path / "data" / "results" / "a.csv", pd.DataFrame({"a": [1]}))
    results.save_json(tmp_path / "data" / "derived" / "a.json", {})
    results.save_json(tmp_path / "a.json", {})
    monkeypatch.setattr(results, "commit", lambda: "0123456789ab")
    results.save_json(tmp_path / "data" / "results" / "a.json", {})


def committed_provenances():
    """What is told of each committed result, set of networks and archive, by its path."""
    told = {}
    for path in sorted(results.DATA.glob("[!d]*/**/*.json")) + sorted(results.DATA.glob("*.json")):
        document = json.loads(path.read_text())
        made = document if path.name.endswith(".provenance.json") else document.get("provenance", document)
        if "commit" in made:
            told[path] = made
    archives = sorted((results.DATA / "results").rglob("*.zip"))
    return told | {path: archive.provenance_of(path) for path in archives}


def test_every_commit_that_is_named_is_in_the_repository():
    """Or the field says why it is unknown.  A shallow clone has no history; there only the form is tested."""
    git = ["git", "-C", str(results.ROOT)]
    told = committed_provenances()
    assert len(told) > 100
    commits = {path: made["commit"] for path, made in told.items()}
    named = {path: name for path, name in commits.items() if not name.startswith("unknown: ")}
    assert {path: name for path, name in named.items() if not re.fullmatch("[0-9a-f]{12}", name)} == {}
    shallow = subprocess.run([*git, "rev-parse", "--is-shallow-repository"], capture_output=True, text=True)
    if shallow.stdout.strip() == "false":  # neither a shallow clone nor an archive without history
        listed = "".join(f"{name}^{{commit}}\n" for name in named.values())
        known = subprocess.run(
            [*git, "cat-file", "--batch-check"], input=listed, capture_output=True, text=True
        )
        assert [line for line in known.stdout.splitlines() if " commit " not in line] == []


def test_every_result_names_its_processor():
    cards = results.DATA / "weights", results.DATA / "peers"
    told = {path: made for path, made in committed_provenances().items() if path.parent not in cards}
    named = [path for path, made in told.items() if made.get("processor", "") in ("", "unknown")]
    assert len(told) > 80 and named == []


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
