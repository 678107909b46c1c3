"""Chapters with another parameter: what a page proposes must run, to the page's end and with its checks."""

import os
import re

import nbformat
import pytest
from lab.book.test_book import CHAPTERS, ROOT, WALK, cells
from nbclient import NotebookClient

TRY = re.compile(r"^(?P<name>\w+) = (?P<value>.+?)  # try (?P<other>[^a-z\s]\S*)$", re.M)
PROPOSED = [(page, match["name"]) for page in CHAPTERS for match in TRY.finditer("\n".join(cells(page)))]


def with_another(page, name: str) -> list[str]:
    """A page's code with the value that it proposes for one of its parameters."""
    return [
        TRY.sub(lambda m: f"{name} = {m['other']}" if m["name"] == name else m[0], code)
        for code in cells(page)
    ]


def test_each_chapter_of_the_walk_proposes_a_value():
    assert {page for page, _ in PROPOSED} >= set(WALK)


@pytest.mark.parametrize("page, name", PROPOSED, ids=lambda value: getattr(value, "stem", value))
def test_a_chapter_runs_with_the_value_that_it_proposes(page, name, monkeypatch):
    monkeypatch.setitem(os.environ, "MPLBACKEND", "agg")
    code = [nbformat.v4.new_code_cell(cell) for cell in with_another(page, name)]
    notebook = nbformat.v4.new_notebook(cells=code)
    place = {"metadata": {"path": str(ROOT / "book")}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=place).execute()
