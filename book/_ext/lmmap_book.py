"""The book's own Sphinx extension: when chapters run anew, what stands under figures, the modules' pages."""

from __future__ import annotations

import hashlib
import re
import shutil
import tomllib
from contextlib import suppress
from pathlib import Path

import nbformat
import plotly
from docutils import nodes
from jupyter_cache import get_cache
from lmmap_notebooks import known_numbers, readable
from lmmap_sources import sources
from PIL import Image
from sphinx.addnodes import pending_xref

from lmmap.provenance import PACKAGE, ROOT, page_fingerprint


def name_cache(app, config) -> None:
    """One execution cache per state of the sources; those of older states go.

    jupyter-cache's own key is the chapter's cells, so an edited module would show stale output.
    """
    caches = Path(app.outdir).parent / "execution"
    current = caches / page_fingerprint(Path(app.srcdir))
    for old in caches.glob("*"):
        if old != current:
            shutil.rmtree(old)
    config.nb_execution_cache_path = str(current)


def name_style(app, config) -> None:
    """Let an edit of the style or of a script alone renew the pages, which name both by checksum."""
    files = [
        p for p in sorted((Path(app.srcdir) / "book" / "_static").glob("*")) if p.suffix in (".css", ".js")
    ]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
    config.html_context = {**config.html_context, "style": digest[:16]}


def name_build(app) -> None:
    """Leave packages' folders out of Sphinx's note of what made the pages, so that pages are equal."""
    if app.builder.format == "html":
        kept = {name: getattr(app.config, name) for name in ("templates_path", "html_static_path")}
        for name in kept:
            setattr(app.config, name, [])
        app.builder.build_info = app.builder.create_build_info()
        for name, folders in kept.items():
            setattr(app.config, name, folders)


def needs_plotly(doctree) -> bool:
    """Whether a page draws an interactive figure."""
    return doctree is not None and "Plotly.newPlot" in "".join(
        node.astext() for node in doctree.findall() if node.tagname == "raw"
    )


def load_plotly(app, pagename, templatename, context, doctree) -> None:
    """Load plotly.js, in the head, on pages that draw with it."""
    if needs_plotly(doctree):
        app.add_js_file("plotly.min.js")


def prepare_static(app) -> None:
    """Ship the plotly.js of the installed wheel with the pages.

    Pages name static files by checksum if they are there: so plotly.js must be there from the start, and
    myst-nb's style sheet, which comes last, must not be left from an earlier build.
    """
    if app.builder.format == "html":
        static = Path(app.outdir) / "_static"
        static.mkdir(parents=True, exist_ok=True)
        for old in static.glob("mystnb.*.css"):
            old.unlink()
        shutil.copy(Path(plotly.__file__).parent / "package_data" / "plotly.min.js", static)


def drop_preloads(app, exception) -> None:
    """Remove the theme's hints to fetch fonts early, which browsers refuse on a page opened as a file."""
    if exception is None and app.builder.format == "html":
        for page in Path(app.outdir).rglob("*.html"):
            text = page.read_text()
            rest = re.sub(r'\s*<link rel="preload" as="font"[^>]*>', "", text)
            if rest != text:
                page.write_text(rest)


def keep_outputs(app, exception) -> None:
    """Write outputs into the notebooks of chapters that myst-nb took from its cache: it leaves them out."""
    cache = get_cache(app.config.nb_execution_cache_path)
    for path in (Path(app.outdir).parent / "jupyter_execute").rglob("*.ipynb"):
        with suppress(KeyError):  # a chapter without code is not in the cache
            _, notebook = cache.merge_match_into_notebook(nbformat.read(path, 4))
            path.write_text(nbformat.writes(notebook))


def offer_notebook(app, pagename, templatename, context, doctree) -> None:
    """Offer a chapter as a notebook too, in the theme's menu of downloads."""
    page = Path(app.srcdir) / f"{pagename}.md"
    if page.exists() and "{code-cell}" in page.read_text():
        context["ipynb_source"] = f"{pagename}.ipynb"


def name_folds(app, pagename, templatename, context, doctree) -> None:
    """Let screen readers hear what stands on a fold; myst-nb calls each of them "Toggle hidden content"."""
    if "body" in context:
        context["body"] = re.sub(r'<summary aria-label="[^"]*">', "<summary>", context["body"])


