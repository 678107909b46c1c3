"""Recipes: which filter is trained, on which data and for how many steps, and the recipes of what ships."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import DOMAIN_GAPS, FILTERS
from lmmap.types import InputError

STEPS = {  # of the shipped weights, until the validation IoU hardly rose
    "ring-rgb": {"high": 2500, "low": 8000, "robust": 12000},
    "ring-event": {"high": 3000, "low": 28000, "robust": 12000},
    "reflector-rgb": {"high": 2500, "low": 8000, "robust": 12000},
    "reflector-event": {"high": 4000, "low": 34000, "robust": 12000},
}
FAST = 1e-2  # a rate with which a filter learns several times faster from chance than with 1e-3
RATE = {"high": 1e-3, "low": 1e-3, "robust": 3e-3}  # of the shipped weights
RESTART = {  # steps at which the shipped weights began a new cosine, as they had still gained at its end
    "ring-rgb-low": (3000,),
    "ring-event-low": (5000, 11000, 19000),
    "reflector-rgb-low": (3000,),
    "reflector-event-low": (8000, 14000, 22000),
}


@dataclass(frozen=True)
class Recipe:
    """All that a training run depends on, as its model card shows it."""

    filter: str
    modality: str
    domain_gap: str = "low"
    seed: int = 0
    steps: int = 2000
    batch: int = 16
    crop_px: int = 96
    positive_crops: float = 0.65
    rate: float = 1e-3
    warm_up: int = 100
    start_from: str = ""  # begin with the weights of this domain gap
    data: str = ""  # name of a folder of recordings, in place of the bench
    restart: tuple[int, ...] = ()  # steps at which the rate rises to its first value and falls once more

    def __post_init__(self):
        named = (("filter", FILTERS), ("modality", CHANNELS), ("domain_gap", DOMAIN_GAPS))
        for name, allowed in named:
            if getattr(self, name) not in allowed:
                raise ValueError(f"Recipe: {name} is one of {list(allowed)}, got {getattr(self, name)!r}")
        if self.steps < 1 or self.batch < 1:
            raise InputError(f"--steps {self.steps}: a training has at least 1 step")
        object.__setattr__(self, "restart", tuple(self.restart))  # JSON has lists
        ends = (0, *self.restart, self.steps)
        if any(a >= b for a, b in pairwise(ends)):
            given = " ".join(map(str, self.restart))
            raise InputError(f"--restart {given}: give rising steps from 1 to {self.steps - 1}")

    @classmethod
    def of_shipped(cls, name: str, modality: str, domain_gap: str, **changes) -> Recipe:
        """The recipe of weights that ship; the robust ones go on from the low domain gap's."""
        start_from = "low" if domain_gap == "robust" else ""
        steps, rate = STEPS[f"{name}-{modality}"][domain_gap], RATE[domain_gap]
        restart = () if "steps" in changes else RESTART.get(f"{name}-{modality}-{domain_gap}", ())
        recipe = cls(
            name, modality, domain_gap, steps=steps, rate=rate, restart=restart, start_from=start_from
        )
        return replace(recipe, **changes)

    @property
    def name(self) -> str:
        """The name of its weights."""
        return f"{self.filter}-{self.modality}-{self.domain_gap}"

    def phase(self, step: int) -> float:
        """Phase in [0, 1) of the cosine along which the rate falls."""
        ends = (0, *self.restart, self.steps)
        first, last = next((a, b) for a, b in pairwise(ends) if step < b)
        return (step - first) / (last - first)

    @property
    def earlier(self) -> list[Recipe]:
        """The recipes that this one can go on from: itself, ended at each of its restarts."""
        return [replace(self, steps=step, restart=self.restart[:k]) for k, step in enumerate(self.restart)]

    @property
    def command(self) -> str:
        """The command that makes the weights again."""
        return (
            f"lmmap train --filter {self.filter} --modality {self.modality} "
            f"--domain-gap {self.domain_gap} --seed {self.seed} --steps {self.steps}"
        ) + "".join(
            f" --{flag} {value}"
            for flag, value in (
                ("start-from", self.start_from),
                ("data", self.data),
                ("restart", " ".join(map(str, self.restart))),
            )
            if value
        )
