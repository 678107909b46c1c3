"""The book's own Sphinx extension: when chapters run anew, what stands under figures, the modules' pages."""

from __future__ import annotations

import hashlib
import re
import shutil
import tomllib
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote

import nbformat
from docutils import nodes
from jupyter_cache import get_cache
from jupyter_cache.base import CacheBundleIn
from jupyter_cache.executors.utils import single_nb_execution
from lmmap_icons import slim
from lmmap_notebooks import known_numbers, readable
from lmmap_settings import hide_signature, list_fields
from lmmap_sources import PACKAGES, origins, sources
from myst_nb.core.read import create_nb_reader
from PIL import Image
from sphinx.addnodes import pending_xref

from lmmap_lab.provenance import ROOT, page_fingerprint

NARROW_PX = 650  # a figure drawn 5.6 inches wide, whose letters can be read at a phone's width
BINDER = "https://mybinder.org/v2/git/ADDRESS/HEAD"


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


def run_ahead(app, env, docnames) -> None:
    """Run the chapters that are not in the cache, two at a time, before Sphinx reads the pages one by one.

    A chapter that fails is left to myst-nb, which runs it again and reports the cell.
    """
    cache, settings, waiting = get_cache(app.config.nb_execution_cache_path), env.mystnb_config, []
    for path in map(Path, map(env.doc2path, docnames)):
        reader = create_nb_reader(str(path), env.myst_config, settings, text := path.read_text())
        if reader is not None:
            notebook = reader.read(text)
            try:
                cache.match_cache_notebook(notebook)
            except KeyError:
                waiting.append((path, notebook))

    def run(chapter):
        path, notebook = chapter
        return single_nb_execution(notebook, str(path.parent), settings.execution_timeout, allow_errors=False)

    with ThreadPoolExecutor(2) as kernels:
        for (path, notebook), result in zip(waiting, kernels.map(run, waiting), strict=True):
            if result.err is None:
                bundle = CacheBundleIn(notebook, str(path), data={"execution_seconds": result.time})
                cache.cache_notebook_bundle(bundle, check_validity=False, overwrite=True)


def name_style(app, config) -> None:
    """Let an edit of the style or of a script alone renew the pages, which name both by checksum."""
    files = [
        p for p in sorted((Path(app.srcdir) / "book" / "_static").glob("*")) if p.suffix in (".css", ".js")
    ]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
    config.html_context = {**config.html_context, "style": digest[:16]}


def order_search(app, config) -> None:
    """Let the search list chapters before modules; Sphinx would look for the file where it was started."""
    config.html_search_scorer = str(Path(__file__).with_name("lmmap_scorer.js"))


def name_build(app) -> None:
    """Leave packages' folders out of Sphinx's note of what made the pages, so that pages are equal."""
    if app.builder.format == "html":
        kept = {name: getattr(app.config, name) for name in ("templates_path", "html_static_path")}
        for name in kept:
            setattr(app.config, name, [])
        app.builder.build_info = app.builder.create_build_info()
        for name, folders in kept.items():
            setattr(app.config, name, folders)


def has_slider(node) -> bool:
    """Whether a cell's output is a figure with a slider."""
    return any('class="steps"' in raw.astext() for raw in node.findall(nodes.raw))


def has_table(node) -> bool:
    """Whether a cell's output is a table."""
    return any("<table" in raw.astext() for raw in node.findall(nodes.raw))


def prepare_static(app) -> None:
    """Remove myst-nb's style sheet of an earlier build.

    Pages name static files by checksum if they are there, and this one comes last.
    """
    if app.builder.format == "html":
        for old in (Path(app.outdir) / "_static").glob("mystnb.*.css"):
            old.unlink()


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


def keep_punctuation(app, pagename, templatename, context, doctree) -> None:
    """Keep a formula and the punctuation about it on one line; browsers break lines beside any picture."""
    formula = r'<span class="math notranslate nohighlight">\\\([^<]*</span>'
    if "body" in context:
        about = rf"\(?{formula}[.,;:)]+|\({formula}"
        context["body"] = re.sub(about, r'<span class="kept">\g<0></span>', context["body"])


def write_notebooks(app, exception) -> None:
    """Write the notebooks that pages offer: executed, with their numbers in the text."""
    executed = Path(app.outdir).parent / "jupyter_execute"
    if exception is None and app.builder.format == "html":
        numbers = known_numbers(executed)
        for path in executed.rglob("*.ipynb"):
            target = Path(app.outdir) / "_sources" / path.relative_to(executed)
            nbformat.write(readable(nbformat.read(path, 4), numbers), target)


