"""Chapters with another parameter: what a reader tries first must run."""

import os
import re

import nbformat
import pytest
import yaml
from lab.book.test_book import ROOT, WALK
from nbclient import NotebookClient

CELL = re.compile(r"^(`{3,})\{code-cell\}[^\n]*\n(.*?)^\1$|^## ", re.M | re.S)
TRY = re.compile(r"^(?P<name>\w+) = (?P<value>.+?)  # try (?P<other>.+)$", re.M)


def parts(page):
    """Cells of a page in order, as ``(tags, code)``; None where a section begins."""
    for match in CELL.finditer(page.read_text()):
        if match[2] is None:
            yield None
            continue
        options = re.match(r"---\n(.*?)\n---\n", match[2], re.S)
        tags = re.match(r":tags: \[(.*?)\]", match[2])
        tags = (
            yaml.safe_load(options[1]).get("tags", [])
            if options
            else re.split(r",\s*", tags[1])
            if tags
            else []
        )
        yield tags, re.sub(r"\A(:[^\n]*\n)+|\A---\n.*?\n---\n", "", match[2], flags=re.S)


def with_another_parameter(page) -> list[str]:
    """Code from the page's top to the end of the section whose parameter is changed."""
    found, kept = 0, []
    for part in parts(page):
        if part is None:
            if found:
                break
            continue
        tags, code = part
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
