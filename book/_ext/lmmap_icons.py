"""The theme's icons as a small style sheet: of Font Awesome's 1.9 MB the pages show a dozen drawings."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from urllib.parse import quote

SHEET = "icons.css"
STYLES = {
    "fas": "fas",
    "fa-solid": "fas",
    "far": "far",
    "fa-regular": "far",
    "fab": "fab",
    "fa-brands": "fab",
}
USED = re.compile(r'class="(?:[\w-]+ )*?(fas|far|fab|fa-solid|fa-regular|fa-brands) (?:fa-fw )?fa-([\w-]+)')
SCRIPT = re.compile(r'\s*<script src="[^"]*vendor/fontawesome/[^"]*"></script>')
HINT = re.compile(r'\s*<link rel="preload" as="font"[^>]*>')
LINK = re.compile(r'<link href="([^"]*_static/)vendor/fontawesome/[^"]*" rel="stylesheet" />')
RULES = """/* Icons: Font Awesome Free 6 by @fontawesome, https://fontawesome.com, licence CC BY 4.0 */
:is(.fas, .far, .fab, .fa-solid, .fa-regular, .fa-brands) {
  display: inline-block; width: 1.25em; height: 1em; vertical-align: -0.125em;
  background: currentColor; mask: var(--icon) no-repeat center / contain;
}
.fa-lg { font-size: 1.25em; }
:is(.nav-link.nav-external, .onthispage)::after,
:is(a.github, a.gitlab, p.highlight-link a)::before { content: none !important; }
"""


def drawings(script: str) -> dict[str, dict[str, tuple[int, int, str]]]:
    """Width, height and path of every icon of Font Awesome's script, by style (fab, far, fas) and name."""
    entry = re.compile(r'"?([\w-]+)"?:\[(\d+),(\d+),\[([^\]]*)\],"\w+",(?:"([^"]+)"|\["[^"]*","([^"]*)"\])\]')
    styles: dict = {}
    for block in re.split(r"(?=\b\w=\{[\w\"-]+:\[\d+,\d+,\[)", script):
        icons = {}
        for name, width, height, others, path, second in entry.findall(block):
            for known in (name, *re.findall(r'"([\w-]+)"', others)):
                icons[known] = int(width), int(height), path or second
        if icons:
            styles["fab" if "github" in icons else "fas" if "magnifying-glass" in icons else "far"] = icons
    return styles


def rule(name: str, drawing: tuple[int, int, str]) -> str:
    """The style of one icon, whose drawing is in its own address."""
    width, height, path = drawing
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"><path d="{path}"/></svg>'
    return f'.fa-{name} {{ --icon: url("data:image/svg+xml,{quote(svg, safe="=/: ")}"); }}'


def slim(app, exception) -> None:
    """Let pages load the icons that they show, instead of Font Awesome's script, style and fonts.

    Hints to fetch fonts early go, too: browsers refuse them on a page that is opened as a file.
    """
    if exception is not None or app.builder.format != "html":
        return
    html = Path(app.outdir)
    vendor, used = html / "_static" / "vendor" / "fontawesome", set()
    for page in sorted(html.rglob("*.html")):
        text = page.read_text()
        used |= {(STYLES[style], name) for style, name in USED.findall(text)}
        rest = LINK.sub(rf'<link href="\1{SHEET}" rel="stylesheet" />', HINT.sub("", SCRIPT.sub("", text)))
        if rest != text:
            page.write_text(rest)
    (script,) = vendor.glob("*/js/all.min.js")
    known = drawings(script.read_text())
    rules = [rule(name, known[style][name]) for style, name in sorted(used) if name in known[style]]
    (html / "_static" / SHEET).write_text(RULES + "\n".join(rules) + "\n")
    shutil.rmtree(vendor)
