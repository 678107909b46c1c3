"""Right, wrong and missing poses of the tracker and of its estimator frame by frame, per light and camera.

    python benchmarks/track_rates.py                        # sequences that neither train nor test anything
    python benchmarks/track_rates.py --profile paper        # the test sequences: half an hour
    python benchmarks/track_rates.py --jobs 2 --only test-low test-high

With a profile, recordings and errors frame by frame are those of its accuracy study, which has to come first.
Errors are kept in data/derived, those of the paper profile also in data/results/accuracy/sequences, so an
interrupted run goes on.  The table goes to data/results/tracks.csv, or tracks-PROFILE.csv.  The tracker
should be right at least as often as frame by frame, wrong at most as often, and late after no loss after
which the other is not.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import joblib
import pandas as pd

from lmmap.files import write_text
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import MODALITIES, OURS
from lmmap_lab.bench import laboratory
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_table
from lmmap_lab.studies import accuracy_run, sequence_files, tracks
from lmmap_lab.studies.archive import pack, unpack
from lmmap_lab.studies.networks import set_hashes
from lmmap_lab.studies.table1 import LIGHTS
from lmmap_lab.unfinished import has_mark

TUNING, SECONDS = [f"realistic-{n}" for n in range(2401, 2413)], 6.0


def kept(path: Path, mark: str, name: str, seconds: float, packed: bool, make) -> pd.DataFrame:
    """A table of errors, made unless the one in its file is of the present tracker, networks and sequence."""
    done, archive = path.with_suffix(".done"), accuracy_run.COMMITTED / "sequences" / f"{path.stem}.zip"
    if not has_mark(done, mark):
        if not (packed and unpack(archive, path.parent, mark)):
            save_table(path, make(), seed=name, seconds=seconds)
            if packed:
                pack(archive, [path], path.parent, mark, seed=name, seconds=seconds)
        write_text(done, mark)
    return pd.read_csv(path)


def tables_of(name: str, seconds: float, folder: Path, profile: str | None) -> list[tuple]:
    """``(light, camera, kind, errors)`` of a sequence."""
    light, rows = laboratory.sequence(name).light, []
    for modality in MODALITIES:

        def made(path: Path, function, modality=modality) -> pd.DataFrame:
            def make():
                recording = sequence_files.bench_recording(name, seconds, folder, print)
                return function(recording, Estimator(recording.camera, modality=modality))

            mark = tracks.mark(name, modality, seconds, function)
            return kept(path, mark, name, seconds, profile == "paper", make)

        alone = folder / f"errors-{accuracy_run.label(name, modality, OURS.weights)}.csv"
        errors = pd.read_csv(alone) if profile else made(alone, tracks.errors_frame_by_frame)
        track = made(folder / f"tracked-{name}-{modality}.csv", tracks.errors_tracked)
        rows += [(light, modality, "frame by frame", errors), (light, modality, "tracked", track)]
        print(f"{name}: {modality} tracked", flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--profile", choices=("quick", "paper"), help="its test sequences")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", nargs="+", metavar="SEQUENCE", help="these sequences")
    a = parser.parse_args()
    names, seconds, folder = TUNING, SECONDS, DERIVED_DATA / "tracks"
    if a.profile:
        names = [name for name in accuracy_run.sequences_of(a.profile) if name.startswith("test-")]
        seconds, folder = laboratory.SECONDS[a.profile]["test"], DERIVED_DATA / a.profile
    folder.mkdir(parents=True, exist_ok=True)
    names = a.only or names
    jobs = (joblib.delayed(tables_of)(name, seconds, folder, a.profile) for name in names)
    parts = joblib.Parallel(a.jobs)(jobs)
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
    if not a.only:
        save_table(path, table, sequences=names, seconds=seconds, networks=set_hashes(OURS.weights))


if __name__ == "__main__":
    main()
