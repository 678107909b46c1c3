"""The mark of code: the same for the same meaning in other words, another for another meaning."""

from types import MappingProxyType

import pytest

from lmmap_lab import definitions, meaning
from lmmap_lab.bench import sequences
from lmmap_lab.studies import ladder

CODE = {
    "lmmap/maths.py": '''"""Maths."""
import math
from functools import cache

LIMIT = 3
TABLE = {}
for key in range(LIMIT):
    TABLE[key] = key


def scale(x, factor=2.0):
    """Scale."""
    return factor * x


@cache
def area(radius):
    if radius < 0:
        raise ValueError(f"radius: expected {LIMIT}, got {radius}")
    return math.pi * scale(radius) ** 2


def unused():
    return 1
''',
    "lmmap/shapes.py": """from .maths import TABLE, area
class Disc:
    radius: float = 1.0
    colour: str = "grey"
    def measure(self):
        print("measuring")
        total = area(self.radius) + TABLE[0]
        return total
    def never(self):
        return 0
def entry():
    return Disc().measure()
""",
    "lmmap/other.py": "def scale(x, factor=2.0):\n    return x\n",
}
ENTRY = "lmmap/shapes.py", "entry"
SAME = {
    "comment": {"maths.py": [("LIMIT = 3", "# the most\nLIMIT = 3  # of all")]},
    "docstring": {"maths.py": [('"""Scale."""', '"""Scale a length.\n\n    At length.\n    """')]},
    "no docstring": {"maths.py": [('    """Scale."""\n', "")]},
    "layout": {"maths.py": [("math.pi * scale(radius) ** 2", "(math.pi *\n        (scale(radius) ** 2))")]},
    "number in other digits": {"maths.py": [("factor=2.0", "factor=2.00e0")]},
    "order of imports": {"maths.py": [("import math\n", ""), ("LIMIT = 3", "import math\nLIMIT = 3")]},
    "import in other words": {
        "shapes.py": [("TABLE, area", "TABLE, area as surface"), ("area(self", "surface(self")]
    },
    "a module's attribute": {
        "shapes.py": [
            (".maths import TABLE, area", ". import maths"),
            ("area(self", "maths.area(self"),
            ("TABLE[0]", "maths.TABLE[0]"),
        ]
    },
    "another library's attribute": {
        "maths.py": [("import math\n", "from math import pi\n"), ("math.pi", "pi")]
    },
    "annotations": {
        "maths.py": [("def area(radius):", "def area(radius: float) -> float:")],
        "shapes.py": [("total = area", "total: float = area"), ("radius: float", "radius: int")],
    },
    "assert": {"shapes.py": [("        return total", "        assert total > 0\n        return total")]},
    "cast": {"shapes.py": [("return total", "from typing import cast\n        return cast(float, total)")]},
    "messages": {
        "maths.py": [("expected {LIMIT}, got", "must be below {LIMIT + 1}, is")],
        "shapes.py": [("measuring", "at work")],
    },
    "a function's name": {"maths.py": [("def scale", "def enlarged"), ("scale(radius)", "enlarged(radius)")]},
    "what nothing leads to": {
        "maths.py": [("return 1", "return 2")],
        "shapes.py": [("return 0", "return area(1)")],
    },
    "order of definitions": {"maths.py": [("LIMIT = 3\nTABLE = {}", "TABLE = {}\nLIMIT = 3")]},
}
FIELDS = 'radius: float = 1.0\n    colour: str = "grey"'
OTHER = {
    "a constant": {"maths.py": [("LIMIT = 3", "LIMIT = 4")]},
    "an operator": {"maths.py": [("factor * x", "factor + x")]},
    "a default": {"maths.py": [("factor=2.0", "factor=3.0")]},
    "a condition": {"maths.py": [("radius < 0", "radius <= 0")]},
    "an error's kind": {"maths.py": [("raise ValueError", "raise TypeError")]},
    "a decorator": {"maths.py": [("@cache\n", "")]},
    "a field's default": {"shapes.py": [("radius: float = 1.0", "radius: float = 1.5")]},
    "order of fields": {"shapes.py": [(FIELDS, "\n    ".join(FIELDS.split("\n    ")[::-1]))]},
    "a field more": {"shapes.py": [(FIELDS, f"weight: float\n    {FIELDS}")]},
    "a method": {"shapes.py": [("+ TABLE[0]", "+ TABLE[1]")]},
    "which method": {"shapes.py": [("Disc().measure()", "Disc().never()")]},
    "a table's loop": {"maths.py": [("TABLE[key] = key", "TABLE[key] = 2 * key")]},
    "another function of the same name": {
        "maths.py": [("import math\n", "import math\nfrom . import other\n"), ("* scale(", "* other.scale(")]
    },
    "a base of another library": {"shapes.py": [("class Disc:", "class Disc(dict):")]},
}


