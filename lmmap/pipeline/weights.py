"""The shipped sets of trained networks: where they lie, and how they are saved, loaded and checked."""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from pathlib import Path
from typing import cast

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from ..documents import read_json
from ..files import atomic, read_text, regular_file
from ..shipped import DATA
from ..types import InputError
from .joint_network import mask_networks
from .network import CHANNELS, FilterNet, MaskNetwork

BEFORE = "before"  # folder of the networks from before, in one of networks that have learned
FILTERS = ("ring", "reflector")
# the paper's two sets of training sequences, ours for real data, and the same of half the width
SETS = ("high", "low", "robust", "slim")
FORMER = {"light": "slim"}  # names of sets
WEIGHTS = DATA / "weights"
MAX_BYTES = 2**26  # of a weight file; ours have 1.6 MB at most
MAX_CARD_BYTES = 2**24  # of its card, with the curve of its training


def weight_path(name: str, modality: str, networks: str = "low", seed: int = 0) -> Path:
    """Path of a filter's shipped weights; those of seeds other than 0 are for comparisons only."""
    other = f"-seed{seed}" if seed else ""
    return WEIGHTS / f"{name}-{modality}-{networks}{other}.safetensors"


def save_weights(net: FilterNet, path, card: dict) -> None:
    """Write half-precision safetensors, and beside them the model card with the file's hash.

    Neither gets its name before both are written; raises `InputError` if they cannot be written.
    """
    content = save({k: v.detach().half().contiguous().cpu() for k, v in net.state_dict().items()})
    card = {**card, "sha256": hashlib.sha256(content).hexdigest()}
    with atomic(path) as weights, atomic(Path(path).with_suffix(".json")) as card_path:
        weights.write_bytes(content)
        card_path.write_text(json.dumps(card, indent=1) + "\n")


def load_card(path) -> dict:
    """Read the model card beside a weight file; raises `InputError`."""
    path = Path(path).with_suffix(".json")
    try:
        card = read_json(read_text(path, MAX_CARD_BYTES))
        if not isinstance(card, dict):
            raise ValueError("expected an object")
        return card
    except ValueError as error:
        raise InputError(f"{path}: not a model card ({str(error)[:100]}); restore it") from None


def shipped_sets() -> list[str]:
    """The names in `SETS` of which all filters are present."""
    everything = [(f, m) for f in FILTERS for m in CHANNELS]
    return [name for name in SETS if all(weight_path(f, m, name).exists() for f, m in everything)]


def load_filter(path, modality: str) -> FilterNet:
    """Load the network of a weight file, whatever its widths; raises `InputError` if the file is missing,
    damaged or of another architecture."""
    path = Path(path)
    if not os.path.isdir(path.parent):
        sets = ", ".join(shipped_sets())
        raise InputError(
            f"{path.parent}: no readable weights (no such folder); give one, or of the shipped sets: {sets}"
        )
    try:
        if os.path.exists(path):
            regular_file(path, MAX_BYTES)  # opening a pipe would wait for ever
        with safe_open(path, "pt") as file:
            tensors = {k: file.get_tensor(k).float() for k in file.keys()}  # noqa: SIM118
        card = load_card(path)
        if not isinstance(card.get("sha256"), str):
            raise ValueError("its card states no hash")
        expected = card["sha256"]
        actual = hashlib.sha256(path.read_bytes()).hexdigest()
    except (OSError, ValueError, KeyError, SafetensorError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: no readable weights ({reason}); restore it or run 'make train'") from None
    if actual != expected:
        raise InputError(f"{path}: its hash differs from its card's; fetch the file again")
    try:
        net = FilterNet.shaped_as(tensors, CHANNELS[modality])
        net.load_state_dict(tensors)
    except (RuntimeError, StopIteration, TypeError, ValueError, ArithmeticError):
        raise InputError(f"{path}: weights of another architecture, not a {modality} FilterNet") from None
    if not all(bool(torch.isfinite(t).all()) for t in tensors.values()):
        raise InputError(f"{path}: weights that are not finite; restore it or run 'make train'")
    return net


def load_network(path, modality: str, precision: str = "auto") -> MaskNetwork:
    """Load a filter from its weight file; errors as `load_filter`."""
    return MaskNetwork(load_filter(path, modality), modality, precision)


def network_paths(weights: str | Path, modality: str) -> list[Path]:
    """The weight files of the ring and of the reflectors: of a shipped set, one of `SETS`, or of a
    folder with files named like those of `low`.  Raises `InputError` for a folder of `lmmap export`."""
    if isinstance(weights, str) and weights in FORMER:
        warnings.warn(f"the networks {weights!r} are now called {FORMER[weights]!r}", stacklevel=2)
        weights = FORMER[weights]
    shipped = weights in SETS
    paths = [weight_path(name, modality, cast(str, weights) if shipped else "low") for name in FILTERS]
    if shipped:
        return paths
    if os.path.isdir(weights) and any(Path(weights).glob("*.onnx")):
        raise InputError(f"{weights}: holds networks in ONNX; name the weights that they were exported from")
    return [Path(weights) / path.name for path in paths]


def own_limit(weights: str | Path, modality: str) -> float:
    """The confidence that the cards of these networks require of a pose, besides the settings' minimum; 0 if
    they state none.  Raises `InputError`."""
    limits = [load_card(path).get("min_confidence", 0.0) for path in network_paths(weights, modality)]
    for limit in limits:
        if isinstance(limit, bool) or not isinstance(limit, int | float) or not 0 <= limit <= 1:
            raise InputError(
                f"{weights}: a card's min_confidence is {limit!r:.40}, not a number from 0 to 1; restore it"
            )
    return max(limits)


def load_networks(weights: str | Path, modality: str, precision: str = "auto") -> list:
    """Load the networks of the ring and of the reflectors from `network_paths`, as
    `joint_network.mask_networks`; errors as `load_filter`."""
    filters = [load_filter(path, modality) for path in network_paths(weights, modality)]
    return mask_networks(filters, modality, precision)


def weight_hashes(weights: str | Path, modality: str) -> dict[str, str]:
    """Hashes of the weight files that `Estimator` reads, by their names in their folder."""
    files = {path.name: path for path in network_paths(weights, modality)}
    if folder := before(weights, modality):
        files |= {f"{BEFORE}/{path.name}": path for path in network_paths(folder, modality)}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest()[:16] for name, path in files.items()}


def before(weights, modality: str) -> Path | None:
    """The folder that keeps the networks from before this modality's have learned; None if they have not.

    Raises `InputError` if this modality's cards say that they have learned, but the folder is empty.
    """
    if not isinstance(weights, str | Path) or weights in (*SETS, *FORMER):
        return None
    folder = Path(weights) / BEFORE
    if any(os.path.exists(path) for path in network_paths(folder, modality)):
        return folder
    for path in network_paths(weights, modality):
        if os.path.exists(path.with_suffix(".json")) and load_card(path).get("adapted"):
            raise InputError(f"{folder}: no networks from before, on which {path.name} relies; restore them")
    return None
