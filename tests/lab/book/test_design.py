"""`DESIGN.md` names things that exist, and the wings that the imports' contract checks."""

import importlib
import re
import tomllib

import pytest

from lmmap_lab.provenance import ROOT

DESIGN = (ROOT / "DESIGN.md").read_text()
STEPS = re.findall(
    r"`(lmmap(?:_lab)?/[\w/]+)\.py:(\w+)`", DESIGN.split("## The paper, step by step")[1].split("## ")[0]
)


def test_the_paper_has_its_table():
    assert len(set(STEPS)) >= 24


@pytest.mark.parametrize("file, name", sorted(set(STEPS)))
def test_each_step_of_the_paper_is_where_the_table_says(file, name):
    assert callable(getattr(importlib.import_module(file.replace("/", ".")), name))


@pytest.mark.parametrize("package", ["lmmap", "lmmap_lab"])
def test_the_wings_are_those_of_the_contract(package):
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = (c["layers"] for c in contracts if c.get("containers") == [package])
    table = DESIGN.split(f"| wing of `{package}` |")[1].split("\n\n")[0]
    rows = re.findall(r"^\| (`.+?`) \| ", table, re.M)
    assert [re.findall(r"`(\w+)/?`", row) for row in rows] == [re.findall(r"\w+", layer) for layer in layers]


def test_each_promise_names_tests_that_exist():
    promises = (ROOT / "tests" / "PROMISES.md").read_text()
    rows = [row for row in promises.splitlines() if row.startswith("|")][2:]
    assert len(rows) >= 15
    for row in rows:
        tests = re.findall(r"`(tests/[\w/]+\.py):(\w+)`", row)
        assert tests, row
        for file, name in tests:
            assert f"\ndef {name}(" in (ROOT / file).read_text(), name
        for script in re.findall(r"`(benchmarks/\w+\.py)`", row):
            assert (ROOT / script).exists(), script


def test_it_is_short_and_lists_every_record():
    assert len(re.findall(r"\S*\w\S*", DESIGN)) < 2500  # without the tables' bars
    linked = set(re.findall(r"\(decisions/(\S+?)\)", DESIGN))
    assert linked == {path.name for path in (ROOT / "decisions").glob("*.md")}


def test_the_tuning_table_names_scripts_and_results_that_exist():
    rows = re.findall(
        r"^\| .+? \| `(\S+?\.py).*?` \| (.+) \|$", (ROOT / "tuning" / "README.md").read_text(), re.M
    )
    assert {script for script, _ in rows} >= {"choose_thresholds.py", "calibrate_uncertainty.py"}
    for script, results in rows:
        assert (ROOT / "tuning" / script).exists(), script
        for path in re.findall(r"`(data/[\w/.-]+)`", results):
            assert (ROOT / path).exists(), path
