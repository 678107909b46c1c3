"""The built book as a reader's browser shows it; run by ``make check-book``, after ``make book``.

Not part of ``make test``, which has no book to look at.
"""

import functools
import http.server
import json
import re
import threading
from html.parser import HTMLParser
from urllib.parse import unquote, urldefrag, urljoin, urlsplit

import numpy as np
import pytest
from browser import PROGRAM, chromium
from lmmap_print import print_book
from scipy.spatial.transform import Rotation

from lmmap.evaluation.pose_errors import normal_error_rad
from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.projection import bearings
from lmmap.pipeline import circle
from lmmap.types import Camera, Pose
from lmmap_lab.provenance import ROOT

BOOK = ROOT / "_build" / "html"
PAGES = sorted(BOOK.rglob("*.html"))
CHAPTERS = sorted(BOOK.glob("book/*.html"))
WIDTHS_PX = (390, 1280, 1920)
NAMES = {page: str(page.relative_to(BOOK)) for page in PAGES if not page.match("_static/**")}

every_page = pytest.mark.parametrize("name", NAMES.values())
in_browser = pytest.mark.skipif(
    PROGRAM is None, reason="no chromium here; on Debian: apt-get install chromium"
)


class Anchors(HTMLParser):
    """What a page links to, what may be linked to in it, and its images' alternative texts."""

    def __init__(self, page):
        super().__init__()
        self.links, self.places, self.images = [], {""}, []
        self.feed(page.read_text())

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.places |= {values[key] for key in ("id", "name") if values.get(key)}
        if tag == "img":
            self.images.append((values.get("src", ""), values.get("alt")))
        self.links += [values[key] for key in ("href", "src") if values.get(key)]


@functools.cache
def anchors(page):
    return Anchors(page)


def test_there_is_a_page_for_every_chapter():
    chapters = {path.stem for path in (ROOT / "book").glob("*.md")}
    assert {page.stem for page in CHAPTERS} == chapters and len(chapters) > 10


@every_page
def test_links_resolve(name):
    page = BOOK / name
    for link in anchors(page).links:
        address, place = urldefrag(urljoin(page.as_uri(), link))
        if urlsplit(address).scheme == "file":
            target = BOOK.__class__(unquote(urlsplit(address).path))
            assert target.is_file(), f"{link}: no such file"
            if target.suffix == ".html" and place:
                assert unquote(place) in anchors(target).places, f"{link}: no such place"


@every_page
def test_images_have_alternative_texts(name):
    poor = [
        src for src, alt in anchors(BOOK / name).images if not alt or re.fullmatch(r"\.\./_images/.*", alt)
    ]
    assert poor == []


@every_page
def test_a_fold_is_called_what_stands_on_it(name):
    assert "<summary aria-label" not in (BOOK / name).read_text()


class Figures(HTMLParser):
    """The captions of a page's figures, and the pictures of cells that are in no figure."""

    def __init__(self, page):
        super().__init__()
        self.captions, self.bare = [], []
        self._depth, self._in_caption = 0, False
        self.feed(page.read_text())

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self._depth += tag == "figure"
        self._in_caption |= tag == "figcaption"
        if tag == "figcaption":
            self.captions.append("")
        if tag == "img" and "_images/" in values.get("src", "") and not self._depth:
            self.bare.append(values["src"])

    def handle_endtag(self, tag):
        self._depth -= tag == "figure"
        self._in_caption &= tag != "figcaption"

    def handle_data(self, data):
        if self._in_caption:
            self.captions[-1] += data


@pytest.mark.parametrize("chapter", CHAPTERS, ids=lambda page: page.stem)
def test_every_figure_has_a_number_and_a_caption_of_two_sentences(chapter):
    figures = Figures(chapter)
    assert figures.bare == [], "pictures outside of figures"
    for caption in figures.captions:
        assert re.match(r"\s*Fig\. \d+", caption), caption
        assert len(re.findall(r"[.!?](?=[\s#]|$)", caption.split(maxsplit=2)[2])) >= 2, caption


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    with chromium(tmp_path_factory.mktemp("chromium")) as page:
        yield page


