"""Trains the high-domain-gap filters twice more, with other seeds, and repeats the headline comparison.

    python tuning/training_seeds.py

One training is one draw: "better" should outlast another.  The extra trainings are shorter than the shipped
one, for they are eight.  The tests' first trajectory is seen at `RATE_HZ`, each image a pose or none; errors
with 95 % intervals go to data/results/accuracy/seeds.csv.  Checkpoints, weights and tables of each seed are
kept in data/derived/seeds, so an interrupted run goes on; the recordings are the paper profile's.
"""

from __future__ import annotations

from itertools import product

import pandas as pd

from lmmap.bench import laboratory
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.run import estimate
from lmmap.pipeline.weights import FILTERS, load_card, weight_path
from lmmap.provenance import DERIVED_DATA, fingerprint, save_table
from lmmap.studies import accuracy_run, accuracy_tables
from lmmap.studies.pose_errors import LIGHTS, MODALITIES, errors, summary
from lmmap.training import train
from lmmap.training.recipe import Recipe
from lmmap.types import Port

SEEDS, STEPS, RATE_HZ = (1, 2), 1500, 2.0
FOLDER = DERIVED_DATA / "seeds"


def say(line: str) -> None:
    print(f"seeds: {line}", flush=True)


def weights_of(seed: int):
    """What `Estimator` takes: the shipped weights, or a folder with this seed's, trained where absent."""
    if seed == 0:
        return "high"
    folder = FOLDER / f"seed-{seed}"
    for name, modality in product(FILTERS, MODALITIES):
        path = folder / weight_path(name, modality, "low").name  # as `Estimator` looks for a folder's
        recipe = Recipe.shipped(name, modality, "high", seed=seed, steps=STEPS)
        if not (path.exists() and load_card(path)["command"] == recipe.command):
            train.train(recipe, DERIVED_DATA / "training", say, path)
    return folder


def cells(seed: int, light: str, modality: str) -> pd.DataFrame:
    """Rows of `accuracy.summary` without outlier filter, of one seed, light and modality."""
    path, weights = FOLDER / f"cells-{seed}-{light}-{modality}.csv", weights_of(seed)
    mark = fingerprint(str(seed), *((p.read_text() for p in sorted(weights.glob("*.json"))) if seed else ()))
    done = path.with_suffix(".done")
    if not (path.exists() and done.exists() and done.read_text() == mark):
        seconds = laboratory.SECONDS["paper"]["test"]
        recording = accuracy_run.bench_recording(f"test-{light}", seconds, DERIVED_DATA / "paper", say)
        estimator = Estimator(recording.camera, Port.lm_map(), modality, weights)
        table = errors(recording, list(estimate(recording, estimator, RATE_HZ)), Port.lm_map())
        rows = summary(table, accuracy_tables.DRAWS, rate_hz=RATE_HZ).query("outlier_filter == 'without'")
        FOLDER.mkdir(parents=True, exist_ok=True)
        rows = rows.drop(columns="outlier_filter")
        rows.assign(seed=seed, light=light, modality=modality).to_csv(path, index=False)
        done.write_text(mark)
        say(f"seed {seed}, {light} light, {modality}: done")
    return pd.read_csv(path)


def main() -> None:
    jobs = product((0, *SEEDS), LIGHTS, MODALITIES)
    table = pd.concat([cells(*job) for job in jobs], ignore_index=True)
    shipped = {f"{f}-{m}": load_card(weight_path(f, m, "high"))["recipe"]["steps"]
               for f, m in product(FILTERS, MODALITIES)}  # fmt: skip
    save_table(
        accuracy_run.COMMITTED / "seeds.csv",
        table,
        steps={"seed 0": shipped, "others": STEPS},
        rate_hz=RATE_HZ,
    )
    say("data/results/accuracy/seeds.csv: written")


if __name__ == "__main__":
    main()
