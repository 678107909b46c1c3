"""Checkpoints of a training run: network, optimiser and progress, as tensors and text that run no code."""

from __future__ import annotations

import json
from dataclasses import asdict

from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from lmmap.files import atomic
from lmmap.types import InputError


def save_checkpoint(path, net, adam, recipe, step, curve) -> None:
    """Save network, optimiser and progress, whole or not at all; raises `InputError` on a full disk."""
    tensors = {f"net.{k}": v.detach().contiguous() for k, v in net.state_dict().items()}
    for i, state in adam.state_dict()["state"].items():
        tensors |= {f"adam.{i}.{k}": v.contiguous() for k, v in state.items()}
    facts = {"recipe": json.dumps(asdict(recipe)), "step": str(step), "curve": json.dumps(curve)}
    with atomic(path) as temporary:
        temporary.write_bytes(save(tensors, facts))


def resume(path, net, adam, recipe) -> tuple[int, list]:
    """Put a checkpoint of this recipe into net and optimiser.

    Returns the next step, and the curve so far.
    """
    if not path.exists():
        return 0, []
    try:
        with safe_open(path, "pt") as file:
            facts = file.metadata()
            tensors = {k: file.get_tensor(k) for k in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: no readable checkpoint ({error}); delete it to start anew") from None
    if facts["recipe"] != json.dumps(asdict(recipe)):
        return 0, []
    net.load_state_dict({k[4:]: v for k, v in tensors.items() if k.startswith("net.")})
    state = adam.state_dict()
    for k, v in tensors.items():
        if k.startswith("adam."):
            _, i, name = k.split(".")
            state["state"].setdefault(int(i), {})[name] = v
    adam.load_state_dict(state)
    return int(facts["step"]), json.loads(facts["curve"])


def saved_step(path, recipe) -> int:
    """The next step of a checkpoint of this recipe; 0 without one."""
    if not path.exists():
        return 0
    with safe_open(path, "pt") as file:
        facts = file.metadata()
    return int(facts["step"]) if facts["recipe"] == json.dumps(asdict(recipe)) else 0
