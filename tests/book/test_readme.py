"""What the README shows runs as it stands."""

import re

from lmmap.provenance import ROOT
from lmmap.types import Pose


def test_five_lines_of_python(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    assert len([line for line in block.splitlines() if line.strip()]) <= 5
    exec(compile(block, "README.md", "exec"), {"__name__": "readme"})
    assert Pose.__name__ in capsys.readouterr().out


def test_no_slot_is_left_open():
    assert "@@" not in (ROOT / "README.md").read_text()
