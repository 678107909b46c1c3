"""What the robust set's variations are worth, on materials that nothing was trained on.

    python tuning/validate_robust.py               # images, and every shipped set on every condition
    python tuning/validate_robust.py --choices     # also short trainings without each variation

Images come from `validation_world`, conditions from `validation_conditions`.  data/results/robust.csv: each
set of weights under each condition.  data/results/robust-choices.csv: ring filters trained on from the low
set for ``STEPS`` steps, with all variations, without each one, without any; all draw the same crops.  What
two seeds differ in is the yardstick.  Images, trained filters and their scores are kept in
data/derived/validation, so that an interrupted run goes on; remove that folder after changing any of this.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack, contextmanager
from functools import partial
from unittest import mock

import numpy as np
import pandas as pd
import validation_world as world
from validation_conditions import CONDITIONS, cases

from lmmap.geometry.conics import circle_ellipse
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import reflector_mask
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.ring import find_ring
from lmmap.pipeline.weights import load_card, load_network, shipped_gaps, weight_path
from lmmap.refinement.contour import Contour
from lmmap.settings import OURS
from lmmap_lab.provenance import DATA, DERIVED_DATA, load_table, save_table
from lmmap_lab.studies.networks import set_hashes
from lmmap_lab.training import augment, train
from lmmap_lab.training.mask_quality import iou
from lmmap_lab.training.recipe import Recipe

STEPS = 100
NEAR_PX, NEAR_SIZE = 2.0, 0.05  # of the centre and, relative, of the axes: an ellipse that is the ring's
VARIATIONS = {
    "rgb": ("clutter", "seams", "tint", "expose", "blur", "noise", "hot_pixels", "compress"),
    "event": ("clutter", "seams", "thin", "noise_events", "hot_pixels", "N"),
}


def is_ring(ring, T) -> bool:
    """Whether `find_ring` found an ellipse, and the true one."""
    if not isinstance(ring, Contour):
        return False
    true = circle_ellipse(T, world.PORT.ring_radius_m, world.CAMERA)
    away_px = np.linalg.norm(ring.ellipse.centre_px - true.centre_px)
    return bool(
        away_px < NEAR_PX and np.allclose(ring.ellipse.semi_axes_px, true.semi_axes_px, rtol=NEAR_SIZE)
    )


def scores(modality: str, estimator: Estimator, ring_network=None, reflectors=True) -> list[dict]:
    """A row a condition and filter: mean IoU, and in how many images the ring's ellipse is found."""
    rows, cut = [], estimator.settings.mask_threshold
    for name, condition in CONDITIONS[modality].items():
        fits, rings, marked = [], [], []
        for image, (ring, markers), T in cases(condition):
            mask = (ring_network or estimator.ring_network)(image)
            fits.append(iou(mask > cut, ring))
            rings.append(is_ring(find_ring(mask, estimator.port, estimator.grid, estimator.settings), T))
            if reflectors:
                seen = reflector_mask(
                    estimator.reflector_network, image, T[None], estimator.port, estimator.grid
                )
                marked.append(iou(seen > cut, markers))
        row = {"modality": modality, "condition": name, "images": len(fits)}
        rows.append(row | {"filter": "ring", "iou": np.mean(fits), "found_percent": 100 * np.mean(rings)})
        if reflectors:
            rows.append(row | {"filter": "reflector", "iou": np.mean(marked)})
    return rows


def ignored(change):
    """A variation that draws what it draws, and leaves things as they are; exposure as for the low set."""

    def kept(image, *more):
        out = change(image, *more)
        return (image, more[0]) if isinstance(out, tuple) else image

    return kept if change is not augment.expose else lambda frame, rng, *wide: change(frame, rng)


@contextmanager
def without(names):
    """Training without these variations, the random numbers being the same."""
    with ExitStack() as stack:
        for name in names:
            what, value = (name, None) if name != "N" else ("HISTOGRAM_EVENTS", (1.0, 1.0))
            stack.enter_context(mock.patch.object(augment, what, value or ignored(getattr(augment, name))))
        yield


def variants(modality: str) -> dict[str, tuple[tuple, int]]:
    """What is left out, and the seed."""
    every = VARIATIONS[modality]
    return {"nothing": ((), 0), "nothing, seed 1": ((), 1), "everything": (every, 0),
            **{name: ((name,), 0) for name in every}}  # fmt: skip


def kept_as(modality: str, label: str, steps: int, suffix: str):
    """Where a variant is kept: another start makes another one."""
    start = load_card(weight_path("ring", modality, "low"))["sha256"][:8]
    return world.FOLDER / "choices" / f"{modality}-{label}-{steps}-{start}{suffix}"


def trained(modality: str, label: str, left_out, seed: int, steps: int):
    """A ring filter trained on from the low set's, kept."""
    kept = kept_as(modality, label, steps, ".safetensors")
    if not kept.exists():
        for old in kept.parent.glob("*.ckpt.safetensors"):  # of another variant
            old.unlink()
        recipe = Recipe("ring", modality, "robust", seed, steps, warm_up=20, start_from="low")
        with without(left_out):
            report = partial(print, label)
            samples = DERIVED_DATA / "training"
            train.train(recipe, samples, report, kept, every=steps, validation_images=4)
    return load_network(kept, modality)


def scored(modality: str, label: str, job, steps: int) -> pd.DataFrame:
    """Scores of a variant, kept."""
    kept = kept_as(modality, label, steps, ".csv")
    if not kept.exists():
        estimator = Estimator(modality=modality)
        ring_network = trained(modality, label, *job, steps) if job else estimator.ring_network
        rows = scores(modality, estimator, ring_network, reflectors=False)
        kept.parent.mkdir(parents=True, exist_ok=True)
        pd.DataFrame(rows).assign(left_out=label).to_csv(kept, index=False)
    return pd.read_csv(kept)


def choices(steps: int) -> None:
    """Train and judge every variant; the table holds those done."""
    tables = []
    for modality in CHANNELS:
        for label, job in {"not trained on": None, **variants(modality)}.items():
            tables.append(scored(modality, label, job, steps))
            print(f"{modality}, left out: {label}, IoU {tables[-1].iou.mean():.4f}", flush=True)
            done = pd.concat(tables, ignore_index=True)
            save_table(DATA / "results" / "robust-choices.csv", done, steps=steps, sequences=world.SEQUENCES,
                       pictures=world.PICTURES)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--choices", action="store_true", help="also train without each variation")
    parser.add_argument("--steps", type=int, default=STEPS, help="of each of these trainings")
    arguments = parser.parse_args()
    world.make()
    table = []
    for gap in shipped_gaps():
        for modality in CHANNELS:
            rows = scores(modality, Estimator(modality=modality, weights=gap))
            table += [{"domain_gap": gap, **row} for row in rows]
            print(f"{gap}, {modality}: IoU {np.mean([row['iou'] for row in rows]):.3f}", flush=True)
    path = save_table(DATA / "results" / "robust.csv", pd.DataFrame(table), sequences=world.SEQUENCES,
                      networks=set_hashes(OURS.weights),
                      pictures=world.PICTURES, near_px=NEAR_PX, near_size=NEAR_SIZE)  # fmt: skip
    wide = load_table(path).pivot_table(
        ["iou", "found_percent"], ["modality", "filter", "condition"], "domain_gap"
    )
    print(wide.round(2).to_string())
    if arguments.choices:
        choices(arguments.steps)


if __name__ == "__main__":
    main()
