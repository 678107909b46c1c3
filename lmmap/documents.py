"""Read short, flat JSON documents and check each of their values."""

from __future__ import annotations

import json
import math

MAX_DEPTH = 20  # of nested lists and objects; a calibration has three


def read_json(text: str):
    """Parse a short, flat JSON document; raises ValueError."""
    try:
        return json.loads(text, object_pairs_hook=once)
    except RecursionError:
        raise ValueError(f"nested deeper than {MAX_DEPTH} levels") from None


def once(pairs: list[tuple]) -> dict:
    """Make a dict of pairs; raises ValueError if a name occurs twice."""
    values = dict(pairs)
    if len(values) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(n for n in names if names.count(n) > 1):.30} is stated twice")
    return values


def check_fields(values: dict, schema: dict, required: set[str]) -> dict:
    """Check each value against its schema's type and range; return the values, with lists as tuples.

    A schema maps a name to ``(type, low, high)``, to ``((type, low, high), lengths)`` for a list of such
    numbers, or to ``(str, *choices)``.

    Raises
    ------
    ValueError
        If a field is missing, unknown or wrong; the message names it.
    """
    if not isinstance(values, dict):
        raise ValueError("expected an object")
    if missing := sorted(required - set(values)):
        raise ValueError(f"missing {', '.join(missing)}")
    if unknown := sorted(map(str, set(values) - set(schema))):
        raise ValueError(f"unknown {', '.join(unknown):.100}")
    return {name: _check_value(name, value, schema[name]) for name, value in values.items()}


def _check_value(name: str, value, rule):
    if isinstance(rule[0], tuple):
        number, lengths = rule
        if not isinstance(value, list | tuple) or len(value) not in lengths:
            counts = " or ".join(map(str, lengths))
            raise ValueError(f"{name}: expected a list of {counts} numbers, got {shown(value)}")
        return tuple(_check_value(name, v, number) for v in value)
    if rule[0] is str:
        if value not in rule[1:]:
            raise ValueError(f"{name}: expected {' or '.join(rule[1:])}, got {shown(value)}")
        return value
    kind, low, high = rule
    expected = "a whole number" if kind is int else "a number"
    if isinstance(value, bool) or not isinstance(value, (int,) if kind is int else (int, float)):
        raise ValueError(f"{name}: expected {expected}, got {shown(value)}")
    if not (low <= value <= high and math.isfinite(value)):
        raise ValueError(f"{name}: expected {expected} from {low:g} to {high:g}, got {shown(value)}")
    return value


def shown(value) -> str:
    """Abbreviate a value to a few characters."""
    if isinstance(value, list | tuple):
        return f"{len(value)} values"
    if isinstance(value, int) and abs(value) >= 10**30:
        return "a number of more than 30 digits"
    return f"{value!r:.30}"
