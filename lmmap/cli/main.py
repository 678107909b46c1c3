"""The ``lmmap`` command.  Exit codes: 0 done, 1 bad input (one line on stderr), 2 usage, 130 interrupted."""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from pathlib import Path

import shtab

from ..bench import laboratory
from ..pages import reference
from ..pipeline.network import CHANNELS
from ..pipeline.weights import DOMAIN_GAPS, FILTERS
from ..provenance import profile
from ..recordings.formats import WRITERS
from ..settings import OURS
from ..studies import odometry_files
from ..types import InputError
from . import authors, bench
from . import recording as work

EXAMPLES = """examples:
  lmmap simulate --sequence test-medium --seconds 10 -o demo.aedat4
  lmmap info demo.aedat4
  lmmap estimate demo.aedat4 --modality event -o poses.csv
  lmmap evaluate demo.aedat4
'lmmap COMMAND --help' has more of them.
"""
ESTIMATE = """examples:
  lmmap estimate run.bag --modality rgb --camera camchain.yaml -o poses.csv
  lmmap estimate run.aedat4 --modality event -o poses.csv --video overlay.mp4
  lmmap estimate run.aedat4 --modality event -o poses.csv --resume     after Ctrl-C
  lmmap estimate run.h5 --modality event --rate 10 -o camera.tum --format tum
  lmmap estimate run.aedat4 --modality fused --rate 10 -o poses.csv    and each camera's poses beside it
"""
EVALUATE = """examples:
  lmmap evaluate demo.aedat4
  lmmap evaluate run.bag --camera camera.yaml --truth arm.tum --modality rgb --json
"""
INFO = """examples:
  lmmap info run.aedat4
  lmmap info run.bag --camera camera.yaml --json
"""
LIVE = """examples:
  lmmap live --modality event --camera camera.json            from an attached camera; Ctrl-C ends it
  lmmap live demo.aedat4 --modality rgb --seconds 5           a recording, in the time that it took
"""
COMPLETION = """examples:
  lmmap completion bash > ~/.local/share/bash-completion/completions/lmmap
  lmmap completion zsh > "${fpath[1]}/_lmmap"
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
    except KeyboardInterrupt as kept:
        print("; ".join(["lmmap: interrupted", *map(str, kept.args)]), file=sys.stderr)
        return 130
    except BrokenPipeError:  # who read us, such as head, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "lmmap", description="Pose of the LM-MAP docking port from an RGB or event camera.",
        epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name, run, text, examples=""):
        sub = commands.add_parser(
            name, help=text, description=text, epilog=examples,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        sub.set_defaults(run=run)
        return sub

    sub = command(
        "simulate", bench.simulate, "record sequences of the bench, with their ground truth beside them"
    )
    sub.add_argument("--sequence", nargs="+", metavar="NAME", help="test-low, realistic-3, ...")
    authors.arguments(sub)
    sub.add_argument("--seconds", type=float, help="length (default: the profile's)")
    sub.add_argument("--profile", choices=tuple(laboratory.SECONDS), default=profile())
    sub.add_argument("--camera", type=Path, help="calibration of another camera, distortion included")
    sub.add_argument("--jobs", type=int, default=1, help="sequences at once")
    sub.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster that does the work")
    sub.add_argument("-o", "--output", type=Path,
                     help=f"FILE ending in {', '.join(WRITERS)}; {{}} stands for the sequence")  # fmt: skip

    sub = command(
        "photometry", bench.calibrate, "calibrate exposure and lamps to the paper's saturation rows"
    )
    sub.add_argument("-o", "--output", type=Path, help="a JSON file for the result and its provenance")

    text = "estimate the port's pose in each frame or histogram of a recording"
    sub = command("estimate", work.estimate, text, ESTIMATE)
    _recording(sub)
    _estimation(sub, required=True, fused=True)
    _file(sub, "-o", "--output", required=True, help="poses to write, each on disk as soon as it is known")
    sub.add_argument("--format", choices=("csv", "tum"), default="csv")
    _file(sub, "--video", help="overlay to write, .mp4 or .avi; takes about half again as long")
    sub.add_argument("--resume", action="store_true", help="go on with an interrupted --output")
    sub.add_argument("--json", action="store_true", help="print the summary as JSON")

    text = "errors and detection rates on a recording whose truth is known"
    sub = command("evaluate", work.evaluate, text, EVALUATE)
    _recording(sub)
    _file(sub, "--truth", help="trajectory, CSV or TUM (default: RECORDING's .truth.csv or .truth.tum)")
    _estimation(sub, required=False, fused=True)
    sub.add_argument("--json", action="store_true", help="print JSON")

    sub = command("info", work.info, "what is in a recording, and its health", INFO)
    _recording(sub)
    sub.add_argument("--json", action="store_true", help="print JSON")

    sub = command("live", work.live_, "poses as images come, from a camera or a recording played", LIVE)
    _recording(sub, nargs="?")
    _estimation(sub, required=True)
    _file(sub, "-o", "--output", help="poses to write as well (CSV)")
    sub.add_argument("--seconds", type=float, help="end after so long")
    sub.add_argument("--json", action="store_true", help="print a line of JSON an image")

    sub = command("completion", lambda a: print(shtab.complete(_parser(), a.shell)),
                  "print the completion script of a shell", COMPLETION)  # fmt: skip
    sub.add_argument("shell", choices=shtab.SUPPORTED_SHELLS)

    sub = command("train", bench.train, "train the filters on the bench; an interrupted run goes on")
    sub.add_argument("--filter", choices=FILTERS, help="default: both")
    sub.add_argument("--modality", choices=tuple(CHANNELS), help="default: both")
    sub.add_argument("--domain-gap", choices=DOMAIN_GAPS, help="default: all")
    sub.add_argument("--seed", type=int, default=0)
    sub.add_argument("--steps", type=int, help="default: the shipped weights' (with --data 2000)")
    sub.add_argument("--start-from", choices=DOMAIN_GAPS,
                     help="weights to go on from (default: low for robust, else none)")  # fmt: skip
    sub.add_argument("--restart", type=int, nargs="+", help="steps at which the learning rate starts anew")
    sub.add_argument("--go-on", action="store_true", help="from the weights there, which end at a restart")
    sub.add_argument("--data", type=Path, metavar="FOLDER", help="of the authors' bags, instead of the bench")

    sub = command("reproduce", bench.reproduce, "regenerate every result of the book")
    sub.add_argument("--profile", choices=tuple(laboratory.SECONDS), default="quick")
    sub.add_argument("--jobs", type=int, default=1, help="sequences at once; 12 GB each in the paper profile")
    sub.add_argument("--go-on", action="store_true", help="take a sequence's packed results where they hold")
    sub.add_argument("--data", type=Path, metavar="FOLDER", help="of the authors' bags, instead of the bench")

    reference.register(command)
    odometry_files.register(command)
    authors.register(command)
    return parser


def _file(sub, *names, **options) -> None:
    sub.add_argument(*names, type=Path, metavar="FILE", **options).complete = shtab.FILE


def _recording(sub, nargs=None) -> None:
    sub.add_argument("recording", type=Path, nargs=nargs).complete = shtab.FILE
    _file(sub, "--camera", help="calibration: our JSON, or YAML of OpenCV, ROS or Kalibr")


def _estimation(sub, required: bool, fused: bool = False) -> None:
    modality = "needed" if required else "default: all"
    choices = ("rgb", "event", "fused") if fused else ("rgb", "event")
    sub.add_argument("--modality", choices=choices, required=required, help=modality)
    _file(sub, "--port", help="another port's geometry (JSON)")
    sub.add_argument("--rate", type=float, metavar="HZ", help="default: every frame, every N events")
    sub.add_argument("--events", type=int, metavar="N", help="events a histogram (default: 0.39 a pixel)")
    text = f"set of mask networks (default: {OURS.weights}, as in Python)"
    sub.add_argument("--domain-gap", choices=DOMAIN_GAPS, default=OURS.weights, help=text)
    sub.add_argument("--weights", metavar="FOLDER", help="filters of your own, named as ours")