@pytest.fixture(scope="module")
def site():
    """Address of the book on a server of this machine."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    handler = functools.partial(Quiet, directory=BOOK)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


LOOSE = """[...document.querySelectorAll("span.math")].filter(formula => {
    if (!/^[.,;:)]/.test(formula.nextSibling?.data ?? "")) return false;
    const mark = document.createRange();
    mark.setStart(formula.nextSibling, 0);
    mark.setEnd(formula.nextSibling, 1);
    return mark.getBoundingClientRect().left < formula.getBoundingClientRect().right - 3;
}).map(formula => formula.textContent)"""  # formulas whose full stop stands on the next line
NOT_DRAWN = "mjx-container svg text, mjx-container [data-mml-node=merror]"  # no such glyph, no such command


@in_browser
@pytest.mark.parametrize(
    "name", [n for n in NAMES.values() if n != "index.html" and not n.startswith("_modules")]
)
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_page_loads_alone_quietly_and_fits(page, site, name, theme):
    home = site if theme == "light" else BOOK.as_uri() + "/"  # a server's page, and a file opened
    page.show_as(1280, theme=theme)
    page.open(home + name)
    assert [asked for asked in page.requests() if not asked.startswith(home)] == []
    assert page.ask("document.documentElement.dataset.theme") in (theme, None)
    assert page.ask("document.querySelectorAll('.math:not(:has(mjx-container))').length") == 0
    assert page.ask(f"[...document.querySelectorAll('{NOT_DRAWN}')].map(e => e.textContent)") == []
    for width_px in WIDTHS_PX:
        page.show_as(width_px, theme=theme)
        assert page.ask("document.documentElement.scrollWidth") <= width_px, f"scrolls at {width_px} px"
        assert page.ask(LOOSE) == [], f"punctuation on a line of its own at {width_px} px"
    assert page.ask("[...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src)") == []
    assert page.complaints() == []


@in_browser
def test_a_page_that_leaves_while_it_is_asked_is_followed(page, tmp_path):
    never = "window.MathJax = {startup: {promise: new Promise(() => 0)}}"
    (tmp_path / "a.html").write_text(f"<script>{never}; setTimeout(() => location = 'b.html', 300)</script>")
    (tmp_path / "b.html").write_text("<p>here</p>")
    page.open((tmp_path / "a.html").as_uri())
    assert page.ask("location.pathname.endsWith('b.html') && document.body.innerText") == "here"


@in_browser
def test_the_first_page_leads_to_the_introduction(page, site):
    page.open(site)
    assert page.wait_for("location.pathname.endsWith('intro.html')")


@in_browser
def test_search_finds_the_ellipse(page, site):
    page.show_as(1280)
    page.open(site + "search.html?q=ellipse")
    page.wait_for("document.querySelector('#search-results a[href*=\"ellipses.html\"]')?.textContent")


@in_browser
@pytest.mark.parametrize("words", ["histogram", "ellipse", "covariance", "yaw", "estimate"])
def test_search_finds_chapters_before_modules(page, site, words):
    page.show_as(1280)
    page.open(site + f"search.html?q={words}")
    page.wait_for("document.querySelectorAll('#search-results li').length > 10")
    page.ask("new Promise(done => setTimeout(done, 1500))")
    links = "[...document.querySelectorAll('#search-results li > a')].map(a => a.pathname.includes('/api'))"
    of_modules = page.ask(links)
    assert of_modules == sorted(of_modules) and not of_modules[0]


def figures_that_move():
    return [name for page, name in NAMES.items() if '<div class="steps">' in page.read_text()]


@in_browser
def test_every_slider_has_a_name_and_answers_keys(page, site):
    assert len(figures_that_move()) >= 4
    for name in figures_that_move():
        page.show_as(390, 900)
        page.open(site + name)
        shown = "document.querySelector('.steps .step:not([hidden])').dataset.label"
        page.ask("document.querySelector('.steps input').focus()")
        first = page.ask(shown)
        for key, code in (("Home", 36), ("ArrowRight", 39)):
            for kind in ("keyDown", "keyUp"):
                page.send("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)
        steps = page.ask("[...document.querySelectorAll('.steps .step')].map(step => step.dataset.label)")
        said = page.ask("document.querySelector('.steps input').getAttribute('aria-valuetext')")
        assert (
            page.ask(shown) == said == steps[1] == page.ask("document.querySelector('.steps output').value")
        )
        assert first in steps and page.ask("document.querySelector('.steps input').labels.length") == 1


@in_browser
def test_the_steps_of_page_one_answer_keys_and_stand_side_by_side_on_paper_and_without_scripts(page, site):
    shown = "[...document.querySelectorAll('.strip .step')].map(step => step.checkVisibility())"
    page.show_as(420, 900)
    page.open(site + "book/intro.html")
    page.ask("document.querySelector('.strip input').focus()")
    seen = [page.ask(shown)]
    for kind in ("keyDown", "keyUp"):
        page.send(
            "Input.dispatchKeyEvent", type=kind, key="ArrowRight", code="ArrowRight", windowsVirtualKeyCode=39
        )
    seen.append(page.ask(shown))
    assert [steps.index(True) for steps in seen] == [0, 1] and [sum(steps) for steps in seen] == [1, 1]
    page.send("Emulation.setEmulatedMedia", media="print")
    assert page.ask(shown) == [True] * 7
    page.send("Emulation.setEmulatedMedia", media="")
    page.send("Emulation.setScriptExecutionDisabled", value=True)
    try:
        page.send("Page.navigate", url=site + "book/intro.html")
        page.wait_for(
            f"document.readyState == 'complete' && !document.querySelector('.live') && {shown}.length"
        )
        assert page.ask(shown) == [True] * 7
    finally:
        page.send("Emulation.setScriptExecutionDisabled", value=False)


RING_LAB = {"tilt_deg": 35, "toward_deg": 20, "distance_m": 0.4, "u_px": 120, "v_px": 90, "lens_mm": 6,
            "same_image": False}  # fmt: skip


@in_browser
@pytest.mark.parametrize("change", [
    {}, {"tilt_deg": 0, "u_px": 172.5, "v_px": 129.5}, {"tilt_deg": 70, "toward_deg": -110},
    {"distance_m": 1.2}, {"lens_mm": 12, "same_image": True}, {"lens_mm": 4},
])  # fmt: skip
def test_the_interactive_ring_computes_what_the_module_computes(page, site, change):
    page.open(site + "book/circles.html")
    state = RING_LAB | change
    solution = page.ask(f"RingLab.solve({json.dumps(state)})")
    focal_px = state["lens_mm"] / 6 * 6e-3 / 18.5e-6
    camera = Camera(346, 260, focal_px, focal_px, 172.5, 129.5)
    radius_m = 0.08 * (6 / state["lens_mm"] if state["same_image"] else 1)
    tilt, toward = np.deg2rad([state["tilt_deg"], state["toward_deg"]])
    n = np.array([np.sin(tilt) * np.cos(toward), np.sin(tilt) * np.sin(toward), -np.cos(tilt)])
    turn = Rotation.align_vectors(n[None], [[0, 0, 1]])[0].as_matrix()
    truth = Pose(turn, state["distance_m"] * bearings([state["u_px"], state["v_px"]], camera))
    seen = circle_ellipse(truth, radius_m, camera)
    exact, printed = (f(seen, camera, radius_m) for f in (circle.poses, circle.paper_poses))
    off_deg = [np.rad2deg(np.sort(normal_error_rad(poses, truth))) for poses in (exact, printed)]
    np.testing.assert_allclose(solution["seen"]["centre"], seen.centre_px, atol=1e-6)
    np.testing.assert_allclose(solution["seen"]["semi"], seen.semi_axes_px, atol=1e-6)
    np.testing.assert_allclose([solution["exact_deg"], solution["twin_deg"]], off_deg[0], atol=1e-4)
    np.testing.assert_allclose(solution["printed_deg"], off_deg[1][0], atol=1e-4)
    np.testing.assert_allclose(solution["printed"]["p"], printed.position_m[0], atol=1e-9)


@in_browser
def test_the_interactive_ring_answers_keys_and_touch(page, site):
    page.show_as(420, 900)
    page.open(site + "book/circles.html")
    said = "document.querySelector('.ring-lab .said').textContent"
    first = page.ask(said)
    page.ask("document.querySelector('.ring-lab input[name=tilt_deg]').focus()")
    for kind in ("keyDown", "keyUp"):
        page.send(
            "Input.dispatchKeyEvent", type=kind, key="ArrowLeft", code="ArrowLeft", windowsVirtualKeyCode=37
        )
    second = page.ask(said)
    page.ask(
        "document.querySelector('.ring-lab svg.image').scrollIntoView({block: 'center', behavior: 'instant'})"
    )
    box = page.ask("document.querySelector('.ring-lab svg.image').getBoundingClientRect().toJSON()")
    x, y = box["left"] + box["width"] / 2, box["top"] + box["height"] / 2
    for kind, shift in (("touchStart", 0), ("touchMove", 40), ("touchEnd", None)):
        points = [] if shift is None else [{"x": x + shift, "y": y}]
        page.send("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    assert len({first, second, page.ask(said)}) == 3


@in_browser
def test_the_book_prints_on_fewer_than_120_pages():
    pdf, count = print_book()
    assert 20 < count < 120 and pdf.stat().st_size > 1e6
