"""Train a peer's network, or one of the pipeline's on the same images; an interrupted run goes on from its
checkpoint.

    python -m lmmap_lab.peers.train pnp --modality rgb --steps 6000 -o FOLDER
"""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import torch
from safetensors.torch import load as load_tensors

from lmmap.pipeline.inputs import check_image
from lmmap.pipeline.network import encode
from lmmap.pipeline.weights import FILTERS, load_card, save_weights
from lmmap.settings import MODALITIES
from lmmap.types import Camera, Estimate, InputError, Port, Status

from ..provenance import DATA, DERIVED_DATA, commit
from ..training import dataset
from ..training import train as filters
from ..training.batches import MASK_LOSS, Loss, learn
from ..training.learning import seeded
from ..training.recipe import SHIPPED, Recipe
from . import crops, points, regression, samples

WEIGHTS = DATA / "peers"  # of the study
CHECKPOINT_STEPS, CHECKED_BATCHES = 250, 4
TRAINED_ON = Camera.davis346()


class Peer(NamedTuple):
    """What a peer is made of: its network by modality and width, a varied image with its target, the pose and
    confidence that the network gives of an image, and its loss."""

    network: Callable[[str, float], torch.nn.Module]
    sample: Callable
    answer: Callable
    loss_of: Loss = MASK_LOSS


_POSE = Peer(regression.network, regression.sample, regression.answer, regression.pose_loss)
PEERS = {
    "pnp": Peer(points.network, points.sample, points.answer),
    "pose": _POSE,
    "pose-large": _POSE._replace(network=partial(regression.network, channels=regression.LARGE)),
    "crop": Peer(crops.network, crops.sample, crops.answer_closely, regression.pose_loss),  # after "pose"
}


class LearnedEstimator:
    """Called like `lmmap.Estimator`: an image and its time give an `Estimate`, whose pose is reported if its
    confidence is at least ``min_confidence``."""

    def __init__(self, peer: str, net: torch.nn.Module, modality: str, camera: Camera | None = None,
                 port: Port | None = None, min_confidence: float = 0.0):  # fmt: skip
        self.peer, self.net, self.modality = peer, net.eval(), modality
        self.camera, self.port = camera or TRAINED_ON, port or Port.lm_map()
        self.min_confidence = min_confidence
        self._maps = None
        if self.camera != TRAINED_ON:  # its images are shown as the networks' camera would see them
            K, distortion = self.camera.K, np.array(self.camera.distortion)
            self._maps = cv2.initUndistortRectifyMap(K, distortion, None, TRAINED_ON.K, TRAINED_ON.size_px,
                                                     cv2.CV_32FC1)  # fmt: skip

    @torch.inference_mode()
    def __call__(self, image: np.ndarray, t_us: int = 0) -> Estimate:
        check_image(image, self.modality, self.camera)
        if self._maps is not None:
            image = cv2.remap(image, *self._maps, cv2.INTER_LINEAR)
        found = PEERS[self.peer].answer(self.net, image, self.modality, TRAINED_ON, self.port)
        if found is None:
            return Estimate(t_us, Status.NO_MARKERS)
        return Estimate(t_us, Status.OK, found[0]).judged(found[1], self.min_confidence)


def batch(peer: str, shown: samples.PosedSamples, recipe: Recipe, step: int, camera: Camera):
    """Input and target of a step, which depend on the recipe's seed and the step alone."""
    rng = np.random.default_rng([recipe.seed, step])
    pairs = [PEERS[peer].sample(shown, recipe, camera, rng) for _ in range(recipe.batch)]
    images, targets = (np.stack([pair[k] for pair in pairs]) for k in (0, 1))
    return encode(images, recipe.modality), torch.from_numpy(targets)


