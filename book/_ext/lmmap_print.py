"""The built book as one document for print: chapters in their order, folds open, and no code that was hidden.

``python book/_ext/lmmap_print.py`` makes ``_build/pdf/lmmap.pdf`` from ``_build/html``, with Chromium.  The
pages of the modules stay out: they are a reference to search in.
"""

from __future__ import annotations

import base64
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import urldefrag

import yaml
from bs4 import BeautifulSoup, Tag
from pypdf import PdfReader

from lmmap.types import InputError
from lmmap_lab.pages.player import Player
from lmmap_lab.provenance import ROOT

HTML, PDF = ROOT / "_build" / "html", ROOT / "_build" / "pdf"
TITLE = "Docking by ring and events"
ABOUT = ("Printed from the book's web pages. Sliders and the video stand here as stills, and the reference "
         "of the package's modules, the model cards, what to call on other hardware and where each result "
         "comes from are in the pages only.")  # fmt: skip
ON_SCREEN = ("book/models", "book/provenance", "book/check")
STYLE = Path(__file__).with_name("lmmap_print.css")
LEFT_OUT = "script:not(.ring-lab + script), style, .headerlink, .copybtn, .steps > label"
LINES = 25  # of a table that was folded; a longer one is left to the pages
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync",
         "--no-pdf-header-footer", "--generate-pdf-document-outline",
         "--virtual-time-budget=300000")  # fmt: skip


def parts() -> list[tuple[str, list[str]]]:
    """The book's parts that are printed: a caption, and names of pages such as ``book/port``."""
    toc = yaml.safe_load((ROOT / "_toc.yml").read_text())
    printed = [part for part in toc["parts"] if not part["caption"].startswith("Modules")]
    files = [
        (p["caption"], [c["file"] for c in p["chapters"] if c["file"] not in ON_SCREEN]) for p in printed
    ]
    return [("", [toc["root"]]), *files]


def label(page: str, place: str = "") -> str:
    """What a place of a page is called in the document."""
    return f"{Path(page).name}--{place}" if place else f"{Path(page).name}--"


def article(page: str, printed: set[str]) -> Tag:
    """The text of a built page, with names and links of the document, and its folds open."""
    soup = BeautifulSoup((HTML / f"{page}.html").read_text(), "html.parser")
    body = soup.select_one("article.bd-article")
    for part in body.select(LEFT_OUT):
        part.decompose()
    for video in body.select("video"):
        still = base64.b64encode(Player().still()).decode()
        video.replace_with(soup.new_tag("img", attrs={"src": f"data:image/png;base64,{still}"}))
    for fold in body.select("details"):
        open_fold(soup, fold)
    for part in body.select("[hidden]"):
        part.decompose()
    for line in body.select("section > p"):  # into the modules, which are not printed
        if line.get_text().startswith("Code:"):
            line.decompose()
    for part in body.select("[id]"):
        part["id"] = label(page, part["id"])
    for copy in body.select("use"):
        copy["href"] = "#" + label(page, copy["href"].removeprefix("#"))
    for picture in body.select("img"):
        picture["src"] = resolved(page, picture["src"])
        picture.attrs.pop("loading", None)
    for link in body.select("a[href]"):
        relink(link, page, printed)
    body.name, body.attrs = "section", {"id": label(page), "class": "chapter"}
    return body


def open_fold(soup: BeautifulSoup, fold: Tag) -> None:
    """Show what is folded: a solution whole, a result without code, and of a long table that it exists."""
    title = fold.summary.get_text(" ", strip=True) if fold.summary else ""
    title = re.split(r"(?<=\w)\s+(?=Hide)", title)[0]
    solution = title.startswith("Show a solution")
    if fold.summary:
        fold.summary.decompose()
    if not solution:
        for code in fold.select(".cell_input"):
            code.decompose()
    inside = fold.get_text(strip=True) or fold.find(["img", "svg"])
    if not inside:
        fold.decompose()
        return
    name = title.removeprefix("Show: ").removeprefix("Show ")
    note = soup.new_tag("p", attrs={"class": "fold"})
    note.string = "A solution" if solution else name[:1].upper() + name[1:]
    if len(fold.select("tr")) > LINES and not solution:
        note.string = f"{note.string}: {len(fold.select('tr')) - 1} rows, in the web pages only."
        fold.replace_with(note)
        return
    if not re.match(r"(click|hide|the code)", name, re.I):
        fold.insert_before(note)
    fold.unwrap()


