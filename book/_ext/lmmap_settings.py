"""Settings on their page: a list of fields, with the comments beside them, in place of one long signature."""

from __future__ import annotations

import inspect
import re
from dataclasses import is_dataclass
from itertools import groupby

FIELD = re.compile(r"    (?P<name>\w+): (?P<type>[^=]+?) = (?P<default>.+?)(?:  # (?P<comment>.+))?")
COMMENT = re.compile(r"    # (?P<text>.+)")


def field_list(cls: type) -> list[str]:
    """Lines of reStructuredText: an item for each field of a dataclass with a default, and between them the
    comments that stand on lines of their own."""
    lines, source = [], inspect.getsource(cls).splitlines()
    for comment, run in groupby(source, lambda line: bool(COMMENT.fullmatch(line))):
        if comment:
            text = " ".join(COMMENT.fullmatch(line)["text"] for line in run)
            text = text[0].upper() + text[1:]
            lines += ["", text if text.endswith(".") else text + ":", ""]
        else:
            lines += [_item(field) for line in run if (field := FIELD.fullmatch(line))]
    return ["", *lines, ""] if any(line.startswith("* ") for line in lines) else []


def _item(field: re.Match) -> str:
    is_made = field["default"].startswith("field(")
    default = f"a `{field['type']}`" if is_made else f"``{field['default']}``"
    return f"* ``{field['name']}``: {default}" + (f", {field['comment']}" if field["comment"] else "")


def _fields(what: str, cls) -> list[str]:
    """The list of fields of a class of settings; of all else, none."""
    of_settings = what == "class" and is_dataclass(cls) and cls.__module__ == "lmmap.settings"
    return field_list(cls) if of_settings else []


def hide_signature(app, what, name, obj, options, signature, annotation):
    """No signature where the list of fields says more."""
    return ("", None) if _fields(what, obj) else None


def list_fields(app, what, name, obj, options, lines) -> None:
    """The list of fields below a class's docstring."""
    if fields := _fields(what, obj):
        bases = [f"`{base.__name__}`" for base in obj.__bases__ if is_dataclass(base)]
        lines += ["", f"The fields of {bases[0]}, and:", ""] if bases else []
        lines += fields
