"""Judges the pipeline beside its peers: geometry alone, points with PnP, a learned pose.

    python tuning/judge_peers.py FOLDER [--curves FOLDER] [--pictures FOLDER] [--samples FOLDER]

``FOLDER`` holds the peers' networks (`lmmap_lab.peers.train`), and the pipeline's unless those that ship are
meant.  Each peer's limit on its confidence is chosen on `TUNING`, as the one at which one image in a hundred
has a wrong pose.  The places are sequences that neither trained nor tuned anything: the test in each light,
the second simulated scene, varied laboratories, the hard cases, a port whose plate stands a fifth higher, and
a lens of another focal length.  Writes data/results/peers/places.csv; with ``--pictures`` pictures.csv, of
the authors' pictures as in `judge_pictures`; with ``--samples``, those of the trainings, cost.csv; with
``--curves`` curves.csv, of networks that learned from fewer images, in folders ``IMAGES-SEED``.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pandas as pd
import torch
from judge_gap import recorded as of_place
from judge_pictures import apart, is_right, without_lines
from judged_images import of_light

from lmmap.estimation.images import images
from lmmap.geometry.conics import circle_ellipse
from lmmap.pipeline import ellipse
from lmmap.pipeline.network import SATURATION
from lmmap.pipeline.weights import load_card
from lmmap.settings import MODALITIES
from lmmap.types import Camera, Port, Pose, Recording
from lmmap_lab.bench import sequences, varied
from lmmap_lab.peers import study, train
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.claims_of_mixing import COST, CURVES, GEOMETRY, OURSELVES, PICTURES, PLACES, PRINTED
from lmmap_lab.studies.pdf import pictures
from lmmap_lab.studies.table1 import LIGHTS
from lmmap_lab.training.recipe import Recipe

SECONDS, MOST, SEQUENCES = 2.0, 15, 6  # of a sequence, images of it, sequences of a light
TUNING = [f"realistic-{n}" for n in range(2401, 2413)]
HIGHER = replace(Port.lm_map(), plate_height_m=1.2 * Port.lm_map().plate_height_m)
LONGER = replace(Camera.davis346(), fx_px=405.0, fy_px=405.0)
UNLIMITED = OURSELVES, PRINTED
UNLEARNED = GEOMETRY, PRINTED  # of the learning curves only
TIMED_STEPS = 10, 40  # of two trainings; their difference counts


def of_varied(name: str) -> Recording:
    """The LM-MAP in a varied laboratory."""
    return varied.record_varied(name, SECONDS, Port.lm_map())


def tests(*lights: str) -> list[str]:
    return [f"test-{light}-{k}" for light in lights for k in range(1, SEQUENCES + 1)]


bench = partial(sequences.simulate, seconds=SECONDS)
AT = {  # how a sequence is recorded, its names, and the port and camera where they are others
    **{f"{light} light": (bench, tests(light), {}) for light in LIGHTS},
    "second scene": (partial(of_place, "second scene"),
                     [n for light in LIGHTS for n in of_light(light, 2791, 4)], {}),
    "varied laboratories": (of_varied, [f"varied-{n}" for n in range(3001, 3013)], {}),
    "slow port": (partial(sequences.simulate, seconds=10.0), ["hard-slow"], {}),
    "reflections": (partial(sequences.simulate, seconds=10.0), ["hard-reflect"], {}),
    "higher plate": (partial(bench, port=HIGHER), tests("medium"), {"port": HIGHER}),
    "longer lens": (partial(bench, camera=LONGER), tests("medium"), {"camera": LONGER}),
}  # fmt: skip
OF_CURVES = {"test": (bench, tests(*LIGHTS)[::2], {}), "second scene": AT["second scene"]}


def limits_of(weights: Path, modality: str, recordings: Sequence[Recording], but: tuple = UNLIMITED) -> dict:
    """Each peer's least confidence, kept beside its weights."""
    kept = weights / f"limits-{modality}.json"
    if not kept.exists():
        makes = without(study.estimators(modality, weights), but)
        found = study.answered(recordings, modality, makes, MOST)
        limits = {name: study.own_limit(*tables[:2]) for name, tables in found.items()}
        kept.write_text(json.dumps(limits, indent=1) + "\n")
    return json.loads(kept.read_text())


def without(makes: Mapping, names: Sequence[str]) -> dict:
    return {name: make for name, make in makes.items() if name not in names}


def at_places(places: Mapping, weights: Mapping[Path, dict], but: tuple = ()) -> Iterator[pd.DataFrame]:
    """`study.side_by_side` at each place of all methods ``but`` some, by ``place, modality`` and the folder
    ``weights``, each with its limits by modality."""
    for place, (record, names, other) in places.items():
        recordings = [record(name) for name in names]
        most = MOST if len(names) > 1 else None
        for folder, limits in weights.items():
            for modality in MODALITIES:
                makes = without(study.estimators(modality, folder, limits[modality], **other), but)
                found = study.answered(recordings, modality, makes, most, other.get("port"))
                own = {"place": place, "modality": modality, "weights": folder.name}
                yield study.side_by_side(found).assign(**own)
        print(f"{place}: {len(names)} sequences", flush=True)


