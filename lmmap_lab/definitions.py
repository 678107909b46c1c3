"""The definitions of our packages, found in their syntax trees: what a name in a file stands for."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from lmmap.shipped import ROOT

HOUSES = ("lmmap", "lmmap_readers", "lmmap_lab")


class Unit(NamedTuple):
    """A definition by the file and name of it: ``Camera``, or of a method ``Camera.scaled``."""

    path: Path
    name: str


class Module:
    """The definitions, imports and statements of a file."""

    def __init__(self, path: Path):
        self.path, self.body = path, ast.parse(path.read_bytes()).body
        self.defined: dict[str, list[ast.stmt]] = {}
        self.effects: list[ast.stmt] = []
        for statement in self.body:
            if not isinstance(statement, ast.Import | ast.ImportFrom) and not is_for_others(statement):
                names = _defined_by(statement)
                self.effects += [statement] if not names or not _only_defines(statement) else []
                for name in names:
                    self.defined.setdefault(name, []).append(statement)

    @cached_property
    def imports(self) -> dict[str, tuple[Path, str | None] | str]:
        """What names stand for that are imported anywhere in the file: a file of ours and a name in it, or
        None for the whole of it; or another library's dotted name."""
        found: dict = {}
        for node in (n for statement in self.body for n in ast.walk(statement)):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    whole = alias.name if alias.asname else alias.name.partition(".")[0]
                    found[alias.asname or whole] = _file(ROOT.joinpath(*whole.split("."))) or whole
            elif isinstance(node, ast.ImportFrom):
                folder = self._folder(node)
                for alias in node.names:
                    named = folder and (_file(folder / alias.name), None)
                    own = folder and (named if named[0] else (_file(folder), alias.name))
                    found[alias.asname or alias.name] = own or f"{node.module}.{alias.name}"
        return {name: (of, None) if isinstance(of, Path) else of for name, of in found.items()}

    def _folder(self, node: ast.ImportFrom) -> Path | None:
        names = (node.module or "").split(".") if node.module else []
        if node.level:
            return self.path.parents[node.level - 1].joinpath(*names)
        return ROOT.joinpath(*names) if names[0] in HOUSES else None

    def find(self, name: str) -> Unit | ModuleType | str | None:
        """The definition, file or other library that a name in this file stands for."""
        if name in self.defined:
            return Unit(self.path, name)
        of = self.imports.get(name)
        return of if of is None or isinstance(of, str) else _find(*of)

    def resolve(self, node: ast.expr) -> tuple[Unit | Path | str, list[str]] | None:
        """What ``a.b.c`` stands for, and the attributes of it that are left; None for a local name."""
        chain: list[str] = []
        while isinstance(node, ast.Attribute):
            chain, node = [node.attr, *chain], node.value
        found = self.find(node.id) if isinstance(node, ast.Name) else None
        while isinstance(found, Path) and chain:
            found, chain = _find(found, chain[0]), chain[1:]
        return None if found is None else (found, chain)


def _file(path: Path) -> Path | None:
    """The file of a module or package at a path without suffix."""
    return next((p for p in (path.with_suffix(".py"), path / "__init__.py") if p.exists()), None)


module_at = cache(Module)


def _find(path: Path, name: str | None) -> Unit | Path | str:
    """What a name of a file of ours stands for."""
    if name is None:
        return path
    found = module_at(path).find(name)
    found = found or (path.name == "__init__.py" and _file(path.parent / name)) or None
    if found is None:
        raise ValueError(f"{path}: expected a definition or import of {name!r}, got none")
    return found


def is_for_others(statement: ast.stmt) -> bool:
    """Whether only type checkers, or only a call of the file as a program, run a statement."""
    text = ast.unparse(statement.test) if isinstance(statement, ast.If) else ""
    return text.startswith("__name__ ==") or text.endswith("TYPE_CHECKING")


def _only_defines(statement: ast.stmt) -> bool:
    if isinstance(statement, ast.Assign | ast.AnnAssign | ast.AugAssign):
        return True
    return isinstance(statement, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef)


def _defined_by(statement: ast.stmt) -> list[str]:
    """Names that a module's statement defines or changes: of ``a[k].b = 1`` it is a."""
    if isinstance(statement, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
        return [statement.name]
    targets = getattr(statement, "targets", [getattr(statement, "target", None)])
    names = []
    for target in filter(None, targets):
        for part in target.elts if isinstance(target, ast.Tuple | ast.List) else [target]:
            while isinstance(part, ast.Attribute | ast.Subscript | ast.Starred):
                part = part.value
            names += [part.id] if isinstance(part, ast.Name) else []
    inner = [
        s for field in ("body", "orelse", "handlers", "finalbody") for s in getattr(statement, field, [])
    ]
    return [
        *names,
        *(name for s in inner if isinstance(s, ast.stmt | ast.ExceptHandler) for name in _defined_by(s)),
    ]


def parts(unit: Unit) -> tuple[list[ast.stmt], dict[str, list[ast.stmt]]]:
    """The statements of a definition, or of a module beside its definitions (the name is then empty); and of
    a class the methods, which are definitions of their own."""
    module, (name, _, method) = module_at(unit.path), unit.name.partition(".")
    nodes = module.defined[name] if name else module.effects
    methods: dict[str, list[ast.stmt]] = {}
    if len(nodes) == 1 and isinstance(of := nodes[0], ast.ClassDef):
        for node in of.body:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                methods.setdefault(node.name, []).append(node)
        body = [node for node in of.body if not hasattr(node, "name") or node.name not in methods]
        nodes = [ast.ClassDef(of.name, of.bases, of.keywords, body, of.decorator_list)]
    return (methods[method], {}) if method else (nodes, methods)


def units_of(function: Callable | ModuleType) -> list[Unit]:
    path = Path(inspect.getsourcefile(inspect.unwrap(getattr(function, "py_func", function)))).resolve()
    if isinstance(function, ModuleType):
        return [Unit(path, name) for name in module_at(path).defined]
    return [Unit(path, function.__qualname__.partition(".<locals>")[0])]  # of what it stands in