def describe_figures(app, doctree) -> None:
    """Put under figures and tables where their numbers come from, and under figures what they are made of;
    give these the alternative text and kind of their file."""
    executed = Path(app.outdir).parent / "jupyter_execute" / f"{app.env.docname}.ipynb"
    if not executed.exists():
        return
    cells = nbformat.read(executed, 4).cells
    sources_by_cell = sources([cell.source if cell.cell_type == "code" else "" for cell in cells])
    for cell in doctree.findall(lambda n: isinstance(n, nodes.container) and "cell" in n["classes"]):
        images = list(cell.findall(nodes.image))
        for image in images:
            file = Image.open(Path(app.srcdir) / image["uri"])
            if not image.get("alt"):
                image["alt"] = file.info.get("Description", "")
            image["classes"].append(file.info.get("Comment", "picture"))
            image["classes"] += ["narrow"] * (file.width <= NARROW_PX)
        used = sources_by_cell[cell["cell_index"]]
        if images or has_slider(cell) or has_table(cell):
            cell += nodes.paragraph("", " · ".join(origins(used)), classes=["origin"])
        if (images or has_slider(cell)) and used:
            cell += source_line(used)


def source_line(names: set[str]) -> nodes.paragraph:
    """``Made by f, g from data/x``, each function a link to its documentation, and so to its source."""
    line = nodes.paragraph(classes=["made-of"])
    ours = sorted(name for name in names if name.startswith(PACKAGES))
    for word, group in (("Made by ", ours), (" from " if ours else "Made from ", sorted(names - set(ours)))):
        for name in group:
            line += nodes.Text(word)
            shown = nodes.literal(text=name.removeprefix("lmmap.").removeprefix("lmmap_lab."))
            link = {"refdomain": "py", "reftype": "obj", "reftarget": name}
            line += pending_xref("", shown, **link) if name in ours else shown
            word = ", "
    return line


def link_binder(app, doctree) -> None:
    """Where ``repository`` in _config.yml names a public clone, link to its Binder instead of telling how."""
    repository = app.config.html_theme_options.get("repository_url")
    for address in [node for node in doctree.findall(nodes.literal) if node.astext() == BINDER]:
        if repository:
            url = BINDER.replace("ADDRESS", quote(repository, safe=""))
            paragraph = nodes.paragraph()
            paragraph += nodes.Text("Without an installation, the chapters run in your browser: ")
            paragraph += [nodes.reference("", "open them in a Binder", refuri=url), nodes.Text(".")]
            address.parent.replace_self(paragraph)


def list_modules(app, docname, source) -> None:
    """Where a page says ``% modules``, document the wing that the page is named after.

    The pages ``api``, ``api/readers`` and ``api/lab`` document the modules outside the wings of a package,
    and link to the pages of the wings, which are in a folder of the same name.
    """
    if "\n% modules\n" in source[0]:
        page = Path(docname).relative_to("book")
        overviews = {Path("api"): "lmmap", Path("api/lab"): "lmmap_lab", Path("api/readers"): "lmmap_readers"}
        text = (
            _package(overviews[page], page.name)
            if page in overviews
            else _wing(overviews[page.parent], page.name)
        )
        source[0] = source[0].replace("\n% modules\n", "\n" + text)


def _package(package: str, folder: str) -> str:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    layers = next(c["layers"] for c in settings["contracts"] if c.get("containers") == [package])[::-1]
    names = [name for layer in layers for name in re.findall(r"\w+", layer)]  # lowest first
    wings = [f"- {{doc}}`{folder}/{name}`" for name in names if (ROOT / package / name).is_dir()]
    modules = [_module(package, name) for name in names if not (ROOT / package / name).is_dir()]
    return "\n".join([*(["## Wings, lowest first", "", *wings] if wings else []), "", *modules])


def _wing(package: str, name: str) -> str:
    modules = sorted(path.stem for path in (ROOT / package / name).glob("[!_]*.py"))
    own = _automodule(f"{package}.{name}", "")
    return "\n".join([own, *(_module(package, f"{name}.{module}") for module in modules)])


def _module(package: str, name: str) -> str:
    return f"## `{package}.{name}`\n\n{_automodule(f'{package}.{name}')}"


def _automodule(name: str, members: str = "   :members:\n") -> str:
    return f"```{{eval-rst}}\n.. automodule:: {name}\n{members}```\n"


def escape_mathematics(app, what, name, obj, options, lines) -> None:
    """Docstrings write |x| and a * b; reStructuredText would read substitutions and emphasis."""
    literal_or_sign = re.compile(r"(``.*?``)|[|*]")
    lines[:] = [literal_or_sign.sub(lambda m: m[1] or "\\" + m[0], line) for line in lines]


def setup(app):
    app.connect("config-inited", name_cache)
    app.connect("config-inited", name_style)
    app.connect("config-inited", order_search)
    app.connect("env-before-read-docs", run_ahead)
    app.connect("source-read", list_modules)
    app.connect("autodoc-process-docstring", escape_mathematics, priority=400)  # before napoleon
    app.connect("autodoc-process-docstring", list_fields, priority=600)  # after napoleon
    app.connect("autodoc-process-signature", hide_signature)
    app.connect("builder-inited", name_build)
    app.connect("builder-inited", prepare_static)
    app.connect("doctree-read", link_binder)
    app.connect("doctree-read", describe_figures, priority=900)  # after images have their places
    app.connect("build-finished", slim)
    app.connect("build-finished", keep_outputs)
    app.connect("html-page-context", name_folds)
    app.connect("html-page-context", keep_punctuation)
    app.connect("html-page-context", offer_notebook, priority=100)  # before the theme's menu
    app.connect("build-finished", write_notebooks, priority=900)  # after outputs are kept
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