def mark_of(folder, monkeypatch, edits=MappingProxyType({}), code=CODE, entry=ENTRY):
    for name, text in code.items():
        for old, new in edits.get(name.removeprefix("lmmap/"), ()):
            assert old in text
            text = text.replace(old, new)
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for module in (definitions, meaning):
        monkeypatch.setattr(module, "ROOT", folder)
    return meaning.of_units(definitions.Unit(folder / entry[0], entry[1]))


@pytest.mark.parametrize("edits", SAME.values(), ids=SAME)
def test_the_same_in_other_words_keeps_the_mark(tmp_path, monkeypatch, edits):
    before = mark_of(tmp_path / "a", monkeypatch)
    assert mark_of(tmp_path / "b", monkeypatch, edits) == before


@pytest.mark.parametrize("edits", OTHER.values(), ids=OTHER)
def test_another_meaning_changes_the_mark(tmp_path, monkeypatch, edits):
    before = mark_of(tmp_path / "a", monkeypatch)
    assert mark_of(tmp_path / "b", monkeypatch, edits) != before


def test_modules_and_definitions_move_freely(tmp_path, monkeypatch):
    before = mark_of(tmp_path / "a", monkeypatch)
    renamed = {"lmmap/new/sums.py": CODE["lmmap/maths.py"],
               "lmmap/shapes.py": CODE["lmmap/shapes.py"].replace(".maths", "lmmap.new.sums")}  # fmt: skip
    assert mark_of(tmp_path / "b", monkeypatch, code=renamed) == before
    first, second = CODE["lmmap/maths.py"].split("@cache")
    imports = "import math\nfrom functools import cache\nfrom .maths import LIMIT, scale\n\n\n"
    user = CODE["lmmap/shapes.py"].replace(", area", "\nfrom .areas import area")
    moved = {"lmmap/maths.py": first, "lmmap/areas.py": imports + "@cache" + second, "lmmap/shapes.py": user}
    assert mark_of(tmp_path / "c", monkeypatch, code=moved) == before
    through = CODE | {"lmmap/__init__.py": "from .maths import TABLE, area\n",
                      "lmmap/shapes.py": CODE["lmmap/shapes.py"].replace(".maths", "lmmap")}  # fmt: skip
    assert mark_of(tmp_path / "d", monkeypatch, code=through) == before


def test_a_name_that_is_nowhere_is_an_error(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=r"maths.py: expected a definition or import of 'volume'"):
        mark_of(tmp_path, monkeypatch, {"shapes.py": [("TABLE, area", "TABLE, volume as area")]})


def test_the_bench_and_the_estimator_are_followed_to_their_ends():
    """From a few functions to what they are made of, and to no command, page or reader."""
    units = meaning.reached(definitions.units_of(sequences.simulate) + definitions.units_of(ladder.Ladder))
    names, folders = {unit.name for unit in units}, {unit.path.parent.name for unit in units}
    assert {"EventSensor.__call__", "Settings", "FilterNet.forward", "Pose.__matmul__", "GAIN"} < names
    assert {"bench", "types", "geometry", "pipeline", "refinement"} < folders
    assert folders.isdisjoint({"cli", "pages", "drawing"}) and "read_camera" not in names


def test_functions_of_one_text_and_other_callees_differ(tmp_path, monkeypatch):
    """Two definitions may be the same word for word; what they stand on tells them apart."""
    step = "def step(x):\n    return {}\ndef walk(x):\n    return step(x)\n"
    entry = (
        "from .a import walk\nfrom .b import walk as other\ndef entry(x):\n    return walk(x) - other(x)\n"
    )
    code = {"lmmap/a.py": step.format(1), "lmmap/b.py": step.format(2), "lmmap/c.py": entry}
    one = mark_of(tmp_path / "1", monkeypatch, code=code, entry=("lmmap/c.py", "entry"))
    swapped = {"c.py": [("walk(x) - other(x)", "other(x) - walk(x)")]}
    assert mark_of(tmp_path / "2", monkeypatch, swapped, code, ("lmmap/c.py", "entry")) != one
