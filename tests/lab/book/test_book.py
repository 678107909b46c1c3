"""The book without a build: what each page must have, that references resolve, that pins are exact."""

import ast
import os
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from docutils import nodes
from lmmap_book import BINDER, link_binder, list_modules, name_style

from lmmap_lab.provenance import page_fingerprint

ROOT = Path(__file__).parents[3]
BOOK = ROOT / "book"
TOC = yaml.safe_load((ROOT / "_toc.yml").read_text())
NAMES = [TOC["root"]] + [chapter["file"] for part in TOC["parts"] for chapter in part["chapters"]]
PAGES = [ROOT / f"{name}.md" for name in NAMES]
API = [page for page in PAGES if page.stem == "api" or "api" in page.parts]
REFERENCE = ("appendix", "bibliography", "provenance", "quickstart")  # no finding of their own
CHAPTERS = [page for page in PAGES if page not in API and page.stem not in REFERENCE]
ENVIRONMENT = (ROOT / "environment.txt").read_text()
WALK = [ROOT / f"{chapter['file']}.md" for part in TOC["parts"] if part["caption"] == "The paper"
        for chapter in part["chapters"]]  # fmt: skip
PINS = [line.split(";")[0].strip() for line in ENVIRONMENT.splitlines() if line and not line.startswith("#")]

every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
every_chapter = pytest.mark.parametrize("page", CHAPTERS, ids=lambda page: page.stem)


CELL = re.compile(r"^(`{3,}|:{3,})\{code-cell\}[^\n]*\n(.*?)^\1$|^## ", re.M | re.S)
OPTIONS = re.compile(r"((?::[^\n]*\n)*)(?:---\n(.*?)\n---\n)?(.*)", re.S)


def parts(page: Path) -> Iterator[tuple[dict, str] | None]:
    """A page's code cells in order, as ``(options, code)``; None where a section begins."""
    for match in CELL.finditer(page.read_text()):
        if match[2] is None:
            yield None
            continue
        lines, block, code = OPTIONS.match(match[2]).groups()
        pairs = (line[1:].split(":", 1) for line in lines.splitlines())
        yield yaml.safe_load(block or "{}") | {name: yaml.safe_load(text) for name, text in pairs}, code


def cells(page: Path) -> list[str]:
    """Source of a page's code cells, without their options."""
    return [code for _, code in filter(None, parts(page))]


