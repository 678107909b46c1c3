"""Chapters as notebooks that JupyterLab can show: numbers stand in the text instead of the book's markup.

``python book/_ext/lmmap_notebooks.py FOLDER`` writes a notebook for each chapter, with the numbers of the
built book, or of the reference where there is none.  The book's extension writes those that its pages offer.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

import jupytext
import nbformat
import yaml

from lmmap_lab.provenance import DATA, ROOT, load_json, profile

GLUED = "application/papermill.record/"
GLUE = re.compile(r"\{glue:text\}`(?:[\w./-]+::)?([\w-]+)(?::([^`]+))?`")
FIGURE = re.compile(r"\{numref\}`(?:[^`<]*<)?([\w-]+)>?`")
CITATION = re.compile(r"\{cite(?::\w+)?\}`([^`]+)`")
NAME = re.compile(r"\{(?:py:)?(?:mod|func|class|meth|obj|data|doc)\}`~?([^`<]+?)(?: <[^>]+>)?`")
LABEL = re.compile(r"^\([\w-]+\)=\n", re.M)
LINK = re.compile(r"\]\(([\w/-]+)\.md(#[\w-]+)?\)")


def glued_numbers(notebook) -> dict:
    """What an executed notebook has glued, by key."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    named = [(output["metadata"]["scrapbook"]["name"], output["data"])
             for output in outputs if "scrapbook" in output.get("metadata", {})]  # fmt: skip
    return {key: _value(data[f"{GLUED}text/plain"]) for key, data in named if f"{GLUED}text/plain" in data}


def _value(text: str):
    with suppress(ValueError, SyntaxError):  # what is glued as an object is shown as it is printed
        return ast.literal_eval(text)
    return text


def readable(notebook, numbers: Mapping[str, object]):
    """The notebook with its text as JupyterLab's own Markdown has it, equal in every build; its figures have
    the book's numbers."""
    names = figure_names()
    for k, cell in enumerate(notebook.cells):
        figure = cell.metadata.get("mystnb", {}).get("figure", {})
        cell["id"] = f"cell-{k}"
        cell.metadata.pop("execution", None)  # its times
        if cell.cell_type == "markdown":
            cell.source = plain(cell.source, numbers, names)
        elif "caption" in figure:
            where = names.index(figure["name"]) + 1
            caption = plain(figure["caption"], numbers, names)
            cell.source = f"# Fig. {where}: " + re.sub(r"\s+", " ", caption) + "\n" + cell.source
    return notebook


def plain(text: str, numbers: Mapping[str, object], figures: list[str]) -> str:
    """Text without the book's roles: numbers, figures, citations and names in words."""
    text = GLUE.sub(lambda m: shown(numbers[m[1]], m[2] or "") if m[1] in numbers else "…", text)
    text = FIGURE.sub(lambda m: f"Fig. {figures.index(m[1]) + 1}", text)
    text = CITATION.sub(lambda m: f"({m[1].replace(',', '; ')})", text)
    text = LINK.sub(r"](\1.ipynb)", LABEL.sub("", text))
    return NAME.sub(r"`\1`", text)


def shown(value, form: str) -> str:
    """A glued value as the page shows it."""
    return format(value, form) if isinstance(value, int | float) else str(value)


def chapters() -> list[Path]:
    """The book's pages with code, in its order."""
    toc = yaml.safe_load((ROOT / "_toc.yml").read_text())
    files = [toc["root"], *(c["file"] for part in toc["parts"] for c in part["chapters"])]
    pages = [ROOT / f"{name}.md" for name in files]
    return [page for page in pages if page.exists() and "{code-cell}" in page.read_text()]


@cache
def figure_names() -> list[str]:
    """Names of the book's figures in its order, by which they are numbered."""
    return [
        name for page in chapters() for name in re.findall(r"^    name: (fig-\S+)$", page.read_text(), re.M)
    ]


def known_numbers(executed: Path) -> dict:
    """The numbers of a folder's executed notebooks, and of the reference those that they do not have."""
    path = DATA / "reference" / f"{profile()}.json"
    reference = load_json(path)["items"] if path.exists() else {}
    items = [item["numbers"] for name, item in reference.items() if name.endswith(", numbers")]
    built = [glued_numbers(nbformat.read(path, 4)) for path in sorted(executed.rglob("*.ipynb"))]
    return {key: value for numbers in (*items, *built) for key, value in numbers.items()}


def main(folder: Path) -> None:
    """Write every chapter into a folder; one that was edited there after the chapter is left as it is."""
    numbers = known_numbers(ROOT / "_build" / "jupyter_execute")
    folder.mkdir(parents=True, exist_ok=True)
    for page in chapters():
        path = folder / f"{page.stem}.ipynb"
        if not path.exists() or path.stat().st_mtime < page.stat().st_mtime:
            nbformat.write(readable(jupytext.read(page, fmt="md:myst"), numbers), path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
