"""Right, wrong and missing poses of the tracker and of its estimator frame by frame, per light and camera.

    python benchmarks/track_rates.py                        # sequences that neither train nor test anything
    python benchmarks/track_rates.py --profile paper        # the test sequences: hours
    python benchmarks/track_rates.py --jobs 2 --limit 6     # the first six of them

Recordings are simulated into data/derived and kept.  The table also goes to data/results/tracks.csv, or
tracks-PROFILE.csv.  The tracker should be right at least as often as frame by frame, wrong at most as often,
and late after no loss after which the other is not.
"""

from __future__ import annotations

import argparse

import joblib
import pandas as pd

from lmmap.bench import laboratory
from lmmap.pipeline.estimator import Estimator
from lmmap.provenance import DATA, DERIVED_DATA, save_table
from lmmap.studies import accuracy_run, sequence_files, tracks
from lmmap.studies.pose_errors import LIGHTS, MODALITIES

TUNING, SECONDS = [f"realistic-{n}" for n in range(2401, 2413)], 6.0


def tables_of(name: str, seconds: float, folder) -> list[tuple]:
    """``(light, camera, kind, errors)`` of a sequence."""
    recording = sequence_files.bench_recording(name, seconds, folder, print)
    rows = []
    for modality in MODALITIES:
        estimator = Estimator(recording.camera, modality=modality)
        kinds = tracks.error_tables(recording, estimator)
        rows += [(laboratory.sequence(name).light, modality, kind, table) for kind, table in kinds.items()]
    print(name, flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--profile", choices=("quick", "paper"), help="its test sequences")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--limit", type=int, help="number of sequences")
    a = parser.parse_args()
    names, seconds, folder = TUNING, SECONDS, DERIVED_DATA / "tracks"
    if a.profile:
        names = [name for name in accuracy_run.sequences_of(a.profile) if name.startswith("test-")]
        seconds, folder = laboratory.SECONDS[a.profile]["test"], DERIVED_DATA / a.profile
    folder.mkdir(parents=True, exist_ok=True)
    names = names[: a.limit]
    parts = joblib.Parallel(a.jobs)(joblib.delayed(tables_of)(name, seconds, folder) for name in names)
    every = [row for part in parts for row in part]
    rows = []
    for light in LIGHTS:
        for modality in MODALITIES:
            for kind in ("frame by frame", "tracked"):
                chosen = [row[3] for row in every if row[:3] == (light, modality, kind)]
                if chosen:
                    rows.append(
                        {"light": light, "camera": modality, "estimates": kind, **tracks.rates(chosen)}
                    )
    table = pd.DataFrame(rows)
    print(table.round(2).to_string(index=False))
    path = DATA / "results" / ("tracks" + (f"-{a.profile}" if a.profile else "") + ".csv")
    save_table(path, table, sequences=names, seconds=seconds)


if __name__ == "__main__":
    main()
