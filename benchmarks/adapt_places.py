"""Before and after: networks that learn the first part of a recording by themselves, judged on its later
part.

    python benchmarks/adapt_places.py rows.csv realistic-52002:60 varied-2003:20 run.bag
    python benchmarks/adapt_places.py places.csv varied-2003:20 --seconds 3 6 10 --steps 200 400 800 --keep
    python benchmarks/adapt_places.py gap.csv test-high:210 --weights high low --seconds 0 20 140 --from 140
    python benchmarks/adapt_places.py rows.csv scene-63000:20=scene-63003:20=scene-63001:20

The last one is judged on two others as well: another motion, another light.
A place is a recording with its truth beside it, or NAME:SECONDS of the bench, which is simulated once and
kept in data/derived/places.  Varied laboratories show the LM-MAP itself, and scene-N is the motion and light
of realistic-N in the second simulated scene (tuning/validation_world.py).  Each row of the table is a camera
of a place; rows that are there are not made again.  Beside it, NAME-images.csv has a row for each image:
whether its pose is right, and how confident.
"""

from __future__ import annotations

import argparse
import re
import resource
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.estimation.estimates import estimate_images
from lmmap.estimation.images import timed_images
from lmmap.evaluation.error_table import errors, is_wrong
from lmmap.pipeline.estimator import Estimator
from lmmap.recordings.formats import open_stream
from lmmap.settings import MODALITIES, OURS
from lmmap.types import Port
from lmmap_lab.adaptation import learning
from lmmap_lab.adaptation.adapt import Outcome, adapt
from lmmap_lab.bench import sequences, simulate, varied
from lmmap_lab.bench.writers import write_recording
from lmmap_lab.provenance import DATA, DERIVED_DATA, ROOT, save_table

sys.path.append(str(ROOT / "tuning"))
import validation_world

OF_BENCH = re.compile(r"([a-z]+(?:-[\w.]+)*):([\d.]+)")
KEY = ["learned_on", "judged_on", "cameras", "modality", "weights", "seconds", "steps", "seed"]


def second_scene(name: str, seconds: float):
    """A recording of other covers, paint, lamps, backdrop, lens and event sensor than the bench's own."""
    gap_m, sensor = validation_world.of_turn(name)
    setup = replace(validation_world.other_setup(gap_m), frame_hz=10)
    return sequences.simulate(name, seconds, sensor=sensor, setup=setup)


def opened(place: str):
    """A place's recording."""
    if not (match := OF_BENCH.fullmatch(place)):
        return open_stream(place)
    name, seconds = match[1], float(match[2])
    path = DERIVED_DATA / "places" / f"{name}-{seconds:g}.h5"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        print(f"{name}: simulating {seconds:g} s", flush=True)
        if varied.NAME.fullmatch(name):
            write_recording(varied.record_varied(name, seconds, Port.lm_map()), path)
        elif name.startswith("scene-"):
            write_recording(second_scene(name.replace("scene", "realistic"), seconds), path)
        else:
            simulate.record(name, seconds, path)
    return open_stream(path)


def judged(stream, estimator: Estimator, *, from_s: float | None, most: int) -> pd.DataFrame:
    """Errors of at most so many images, spread over a recording from a time on (default: its second half)."""
    shots = timed_images(stream, estimator.modality, estimator.settings)
    times_us = np.array([shot.t_us for shot in shots], np.int64)
    first_us = times_us[0] + (1e6 * from_s if from_s is not None else np.ptp(times_us) / 2)
    later_us = times_us[times_us >= first_us]
    keep = set(later_us[np.unique(np.linspace(0, len(later_us) - 1, most).astype(int))].tolist())
    shots = timed_images(stream, estimator.modality, estimator.settings)
    estimates = [e for _, e in estimate_images((s for s in shots if s.t_us in keep), estimator)]
    table = errors(stream, estimates, estimator.port)
    confidence = {e.t_us: e.confidence for e in estimates}
    table = table.assign(confidence=table.t_us.map(confidence), wrong=is_wrong(table))
    return table.assign(right=table.position_error_m.notna() & ~table.wrong).query("in_view")


def counts(table: pd.DataFrame) -> dict:
    return {"images": len(table), "right": int(table.right.sum()), "wrong": int(table.wrong.sum())}


