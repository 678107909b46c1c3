"""The book's own Sphinx extension: a cache that knows the module, and plotly.js only where it is needed."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from pathlib import Path

import plotly

# all that a chapter's output depends on besides its own cells
SOURCES = ("lmmap/*.py", "data/weights/*", "data/mini/*", "data/paper/*", "data/results/**/*",
           "data/derived/quick/*.[cj]s*", "data/derived/paper/*.[cj]s*",
           "data/derived/recordings/*/summary.csv", "environment.txt")  # fmt: skip


def sources_hash(root: Path) -> str:
    """Hash of the profile, and of names and contents of everything in ``SOURCES`` below ``root``."""
    digest = hashlib.sha256(os.environ.get("PROFILE", "").encode())
    for path in sorted(p for pattern in SOURCES for p in root.glob(pattern) if p.is_file()):
        digest.update(f"{path.relative_to(root)}\0".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def name_cache(app, config) -> None:
    """One execution cache per state of the sources; those of older states go.

    jupyter-cache's own key is the chapter's cells, so an edited module would show stale output.
    """
    caches = Path(app.outdir).parent / "execution"
    current = caches / sources_hash(Path(app.srcdir))
    for old in caches.glob("*"):
        if old != current:
            shutil.rmtree(old)
    config.nb_execution_cache_path = str(current)


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


def escape_mathematics(app, what, name, obj, options, lines) -> None:
    """Docstrings write |x| and a * b; reStructuredText would read substitutions and emphasis."""
    literal_or_sign = re.compile(r"(``.*?``)|[|*]")
    lines[:] = [literal_or_sign.sub(lambda m: m[1] or "\\" + m[0], line) for line in lines]


def setup(app):
    app.connect("config-inited", name_cache)
    app.connect("html-page-context", load_plotly)
    app.connect("autodoc-process-docstring", escape_mathematics, priority=400)  # before napoleon
    app.connect("builder-inited", prepare_static)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
