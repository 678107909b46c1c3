"""Chapters as notebooks: the book's markup is gone, the code is the chapter's."""

import re

import jupytext
import nbformat
import pytest
from lmmap_notebooks import chapters, figure_names, glued_numbers, plain, readable

ROLE = re.compile(r"\{[a-z:]+\}`")


def test_roles_become_words():
    text = "(here)=\nIt is {glue:text}`a_mm:.1f` mm, see {numref}`fig-b`, {cite:p}`x1,y2`, {py:mod}`a.b`."
    shown = plain(text, {"a_mm": 2.345}, ["fig-a", "fig-b"])
    assert shown == "It is 2.3 mm, see Fig. 2, (x1; y2), `a.b`."
    assert plain("{glue:text}`of.md::unknown:.0f` [x](yaw.md#z)", {}, []) == "… [x](yaw.ipynb)"


@pytest.mark.parametrize("page", chapters(), ids=lambda page: page.stem)
def test_a_chapters_notebook_has_its_code_and_no_markup(page):
    chapter = jupytext.read(page, fmt="md:myst")
    before = [cell.source for cell in chapter.cells if cell.cell_type == "code"]
    notebook = readable(chapter, {})
    nbformat.validate(notebook)
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert not ROLE.search(text.replace("``", ""))
    after = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    assert all(new.endswith(old) for old, new in zip(before, after, strict=True))


def test_figures_are_numbered_through_the_book_and_not_anew_in_each_notebook():
    notebooks = [readable(jupytext.read(page, fmt="md:myst"), {}) for page in chapters()]
    sources = [cell.source for notebook in notebooks for cell in notebook.cells if cell.cell_type == "code"]
    numbers = [int(n) for source in sources for n in re.findall(r"\A# Fig\. (\d+): ", source)]
    assert numbers == list(range(1, len(numbers) + 1)) and len(numbers) == len(figure_names()) > 50


def test_glued_numbers_are_those_of_the_outputs():
    data = {"application/papermill.record/text/plain": "2.5"}
    output = nbformat.v4.new_output("display_data", data, metadata={"scrapbook": {"name": "x"}})
    cell = nbformat.v4.new_code_cell("glue('x', 2.5)", outputs=[output])
    assert glued_numbers(nbformat.v4.new_notebook(cells=[cell])) == {"x": 2.5}
