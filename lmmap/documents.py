"""Short flat documents in JSON and YAML, and a check of each of their values."""

from __future__ import annotations

import json
import math
import re

MAX_YAML_LETTERS = 2**17  # of which the parser takes two seconds
MAX_DEPTH = 20  # of nested lists and objects; a calibration has three


def read_yaml(text: str):
    """A short flat YAML document, without what OpenCV writes and no YAML parser knows; raises ValueError.

    Aliases are refused: a few of them stand for gigabytes.
    """
    import yaml  # only who has a calibration in YAML waits for it

    if len(text) > MAX_YAML_LETTERS:
        raise ValueError(f"{len(text)} letters, and at most {MAX_YAML_LETTERS} are read")
    text = re.sub(r"^%YAML.*\n(---\n)?", "", text).replace("!!opencv-matrix", "")
    try:
        depth = 0
        for event in yaml.parse(text, yaml.SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent):
                raise ValueError("it refers to its own parts")
            if getattr(event, "tag", None):  # what its parser makes of one may be no number or text
                raise ValueError(f"it has the tag {shown(event.tag)}")
            if depth > MAX_DEPTH:
                raise ValueError(f"nested deeper than {MAX_DEPTH} levels")
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"not YAML: {' '.join(str(error).split()):.100}") from None


def read_json(text: str):
    """A short flat JSON document; raises ValueError."""
    try:
        return json.loads(text, object_pairs_hook=_once)
    except RecursionError:
        raise ValueError(f"nested deeper than {MAX_DEPTH} levels") from None


def _once(pairs: list[tuple]) -> dict:
    values = dict(pairs)
    if len(values) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(n for n in names if names.count(n) > 1):.30} is stated twice")
    return values


def read_xml(text: str) -> dict:
    """A document of OpenCV's FileStorage in XML: names with texts, lists or matrices; raises ValueError."""
    from xml.etree import ElementTree  # only who has one waits for it

    def value(element, depth: int = 0):
        if depth > MAX_DEPTH:
            raise ValueError(f"nested deeper than {MAX_DEPTH} levels")
        if len(element):
            return _once([(child.tag, value(child, depth + 1)) for child in element])
        words = (element.text or "").strip().strip('"').split()
        return words if element.tag == "data" or len(words) > 1 else "".join(words)

    try:
        return value(ElementTree.fromstring(text))
    except ElementTree.ParseError as error:
        raise ValueError(f"not XML: {error}") from None


def check_fields(values: dict, schema: dict, required: set[str]) -> dict:
    """The values, lists as tuples, where each is of its schema's type and within its range.

    A schema has ``(type, low, high)``, or for lists of such numbers ``((type, low, high), lengths)``, or
    ``(str, *choices)``.

    Raises
    ------
    ValueError
        That names the first field that is missing, unknown or wrong.
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
    """A value in a few characters."""
    if isinstance(value, list | tuple):
        return f"{len(value)} values"
    if isinstance(value, int) and abs(value) >= 10**30:
        return "a number of more than 30 digits"
    return f"{value!r:.30}"
