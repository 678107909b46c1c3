"""`make vo`: run ORB-SLAM3, SVO and EVO on the bench's recordings, estimate our poses, keep all tracks.

Simulates the sequences, exports them, and starts each run in a process of its own, ORB-SLAM3's and SVO's
from `.venv-vo`.  ``--methods EVO`` runs that alone and keeps the committed rows of the others; ``--methods
lmmap`` estimates our poses alone.  What is done is kept in data/derived/vo under a hash of what made it, so
that an interrupted benchmark goes on.  Ends by writing data/results/odometry: tracks, truth, run log,
provenance.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import published

from lmmap.estimation.estimates import estimate
from lmmap.pipeline.estimator import Estimator
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import write_trajectory
from lmmap.types import Port
from lmmap_lab.bench import sequences, simulate
from lmmap_lab.provenance import DERIVED_DATA, ROOT, commit, fingerprint, profile
from lmmap_lab.studies import odometry, odometry_files, sequence_files

SECONDS = {"quick": 40.0, "paper": 210.0}  # of each sequence
STARTS = (0.0, 0.25, 0.5)  # where in the sequence a run begins
RUNS = 2  # of each start, by default: ORB-SLAM3 is not deterministic
TIMEOUT_S = 600.0  # beyond a run's own length: it hangs, or the machine is far too busy
OWN_TIMEOUT_S = 7200.0  # EVO here reads a file as fast as it can, and cannot hang
PYTHON, HERE = ROOT / ".venv-vo" / "bin" / "python", Path(__file__).parent
RUNNERS = {"ORB-SLAM3": "orbslam3.py", "SVO": "svo.py", "EVO": "evo_run.py"}
METHODS = ("lmmap", *RUNNERS)
EVENTS_ALONE = ("EVO",)  # methods that know no frames
OWN = ("EVO",)  # written here, and so deterministic on each kind of processor
SCRIPTS = ("benchmarks/vo/frames.py", "benchmarks/vo/requirements.txt")


def say(line: str) -> None:
    print(f"vo: {line}", flush=True)


def kept(path: Path, mark: str, make) -> bool:
    """Make what ``path.done`` does not say to be there already."""
    done = path.with_name(path.name + ".done")
    if done.exists() and done.read_text() == mark:
        return False
    done.unlink(missing_ok=True)
    make()
    done.write_text(mark)
    return True


def prepare(name: str, seconds: float, folder: Path) -> str:
    """Simulate and export a sequence; returns a hash of its images, whatever made them."""
    mark = fingerprint(name, str(seconds), code=(sequences.simulate,))
    path = folder / f"{name}.h5"
    say(f"{name}: {seconds:.0f} s")
    kept(path, mark, lambda: simulate.record(name, seconds, path))
    exported = mark + fingerprint(code=(odometry_files.export,))
    kept(
        folder / name, exported, lambda: odometry_files.export(open_recording(path), folder / name, bag=False)
    )
    images = f"{(folder / name).relative_to(ROOT)}/*"
    return fingerprint(files=(f"{images}.txt", f"{images}.json", f"{images}/*.png"))


def run(
    method: str, modality: str, name: str, start_s: float, number: int, folder: Path, seconds: float
) -> dict:
    """One run in its own process; a crash or a time-out is an outcome like another."""
    row = {"method": method, "modality": modality, "sequence": name, "run": number, "start_s": start_s}
    stem = f"{method}-{modality}-{name}-{number:02d}"
    track = folder / "tracks" / f"{stem}.tum"
    track.unlink(missing_ok=True)
    arguments = [folder / name, modality, str(start_s), track, folder / "vocabulary.txt"]
    counts, limit_s = dict.fromkeys(odometry.COUNTS), seconds - start_s + TIMEOUT_S
    limit_s = OWN_TIMEOUT_S if method in OWN else limit_s
    with (track.with_suffix(".log")).open("w") as log:
        try:  # in a session of its own: Ctrl-C is for us, and no failure of theirs
            command = [sys.executable if method in OWN else PYTHON, HERE / RUNNERS[method], *arguments]
            code = subprocess.run(command, stdout=log, stderr=log, timeout=limit_s, check=False,
                                  start_new_session=True).returncode  # fmt: skip
            outcome = f"crashed, signal {-code}" if code < 0 else f"ended with code {code}"
            outcome = "finished" if code == 0 else outcome
        except subprocess.TimeoutExpired:
            outcome = f"timed out after {limit_s:.0f} s"
    text = track.with_suffix(".log").read_text(errors="replace")
    for line in (line for line in text.splitlines() if line.startswith("SUMMARY ")):
        counts |= json.loads(line.removeprefix("SUMMARY "))
    if not track.exists():
        track.write_text("")
    say(f"{stem}: {outcome}, tracked {counts['tracked']} of {counts['frames']}, {counts['resets']} resets")
    return {**row, "outcome": outcome, **counts, "file": track.name}


def runs(
    pool: ThreadPoolExecutor, folder: Path, marks: dict[str, str], seconds: float, repeats: int, methods
):
    """Start all runs of the odometries and yield their rows; those kept are not repeated.

    A deterministic method runs once from each start.
    """
    vocabulary = f"{folder.relative_to(ROOT)}/vocabulary.txt"

    def one(job):
        (number, start), method, modality, name = job
        path = folder / "tracks" / f"{method}-{modality}-{name}-{number:02d}.json"
        scripts = (*SCRIPTS, f"benchmarks/vo/{RUNNERS[method]}")
        own = ("benchmarks/vo/evo/*.py",) if method in OWN else (vocabulary,)
        mark = marks[name] + fingerprint(str(start), files=(*scripts, *own))
        kept(path, mark, lambda: path.write_text(
            json.dumps(run(method, modality, name, start * seconds, number, folder, seconds))))  # fmt: skip
        return json.loads(path.read_text())

    starts = enumerate(STARTS * repeats)
    jobs = itertools.product(starts, methods, odometry.MODALITIES, marks)
    return pool.map(one, (job for job in jobs if _is_meant(*job)))


def _is_meant(numbered_start, method: str, modality: str, _name: str) -> bool:
    """Not frames for a method of events, nor a deterministic method again."""
    again = method in OWN and numbered_start[0] >= len(STARTS)
    return not again and not (method in EVENTS_ALONE and modality != "event")


def ours(name: str, modality: str, folder: Path, mark: str) -> dict:
    """Our estimates on the same images, as a track; one run, for it is deterministic."""
    path, port = folder / "tracks" / f"lmmap-{modality}-{name}-00.tum", Port.lm_map()
    counts = path.with_suffix(".json")

    def make():
        recording = open_recording(folder / f"{name}.h5")
        estimator = Estimator(recording.camera, port, modality, "low")
        found = list(estimate(recording, estimator, estimator.settings.rate_hz))
        track = odometry.camera_track(found, port)
        write_trajectory(track, path, "tum")
        first = (
            next((k for k, e in enumerate(found) if e.t_us == track.t_us[0]), 0) if len(track) else len(found)
        )
        values = (len(found), first, len(track), len(found) - first - len(track), 0, int(len(track) > 0))
        counts.write_text(json.dumps(dict(zip(odometry.COUNTS, values, strict=True))))
        say(f"{path.stem}: {len(track)} poses of {len(found)} images")

    code = (odometry.camera_track,)
    kept(path, mark + sequence_files.estimates_fingerprint(modality, "low", code=code), make)
    row = {"method": "lmmap", "modality": modality, "sequence": name, "run": 0, "start_s": 0.0}
    return {**row, "outcome": "finished", **json.loads(counts.read_text()), "file": path.name}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 2,
                        help="runs at a time; each wants a third of a core, in real time")  # fmt: skip
    parser.add_argument("--runs", type=int, default=RUNS, help="of each of the three starts")
    parser.add_argument("--methods", nargs="+", choices=METHODS, metavar="METHOD",
                        help="run these alone, and keep the committed rows of all others")  # fmt: skip
    arguments = parser.parse_args()
    methods = arguments.methods or METHODS
    others = [method for method in methods if method in RUNNERS]
    seconds, folder = SECONDS[profile()], DERIVED_DATA / "vo" / profile()
    (folder / "tracks").mkdir(parents=True, exist_ok=True)
    facts, kept_rows, rows = {"profile": profile(), "seconds": seconds, "commits": {}}, [], []
    if arguments.methods:
        kept_rows, facts = published.kept_rows(methods, facts)
    marks = {name: prepare(name, seconds, folder) for name in odometry.SEQUENCES}
    facts["commits"] |= dict.fromkeys(methods, commit())
    if "lmmap" in methods:
        rows = [ours(name, m, folder, marks[name]) for name in marks for m in odometry.MODALITIES]
    if set(others) - set(OWN):
        facts["vocabulary_sha256"] = _vocabulary(folder / "vocabulary.txt")
        pins = (HERE / "requirements.txt").read_text().splitlines()
        facts["pins"] = [line.strip() for line in pins if "==" in line]
    with ThreadPoolExecutor(arguments.workers) as pool:  # after ours, for theirs run in real time
        try:
            rows += runs(pool, folder, marks, seconds, arguments.runs, others)
        except BaseException:  # those under way end, and are kept; no other begins
            pool.shutdown(cancel_futures=True)
            raise
    published.publish(rows, folder, facts, kept_rows, METHODS)
    say(f"{odometry.FOLDER.relative_to(ROOT)}: {len(rows)} runs written, {len(kept_rows)} kept")


def _vocabulary(words: Path) -> str:
    """Train ORB-SLAM3's vocabulary where it is not there yet; its SHA-256."""
    mark = fingerprint(files=("benchmarks/vo/vocabulary.py", "benchmarks/vo/requirements.txt"))
    kept(words, mark, lambda: subprocess.run([PYTHON, HERE / "vocabulary.py", words], check=True))
    return subprocess.run(["sha256sum", words], capture_output=True, text=True, check=True).stdout.split()[0]


if __name__ == "__main__":
    main()