def resolved(page: str, address: str) -> str:
    """An address of a page as one of the document, which lies beside the folder of pages."""
    if re.match(r"(data|https?):", address):
        return address
    return "../html/" + str((HTML / page).parent.joinpath(address).resolve().relative_to(HTML.resolve()))


def relink(link: Tag, page: str, printed: set[str]) -> None:
    """Let a link lead to its place in the document; one to a page that is not printed becomes text."""
    address, place = urldefrag(link["href"])
    if re.match(r"(https?|mailto):", address):
        return
    target = page if not address else (Path(page).parent / address).as_posix().removesuffix(".html")
    target = re.sub(r"[^/]+/\.\./", "", target)
    if target in printed:
        link["href"] = "#" + label(target, place)
    else:
        link.unwrap()


def document(chapters: list[tuple[str, list[Tag]]], pages: dict[str, int]) -> str:
    """The whole document; ``pages`` says on which page each chapter begins, once that is known."""
    contents = []
    for caption, articles in chapters:
        contents += [f"<h2>{caption}</h2>"] if caption else []
        for body in articles:
            title = body.h1.get_text(strip=True)
            contents.append(f'<p><a href="#{body["id"]}">{title}</a><span>{pages.get(title, "")}</span></p>')
    text = "\n".join(str(body) for _, articles in chapters for body in articles)
    front = (
        f'<section class="front"><p class="title">{TITLE}</p><p>the lmmap authors</p><p>{ABOUT}</p></section>'
    )
    head = (f'<meta charset="utf-8"><title>{TITLE}</title><style>{STYLE.read_text()}</style>'
            "<script>MathJax = {options: {enableMenu: false, processHtmlClass: 'math'}};</script>"
            '<script src="../html/_static/mathjax/mathjax.js"></script>')  # fmt: skip
    listed = f'<section class="contents"><p class="head">Contents</p>{"".join(contents)}</section>'
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{front}{listed}{text}</body></html>'


def first_pages(pdf: Path) -> dict[str, int]:
    """On which page each heading of the PDF's outline begins, the first of equal ones."""
    reader, pages = PdfReader(pdf), {}

    def walk(items):
        for item in items:
            if isinstance(item, list):
                walk(item)
            else:
                pages.setdefault(item.title.strip(), reader.get_destination_page_number(item) + 1)

    walk(reader.outline)
    return pages


def print_to(pdf: Path, page: Path) -> None:
    """Print a page with Chromium; raises `InputError`."""
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        raise InputError("pdf: no chromium here; on Debian: apt-get install chromium")
    with tempfile.TemporaryDirectory() as profile:
        command = [program, *FLAGS, f"--user-data-dir={profile}", f"--print-to-pdf={pdf}", page.as_uri()]
        said = subprocess.run(command, capture_output=True, text=True, check=False)
    if said.returncode or not pdf.exists():
        raise InputError(f"pdf: chromium did not print: {said.stderr.strip().splitlines()[-1:]}")


def print_book() -> tuple[Path, int]:
    """Print the built book; returns the file and its number of pages, and raises `InputError`."""
    if not (HTML / "index.html").exists():
        raise InputError("pdf: no book yet; make book first")
    PDF.mkdir(parents=True, exist_ok=True)
    printed = {page for _, pages in parts() for page in pages}
    chapters = [(caption, [article(page, printed) for page in pages]) for caption, pages in parts()]
    page, pdf, pages = PDF / "book.html", PDF / "lmmap.pdf", {}
    for _ in range(2):  # the second time with the pages' numbers in its contents
        page.write_text(document(chapters, pages))
        print_to(pdf, page)
        pages = first_pages(pdf)
    return pdf, len(PdfReader(pdf).pages)


def main() -> None:
    pdf, count = print_book()
    print(f"pdf: {pdf.relative_to(ROOT)}, {count} pages")


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(str(error))
