"""Training many filters at once: all that learn from the same crops see them at the same time.

On a GPU a step of all of them is one graph, since small networks cost more to launch than to compute; worker
processes make the crops ahead.  Each filter ends as `train.train` trains it alone, but for rounding.
"""

from __future__ import annotations

import time
from pathlib import Path

import torch
from torch.nn import functional as F

from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import save_weights

from . import dataset
from .ahead import Batches
from .batches import half_precision, learning_rate, taught
from .checkpoint import resume, save_checkpoint, saved_step
from .learning import card_of, teacher_of, untrained
from .recipe import Recipe
from .train import CHECKED_IMAGES, VALIDATION_IMAGES, validate

WARM_UP = 3  # steps before the graph is recorded
STREAMS = 8  # of the GPU's, for networks that do not wait for each other


class Learner:
    """One filter on its way: network, optimiser, and the loss since the last check."""

    def __init__(self, label: str, recipe: Recipe, prior: float, device: str, checkpoint: Path,
                 first: int):  # fmt: skip
        self.label, self.recipe, self.checkpoint = label, recipe, checkpoint
        self.net = untrained(recipe, prior).to(device, memory_format=torch.channels_last).train()
        self._on_gpu = device != "cpu"
        self._rate = torch.zeros((), device=device)
        more = {"fused": True, "capturable": True, "lr": self._rate} if self._on_gpu else {"lr": recipe.rate}
        self.adam, self.loss = torch.optim.Adam(self.net.parameters(), **more), torch.zeros((), device=device)
        self.curve = resume(checkpoint, self.net, self.adam, recipe)[1] if first else []

    def set_rate(self, step: int) -> None:
        rate = learning_rate(self.recipe, step)
        if self._on_gpu:
            self._rate.fill_(rate)
        for group in self.adam.param_groups:
            group["lr"] = self._rate if self._on_gpu else rate

    def step(self, x, target) -> None:
        with half_precision(x.device, cache=False):
            logits = self.net(x)
        loss = F.binary_cross_entropy_with_logits(logits.float(), target)
        self.adam.zero_grad()
        loss.backward()
        self.adam.step()
        self.loss += loss.detach()

    def check(self, step: int, steps: int, held_out: dataset.Samples) -> None:
        """Validate, and keep a checkpoint."""
        fit = validate(self.net, held_out, VALIDATION_IMAGES if step == self.recipe.steps else CHECKED_IMAGES)
        self.net.train()
        self.curve.append({"step": step, "training_loss": round(self.loss.item() / steps, 6), **fit})
        self.loss.zero_()
        save_checkpoint(self.checkpoint, self.net, self.adam, self.recipe, step, self.curve)


class Kind:
    """The filters that learn from the same crops: those of the first one's seed."""

    def __init__(self, recipes: dict[str, Recipe], folder: Path, out: Path, workers: int):
        self.recipe, self._recipes, self._out = next(iter(recipes.values())), recipes, out
        parts = dataset.split(dataset.SETS[self.recipe.domain_gap])
        first = self.recipe
        self.samples, self.held_out = (
            dataset.Samples(names, first.filter, first.modality, folder) for names in parts
        )
        self.prior = self.samples.positive_share()
        self._workers = workers

    def feed(self, first: int) -> None:
        self.batches = iter(Batches(self.samples, self.recipe, first, self._workers))

    def load(self, device: str, first: int) -> None:
        self.learners = [Learner(label, r, self.prior, device, _checkpoint(self._out, label), first)
                         for label, r in self._recipes.items()]  # fmt: skip
        self.teachers = {r.teacher: teacher_of(r, device) for r in self._recipes.values()}
        size, batch = self.recipe.crop_px, self.recipe.batch
        channels = CHANNELS[self.recipe.modality]
        x = torch.zeros((batch, channels, size, size), device=device)
        self.x = x.to(memory_format=torch.channels_last)
        self.y = torch.zeros((batch, 1, size, size), device=device)

    def receive(self, step: int) -> None:
        for static, batch in zip((self.x, self.y), next(self.batches), strict=True):
            static.copy_(batch.to(static.device))
        for learner in self.learners:
            learner.set_rate(step)

    def targets(self) -> dict:
        with torch.no_grad(), half_precision(self.x.device, cache=False):
            return {name: taught(teacher, self.x, self.y) for name, teacher in self.teachers.items()}


