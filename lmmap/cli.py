"""The ``lmmap`` command.  Exit codes: 0 done, 1 bad input (one line on stderr), 2 usage, 130 interrupted."""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from itertools import product
from pathlib import Path

from tqdm import tqdm

from . import accuracy, photometry, pipeline, sequences, simulation
from .core import PAPER, Camera, InputError, Port, Recording
from .filters import CHANNELS, DOMAIN_GAPS, FILTERS, shipped_gaps
from .recordings import WRITERS, health, open_recording
from .results import DERIVED, profile, save_json
from .trajectories import trajectory_of, write_estimates, write_trajectory

EXAMPLES = """examples:
  lmmap simulate --sequence test-medium --seconds 10 -o demo.aedat4
  lmmap info demo.aedat4
  lmmap estimate demo.aedat4 --modality event -o poses.csv
  lmmap evaluate demo.aedat4
"""


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    arguments = _parser().parse_args(argv)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", UserWarning)
            warnings.showwarning = lambda text, *_: print(f"lmmap: note: {text}", file=sys.stderr)
            arguments.run(arguments)
    except InputError as error:
        print(f"lmmap: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("lmmap: interrupted", file=sys.stderr)
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "lmmap", description="Pose of the LM-MAP docking port from an RGB or event camera.",
        epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name, run, text):
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(run=run)
        return sub

    sub = command("simulate", simulate, "record sequences of the bench, with their ground truth beside them")
    sub.add_argument(
        "--sequence", nargs="+", required=True, metavar="NAME", help="test-low, realistic-3, ..."
    )
    sub.add_argument("--seconds", type=float, help="length (default: the profile's)")
    sub.add_argument("--profile", choices=tuple(sequences.SECONDS), default=profile())
    sub.add_argument("--camera", type=Path, help="calibration of another camera, distortion included")
    sub.add_argument("--jobs", type=int, default=1, help="sequences at once")
    sub.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster that does the work")
    sub.add_argument("-o", "--output", type=Path, required=True,
                     help=f"FILE ending in {', '.join(WRITERS)}; {{}} stands for the sequence")  # fmt: skip

    sub = command("photometry", photometric, "calibrate exposure and lamps to the paper's saturation rows")
    sub.add_argument("-o", "--output", type=Path, help="a JSON file for the result and its provenance")

    sub = command("estimate", estimate, "estimate the port's pose in each frame or histogram of a recording")
    _recording(sub)
    sub.add_argument("--modality", choices=("rgb", "event"), required=True)
    sub.add_argument("-o", "--output", type=Path, required=True, help="poses to write")
    sub.add_argument("--format", choices=("csv", "tum"), default="csv")
    _domain_gap(sub)
    sub.add_argument("--rate", type=float, help="estimates per second (default: every frame, every N events)")

    sub = command("evaluate", evaluate, "errors and detection rates on a recording whose truth is known")
    _recording(sub)
    sub.add_argument("--modality", choices=("rgb", "event"), help="default: both")
    _domain_gap(sub)
    sub.add_argument("--json", action="store_true", help="print JSON")

    sub = command("info", info, "what is in a recording, and its health")
    sub.add_argument("recording", type=Path)
    sub.add_argument("--camera", type=Path, help="calibration: our JSON, or YAML of OpenCV, ROS or Kalibr")
    sub.add_argument("--json", action="store_true", help="print JSON")

    sub = command("train", train, "train the filters on the bench; an interrupted run goes on")
    sub.add_argument("--filter", choices=FILTERS, help="default: both")
    sub.add_argument("--modality", choices=tuple(CHANNELS), help="default: both")
    sub.add_argument("--domain-gap", choices=DOMAIN_GAPS, help="default: all")
    sub.add_argument("--seed", type=int, default=0)
    sub.add_argument("--steps", type=int, default=2000)
    sub.add_argument("--start-from", choices=DOMAIN_GAPS, default="", help="other weights to go on from")

    sub = command("reproduce", reproduce, "regenerate every result of the book")
    sub.add_argument("--profile", choices=tuple(sequences.SECONDS), default="quick")
    return parser


def _domain_gap(sub) -> None:
    default = shipped_gaps()[-1]  # robust, once trained: for what nobody rendered
    sub.add_argument("--domain-gap", choices=DOMAIN_GAPS, default=default, help=f"default: {default}")


def _recording(sub) -> None:
    sub.add_argument("recording", type=Path)
    sub.add_argument("--camera", type=Path, help="calibration: our JSON, or YAML of OpenCV, ROS or Kalibr")
    sub.add_argument("--port", type=Path, help="another port's geometry (JSON)")


def _check_folder(path: Path) -> None:
    """Before the work, not after it."""
    if not path.parent.is_dir():
        raise InputError(f"{path}: no folder {path.parent}; make it first")


