"""Read short, flat documents in YAML and XML, the forms of calibrations."""

from __future__ import annotations

import re
from functools import partial

from lmmap.documents import MAX_DEPTH, once, shown

MAX_YAML_LETTERS = 2**17  # of which the parser takes two seconds


def read_yaml(text: str):
    """Parse a short, flat YAML document, dropping OpenCV's tags that no YAML parser knows; raises ValueError.

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
        loader = yaml.SafeLoader(text)
        loader.construct_mapping = partial(_mapping, loader)
        return loader.get_single_data()
    except yaml.YAMLError as error:
        raise ValueError(f"not YAML: {' '.join(str(error).split()):.100}") from None


def _mapping(loader, node, deep: bool = False) -> dict:
    """The dict of a YAML mapping; ValueError where a key is stated twice, of which YAML's takes the last."""
    once([(str(key.value), None) for key, _ in node.value])
    return type(loader).construct_mapping(loader, node, deep)


def read_xml(text: str) -> dict:
    """Parse XML of OpenCV's FileStorage: names with texts, lists or matrices; raises ValueError."""
    from xml.etree import ElementTree  # only who has one waits for it

    def value(element, depth: int = 0):
        if depth > MAX_DEPTH:
            raise ValueError(f"nested deeper than {MAX_DEPTH} levels")
        if len(element):
            return once([(child.tag, value(child, depth + 1)) for child in element])
        words = (element.text or "").strip().strip('"').split()
        return words if element.tag == "data" or len(words) > 1 else "".join(words)

    try:
        return value(ElementTree.fromstring(text))
    except ElementTree.ParseError as error:
        raise ValueError(f"not XML: {error}") from None