def code(page: Path) -> ast.Module:
    return ast.parse("\n".join(cells(page)))


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^(`{3,})[^\n]*\n.*?^\1$", "", page.read_text(), flags=re.M | re.S)


def glued(page: Path) -> set[str] | None:
    """Keys that a page glues by literal name; None if it also makes names."""
    calls = [
        n for n in ast.walk(code(page)) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "glue"
    ]
    names = [call.args[0] for call in calls]
    literal = all(isinstance(name, ast.Constant) for name in names)
    return {name.value for name in names} if literal else None


def test_the_table_of_contents_is_the_book():
    assert sorted(PAGES) == sorted([*BOOK.glob("*.md"), *BOOK.glob("api/**/*.md")])
    assert not list(BOOK.rglob("*.ipynb"))  # notebooks store outputs; chapters are text


@every_page
def test_a_page_opens_with_one_title_and_an_epigraph(page):
    titles = re.findall(r"^# .+\n\n(.*)", prose(page), re.M)
    assert len(titles) == 1
    assert re.match(r"\*[^*]", titles[0]), f"{page.name}: no epigraph under the title"


@every_page
def test_no_line_of_text_is_a_comment(page):
    assert not re.search(r"^%(?! modules)", prose(page), re.M), "MyST drops a line that begins with %"


@every_chapter
def test_a_chapter_runs_in_the_environments_kernel_and_asserts(page):
    header = yaml.safe_load(page.read_text().split("---\n")[1])
    assert header["kernelspec"]["name"] == "python3"
    assert any(isinstance(node, ast.Assert) for node in ast.walk(code(page))), f"{page.name}: no assert"


@pytest.mark.parametrize(
    "page", [page for page in CHAPTERS if page.stem != "provenance"], ids=lambda page: page.stem
)
def test_a_chapter_draws(page):
    drawing = re.compile(
        r"\b(plt\.|(?:gallery|waterfall)\.draw|\w+_page\.draw|figures\.(?!use_style|COLOUR)|go\.Figure|px\.)"
    )
    assert drawing.search("\n".join(cells(page))), f"{page.name}: draws no figure"


@every_page
def test_functions_in_chapters_stay_short(page):
    functions = [n for n in ast.walk(code(page)) if isinstance(n, ast.FunctionDef)]
    long = [f.name for f in functions if f.end_lineno - f.lineno >= 5]
    assert not long, f"{page.name}: {long} belong into the module"


def linked_pages(text: str, folder: Path = BOOK) -> list[Path]:
    return [folder / f"{target}.md" for target in re.findall(r"\{doc\}`(?:[^`<]*<)?([^`>]+)>?`", text)]


@every_page
def test_citations_and_links_resolve(page):
    text = prose(page)
    keys = set(re.findall(r"@\w+\{(\w+),", (BOOK / "references.bib").read_text()))
    cited = [key.strip() for group in re.findall(r"\{cite:\w+\}`([^`]+)`", text) for key in group.split(",")]
    assert set(cited) <= keys
    assert all(target in PAGES for target in linked_pages(text))
    for target in re.findall(r"\]\((?!\w+:|#)([^)#\s]+)", text):
        assert (BOOK / target).exists(), target


@every_page
def test_glued_numbers_exist(page):
    for role in re.findall(r"\{glue:\w+\}`([^`]+)`", page.read_text()):
        place, _, key = role.rpartition("::")
        source = BOOK / place if place else page
        assert source in PAGES, role
        names = glued(source)
        assert names is None or key.split(":")[0] in names, role


def test_no_text_names_a_machine():
    texts = [
        *PAGES,
        *ROOT.glob("*.md"),
        *ROOT.glob("*.yml"),
        *(ROOT / "lmmap").rglob("*.py"),
        *(ROOT / "lmmap_readers").rglob("*.py"),
        *(ROOT / "lmmap_lab").rglob("*.py"),
        ROOT / "Makefile",
    ]
    machine = re.compile(r"(?<![\w.])/(home|root|tmp|work|Users|mnt)/")
    assert [path.name for path in texts if machine.search(path.read_text())] == []


def test_the_reference_documents_every_module():
    documented = []
    for page in API:
        source = [page.read_text()]
        list_modules(None, str(page.relative_to(ROOT).with_suffix("")), source)
        documented += re.findall(r"automodule:: (lmmap(?:_lab|_readers)?\.[\w.]+)", source[0])
        assert all(link in PAGES for link in linked_pages(source[0], page.parent)), page.name
    packages = [
        path for house in ("lmmap", "lmmap_readers", "lmmap_lab") for path in (ROOT / house).rglob("*.py")
    ]
    files = [path.relative_to(ROOT).with_suffix("").parts for path in packages]
    names = {".".join(parts).removesuffix(".__init__") for parts in files}
    assert sorted(documented) == sorted(names - {"lmmap", "lmmap.__main__", "lmmap_readers", "lmmap_lab"})


def test_pins_are_exact():
    assert [pin for pin in PINS if not re.fullmatch(r"[\w.-]+==[\w.]+", pin)] == []
    names = [re.sub(r"[-_.]+", "-", pin.split("==")[0]).lower() for pin in PINS]
    assert len(set(names)) == len(names)
    assert not [name for name in names if re.match("nvidia|cuda|triton", name)]


def test_the_quickstart_links_to_the_binder_of_a_repository_that_is_named():
    """And tells how to make one where none is."""
    assert sum(f"`{BINDER}`" in page.read_text() for page in PAGES) == 1
    assert f"`{BINDER}`" in (BOOK / "quickstart.md").read_text()
    for repository in (None, "https://example.org/you/lmmap"):
        section, text = nodes.section(), nodes.paragraph("", "")
        section += text
        text += [nodes.Text("Open "), nodes.literal(text=BINDER), nodes.Text(".")]
        config = SimpleNamespace(html_theme_options={"repository_url": repository})
        link_binder(SimpleNamespace(config=config), section)
        links = [node["refuri"] for node in section.findall(nodes.reference)]
        named = ["https://mybinder.org/v2/git/https%3A%2F%2Fexample.org%2Fyou%2Flmmap/HEAD"]
        assert links == (named if repository else [])
        assert ("ADDRESS" in section.astext()) == (repository is None)


def test_binder_installs_the_pins():
    script = ROOT / "binder" / "postBuild"
    assert os.access(script, os.X_OK) and "-r environment.txt" in script.read_text()
    minor = re.fullmatch(r"python-3\.(\d+)\n", (ROOT / "binder" / "runtime.txt").read_text())[1]
    assert 11 <= int(minor) <= 13


def test_every_direct_dependency_has_its_reason():
    direct = re.findall(r"^([\w.-]+)==", ENVIRONMENT.split("# indirect")[0], re.M)
    section = (ROOT / "DESIGN.md").read_text().split("## Dependencies")[1]
    rows = re.findall(r"^\| ([\w.-]+) \| .+ \| .+ \|$", section, re.M)
    assert sorted(rows) == sorted([*direct, "package"])


def test_every_oracle_has_its_pin_and_its_reason():
    text = (ROOT / "tests" / "oracles.txt").read_text()
    pins = [pin for line in text.splitlines() if (pin := line.split("  #")[0]) and not pin.startswith("#")]
    form = r'[\w.-]+==[\w.]+(; python_version < "3\.\d+")?'
    assert [pin for pin in pins if not re.fullmatch(form, pin)] == []
    direct = re.findall(r"^([\w.-]+)==", text.split("# indirect")[0], re.M)
    section = (ROOT / "DESIGN.md").read_text().split("## Oracles")[1].split("## ")[0]
    assert sorted(re.findall(r"^\| ([\w.-]+) \| .+ \| .+ \|$", section, re.M)) == sorted([*direct, "package"])


def test_the_cache_is_named_by_what_pages_depend_on(tmp_path, monkeypatch):
    module = tmp_path / "lmmap" / "core.py"
    module.parent.mkdir()
    names = [page_fingerprint(tmp_path)]
    for text in ("a = 1\n", "a = 2\n"):
        module.write_text(text)
        names.append(page_fingerprint(tmp_path))
    (tmp_path / "data" / "results" / "paper").mkdir(parents=True)
    (tmp_path / "data" / "results" / "paper" / "table.csv").write_text("x\n")
    names.append(page_fingerprint(tmp_path))
    monkeypatch.setenv("PROFILE", "another")
    names.append(page_fingerprint(tmp_path))
    assert len(set(names)) == len(names)
    (tmp_path / "data" / "derived").mkdir()
    (tmp_path / "data" / "derived" / "scratch.npz").write_text("y\n")
    (tmp_path / "data" / "derived" / "quick").mkdir()
    (tmp_path / "data" / "derived" / "quick" / "summary.csv").write_text("of another profile\n")
    assert page_fingerprint(tmp_path) == names[-1]


@every_chapter
def test_a_chapter_that_needs_results_says_so_where_there_are_none(page):
    """By `made_results`, whose error names the command: a path would give an error about a file."""
    source = "\n".join(cells(page))
    assert not re.search(r"DERIVED_DATA / (profile|\"quick|\"paper)", source)


def test_references_link_out():
    """All but two: of one we know no DOI, and the other has none."""
    entries = re.findall(r"^@\w+\{(\w+),(.*?)^\}", (BOOK / "references.bib").read_text(), re.M | re.S)
    without = {
        name for name, fields in entries if not re.search(r"^\s*doi = \{10\.\d+/\S+\},$", fields, re.M)
    }
    assert len(entries) >= 18 and without == {"kanatani1993", "halir1998"}


def test_an_edit_of_the_style_alone_renews_the_pages(tmp_path):
    static = tmp_path / "book" / "_static"
    static.mkdir(parents=True)
    app, styles = SimpleNamespace(srcdir=tmp_path), []
    for text in ("a", "b", "b"):
        (static / "custom.css").write_text(text)
        config = SimpleNamespace(html_context={"default_mode": "auto"})
        name_style(app, config)
        styles.append(config.html_context)
    assert styles[0] != styles[1] == styles[2] and styles[0]["default_mode"] == "auto"


# --- what a chapter must have, CONTRIBUTING.md: "A chapter" -------------------------------------------------
APART = {"book/quickstart", "book/models"}  # commands, and cards
TAUGHT = [
    ROOT / f"{chapter['file']}.md"
    for part in TOC["parts"]
    if part["caption"] != "Reference" and not part["caption"].startswith("Modules")
    for chapter in part["chapters"]
    if chapter["file"] not in APART
]
every_taught = pytest.mark.parametrize("page", TAUGHT, ids=lambda page: page.stem)


def options(page: Path) -> list[dict]:
    """Options of a page's code cells."""
    return [options for options, _ in filter(None, parts(page))]


def sentences(text: str) -> int:
    plain = re.sub(r"\{[\w:-]+\}`[^`]*`|`[^`]*`|\$[^$]*\$", "x", text).strip()
    return len(re.findall(r"[.!?]\)?(?=\s|$)", plain))


@every_taught
def test_a_chapter_begins_with_goals_and_ends_with_a_summary_of_three_sentences(page):
    text = prose(page)
    assert re.search(r"^# .+\n\n\*.+\*\n\n\*\*You will learn\*\* .+?[.]", text, re.M | re.S), "no goals"
    summary = re.search(r"^## Summary\n\n(.+?)\n\n## Exercises$", text, re.M | re.S)
    assert summary, f"{page.name}: no summary before the exercises"
    assert sentences(summary[1]) == 3, f"{page.name}: {sentences(summary[1])} sentences"


@every_taught
def test_a_chapter_has_two_exercises_and_each_a_folded_solution_that_runs(page):
    rest = page.read_text().split("\n## Exercises\n")[1]
    tasks = re.split(r"^\*\*Exercise (\d+)\.\*\*", rest, flags=re.M)
    assert len(tasks[1::2]) >= 2 and tasks[1::2] == [f"{k + 1}" for k in range(len(tasks) // 2)]
    for number, task in zip(tasks[1::2], tasks[2::2], strict=True):
        assert re.search(r"^tags: \[hide-cell\]$", task, re.M), f"exercise {number}: no folded solution"


@every_page
def test_captions_have_names_of_their_own_and_at_least_two_sentences(page):
    for option in options(page):
        figure = option.get("mystnb", {}).get("figure")
        if figure:
            assert re.fullmatch(r"fig-[a-z0-9-]+", figure["name"])
            assert sentences(figure["caption"]) >= 2, f"{figure['name']}: {figure['caption']}"


@every_page
def test_the_title_of_a_fold_is_one_whole_line(page):
    """MyST takes the rest of the line for the title, and the next line for the text."""
    for title, text in re.findall(r"^:{3,}\{dropdown\} (.*)\n(.*)$", prose(page), re.M):
        assert "**" not in title and not re.match(r"[a-z{]", text), title


def words(page: Path) -> int:
    """Of a page's prose, without code, folds and equations; a number that is glued counts as one."""
    text = re.sub(r"\A---\n.*?\n---\n", "", prose(page), flags=re.S)
    for what, instead in (
        (r"^(:{3,})\{dropdown\}.*?^\1$", ""),
        (r"\$\$.*?\$\$", ""),
        (r"\{glue:\w+\}`[^`]*`", "0"),
    ):
        text = re.sub(what, instead, text, flags=re.S | re.M)
    return len(text.split())


def test_the_walk_is_ten_chapters_of_a_quarter_of_an_hour_each():
    assert len(WALK) == 10
    lengths = {page.stem: words(page) for page in WALK}
    assert all(800 <= n <= 1600 for n in lengths.values()) and lengths["accuracy"] <= 1500, lengths


def test_the_first_page_is_read_in_a_minute_and_the_book_in_an_afternoon():
    assert words(PAGES[0]) < 350
    assert sum(words(page) for page in PAGES if page not in API and page.stem != "appendix") < 22_000


def terms() -> dict[str, str]:
    """Pages by the term that the glossary takes from them, in the order of the page."""
    entries = (BOOK / "notation.md").read_text().split("```{glossary}")[1].split("```")[0]
    found = re.findall(r"^(\S[^\n]*)\n((?:  .*\n?)+)", entries, re.M)
    return {term: re.search(r"\((\w[\w-]*)\.md\)$", text.strip())[1] for term, text in found}


def test_no_term_of_the_walk_stands_before_the_chapter_that_defines_it():
    order = [page.stem for page in PAGES]
    for term, where in terms().items():
        assert where in order, term
        defined = prose(BOOK / f"{where}.md")
        words_of_it = r"\s+".join(term.split())
        assert re.search(rf"\*{words_of_it}\w*\*", defined, re.I), f"{where}.md: no *{term}*"
        early = [page.stem for page in WALK if order.index(page.stem) < order.index(where)
                 and re.search(rf"(?<![\w/.-]){re.escape(term)}s?(?![\w.-])", prose(page), re.I)]  # fmt: skip
        assert not early, f"{term!r} is defined in {where}, but used in {early}"


def test_no_two_figures_share_a_name():
    names = [
        o["mystnb"]["figure"]["name"]
        for page in PAGES
        for o in options(page)
        if "figure" in o.get("mystnb", {})
    ]
    assert len(set(names)) == len(names)
    pointed = {name for page in PAGES for name in re.findall(r"\{numref\}`([\w-]+)`", page.read_text())}
    assert pointed <= set(names)
