"""What a figure is made of: the module's functions and the data that its cell's variables come from, and
whether its numbers are computed with the book."""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
import textwrap
from pathlib import Path

from lmmap.pipeline.weights import load_card
from lmmap_lab import provenance
from lmmap_lab.studies import accuracy_run, odometry

PACKAGES = ("lmmap.", "lmmap_readers.", "lmmap_lab.")
FOLDERS = {"ROOT": provenance.ROOT, "DATA": provenance.DATA, "DERIVED_DATA": provenance.DERIVED_DATA,
           "COMMITTED": accuracy_run.COMMITTED, "odometry.FOLDER": odometry.FOLDER}  # fmt: skip

COMMITTED, PAPER, NOW = "from a committed run", "from the paper", "computed now"
ORIGINS = {
    "data/results": COMMITTED,
    "data/weights": COMMITTED,
    "book/_static": COMMITTED,
    "data/paper": PAPER,
    "data/results/accuracy/claims.csv": PAPER,  # beside ours
}
COMPUTING = ("lmmap.pipeline.estimator.", "lmmap.estimation.", "lmmap.tracking.", "lmmap_lab.bench.")
PAGES = ("lmmap_lab.pages", "lmmap_lab.studies")  # whose functions read files of which a page says nothing


def origins(used: set[str]) -> list[str]:
    """Where the numbers come from of what rests on these functions and paths (`sources`), in words."""
    functions = {_at(name) for name in used if name.startswith(PACKAGES)}
    paths = used | _read_by(functions)
    found = {words for folder, words in ORIGINS.items() if any(path.startswith(folder) for path in paths)}
    if COMMITTED not in found or any(name.startswith(COMPUTING) for name in used):
        found.add(NOW)
    return [words for words in (NOW, COMMITTED, PAPER) if words in found]


def _read_by(functions: set) -> set[str]:
    """Files of results, cards and the paper that functions name, or those of `PAGES` that they call."""
    paths, waiting, known = set(), set(functions), set()
    while waiting:
        function = waiting.pop()
        known.add(function)
        for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(function)))):
            value = _value(node, vars(sys.modules[function.__module__]))
            paths |= _path(node) | _inside(value)
            if value is load_card:
                paths.add("data/weights")
            elif inspect.isfunction(value) and value.__module__.startswith(PAGES) and value not in known:
                waiting.add(value)
    return paths


def _value(node, known: dict):
    """What a name, or an attribute of one, stands for."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return getattr(known.get(node.value.id), node.attr, None)
    return known.get(node.id) if isinstance(node, ast.Name) else None


def _inside(value) -> set[str]:
    """A path of `ORIGINS`; nothing for anything else."""
    if not isinstance(value, Path) or not value.is_relative_to(provenance.ROOT):
        return set()
    path = str(value.relative_to(provenance.ROOT))
    return {path} if path.startswith(tuple(ORIGINS)) else set()


def _at(name: str):
    module, _, function = name.rpartition(".")
    return getattr(importlib.import_module(module), function)


def sources(cells: list[str]) -> list[set[str]]:
    """For each code cell of a chapter, the functions ``lmmap...`` and paths ``data/...`` that it rests on.

    A variable has the sources of the statements that assign it; a statement has those of the functions,
    paths and variables in it.
    """
    imported, known, results = {}, {}, []
    for cell in cells:
        used = set()
        for statement in ast.parse(cell).body:
            if isinstance(statement, ast.ImportFrom) and (statement.module or "").startswith("lmmap"):
                for name in statement.names:
                    imported[name.asname or name.name] = _resolved(statement.module, name.name)
                continue
            inner = _of_comprehensions(statement)
            new, changed = _names(statement, ast.Store) - inner, _changed(statement)
            own = inner | (new if isinstance(statement, ast.For | ast.With) else set())
            loaded = (_names(statement, ast.Load) - own) | changed
            rests_on = _named(statement, imported).union(*(known.get(name, ()) for name in loaded))
            known |= dict.fromkeys(new | changed, rests_on)
            used |= rests_on
        results.append(used)
    return results


def _resolved(module: str, name: str):
    try:
        return importlib.import_module(f"{module}.{name}")
    except ModuleNotFoundError:
        return getattr(importlib.import_module(module), name)


def _names(tree, context) -> set[str]:
    names = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, context)}
    return names | ({tree.name} if isinstance(tree, ast.FunctionDef) and context is ast.Store else set())


def _of_comprehensions(statement) -> set[str]:
    """Variables that live inside a comprehension only."""
    targets = [n.target for n in ast.walk(statement) if isinstance(n, ast.comprehension)]
    return {n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}


def _changed(statement) -> set[str]:
    """Variables whose elements a statement assigns, or to which it appends."""
    nodes = list(ast.walk(statement))
    parts = [n for n in nodes if isinstance(n, ast.Subscript) and isinstance(n.ctx, ast.Store)]
    parts += [n for n in nodes if isinstance(n, ast.Attribute) and n.attr in ("append", "extend", "update")]
    parts += [n.target for n in nodes if isinstance(n, ast.AugAssign)]
    return {n.id for part in parts for n in ast.walk(part) if isinstance(n, ast.Name)}


def _named(statement, imported: dict) -> set[str]:
    sources = set()
    for node in ast.walk(statement):
        value = _value(node, imported)
        sources |= _function(value) | _inside(value) | _path(node)
    longest = {path for path in sources if any(other.startswith(path + "/") for other in sources)}
    return sources - longest


def _function(value) -> set[str]:
    """The full name of a function of our packages, or of the page's video, unless it only names files or sets
    styles."""
    ours = (
        inspect.isfunction(value) or getattr(value, "__name__", "") == "Player"
    ) and value.__module__.startswith(PACKAGES)
    ours = (
        ours
        and value.__module__ != "lmmap_lab.provenance"
        and value.__name__ not in ("use_style", "interactive")
    )
    return {f"{value.__module__}.{value.__name__}"} if ours else set()


def _path(node) -> set[str]:
    """``DATA / "mini" / name`` as ``data/mini``: as far as it is written out."""
    if not isinstance(node, ast.BinOp) or not isinstance(node.op, ast.Div):
        return set()
    parts = []
    while isinstance(node, ast.BinOp):
        parts.append(node.right.value if isinstance(node.right, ast.Constant) else None)
        node = node.left
    folder = FOLDERS.get(ast.unparse(node))
    if folder is None:
        return set()
    parts = parts[::-1]
    known = parts[: parts.index(None)] if None in parts else parts
    return {str(folder.relative_to(provenance.ROOT).joinpath(*map(str, known)))}
