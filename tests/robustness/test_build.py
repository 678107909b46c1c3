"""Builds of a book with one page: never stale, never with a broken cell, always the same bytes."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

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


@pytest.fixture(scope="module")
def builds(tmp_path_factory):
    """Of one book: built, built again elsewhere, after a change of its prose, and of its module."""
    book = _sources(tmp_path_factory.mktemp("book"))
    other = shutil.copytree(book, tmp_path_factory.mktemp("elsewhere") / "another-name")
    first, elsewhere = (build(place, "1") for place in (book, other))
    (book / "book" / "page.md").write_text(PAGE + DRAWN + "\nA sentence more.\n")
    return first, elsewhere, build(book, "1"), build(book, "1 / 0")


def _sources(folder: Path) -> Path:
    for name in ("_config.yml", "book/_ext", "book/references.bib", "book/_static/logo.svg",
                 "book/_static/favicon.svg", "book/_static/custom.css", "book/_static/wide.js"):  # fmt: skip
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, target)
    (folder / "_toc.yml").write_text("format: jb-book\nroot: book/page\n")
    (folder / "book" / "page.md").write_text(PAGE + DRAWN)
    (folder / "lmmap").mkdir()
    return folder


class Built(NamedTuple):
    """Exit code of the Makefile's command, what it said, and files by their names in ``_build``."""

    code: int
    said: str
    files: dict[str, bytes]

    def text(self, name: str) -> str:
        return self.files[name].decode()


def build(book: Path, number: str) -> Built:
    """Build with this number in the module."""
    (book / "lmmap" / "number.py").write_text(f"NUMBER = {number}\n")
    command = [JUPYTER_BOOK, "build", book, "-W", "--keep-going", "--quiet"]
    fixed = {"SOURCE_DATE_EPOCH": "1767225600", "PYTHONHASHSEED": "0"}  # as in the Makefile
    environment = os.environ | {"JUPYTER_PREFER_ENV_PATH": "1", "PYTHONPATH": str(ROOT), **fixed}
    environment.pop("MPLBACKEND", None)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    files = {str(path.relative_to(book / "_build")): path.read_bytes()
             for kind in ("html", "jupyter_execute") for path in (book / "_build" / kind).rglob("*")
             if path.is_file()}  # fmt: skip
    return Built(done.returncode, done.stderr, files)


def test_the_next_build_after_an_edit_shows_what_the_module_does_now(builds):
    first, _, _, broken = builds
    page = first.text("html/book/page.html")
    assert first.code == 0 and "It is 1" in page, first.said
    assert "<summary>" in page and "<summary " not in page  # a fold is called what stands on it
    # a stale page would say that it is 1, and a tolerant build succeed
    assert broken.code != 0 and "ZeroDivisionError" in broken.said + broken.text("html/book/page.html")


def test_a_chapter_whose_prose_changed_keeps_its_outputs(builds):
    """`lmmap check` reads them there."""
    for built in (builds[0], builds[2]):
        assert built.code == 0, built.said
        assert "It is 1" in built.text("jupyter_execute/book/page.ipynb")
    assert "A sentence more." in builds[2].text("jupyter_execute/book/page.ipynb")


def test_two_builds_in_two_places_are_equal_byte_by_byte(builds):
    assert (builds[0].code, builds[1].code) == (0, 0), builds[0].said + builds[1].said
    first, second = ({name: content for name, content in built.files.items() if name.startswith("html/")}
                     for built in builds[:2])  # fmt: skip
    assert "error (mm)" in builds[0].text("html/book/page.html")
    assert "It is 1" in builds[0].text("html/_sources/book/page.ipynb")  # the number, not its markup
    assert any(name.startswith("html/_images/") and name.endswith(".png") for name in first)
    assert first.keys() == second.keys() and [name for name in first if first[name] != second[name]] == []
