"""Recipes: which filter is trained, on which data and for how many steps, and the recipes of what ships."""

from __future__ import annotations

from dataclasses import dataclass

from lmmap.pipeline.network import CHANNELS, WIDTHS
from lmmap.pipeline.weights import FILTERS, weight_path
from lmmap.types import InputError

# Of the shipped weights.  The paper's two sets have equal trainings, so that they can be compared.
SHIPPED = {
    "high": {"steps": 30_000, "rate": 1e-3},
    "low": {"steps": 30_000, "rate": 1e-3},
    "robust": {"steps": 50_000, "rate": 3e-3, "start_from": "low"},
    "slim": {"steps": 40_000, "rate": 3e-3, "width": 0.5, "teacher": "robust"},
}
JOINT = "joint"  # in place of a filter: both of them as one network
FAST = 1e-2  # a rate with which a filter learns several times faster from chance than with 1e-3


@dataclass(frozen=True)
class Recipe:
    """All that a training run depends on, as its model card shows it."""

    filter: str
    modality: str
    networks: str = "low"
    seed: int = 0
    steps: int = 2000
    batch: int = 16
    crop_px: int = 96
    positive_crops: float = 0.65
    rate: float = 1e-3
    warm_up: int = 100
    start_from: str = ""  # begin with the weights of this set
    width: float = 1.0  # channels, as a share of the paper's
    depthwise: bool = False  # convolutions of each channel alone, then across channels
    teacher: str = ""  # learn from the masks of these weights as much as from the true ones
    data: str = ""  # name of a folder of recordings, in place of the bench

    def __post_init__(self):
        named = (("filter", (*FILTERS, JOINT)), ("modality", CHANNELS), ("networks", SHIPPED))
        for name, allowed in named:
            if getattr(self, name) not in allowed:
                raise ValueError(f"Recipe: {name} is one of {list(allowed)}, got {getattr(self, name)!r}")
        if self.steps < 1 or self.batch < 1:
            raise InputError(f"--steps {self.steps}: a training has at least 1 step")
        if self.filter == JOINT and self.start_from:
            text = "its networks have one mask each, so a joint one cannot begin with them; leave it out"
            raise InputError(f"--start-from {self.start_from}: {text}")
        if not 0 <= self.seed < 2**63:
            raise InputError(f"--seed {self.seed}: give a whole number from 0 to 2^63 - 1")

    @classmethod
    def of_shipped(cls, name: str, modality: str, networks: str, **changes) -> Recipe:
        """The recipe of weights that ship, with what is to be another; a joint network starts from random
        weights and has no teacher."""
        alone = {"start_from": "", "teacher": ""} if name == JOINT else {}
        return cls(name, modality, networks, **{**SHIPPED[networks], **alone, **changes})

    @property
    def widths(self) -> tuple[int, ...]:
        """Channels after each convolution."""
        return tuple(round(self.width * w) for w in WIDTHS)

    @property
    def robust(self) -> bool:
        """Whether it learns from the varied laboratories, and from varied images."""
        return self.networks in ("robust", "slim")

    @property
    def name(self) -> str:
        """The name of its weights."""
        return weight_path(self.filter, self.modality, self.networks, self.seed).stem

    @property
    def command(self) -> str:
        """The command that makes the weights again."""
        return (
            f"lmmap train --filter {self.filter} --modality {self.modality} "
            f"--networks {self.networks} --seed {self.seed} --steps {self.steps}"
        ) + "".join(
            f" --{flag} {value}"
            for flag, value in (("start-from", self.start_from), ("data", self.data))
            if value
        )