def simulate(a) -> None:
    if a.output.suffix not in WRITERS:
        raise InputError(f"{a.output}: cannot write '{a.output.suffix}'; name it {', '.join(WRITERS)}")
    if len(a.sequence) > 1 and "{}" not in a.output.name:
        raise InputError(f"{a.output}: one name for {len(a.sequence)} sequences; put {{}} where theirs goes")
    _check_folder(a.output)
    camera = Camera.load(a.camera) if a.camera else None
    jobs = [(name, sequences.duration_s(sequences.sequence(name), a.seconds, a.profile),
             a.output.with_name(a.output.name.replace("{}", name))) for name in a.sequence]  # fmt: skip
    if a.jobs > 1 or a.scheduler:
        if camera:
            raise InputError(f"{a.camera}: another camera records one sequence at a time; leave --jobs out")
        for path, events, frames in tqdm(
            simulation.record_all(jobs, a.jobs, a.scheduler), "simulate", len(jobs)
        ):
            tqdm.write(f"{path}: {events} events, {frames} frames")
        return
    for name, seconds, path in jobs:
        with tqdm(total=seconds, desc=name, bar_format="{desc} {percentage:3.0f}% {bar} {elapsed}") as bar:
            events, frames = simulation.record(
                name, seconds, path, lambda s, bar=bar: bar.update(s - bar.n), camera
            )
            bar.update(seconds - bar.n)
        print(f"{path}: {events} events, {frames} frames, {seconds:g} s")


def photometric(a) -> None:
    if a.output:
        _check_folder(a.output)
    result = photometry.calibrate(lambda line: print(line, file=sys.stderr))
    if a.output:
        save_json(a.output, result, command=f"lmmap photometry -o {a.output.name}")
    print(json.dumps(result, indent=1))


def _estimates(recording: Recording, modality: str, port: Port, gap: str, rate_hz=None) -> list:
    """All estimates, with a progress bar; those so far when interrupted."""
    estimator = pipeline.Estimator(recording.camera, port, modality, gap)
    period = len(recording.frames) if modality == "rgb" else len(recording.events) // PAPER.events_per_window
    total = None if rate_hz else period
    found = []
    try:
        with tqdm(pipeline.estimate(recording, estimator, rate_hz), modality, total, unit="img") as bar:
            for one in bar:
                found.append(one)
                bar.set_postfix(poses=sum(e.T_cam_port is not None for e in found), refresh=False)
    except KeyboardInterrupt:
        print("lmmap: interrupted; keeping what was estimated", file=sys.stderr)
    return found


def _open(a) -> tuple[Recording, Port]:
    camera = Camera.load(a.camera) if a.camera else None
    return open_recording(a.recording, camera), Port.load(a.port) if a.port else Port.lm_map()


def estimate(a) -> None:
    recording, port = _open(a)
    if a.rate is not None and not 0 < a.rate < 1e4:
        raise InputError(f"--rate {a.rate:g}: give a number of estimates per second between 0 and 10000")
    _check_folder(a.output)
    found = _estimates(recording, a.modality, port, a.domain_gap, a.rate)
    if a.format == "csv":
        write_estimates(found, a.output)
    else:
        write_trajectory(trajectory_of(found), a.output, "tum")
    counts = {}
    for one in found:
        counts[str(one.status)] = counts.get(str(one.status), 0) + 1
    print(f"{a.output}: {len(found)} images; " + ", ".join(f"{v} {k}" for k, v in sorted(counts.items())))


def evaluate(a) -> None:
    recording, port = _open(a)
    if recording.truth is None:
        raise InputError(f"{a.recording}: no ground truth beside it; put it in {a.recording.stem}.truth.csv")
    report = {}
    for modality in [a.modality] if a.modality else ["rgb", "event"]:
        table = accuracy.errors(recording, _estimates(recording, modality, port, a.domain_gap), port)
        if not len(table):
            raise InputError(f"{a.recording}: holds no {modality} data that its truth covers")
        report[modality] = accuracy.report(table)
    if a.json:
        print(json.dumps(report, indent=1))
        return
    names = list(next(iter(report.values())))
    print(f"{'':34}" + "".join(f"{m:>10}" for m in report))
    for name in names:
        print(f"{name.replace('_', ' '):34}" + "".join(f"{report[m][name]:10.2f}" for m in report))


def info(a) -> None:
    facts = health(open_recording(a.recording, Camera.load(a.camera) if a.camera else None))
    if a.json:
        print(json.dumps(facts, indent=1))
        return
    for name, value in facts.items():
        print(
            f"{name.replace('_', ' '):18} {value:.6g}"
            if isinstance(value, float)
            else f"{name.replace('_', ' '):18} {value}"
        )


def train(a) -> None:
    from . import training  # torch's optimisers take a second to import, and only this command needs them

    gaps = [a.domain_gap] if a.domain_gap else DOMAIN_GAPS
    names = [a.filter] if a.filter else FILTERS
    modalities = [a.modality] if a.modality else CHANNELS
    for gap, name, modality in product(gaps, names, modalities):
        recipe = training.Recipe(name, modality, gap, a.seed, a.steps, start_from=a.start_from)
        path = training.train(recipe, DERIVED / "training", lambda line: print(line, flush=True))
        print(f"{path}: written")


def reproduce(a) -> None:
    accuracy.reproduce(a.profile, lambda line: print(line, flush=True))
