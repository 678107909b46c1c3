"""Which results are of the present port is said by what made them."""

import json

from lmmap_lab import provenance
from lmmap_lab.pages import former_port


def test_results_of_another_port_are_listed(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "DATA", tmp_path)
    folder = tmp_path / "results"
    present = provenance.save_json(folder / "new.json", {})
    assert former_port.of_former_port() == []
    facts = json.loads(present.read_text())
    for name, port in (("old", "another"), ("port", "another")):
        changed = {**facts, "provenance": {**facts["provenance"], "port": port}}
        (folder / f"{name}.json").write_text(json.dumps(changed))
    (folder / "oldest.provenance.json").write_text('{"commit": "1"}')
    assert [path.name for path in former_port.of_former_port()] == ["old.json", "oldest.provenance.json"]
