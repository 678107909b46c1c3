"""The default networks on the test sequences with one look and with a second: right, wrong and missing poses.

    python benchmarks/turned_rates.py --jobs 2           # an hour: the sequences are simulated

The errors of one look are the accuracy study's, of the paper profile.  Images with the whole ring in view
that had no pose then are estimated again with ``turned_look``; the others would be answered as before.  Low
light is left out: there one look leaves 0.5 % of the images without a pose at most.  A sequence's errors are
kept in data/derived, so an interrupted run goes on.  The table goes to data/results/turned-paper.csv.
"""

from __future__ import annotations

import argparse
import zipfile
from dataclasses import replace

import joblib
import pandas as pd

from lmmap.bench import laboratory
from lmmap.files import has_mark, tune_allocator, write_text
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.run import each_image, estimate_image, timed_images
from lmmap.provenance import DATA, DERIVED_DATA, save_table, source_files
from lmmap.settings import OURS, PAPER
from lmmap.studies import accuracy_run, pose_errors, sequence_files
from lmmap.studies.right_and_wrong import right_and_wrong

SOURCES = (*source_files("studies.pose_errors"), "benchmarks/turned_rates.py")
PROFILE, KEPT, LIGHTS = "paper", DERIVED_DATA / "turned", ("medium", "high")


def of_one_look(name: str, modality: str) -> pd.DataFrame:
    """The study's errors of a test sequence, by the default networks."""
    file = f"errors-{accuracy_run.label(name, modality, OURS.weights)}.csv"
    with zipfile.ZipFile(accuracy_run.Study().archive(name)) as archive, archive.open(file) as content:
        return pd.read_csv(content)


def look_again(name: str, modality: str) -> pd.DataFrame:
    """The same, after a second look at images with the whole ring in view that had no pose."""
    path = KEPT / f"errors-{name}-{modality}.csv"
    mark = sequence_files.estimates_fingerprint(modality, OURS.weights, name, sources=SOURCES)
    if not has_mark(path.with_suffix(".done"), mark):
        tune_allocator()
        seconds, folder = laboratory.SECONDS[PROFILE]["test"], DERIVED_DATA / PROFILE
        folder.mkdir(parents=True, exist_ok=True)
        recording = sequence_files.bench_recording(name, seconds, folder, print)
        before = of_one_look(name, modality)
        again = set(before.t_us[before.in_view & before.position_error_m.isna()])
        settings = replace(OURS, turned_look=True)
        estimator = Estimator(recording.camera, modality=modality, settings=settings)
        timed = timed_images(recording, modality, settings, PAPER.rate_hz)
        chosen = (shot for shot in timed if shot.times_us & again)
        estimates = list(each_image(chosen, lambda shot: estimate_image(estimator, shot)[1]))
        after = pose_errors.errors(recording, estimates, estimator.port)
        rest = before[~before.t_us.isin(again)]
        save_table(path, pd.concat([rest, after]).sort_values("t_us"), seed=name)
        write_text(path.with_suffix(".done"), mark)
        print(f"{name}: {modality}, {len(estimates)} images again", flush=True)
    return pd.read_csv(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=1)
    jobs = parser.parse_args().jobs
    tests = [name for name in accuracy_run.sequences_of(PROFILE) if name.startswith("test-")]
    by_light = {light: [n for n in tests if laboratory.sequence(n).light == light] for light in LIGHTS}
    names = [name for chosen in by_light.values() for name in chosen]
    made = joblib.Parallel(jobs)(joblib.delayed(_both)(name) for name in names)
    after, rows = dict(zip(names, made, strict=True)), []
    for light, chosen in by_light.items():
        for modality in pose_errors.MODALITIES:
            looks = {"one look": [of_one_look(n, modality) for n in chosen],
                     "turned too": [after[n][modality] for n in chosen]}  # fmt: skip
            for k, tables in looks.items():
                ours = right_and_wrong(tables).query("estimator == 'ours'")
                rows.append(ours.drop(columns="estimator").assign(light=light, camera=modality, looks=k))
    table = pd.concat(rows)[["light", "camera", "looks", *ours.columns[1:]]]
    print(table.round(2).to_string(index=False))
    save_table(DATA / "results" / "turned-paper.csv", table, sequences=names)


def _both(name: str) -> dict[str, pd.DataFrame]:
    return {modality: look_again(name, modality) for modality in pose_errors.MODALITIES}


if __name__ == "__main__":
    main()