def before_and_after(
    a, known: dict, place: str, seconds: float, steps: int, weights: str
) -> tuple[list, list]:
    """Rows of both tables, of each camera of a place, and of each recording that judges its networks.
    ``known`` keeps what was judged of networks from before."""
    learn, *others = place.split("=")
    taught = opened(learn)
    asked = {learn: (taught, a.start), **{name: (opened(name), 0.0) for name in others}}
    rows, images = [], []
    with tempfile.TemporaryDirectory() as folder:
        began_s = time.monotonic()
        outcomes = {m: Outcome(False, "judged as they are", {"labels": 0}) for m in a.cameras}
        if seconds:
            how = {"seconds": seconds, "steps": steps, "seed": a.seed, "always": a.always}
            outcomes = adapt(taught, folder, a.cameras, weights, **how)
        took_s = time.monotonic() - began_s
        memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        for key in keys_of(a, place, seconds, steps, weights):
            (stream, start_s), m = asked[key[1]], key[3]
            key, outcome = dict(zip(KEY, key, strict=True)), outcomes[m]
            judge = partial(judged, stream, from_s=start_s, most=a.images)
            first = key["judged_on"], m, weights
            if first not in known:
                known[first] = judge(Estimator(stream.camera, None, m, weights))
            tables = {"before": known[first]}
            if outcome.taken:
                tables["after"] = judge(Estimator(stream.camera, None, m, folder))
            before, after = tables["before"], tables.get("after", tables["before"])
            row = key | {f"{k}_before": v for k, v in counts(before).items()}
            row |= {f"{k}_after": v for k, v in counts(after).items()}
            row |= {"taken": outcome.taken, "labels": outcome.facts["labels"], "why": outcome.why,
                    "min_confidence": outcome.facts.get("min_confidence"), "seconds_taken": round(took_s, 1),
                    "memory_mb": round(memory_mb)}  # fmt: skip
            rows.append(row)
            columns = ["t_us", "status", "confidence", "right", "wrong"]
            images += [table[columns].assign(**key, when=when) for when, table in tables.items()]
            told = " before, ".join(f"{part.right.sum()} / {part.wrong.sum()}" for part in (before, after))
            print(
                f"{learn}, {key['judged_on']} {m}, right / wrong of {len(before)}: {told} after", flush=True
            )
    return rows, images


def keys_of(a, place: str, seconds: float, steps: int, weights: str) -> list[tuple]:
    """The keys of a place's rows."""
    learn, *others = place.split("=")
    cases = product([learn, *others], a.cameras)
    return [(learn, judge, "+".join(a.cameras), m, weights, seconds, steps, a.seed) for judge, m in cases]


def images_beside(rows: Path) -> Path:
    return rows.with_name(f"{rows.stem}-images.csv")


def append(path: Path, table: pd.DataFrame) -> None:
    before = [pd.read_csv(path)] if path.exists() else []
    pd.concat([*before, table], ignore_index=True).to_csv(path, index=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", type=Path, help="table to append to")
    parser.add_argument("places", nargs="+", help="RECORDING or NAME:SECONDS, and =ANOTHER that judges too")
    parser.add_argument("--cameras", nargs="+", choices=MODALITIES, default=list(MODALITIES))
    parser.add_argument("--weights", nargs="+", default=[OURS.weights])
    parser.add_argument(
        "--seconds", nargs="+", type=float, help="learned from; 0: nothing (default: half of the recording)"
    )
    parser.add_argument(
        "--from", dest="start", type=float, help="second from which on is judged (default: half)"
    )
    parser.add_argument("--steps", nargs="+", type=int, default=[learning.STEPS])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--images", type=int, default=60, help="judged at most")
    parser.add_argument("--always", action="store_true", help="learn where all seems well, too")
    parser.add_argument("--keep", action="store_true", help="the tables in data/results/adaptation as well")
    a = parser.parse_args()
    done = set(pd.read_csv(a.rows)[KEY].itertuples(index=False, name=None)) if a.rows.exists() else set()
    for place in a.places:
        known = {}
        span_us = opened(place.partition("=")[0]).source.span_us
        half_s = round(0.5e-6 * (span_us[1] - span_us[0]), 3)
        for case in product([half_s] if a.seconds is None else a.seconds, a.steps, a.weights):
            if not done.issuperset(keys_of(a, place, *case)):
                rows, images = before_and_after(a, known, place, *case)
                append(images_beside(a.rows), pd.concat(images))
                append(a.rows, pd.DataFrame(rows))
    if a.keep:
        for path in (a.rows, images_beside(a.rows)):
            save_table(DATA / "results" / "adaptation" / path.name, pd.read_csv(path))


if __name__ == "__main__":
    main()
