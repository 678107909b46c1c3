"""Which results are still of a port that the laboratory no longer has."""

from __future__ import annotations

import json
from pathlib import Path

from .. import provenance

NO_PORT = ("attacks", "formats", "port", "port-outlines")  # results that no port of ours takes part in


def of_former_port() -> list[Path]:
    """Tables and documents of data/results that do not say that they were made with the present port."""
    found, present = [], provenance.port_mark()
    for path in sorted((provenance.DATA / "results").rglob("*.json")):
        document = json.loads(path.read_text())
        facts = document if path.name.endswith(".provenance.json") else document.get("provenance")
        if facts and path.name.split(".")[0] not in NO_PORT and facts.get("port") != present:
            found.append(path)
    return found