def write_notebooks(app, exception) -> None:
    """Write the notebooks that pages offer: executed, with their numbers in the text."""
    executed = Path(app.outdir).parent / "jupyter_execute"
    if exception is None and app.builder.format == "html":
        numbers = known_numbers(executed)
        for path in executed.rglob("*.ipynb"):
            target = Path(app.outdir) / "_sources" / path.relative_to(executed)
            nbformat.write(readable(nbformat.read(path, 4), numbers), target)


def describe_figures(app, doctree) -> None:
    """Put under each figure what it is made of, and give it the alternative text and kind of its file."""
    executed = Path(app.outdir).parent / "jupyter_execute" / f"{app.env.docname}.ipynb"
    if not executed.exists():
        return
    cells = nbformat.read(executed, 4).cells
    sources_by_cell = sources([cell.source if cell.cell_type == "code" else "" for cell in cells])
    for cell in doctree.findall(lambda n: isinstance(n, nodes.container) and "cell" in n["classes"]):
        images = list(cell.findall(nodes.image))
        for image in images:
            said = Image.open(Path(app.srcdir) / image["uri"]).info
            if not image.get("alt"):
                image["alt"] = said.get("Description", "")
            image["classes"].append(said.get("Comment", "picture"))
        if (images or needs_plotly(cell)) and sources_by_cell[cell["cell_index"]]:
            cell += source_line(sources_by_cell[cell["cell_index"]])


def source_line(names: set[str]) -> nodes.paragraph:
    """``Made by f, g from data/x``, each function a link to its documentation, and so to its source."""
    line = nodes.paragraph(classes=["made-of"])
    ours = sorted(name for name in names if name.startswith("lmmap."))
    for word, group in (("Made by ", ours), (" from " if ours else "Made from ", sorted(names - set(ours)))):
        for name in group:
            line += nodes.Text(word)
            shown = nodes.literal(text=name.removeprefix("lmmap."))
            link = {"refdomain": "py", "reftype": "obj", "reftarget": name}
            line += pending_xref("", shown, **link) if name.startswith("lmmap.") else shown
            word = ", "
    return line


def list_modules(app, docname, source) -> None:
    """Where a page says ``% modules``, document the wing that the page is named after.

    The page ``api`` documents the modules outside the wings, and links to the pages of the wings.
    """
    if "\n% modules\n" in source[0]:
        name = Path(docname).name
        text = _package() if name == "api" else _wing(name)
        source[0] = source[0].replace("\n% modules\n", "\n" + text)


def _package() -> str:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    layers = settings["contracts"][0]["layers"][::-1]  # lowest first
    names = [name for layer in layers for name in re.findall(r"\w+", layer)]
    wings = [f"- {{doc}}`api/{name}`" for name in names if (PACKAGE / name).is_dir()]
    modules = [_module(name) for name in names if not (PACKAGE / name).is_dir()]
    return "\n".join(["## Wings, lowest first", "", *wings, "", *modules])


def _wing(name: str) -> str:
    modules = sorted(path.stem for path in (PACKAGE / name).glob("[!_]*.py"))
    return "\n".join([_automodule(f"lmmap.{name}", ""), *(_module(f"{name}.{m}") for m in modules)])


def _module(name: str) -> str:
    return f"## `lmmap.{name}`\n\n{_automodule(f'lmmap.{name}')}"


def _automodule(name: str, members: str = "   :members:\n") -> str:
    return f"```{{eval-rst}}\n.. automodule:: {name}\n{members}```\n"


def escape_mathematics(app, what, name, obj, options, lines) -> None:
    """Docstrings write |x| and a * b; reStructuredText would read substitutions and emphasis."""
    literal_or_sign = re.compile(r"(``.*?``)|[|*]")
    lines[:] = [literal_or_sign.sub(lambda m: m[1] or "\\" + m[0], line) for line in lines]


def setup(app):
    app.connect("config-inited", name_cache)
    app.connect("config-inited", name_style)
    app.connect("source-read", list_modules)
    app.connect("html-page-context", load_plotly)
    app.connect("autodoc-process-docstring", escape_mathematics, priority=400)  # before napoleon
    app.connect("builder-inited", name_build)
    app.connect("builder-inited", prepare_static)
    app.connect("doctree-read", describe_figures, priority=900)  # after images have their places
    app.connect("build-finished", drop_preloads)
    app.connect("build-finished", keep_outputs)
    app.connect("html-page-context", name_folds)
    app.connect("html-page-context", offer_notebook, priority=100)  # before the theme's menu
    app.connect("build-finished", write_notebooks, priority=900)  # after outputs are kept
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
