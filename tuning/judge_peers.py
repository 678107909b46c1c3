"""Judges the pipeline beside its peers: geometry alone, points with PnP, a learned pose.

    python tuning/judge_peers.py FOLDER [--curves FOLDER]

``FOLDER`` holds the networks of all methods, equally trained (`lmmap_lab.peers.train`).  Each peer's limit on
its confidence is chosen on `TUNING`, as the one at which one image in a hundred has a wrong pose.  The places
are sequences that neither trained nor tuned anything: the test in each light, the second simulated scene,
varied laboratories, the hard cases, a port whose plate stands a fifth higher, and a lens of another focal
length.  Writes data/results/peers/places.csv and cost.csv, and with ``--curves`` curves.csv, of networks that
learned from fewer images, in folders ``IMAGES-SEED``.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pandas as pd
import torch
from judge_gap import recorded as of_place
from judged_images import of_light

from lmmap.estimation.images import images
from lmmap.settings import MODALITIES
from lmmap.types import Camera, Port, Recording
from lmmap_lab.bench import sequences, varied
from lmmap_lab.peers import study
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.table1 import LIGHTS

RESULTS = DATA / "results" / "peers"
SECONDS, MOST, SEQUENCES = 2.0, 15, 6  # of a sequence, images of it, sequences of a light
TUNING = [f"realistic-{n}" for n in range(2401, 2413)]
HIGHER = replace(Port.lm_map(), plate_height_m=1.2 * Port.lm_map().plate_height_m)
LONGER = replace(Camera.davis346(), fx_px=405.0, fy_px=405.0)


def of_varied(name: str) -> Recording:
    """The LM-MAP in a varied laboratory."""
    return varied.record_varied(name, SECONDS, Port.lm_map())


def tests(*lights: str) -> list[str]:
    return [f"test-{light}-{k}" for light in lights for k in range(1, SEQUENCES + 1)]


bench = partial(sequences.simulate, seconds=SECONDS)
PLACES = {  # how a sequence is recorded, its names, and the port and camera where they are others
    **{f"{light} light": (bench, tests(light), {}) for light in LIGHTS},
    "second scene": (partial(of_place, "second scene"),
                     [n for light in LIGHTS for n in of_light(light, 2791, 4)], {}),
    "varied laboratories": (of_varied, [f"varied-{n}" for n in range(3001, 3013)], {}),
    "slow port": (partial(sequences.simulate, seconds=10.0), ["hard-slow"], {}),
    "reflections": (partial(sequences.simulate, seconds=10.0), ["hard-reflect"], {}),
    "higher plate": (partial(bench, port=HIGHER), tests("medium"), {"port": HIGHER}),
    "longer lens": (partial(bench, camera=LONGER), tests("medium"), {"camera": LONGER}),
}  # fmt: skip


def limits_of(weights: Path, modality: str, recordings: list[Recording]) -> dict[str, float]:
    """Each peer's least confidence, kept beside its weights."""
    kept = weights / f"limits-{modality}.json"
    if not kept.exists():
        found = study.answered(recordings, modality, study.estimators(modality, weights), MOST)
        limits = {name: study.own_limit(*tables) for name, tables in found.items()}
        kept.write_text(json.dumps(limits, indent=1) + "\n")
    return json.loads(kept.read_text())


def at_places(weights: Path, tuning: list[Recording], places=PLACES) -> tuple[pd.DataFrame, dict]:
    rows, limits = [], {m: limits_of(weights, m, tuning) for m in MODALITIES}
    for place, (record, names, other) in places.items():
        recordings = [record(name) for name in names]
        most = MOST if len(names) > 1 else None
        for modality in MODALITIES:
            makes = study.estimators(modality, weights, limits[modality], **other)
            found = study.answered(recordings, modality, makes, most, other.get("port"))
            rows.append(study.side_by_side(found).assign(place=place, modality=modality))
        print(f"{place}: {len(names)} sequences", flush=True)
    return pd.concat(rows, ignore_index=True), limits


def costs(weights: Path) -> pd.DataFrame:
    recording, rows = bench("test-medium-1"), []
    for modality in MODALITIES:
        image = next(iter(images(recording, modality)))[1]
        rows.append(study.cost(study.estimators(modality, weights), image).assign(modality=modality))
    return pd.concat(rows, ignore_index=True)


def curves(folder: Path, tuning: list[Recording]) -> pd.DataFrame:
    """The test and the second scene by the number of images that the networks learned from."""
    test = (bench, tests(*LIGHTS)[::2], {})
    places, rows = {"test": test, "second scene": PLACES["second scene"]}, []
    for weights in sorted(folder.glob("*-*")):
        count, seed = map(int, weights.name.split("-"))
        rows.append(at_places(weights, tuning, places)[0].assign(images_learned=count, seed=seed))
    table = pd.concat(rows, ignore_index=True)
    return table[table.method != study.GEOMETRY]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("weights", type=Path, metavar="FOLDER")
    parser.add_argument("--curves", type=Path, metavar="FOLDER")
    a = parser.parse_args()
    torch.set_num_threads(1)
    tuning = [bench(name) for name in TUNING]
    table, limits = at_places(a.weights, tuning)
    cards = {p.stem: json.loads(p.with_suffix(".json").read_text())["recipe"]
             for p in sorted(a.weights.glob("*.safetensors")) if "ckpt" not in p.name}  # fmt: skip
    names = {place: names for place, (_, names, _) in PLACES.items()}
    facts = {"limits": limits, "recipes": cards, "sequences": names}
    save_table(RESULTS / "places.csv", table, **facts)
    save_table(RESULTS / "cost.csv", costs(a.weights))
    print(table.round(2).to_string())
    if a.curves:
        save_table(RESULTS / "curves.csv", curves(a.curves, tuning))


if __name__ == "__main__":
    main()