def costs(weights: Path, samples: Path) -> pd.DataFrame:
    """`study.cost` and the milliseconds of a training's step, of all its networks, on one thread."""
    recording, rows = bench("test-medium-1"), []
    for modality in MODALITIES:
        image = next(iter(images(recording, modality)))[1]
        table = study.cost(study.estimators(modality, weights), image).assign(modality=modality)
        trained = {name: ((name,) if name in train.PEERS else train.FILTERS) for name in table.method}
        trained |= {GEOMETRY: (), "crop": ("pose", "crop")}
        ms = {p: step_ms(p, modality, weights, samples) for p in sorted({*sum(trained.values(), ())})}
        rows.append(table.assign(step_ms=[sum(ms[p] for p in trained[name]) for name in table.method]))
    return pd.concat(rows, ignore_index=True)


def step_ms(peer: str, modality: str, weights: Path, samples: Path) -> float:
    filters = dict(zip(train.FILTERS, study.filter_paths(weights, modality), strict=True))
    path = filters.get(peer) or train.weights_path(weights, peer, modality)
    card, spent_s = load_card(path), []
    for steps in TIMED_STEPS:
        with TemporaryDirectory() as folder:
            start_s = time.perf_counter()
            recipe = replace(Recipe(**card["recipe"]), steps=steps)
            train.train(peer, recipe, Path(folder), samples, report=str)
            spent_s.append(time.perf_counter() - start_s)
    return 1e3 * (spent_s[1] - spent_s[0]) / (TIMED_STEPS[1] - TIMED_STEPS[0])


def of_pictures(folder: Path, weights: Path, limits: dict) -> pd.DataFrame:
    """Whether each method's pose puts the ring where a person marked it, in the authors' pictures at the size
    of the camera's images, as if through its lens, and without the lines that were drawn on them."""
    what = pd.read_csv(DATA / "paper" / "pictures.csv").set_index("picture")
    marked = pd.read_csv(DATA / "paper" / "picture-points.csv").query("kind == 'edge'")
    camera, rows = Camera.davis346(), []
    makes = {m: study.estimators(m, weights, limits[m]) for m in MODALITIES}
    for name, picture in pictures(folder):
        points = marked[marked.picture == name][["u_px", "v_px"]].to_numpy()
        if name not in what.index or not len(points):
            continue
        facts, scale = what.loc[name], camera.width_px / picture.shape[1]
        outer = ellipse.fit((points + 0.5) * scale - 0.5)
        image = without_lines(picture) if facts.lines else picture
        image = cv2.resize(image, camera.size_px, interpolation=cv2.INTER_AREA)
        if facts.modality == "event":
            image = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32) * (SATURATION / 255)
        for method, estimator in makes[facts.modality].items():
            found = estimator(image, 0)
            right = found.T_cam_port is not None and on_ring(found.T_cam_port, outer, camera)
            rows.append({"picture": name, "method": method, "status": found.status, "ring_right": right})
    return pd.DataFrame(rows)


def on_ring(T_cam_port: Pose, outer, camera: Camera) -> bool:
    ring = circle_ellipse(T_cam_port, Port.lm_map().ring_outer_radius_m, camera)
    return is_right(*apart(ring, outer, camera.width_px))


def curves(folder: Path, tuning: Sequence[Recording]) -> pd.DataFrame:
    """The test and the second scene by the number of images that the networks learned from."""
    folders = sorted(folder.glob("*-*"))
    limits = {f: {m: limits_of(f, m, tuning, (*UNLIMITED, *UNLEARNED)) for m in MODALITIES} for f in folders}
    table = pd.concat(at_places(OF_CURVES, limits, UNLEARNED), ignore_index=True)
    numbers = table.weights.str.split("-", expand=True).astype(int)
    return table.drop(columns="weights").assign(images_learned=numbers[0], seed=numbers[1])


def recipes(folder: Path) -> dict[str, dict]:
    """The recipe of each network in a folder."""
    paths = [p for p in sorted(folder.glob("*.safetensors")) if "ckpt" not in p.name]
    return {p.stem: load_card(p)["recipe"] for p in paths}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("weights", type=Path, metavar="FOLDER")
    for option in ("--curves", "--pictures", "--samples"):
        parser.add_argument(option, type=Path, metavar="FOLDER")
    a = parser.parse_args()
    torch.set_num_threads(1)
    tuning = [bench(name) for name in TUNING]
    limits = {m: limits_of(a.weights, m, tuning) for m in MODALITIES}
    facts = {"limits": limits, "recipes": recipes(a.weights)}
    if a.pictures:
        save_table(PICTURES, of_pictures(a.pictures, a.weights, limits), **facts)
    if a.samples:
        save_table(COST, costs(a.weights, a.samples))
    if a.curves:
        of_each = {folder.name: recipes(folder) for folder in sorted(a.curves.glob("*-*"))}
        save_table(CURVES, curves(a.curves, tuning), recipes=of_each)
    table = pd.concat(at_places(AT, {a.weights: limits}), ignore_index=True).drop(columns="weights")
    names = {place: names for place, (_, names, _) in AT.items()}
    save_table(PLACES, table, **facts, sequences=names)
    print(table.round(2).to_string())


if __name__ == "__main__":
    main()
