"""Pictures have alternative texts that somebody wrote; what moves says itself what it shows."""

import re

import pytest
import yaml

from lmmap_lab.provenance import ROOT

PAGES = sorted((ROOT / "book").glob("*.md"))
CELL = re.compile(r"^```\{code-cell\}\n---\n(.*?)\n---\n(.*?)^```$", re.M | re.S)  # with options in a block
MOVING = re.compile(r"\b(Slider|Strip|RingLab|Player)\(")  # outputs in HTML, with labels of their own


def figures():
    """Name, options and code of each figure that a cell draws."""
    drawn = []
    for page in PAGES:
        for options, code in CELL.findall(page.read_text()):
            shown = yaml.safe_load(options).get("mystnb") or {}
            if "figure" in shown and not MOVING.search(code):
                drawn.append((shown["figure"]["name"], shown))
    return drawn


@pytest.mark.parametrize(("name", "shown"), [pytest.param(*f, id=f[0]) for f in figures()])
def test_a_figure_has_an_alternative_text_in_sentences(name, shown):
    """One that tells what is seen, and so is no copy of the caption."""
    text = shown.get("image", {}).get("alt", "")
    assert re.fullmatch(r"[A-Z].{40,350}\.", text), f"{name}: {text!r}"
    assert text not in shown["figure"]["caption"]


def test_most_figures_are_among_them():
    assert len(figures()) > 60