def step_all(kinds: list[Kind]) -> None:
    """One step of every filter; on a GPU, on streams that do not wait for each other."""
    jobs = [(learner, kind.x, targets[learner.recipe.teacher])
            for kind in kinds for targets in (kind.targets(),) for learner in kind.learners]  # fmt: skip
    if kinds[0].x.device.type == "cpu":
        for learner, x, target in jobs:
            learner.step(x, target)
        return
    main, sides = torch.cuda.current_stream(), [torch.cuda.Stream() for _ in range(STREAMS)]
    for i, (learner, x, target) in enumerate(jobs):
        side = sides[i % STREAMS]
        side.wait_stream(main)
        with torch.cuda.stream(side):
            learner.step(x, target)
    for side in sides:
        main.wait_stream(side)


def _run(kinds: list[Kind], first: int, every: int, report) -> None:
    steps, graph, checked, start_s = kinds[0].recipe.steps, None, first, time.monotonic()
    on_gpu = kinds[0].x.device.type == "cuda"
    for step in range(first, steps):
        for kind in kinds:
            kind.receive(step)
        if on_gpu and graph is None and step == first + WARM_UP:
            graph = torch.cuda.CUDAGraph()
            with torch.cuda.graph(graph):
                step_all(kinds)
        if graph is None:
            step_all(kinds)
        else:
            graph.replay()
        done = step + 1
        if done % 500 == 0 or done == steps:
            pace_s = (time.monotonic() - start_s) / (done - first)
            left_min = pace_s * (steps - done) / 60
            report(f"step {done} of {steps}, {1e3 * pace_s:.1f} ms each, {left_min:.0f} min left")
        if done % every == 0 or done == steps:
            for kind in kinds:
                for learner in kind.learners:
                    learner.check(done, done - checked, kind.held_out)
                    report("{}: step {step}, loss {loss:.4f}, IoU {iou:.3f}".format(
                        learner.label, **learner.curve[-1]))  # fmt: skip
            checked = done


def _checkpoint(out: Path, label: str) -> Path:
    return out / f"{label}.ckpt.safetensors"


def train_together(recipes: dict[str, Recipe], folder: Path, out: Path, report=print, every: int = 10_000,
                   workers: int = 1) -> None:  # fmt: skip
    """Train the filters that lack weights in a folder; an interrupted run goes on from its checkpoints.

    Parameters
    ----------
    recipes : by the name that the weights get; all have equal steps, batches and crops
    folder, out : of the training set, which is made where it is absent, and for weights and checkpoints
    workers : processes that make crops, for each kind of filter; seeds see the same crops
    """
    out.mkdir(parents=True, exist_ok=True)
    recipes = {k: r for k, r in recipes.items() if not (out / f"{k}.safetensors").exists()}
    if len({(r.steps, r.batch, r.crop_px) for r in recipes.values()}) > 1:
        raise ValueError("train_together: recipes of equal steps, batches and crops are expected")
    groups = {}
    for label, r in recipes.items():
        groups.setdefault((r.filter, r.modality, r.robust), {})[label] = r
    for gap in {r.domain_gap for r in recipes.values()}:
        dataset.make_samples(dataset.SETS[gap], folder, report=report)
    kinds = [Kind(group, folder, out, workers) for group in groups.values()]
    saved = {saved_step(_checkpoint(out, label), recipe) for label, recipe in recipes.items()}
    first = saved.pop() if len(saved) == 1 else 0  # interrupted between two checkpoints: from the start
    for kind in kinds:
        kind.feed(first)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    for kind in kinds:
        kind.load(device, first)
    with torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True):
        _run(kinds, first, every, report)
    for kind in kinds:
        for learner in kind.learners:
            card = card_of(learner.recipe, kind.samples, kind.held_out, kind.prior, device, learner.curve)
            save_weights(learner.net, out / f"{learner.label}.safetensors", card)
