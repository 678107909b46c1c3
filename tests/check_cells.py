"""Chapters with another parameter: what a page proposes must run, with the page's checks.

Of the page's cells those run that can see the change, and those that can change what they see.
"""

import ast
import builtins
import dis
import re
from importlib import import_module
from multiprocessing import get_context
from types import CodeType

import matplotlib.pyplot as plt
import pytest
from IPython.core.interactiveshell import InteractiveShell
from lab.book.test_book import CHAPTERS, ROOT, WALK, cells, code
from traitlets.config import Config

TRY = re.compile(r"^(?P<name>\w+) = (?P<value>.+?)  # try (?P<others>[^a-z\s].*)$", re.M)
PROPOSED = [
    (page, match["name"], other)
    for page in CHAPTERS
    for match in TRY.finditer("\n".join(cells(page)))
    for other in match["others"].split(", ")
]
QUIET = Config({"HistoryManager": {"enabled": False}})
LONGEST_S = 300


def with_another(page, name: str, other: str) -> list[str]:
    """A page's code with a value that it proposes for one of its parameters: the cells that this concerns."""
    before = cells(page)
    after = [TRY.sub(lambda m: f"{name} = {other}" if m["name"] == name else m[0], cell) for cell in before]
    (changed,) = (k for k, pair in enumerate(zip(before, after, strict=True)) if len(set(pair)) == 2)
    return [after[k] for k in concerned(after, changed)]


def concerned(cells: list[str], changed: int) -> list[int]:
    """Which cells a change of one concerns: those that can see it, and those that can change what these see.

    A cell may change whatever it reads, but for what is imported or defined as a function.
    """
    reads, binds, fixed = zip(*map(names, cells), strict=True)
    everywhere = set(dir(builtins)).union(*fixed)
    leaves = [(r | b) - everywhere for r, b in zip(reads, binds, strict=True)]
    kept, dirty, wanted = {changed}, leaves[changed], set()
    for k in range(changed + 1, len(cells)):
        if reads[k] & dirty:
            kept.add(k)
            dirty = dirty | leaves[k]
    for k in reversed(range(len(cells))):
        if k in kept or (leaves[k] | binds[k]) & wanted:
            kept.add(k)
            wanted |= reads[k]
    return sorted(kept)


def names(cell: str) -> tuple[set, set, set]:
    """Names that a cell reads from before, those that it binds, and of these the imports and functions."""
    tree, bound = ast.parse(cell), set()
    reads = _loads(compile(cell, "cell", "exec"), bound)
    for branch in ast.walk(tree):  # what is bound in a branch may come from before
        if isinstance(branch, ast.If | ast.Try | ast.While):
            reads |= {n.id for n in ast.walk(branch) if isinstance(n, ast.Name)}
    imports = [n for n in ast.walk(tree) if isinstance(n, ast.Import | ast.ImportFrom)]
    fixed = {(name.asname or name.name).split(".")[0] for node in imports for name in node.names}
    return reads, bound, fixed | {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)}


def _loads(code: CodeType, bound: set) -> set:
    """Global names that code loads before it binds them; those that it binds are added to ``bound``."""
    loaded = set()
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_NAME", "LOAD_GLOBAL") and step.argval not in bound:
            loaded.add(step.argval)
        elif step.opname in ("STORE_NAME", "STORE_GLOBAL"):
            bound.add(step.argval)
        elif isinstance(step.argval, CodeType):
            loaded |= _loads(step.argval, set(bound))
    return loaded


def run(cells: list[str]) -> None:
    """Run cells as a kernel does, which also shows what their last lines give."""
    shell = InteractiveShell.instance(config=QUIET)
    for cell in cells:
        shell.run_cell(cell).raise_error()
        plt.close("all")


@pytest.fixture(scope="module")
def imported():
    """What pages import, imported once: the processes that run them are forked from this one."""
    for page in CHAPTERS:
        for node in ast.walk(code(page)):
            if isinstance(node, ast.ImportFrom):
                import_module(node.module)


def test_each_chapter_of_the_walk_proposes_a_value():
    assert {page for page, *_ in PROPOSED} >= set(WALK)


def test_a_change_concerns_what_reads_it_and_what_changes_what_that_reads():
    page = ["import x", "a = 1", "b = a", "c = []", "c.append(b)", "d = 3", "for a in c:\n    d += a",
            "z = a", "if z:\n    b = z", "e = 1", "print(e)"]  # fmt: skip
    assert concerned(page, 2) == [1, 2, 3, 4, 5, 6, 7, 8]
    assert concerned(page, 5) == [1, 2, 3, 4, 5, 6, 7, 8]
    assert concerned(page, 9) == concerned(page, 10) == [9, 10]
    assert concerned(page, 0) == [0]


@pytest.mark.parametrize("page, name, other", PROPOSED, ids=lambda value: getattr(value, "stem", value))
def test_a_chapter_runs_with_the_value_that_it_proposes(page, name, other, imported, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(ROOT / "book")
    process = get_context("fork").Process(target=run, args=(with_another(page, name, other),))
    process.start()
    process.join(LONGEST_S)
    process.kill()
    assert process.exitcode == 0
