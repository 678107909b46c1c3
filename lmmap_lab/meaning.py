"""What code means, as one hash: equal for code that computes the same in other words, other in all else.

The unit is a definition: a function, a method, a class without its methods, or a name assigned in a module.
From the functions that make a result we follow every name to the definition of ours that it stands for.

Part of the meaning are expressions, constants, defaults, decorators, fields and their order, base classes,
the definitions that all of these stand for, and a module's own statements beside its definitions, such as
a loop that fills a table.

No part of it are

- layout, comments, docstrings and type annotations;
- where a definition stands, what it is called, and how it is imported: a name counts as what it stands for;
- what is only said or refused: arguments of ``raise``, of `print`, ``report`` and ``warn``; ``assert`` and
  ``cast``; and calls for nothing but themselves of functions whose names begin with ``check``;
- how files are kept: the definitions of the modules `STORING`, and methods called ``load`` or ``save``;
- definitions that nothing leads to.  A method counts if its class is reached and its name occurs as an
  attribute or word in anything that is reached, or if a class of another library, which may call it, is a
  base of its class.

Other libraries count by their pins (`lmmap_lab.provenance.pins`).  Names that exist only at run time are not
followed: modules imported by a text, or assigned from outside.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

from lmmap.shipped import ROOT

from .definitions import Module, Unit, is_for_others, module_at, parts, units_of

SAID, STORED = {"print", "report", "warn"}, {"load", "save"}
STORING = {f"lmmap/{name}.py" for name in ("disk", "errors", "files", "marks")} | {
    "lmmap_lab/bench/part_files.py"
}
UNSAID = {"annotation", "returns", "type_comment", "type_params", "ctx", "kind"}  # fields of a syntax tree
DEEP = 8  # definitions that differ only this many calls below a name are not told apart by that name


class Word(str):
    """A text that may name a method."""


def _tokens(node, module: Module, in_class: bool = False) -> Iterator[str | Unit]:
    """What a piece of a syntax tree says, names of ours replaced by what they stand for."""
    if isinstance(node, list):
        yield "["
        for part in node:
            yield from _tokens(part, module, in_class)
        yield "]"
    elif not isinstance(node, ast.AST):
        yield node if isinstance(node, str) else repr(node)
    elif isinstance(node, ast.AnnAssign) and not in_class:  # an annotation makes no other assignment
        yield from _tokens(ast.Assign([node.target], node.value), module) if node.value else ()
    elif isinstance(node, ast.Name | ast.Attribute) and (found := module.resolve(node)):
        of, attributes = found
        if isinstance(of, str):  # of another library, which no method of ours is
            yield ".".join([of, *attributes])
        else:
            yield from [Unit(of, name) for name in module_at(of).defined] if isinstance(of, Path) else [of]
            yield from map(Word, attributes)
    elif isinstance(node, ast.Raise):
        yield "Raise"
        yield from _tokens(getattr(node.exc, "func", node.exc), module) if node.exc else ()
    elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "cast":
        yield from _tokens(node.args[1], module)
    elif not _is_only_said(node):
        yield type(node).__name__
        for field, value in ast.iter_fields(node):
            if value is not None and value != [] and not _is_unsaid(node, field):
                yield field
                if isinstance(value, str) and field in ("attr", "value"):
                    yield Word(value)
                else:
                    yield from _tokens(value, module, isinstance(node, ast.ClassDef))


def _is_unsaid(node: ast.AST, field: str) -> bool:
    own_name = field == "name" and isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    return field in UNSAID or own_name


def _is_only_said(node: ast.AST) -> bool:
    """Whether a statement changes no result."""
    if isinstance(node, ast.Expr):
        call = node.value.func if isinstance(node.value, ast.Call) else None
        name = getattr(call, "id", getattr(call, "attr", ""))
        return name in SAID or name.lstrip("_").startswith("check") or isinstance(node.value, ast.Constant)
    return isinstance(node, ast.Import | ast.ImportFrom | ast.Assert | ast.Pass) or is_for_others(node)


def reached(entries: list[Unit]) -> dict[Unit, list[str | Unit]]:
    """What every definition says that the entries lead to."""
    said: dict[Unit, list[str | Unit]] = {}
    methods: dict[Unit, tuple[Unit, str, bool]] = {}  # of reached classes: class, name, whether always called
    words: set[str] = set()
    waiting = set(entries)
    while waiting:
        unit = waiting.pop()
        module, (nodes, own) = module_at(unit.path), parts(unit)
        is_stored = unit.path.relative_to(ROOT).as_posix() in STORING
        said[unit] = ["stored"] if is_stored else list(_tokens(nodes, module))
        words |= {token for token in said[unit] if isinstance(token, Word)} - STORED
        for name in () if is_stored else own:
            # a base of another library may call any method
            free = any(not isinstance((module.resolve(b) or [0])[0], Unit) for b in nodes[0].bases)
            method = Unit(unit.path, f"{unit.name}.{name}")
            methods[method] = unit, name, free or (name.startswith("__") and name.endswith("__"))
        waiting |= {token for token in said[unit] if isinstance(token, Unit)} | {Unit(unit.path, "")}
        waiting |= {m for m, (_, name, always) in methods.items() if always or name in words}
        waiting -= said.keys()
    for method in sorted(methods.keys() & said.keys()):
        of, name, _ = methods[method]
        said[of] += [name, method]
    return said


@cache
def meaning(*entries: Callable | ModuleType) -> str:
    """Hash of what functions, classes, methods or modules of ours mean, and all definitions they lead to."""
    return of_units(*(unit for entry in entries for unit in units_of(entry)))


def of_units(*units: Unit) -> str:
    """`meaning` of definitions by their files and names."""
    said = reached(list(units))
    marks = dict.fromkeys(said, "")
    for _ in range(DEEP):  # each round tells definitions apart that differ one call deeper
        marks = {unit: _hash(marks[t] if isinstance(t, Unit) else t for t in tokens)
                 for unit, tokens in said.items()}  # fmt: skip
    return _hash([*(marks[unit] for unit in units), "", *sorted(set(marks.values()))])


def _hash(texts) -> str:
    return hashlib.sha256("\0".join(texts).encode(errors="surrogatepass")).hexdigest()
