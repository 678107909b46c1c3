"""What a figure is made of: the module's functions and the data that its cell's variables come from."""

from __future__ import annotations

import ast
import importlib
import inspect

from lmmap_lab import provenance
from lmmap_lab.studies import accuracy_run, odometry

FOLDERS = {"DATA": provenance.DATA, "DERIVED_DATA": provenance.DERIVED_DATA,
           "COMMITTED": accuracy_run.COMMITTED, "odometry.FOLDER": odometry.FOLDER}  # fmt: skip


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
        if isinstance(node, ast.Name):
            sources |= _function(imported.get(node.id))
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            sources |= _function(getattr(imported.get(node.value.id), node.attr, None))
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            sources |= _path(node)
    longest = {path for path in sources if any(other.startswith(path + "/") for other in sources)}
    return sources - longest


def _function(value) -> set[str]:
    """The full name of a function of our packages, unless it only names files or sets styles."""
    ours = inspect.isfunction(value) and value.__module__.startswith(
        ("lmmap.", "lmmap_readers.", "lmmap_lab.")
    )
    ours = (
        ours
        and value.__module__ != "lmmap_lab.provenance"
        and value.__name__ not in ("use_style", "interactive")
    )
    return {f"{value.__module__}.{value.__name__}"} if ours else set()


def _path(node) -> set[str]:
    """``DATA / "mini" / name`` as ``data/mini``: as far as it is written out."""
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
