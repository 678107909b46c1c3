"""The networks that made a table, as its provenance names them."""

from __future__ import annotations

from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import FILTERS, load_card, weight_path


def set_hashes(networks: str) -> str:
    """The networks of a shipped set, as a table's provenance names them (``networks``)."""
    paths = [weight_path(name, modality, networks) for name in FILTERS for modality in CHANNELS]
    return " ".join(load_card(path)["sha256"][:12] for path in paths)
