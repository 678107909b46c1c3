"""The printed book: what is folded is shown, hidden code is not, and links lead to places of the document."""

import lmmap_print
import pytest
from bs4 import BeautifulSoup
from lmmap_print import document, open_fold, parts, relink

CODE, RESULT = '<div class="cell_input">code</div>', '<div class="cell_output">42</div>'


def fold(title: str, inside: str) -> str:
    """What a fold with this title becomes."""
    soup = BeautifulSoup(f"<div><details><summary>{title}</summary>{inside}</details></div>", "html.parser")
    open_fold(soup, soup.details)
    return soup.div.decode_contents()


def test_hidden_code_is_not_printed():
    assert fold("Show the code", CODE) == ""


def test_a_solution_is_printed_whole_and_a_result_without_its_code():
    assert fold("<span>Show a solution</span> <span>Hide the solution</span>", CODE + RESULT) == (
        f'<p class="fold">A solution</p>{CODE}{RESULT}'
    )
    assert fold("Show: three seeds", CODE + RESULT) == f'<p class="fold">Three seeds</p>{RESULT}'


def test_a_long_table_is_named_and_left_to_the_pages():
    table = "<table>" + "<tr><td>1</td></tr>" * 100 + "</table>"
    assert fold("Show the files", table) == '<p class="fold">The files: 99 rows, in the web pages only.</p>'
    assert "<table>" in fold("Show: a table", table[: table.index("</tr>") + 5] + "</table>")


@pytest.mark.parametrize(("href", "expected"), [
    ("circles.html", '<a href="#circles--">x</a>'), ("circles.html#why", '<a href="#circles--why">x</a>'),
    ("#here", '<a href="#yaw--here">x</a>'), ("api/pipeline.html#f", "x"), ("../book/port.html", "x"),
    ("https://doi.org/1", '<a href="https://doi.org/1">x</a>'),
])  # fmt: skip
def test_a_link_leads_into_the_document_or_becomes_text(href, expected):
    soup = BeautifulSoup(f'<p><a href="{href}">x</a></p>', "html.parser")
    relink(soup.a, "book/yaw", {"book/yaw", "book/circles"})
    assert soup.p.decode_contents() == expected


def test_chapters_stand_in_the_books_order_without_the_modules():
    pages = [page for _, group in parts() for page in group]
    assert pages[0] == "book/intro" and "book/accuracy" in pages
    assert not [page for page in pages if "api" in page]


def test_the_contents_name_each_chapter_and_its_page():
    body = BeautifulSoup('<section id="port--"><h1>The port</h1></section>', "html.parser").section
    text = document([("The world", [body])], {"The port": 7})
    assert '<h2>The world</h2><p><a href="#port--">The port</a><span>7</span></p>' in text.replace("\n", "")


def test_a_slider_prints_the_step_that_it_shows_and_no_control(tmp_path, monkeypatch):
    pictures = '<svg><image id="p"></image></svg><svg><use href="#p"></use></svg>'
    steps = (f'<div class="step" hidden="">1</div><div class="step">2{pictures}</div>'
             '<label>N<input type="range"></label>')  # fmt: skip
    page = (f'<article class="bd-article"><h1 id="a">A</h1><div class="steps">{steps}</div>'
            "<script>x</script></article>")  # fmt: skip
    (tmp_path / "book").mkdir()
    (tmp_path / "book" / "port.html").write_text(page)
    monkeypatch.setattr(lmmap_print, "HTML", tmp_path)
    body = lmmap_print.article("book/port", {"book/port"})
    assert body.select_one(".steps").get_text() == "2" and not body.select("script, label")
    assert body["id"] == "port--" and body.h1["id"] == "port--a"
    assert body.use["href"] == "#" + body.image["id"] == "#port--p"
