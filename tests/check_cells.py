"""Chapters with another parameter: what a reader tries first must run."""

import os
import re

import nbformat
import pytest
from lab.book.test_book import ROOT, WALK, parts
from nbclient import NotebookClient

TRY = re.compile(r"^(?P<name>\w+) = (?P<value>.+?)  # try (?P<other>.+)$", re.M)


def with_another_parameter(page) -> list[str]:
    """Code from the page's top to the end of the section whose parameter is changed."""
    found, kept = 0, []
    for part in parts(page):
        if part is None:
            if found:
                break
            continue
        options, code = part
        tags = options.get("tags", [])
        if "check" in tags:  # of the printed values
            continue
        if not {"remove-cell", "remove-input"} & set(tags):
            code, here = TRY.subn(r"\g<name> = \g<other>", code)
            found += here
        kept.append(code)
    assert found == 1, f"{page.name}: {found} lines that end in '# try VALUE'"
    return kept


@pytest.mark.parametrize("page", WALK, ids=lambda page: page.stem)
def test_a_chapter_runs_with_the_parameter_that_it_proposes(page, monkeypatch):
    monkeypatch.setitem(os.environ, "MPLBACKEND", "agg")
    cells = [nbformat.v4.new_code_cell(code) for code in with_another_parameter(page)]
    notebook = nbformat.v4.new_notebook(cells=cells)
    place = {"metadata": {"path": str(ROOT / "book")}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=place).execute()
