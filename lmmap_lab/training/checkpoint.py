"""Checkpoints of a training run: network, optimiser and progress, as tensors and text that run no code."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict

from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from lmmap.files import atomic, regular_file
from lmmap.types import InputError


def save_checkpoint(path, net, adam, recipe, step, curve) -> None:
    """Save network, optimiser and progress, whole or not at all; raises `InputError` on a full disk."""
    tensors = {f"net.{k}": v.detach().contiguous() for k, v in net.state_dict().items()}
    for i, state in adam.state_dict()["state"].items():
        tensors |= {f"adam.{i}.{k}": v.contiguous() for k, v in state.items()}
    facts = {"recipe": json.dumps(asdict(recipe)), "step": str(step), "curve": json.dumps(curve)}
    with atomic(path) as temporary:
        temporary.write_bytes(save(tensors, facts | {"sha256": _digest(tensors, facts)}))


def _digest(tensors: dict, facts: dict) -> str:
    return hashlib.sha256(save(tensors) + json.dumps(facts, sort_keys=True).encode()).hexdigest()


def _read(path, recipe) -> tuple[dict, dict] | None:
    """Tensors and facts of a checkpoint of this recipe; None where there is none, `InputError` for damage."""
    if not os.path.lexists(path):
        return None
    regular_file(path)  # opening a pipe would wait for ever
    try:
        with safe_open(path, "pt") as file:
            facts = file.metadata() or {}
            tensors = {k: file.get_tensor(k) for k in file.keys()}  # noqa: SIM118
        if facts.pop("sha256", None) != _digest(tensors, facts):
            raise ValueError("its hash is another")
    except (OSError, ValueError, SafetensorError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: no readable checkpoint ({reason}); delete it to start anew") from None
    return (tensors, facts) if facts["recipe"] == json.dumps(asdict(recipe)) else None


def resume(path, net, adam, recipe) -> tuple[int, list]:
    """Put a checkpoint of this recipe into net and optimiser.

    Returns the next step, and the curve so far.
    """
    if (saved := _read(path, recipe)) is None:
        return 0, []
    tensors, facts = saved
    net.load_state_dict({k[4:]: v for k, v in tensors.items() if k.startswith("net.")})
    state = adam.state_dict()
    for k, v in tensors.items():
        if k.startswith("adam."):
            _, i, name = k.split(".")
            state["state"].setdefault(int(i), {})[name] = v
    adam.load_state_dict(state)
    return int(facts["step"]), json.loads(facts["curve"])