def train(peer: str, recipe: Recipe, folder: Path, samples_folder: Path, names: list[str] | None = None,
          images: int | None = None, every: int = CHECKPOINT_STEPS, camera: Camera | None = None,
          report=print) -> Path:  # fmt: skip
    """Train a network and save its weights, with their card, in ``folder``; returns their path.

    Parameters
    ----------
    peer
        One of `PEERS`, or one of the pipeline's `FILTERS`, which is the recipe's then.
    samples_folder
        Where `samples.make` writes what is absent.
    names
        Sequences; default: those of the recipe's networks.
    images
        Learn from only this many images, drawn by the recipe's seed.
    every
        Steps between two checkpoints.
    """
    camera = camera or Camera.davis346()
    names = names or dataset.SETS[recipe.networks]
    samples.make(names, samples_folder, report=report)
    path = weights_path(folder, peer, recipe.modality)
    if peer in FILTERS:
        chosen = partial(samples.PosedSamples, most=images, seed=recipe.seed)
        return filters.train(recipe, samples_folder, report, path, names, every, samples_of=chosen)
    for_training, held_out_names = dataset.split(names)
    at = (recipe.filter, recipe.modality, samples_folder)
    shown = samples.PosedSamples(for_training, *at, images, recipe.seed)
    held_out = samples.PosedSamples(held_out_names, *at)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    net = seeded(recipe, PEERS[peer].network, recipe.modality, recipe.width).to(
        device, memory_format=torch.channels_last
    )

    @torch.inference_mode()
    def check(done: int) -> dict:
        net.eval()
        losses = []
        for step in range(CHECKED_BATCHES):
            x, y = batch(peer, held_out, recipe, step, camera)
            losses.append(PEERS[peer].loss_of(net(x.to(device)), y.to(device)).item())
        return {"loss": round(sum(losses) / len(losses), 6)}

    progress = learn(net, recipe, lambda step: batch(peer, shown, recipe, step, camera),
                     path.with_suffix(".ckpt.safetensors"), every, check=check,
                     loss_of=PEERS[peer].loss_of)  # fmt: skip
    with torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True):
        for step, curve in progress:
            if curve and curve[-1]["step"] == step:
                report("{}: step {step} of {}, loss {loss:.4f}".format(path.stem, recipe.steps, **curve[-1]))
    card = {"peer": peer, "recipe": asdict(recipe), "commit": commit(), "bench": shown.made_of(),
            "training_sequences": for_training, "training_images": len(shown), "device": device,
            "torch": torch.__version__, "curve": curve}  # fmt: skip
    save_weights(net.float(), path, card)
    return path


def weights_path(folder: Path, peer: str, modality: str) -> Path:
    """Where `train` saves a peer's weights."""
    return Path(folder) / f"{peer}-{modality}.safetensors"


def load(path: Path, camera: Camera | None = None, port: Port | None = None,
         min_confidence: float = 0.0) -> LearnedEstimator:  # fmt: skip
    """The estimator of weights that `train` saved; `InputError` if they are not whole."""
    card, content = load_card(path), path.read_bytes()
    if card.get("sha256") != hashlib.sha256(content).hexdigest():
        raise InputError(f"{path}: its hash differs from its card's; train it again")
    peer, modality = card["peer"], card["recipe"]["modality"]
    net = PEERS[peer].network(modality, card["recipe"]["width"])
    net.load_state_dict({name: values.float() for name, values in load_tensors(content).items()})
    if peer == "crop":
        net = crops.Staged(load(weights_path(path.parent, "pose", modality)).net, net)
    return LearnedEstimator(peer, net, modality, camera, port, min_confidence)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("peer", choices=[*PEERS, *FILTERS], help="the last two are the pipeline's")
    parser.add_argument("--modality", choices=MODALITIES, required=True)
    text = "learn from the sequences and variations of this set of filters (default: low)"
    parser.add_argument("--networks", choices=SHIPPED, default="low", help=text)
    parser.add_argument("--steps", type=int, help="default: as many as those filters")
    parser.add_argument("--rate", type=float, default=1e-3, help="of Adam (default: 0.001)")
    parser.add_argument("--width", type=float, default=1.0, help="share of the channels (default: 1)")
    parser.add_argument("--seed", type=int, default=0, help="of the random draws (default: 0)")
    parser.add_argument("--images", type=int, help="learn from only this many images (default: all)")
    default = DERIVED_DATA / "peers"
    text = f"samples, made where they are absent (default: {default})"
    parser.add_argument("--samples", type=Path, default=default, metavar="FOLDER", help=text)
    text = "folder for the weights and their checkpoint"
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER", help=text)
    args = parser.parse_args(arguments)
    try:
        steps = SHIPPED[args.networks]["steps"] if args.steps is None else args.steps
        name = args.peer if args.peer in FILTERS else FILTERS[0]  # which a recipe has to name
        recipe = Recipe(name, args.modality, args.networks, args.seed, steps, rate=args.rate,
                        width=args.width)  # fmt: skip
        if args.images is not None and args.images < 1:
            raise InputError(f"--images {args.images}: expected at least 1")
        print(train(args.peer, recipe, args.output, args.samples, images=args.images))
    except InputError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
