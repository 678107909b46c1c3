"""Builds of a book with one page: never stale, never with a broken cell, always the same bytes."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lmmap_lab.provenance import ROOT

JUPYTER_BOOK = Path(sys.executable).with_name("jupyter-book")
PAGE = """---
jupytext: {text_representation: {extension: .md, format_name: myst}}
kernelspec: {name: python3, display_name: Python 3}
---
# One page

```{code-cell}
:tags: [hide-input]
import runpy

print("It is", runpy.run_path("../lmmap/number.py")["NUMBER"])
```
"""


DRAWN = """
```{code-cell}
import matplotlib.pyplot as plt
import pandas as pd
from lmmap_lab.pages import drawings

drawings.use_style()
plt.plot([0, 1]);
```

```{code-cell}
pd.DataFrame({"error (mm)": [1.25]}).style.format(precision=1)
```
"""


@pytest.fixture
def book(tmp_path):
    for name in ("_config.yml", "book/_ext", "book/references.bib", "book/_static/logo.svg",
                 "book/_static/favicon.svg", "book/_static/custom.css", "book/_static/wide.js"):  # fmt: skip
        target = tmp_path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, target)
    (tmp_path / "_toc.yml").write_text("format: jb-book\nroot: book/page\n")
    (tmp_path / "book" / "page.md").write_text(PAGE)
    (tmp_path / "lmmap").mkdir()
    return tmp_path


def build(book, number: str) -> tuple[int, str]:
    """Exit code of the Makefile's command, and what it said and the page, with this in the module."""
    (book / "lmmap" / "number.py").write_text(f"NUMBER = {number}\n")
    command = [JUPYTER_BOOK, "build", book, "-W", "--keep-going", "--quiet"]
    fixed = {"SOURCE_DATE_EPOCH": "1767225600", "PYTHONHASHSEED": "0"}  # as in the Makefile
    environment = os.environ | {"JUPYTER_PREFER_ENV_PATH": "1", "PYTHONPATH": str(ROOT), **fixed}
    environment.pop("MPLBACKEND", None)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    page = book / "_build" / "html" / "book" / "page.html"
    return done.returncode, done.stderr + (page.read_text() if page.exists() else "")


def test_the_next_build_after_an_edit_shows_what_the_module_does_now(book):
    code, page = build(book, "1")
    assert code == 0 and "It is 1" in page, page
    assert "<summary>" in page and "<summary " not in page  # a fold is called what stands on it
    code, page = build(book, "1 / 0")  # a stale page would say that it is 1, and a tolerant build succeed
    assert code != 0 and "ZeroDivisionError" in page, page


def test_a_chapter_whose_prose_changed_keeps_its_outputs(book):
    """`lmmap check` reads them there."""
    executed = book / "_build" / "jupyter_execute" / "book" / "page.ipynb"
    for prose in ("", "\nA sentence more.\n"):
        (book / "book" / "page.md").write_text(PAGE + prose)
        code, said = build(book, "1")
        assert code == 0, said
        assert "It is 1" in executed.read_text()
    assert "A sentence more." in executed.read_text()


def test_two_builds_in_two_places_are_equal_byte_by_byte(book, tmp_path_factory):
    (book / "book" / "page.md").write_text(PAGE + DRAWN)
    other = shutil.copytree(book, tmp_path_factory.mktemp("elsewhere") / "another-name")
    for place in (book, other):
        code, said = build(place, "1")
        assert code == 0, said
    first, second = ({path.relative_to(html): path.read_bytes() for path in html.rglob("*") if path.is_file()}
                     for html in (book / "_build" / "html", other / "_build" / "html"))  # fmt: skip
    assert "error (mm)" in first[Path("book/page.html")].decode()
    assert "_sources/book/page.ipynb" in first[Path("book/page.html")].decode()
    assert "It is 1" in first[Path("_sources/book/page.ipynb")].decode()  # the number, not its markup
    assert any(path.suffix == ".png" and path.parts[0] == "_images" for path in first)
    assert first.keys() == second.keys() and [path for path in first if first[path] != second[path]] == []
