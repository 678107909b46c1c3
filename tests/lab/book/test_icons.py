"""The pages' icons: those that are used, from the theme's own script, and nothing else of it."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import pydata_sphinx_theme
import pytest
from lmmap_icons import drawings, slim

SCRIPT = next(Path(pydata_sphinx_theme.__file__).parent.rglob("fontawesome/*/js/all.min.js"))
PAGE = """<head>
  <link href="../_static/vendor/fontawesome/6/css/all.min.css?digest=1" rel="stylesheet" />
  <link rel="preload" as="font" type="font/woff2" href="x.woff2" />
  <script src="../_static/vendor/fontawesome/6/js/all.min.js?digest=1"></script></head>
<span class="theme-switch fa-solid fa-moon fa-lg"></span><i class="fas fa-search"></i>"""


@pytest.fixture
def built(tmp_path):
    (tmp_path / "book").mkdir()
    (tmp_path / "book" / "port.html").write_text(PAGE)
    vendor = tmp_path / "_static" / "vendor" / "fontawesome" / "6" / "js"
    vendor.mkdir(parents=True)
    shutil.copy(SCRIPT, vendor)
    slim(SimpleNamespace(outdir=tmp_path, builder=SimpleNamespace(format="html")), None)
    return tmp_path


def test_a_page_loads_the_small_sheet_and_no_script_or_font(built):
    page = (built / "book" / "port.html").read_text()
    assert '<link href="../_static/icons.css" rel="stylesheet" />' in page
    assert "fontawesome" not in page and "woff2" not in page
    assert not (built / "_static" / "vendor" / "fontawesome").exists()


def test_the_sheet_holds_the_icons_that_are_used_by_name_or_alias(built):
    sheet = (built / "_static" / "icons.css").read_text()
    assert [line.split(" ")[0] for line in sheet.splitlines() if "--icon:" in line] == [
        ".fa-moon",
        ".fa-search",
    ]
    assert len(sheet) < 5000


def test_every_style_is_read_whole():
    styles = drawings(SCRIPT.read_text())
    assert {style: len(icons) > 100 for style, icons in styles.items()} == {
        "fab": True,
        "far": True,
        "fas": True,
    }
    assert styles["far"]["moon"] != styles["fas"]["moon"]
    assert all(path.startswith(("M", "m")) for icons in styles.values() for _, _, path in icons.values())
