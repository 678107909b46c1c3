"""Judges every shipped filter on the tests' whole sequences: overlap, and distance of the skeleton.

    python tuning/judge_filters.py

The table that `make evaluate PROFILE=paper` writes, data/results/accuracy/filters.csv, without its hours of
poses.  Recordings and the judgement of each are kept in data/derived/paper and data/derived/judged, so an
interrupted run goes on.
"""

from __future__ import annotations

import pandas as pd

from lmmap.pipeline.weights import shipped_gaps
from lmmap_lab.bench import laboratory
from lmmap_lab.provenance import DERIVED_DATA, PINS, fingerprint, save_table
from lmmap_lab.studies import accuracy_run, sequence_files
from lmmap_lab.studies.table1 import LIGHTS
from lmmap_lab.training.mask_quality import filter_quality, medians

FOLDER = DERIVED_DATA / "judged"


def say(line: str) -> None:
    print(f"filters: {line}", flush=True)


def judged(name: str, mark: str) -> pd.DataFrame:
    """A row per image and filter of one sequence."""
    path = FOLDER / f"{name}-{mark}.csv"
    if not path.exists():
        seconds = laboratory.SECONDS["paper"]["test"]
        recording = sequence_files.bench_recording(name, seconds, DERIVED_DATA / "paper", say)
        table = filter_quality(recording, shipped_gaps(), precision="float32")
        FOLDER.mkdir(parents=True, exist_ok=True)
        table.to_csv(path, index=False)
        say(f"{name}: done")
    return pd.read_csv(path)


def main() -> None:
    mark = fingerprint(code=(judged,), files=("data/weights/*", PINS))[:12]
    tests = [name for name in accuracy_run.sequences_of("paper") if name.startswith("test-")]
    names = sorted(tests, key=lambda name: LIGHTS.index(name.split("-")[1]))
    table = medians(pd.concat([judged(name, mark).assign(light=name.split("-")[1]) for name in names]))
    path = save_table(accuracy_run.COMMITTED / "filters.csv", table, profile="paper")
    print(table[table["filter"] == "ring"].round(2).to_string(index=False))
    say(f"{path.name}: written")


if __name__ == "__main__":
    main()
