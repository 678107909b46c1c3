"""The words of the ``lmmap`` command: what each subcommand takes, and which function does its work.

Functions are named here, not imported, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .choices import DEFAULT_WEIGHTS, DOMAIN_GAPS, FILTERS, MODALITIES, PROFILES, SHELLS, WRITTEN, profile

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
  lmmap estimate run.h5 --modality event --rate 10 -o camera.tum       a trajectory in TUM's format
  lmmap estimate run.aedat4 --modality fused --rate 10 -o poses.csv    and each camera's poses beside it
"""
DRAW = """examples:
  lmmap draw run.aedat4 poses.csv --modality event -o overlay.mp4
  lmmap draw pictures --fps 30 poses.csv --modality rgb --camera camera.yaml -o overlay.mp4
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
DATASET = """examples:
  lmmap dataset                     what the data set is, and what each study needs of it
  lmmap dataset check recordings    which of its bags are in a folder, and whether they can be used
"""
CALIBRATE = """examples:
  lmmap calibrate dataset_0307/dvs_calibration.bag --board 8x5 --square 0.03     writes camera.json
  lmmap calibrate normal__train.bag --hand-eye camera-to-robot-calibration_dvs.yaml
  lmmap calibrate T1_RA_0_ES_0_a.bag T2_RA_0_ES_1_a.bag --free -o rig.json
"""


class _Version(argparse.Action):
    """Print the installed version; looking it up takes a tenth of a second, which others need not wait."""

    def __call__(self, parser, *_):
        from importlib.metadata import PackageNotFoundError, version

        try:
            number = version("lmmap")
        except PackageNotFoundError:
            number = "of a checkout that is not installed"
        print(f"lmmap {number}")
        parser.exit()


class _Commands:
    """The parser of the command line, as it grows by one subcommand after another."""

    def __init__(self, complete_files=None):
        self.complete_files = complete_files
        self.parser = argparse.ArgumentParser(
            "lmmap",
            description="Pose of the LM-MAP docking port from an RGB or event camera.",
            epilog=EXAMPLES,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        self.parser.add_argument(
            "--version", action=_Version, nargs=0, help="print the version of lmmap and exit"
        )
        self._commands = self.parser.add_subparsers(required=True, metavar="COMMAND")

    def add(self, name: str, run: str, text: str, examples: str = "") -> argparse.ArgumentParser:
        """A subcommand whose work is done by ``run``, a function named as ``module:function``."""
        command = self._commands.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:],
            epilog=examples,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.set_defaults(run=run)
        return command

    def add_file(self, command, *names: str, **options) -> None:
        """An argument that is a file's name, which the shell can complete."""
        options = {"metavar": "FILE"} | options
        action = command.add_argument(*names, type=Path, **options)
        if self.complete_files is not None:
            action.complete = self.complete_files

    def add_output(self, command, text: str, **options) -> None:
        self.add_file(command, "-o", "--output", help=text, **options)
        command.add_argument("--overwrite", action="store_true", help="replace an output that exists")


def parser(complete_files=None) -> argparse.ArgumentParser:
    """The parser of the command line.

    Parameters
    ----------
    complete_files
        shtab's word for arguments that are files, where a completion script is made.
    """
    commands = _Commands(complete_files)
    _add_bench(commands)
    _add_recordings(commands)
    _add_studies(commands)
    _add_authors(commands)
    return commands.parser


def _add_bench(commands: _Commands) -> None:
    command = commands.add(
        "simulate",
        "lmmap.cli.bench:simulate",
        "record sequences of the bench, and their ground truth",
    )
    command.add_argument("--sequence", nargs="+", metavar="NAME", help="test-low, realistic-3, ...")
    commands.add_file(
        command,
        "--as-published",
        metavar="FOLDER",
        help="write stand-ins for the authors' bags into this folder instead",
    )
    command.add_argument("--seconds", type=float, help="length of each sequence (default: the profile's)")
    command.add_argument("--profile", choices=PROFILES, default=profile(), help="decides the default lengths")
    commands.add_file(command, "--camera", help="calibration of another camera, distortion included")
    command.add_argument("--jobs", type=int, default=1, help="how many sequences to simulate at once")
    command.add_argument("--scheduler", metavar="ADDRESS", help="Dask cluster that does the work")
    commands.add_output(
        command, f"recording to write, ending in {', '.join(WRITTEN)}; {{}} stands for the sequence's name"
    )
    command = commands.add(
        "photometry",
        "lmmap.cli.bench:calibrate_lamps",
        "calibrate exposure and lamps to the paper's saturation rows",
    )
    commands.add_output(command, "JSON file for the result and its provenance")


def _add_recordings(commands: _Commands) -> None:
    command = commands.add(
        "estimate",
        "lmmap.cli.estimation:estimate",
        "estimate the port's pose in each frame or histogram of a recording",
        ESTIMATE,
    )
    _add_recording(commands, command)
    _add_estimation(commands, command, required=True, fused=True)
    commands.add_output(command, "poses to write, each as soon as it is known", required=True)
    command.add_argument(
        "--format",
        choices=("csv", "tum"),
        help="of the poses (default: tum if the name ends in .tum, else csv)",
    )
    commands.add_file(
        command, "--video", help="overlay to write, .mp4 or .avi; takes two or three times as long"
    )
    command.add_argument("--resume", action="store_true", help="go on with an interrupted --output")
    command.add_argument("--json", action="store_true", help="print the summary as JSON")

    command = commands.add(
        "draw",
        "lmmap.cli.drawing:draw",
        "draw poses on the images that they were estimated from, as a video",
        DRAW,
    )
    _add_recording(commands, command)
    commands.add_file(command, "poses", metavar=None, help="CSV that lmmap estimate wrote")
    command.add_argument("--modality", choices=MODALITIES, required=True, help="as it was estimated with")
    commands.add_file(command, "--port", help="as it was estimated with")
    command.add_argument("--rate", type=float, metavar="HZ", help="as it was estimated with")
    command.add_argument("--events", type=int, metavar="N", help="as it was estimated with")
    commands.add_output(command, "video to write: .mp4, which browsers play, or .avi", required=True)

    command = commands.add(
        "evaluate",
        "lmmap.cli.evaluation:evaluate",
        "errors and detection rates on a recording whose truth is known",
        EVALUATE,
    )
    _add_recording(commands, command)
    commands.add_file(command, "--truth", help="CSV or TUM (default: RECORDING's .truth.csv or .truth.tum)")
    _add_estimation(commands, command, required=False, fused=True)
    command.add_argument("--json", action="store_true", help="print JSON")

    command = commands.add(
        "info", "lmmap.cli.recording:info", "what a recording holds, and whether it is sound", INFO
    )
    _add_recording(commands, command)
    command.add_argument("--json", action="store_true", help="print JSON")

    command = commands.add(
        "live",
        "lmmap.cli.recording:live",
        "poses as images come, from a camera or from a recording that is played",
        LIVE,
    )
    _add_recording(commands, command, nargs="?")
    _add_estimation(commands, command, required=True)
    commands.add_output(command, "poses to write as well (CSV, or TUM if the name ends in .tum)")
    command.add_argument("--seconds", type=float, help="end after so many seconds")
    command.add_argument("--json", action="store_true", help="print a line of JSON for each image")

    command = commands.add(
        "completion", "lmmap.cli.completion:completion", "print the completion script of a shell", COMPLETION
    )
    command.add_argument("shell", choices=SHELLS)


def _add_recording(commands: _Commands, command, nargs=None) -> None:
    commands.add_file(
        command,
        "recording",
        nargs=nargs,
        metavar=None,
        help="AEDAT4, RAW, DAT, HDF5, ROS 1 or 2 bag, text, CSV, npy, video, image, or a folder of images",
    )
    commands.add_file(
        command,
        "--camera",
        help="calibration: our JSON, or YAML of OpenCV, ROS or Kalibr; or a sensor and its nominal lens, "
        "such as evk4:8mm",
    )
    command.add_argument(
        "--fps", type=float, metavar="HZ", help="pictures a second, of a folder without timestamps.txt"
    )


def _add_estimation(commands: _Commands, command, required: bool, fused: bool = False) -> None:
    choices = (*MODALITIES, "fused") if fused else MODALITIES
    text = "which images to use" if required else "which images to use (default: all)"
    command.add_argument("--modality", choices=choices, required=required, help=text)
    commands.add_file(command, "--port", help="geometry of another port (JSON)")
    command.add_argument(
        "--rate", type=float, metavar="HZ", help="estimates a second (default: every frame, every N events)"
    )
    command.add_argument(
        "--events", type=int, metavar="N", help="events in a histogram (default: 0.39 for each pixel)"
    )
    command.add_argument(
        "--domain-gap",
        choices=DOMAIN_GAPS,
        default=DEFAULT_WEIGHTS,
        help=f"set of mask networks (default: {DEFAULT_WEIGHTS}, as in Python)",
    )
    command.add_argument(
        "--weights", metavar="FOLDER", help="mask networks of your own, in files named as those of lmmap"
    )


def _add_studies(commands: _Commands) -> None:
    command = commands.add(
        "train", "lmmap.cli.bench:train", "train the mask networks; an interrupted run goes on"
    )
    command.add_argument("--filter", choices=FILTERS, help="which of the two (default: both)")
    command.add_argument("--modality", choices=MODALITIES, help="which images (default: both)")
    command.add_argument("--domain-gap", choices=DOMAIN_GAPS, help="training sequences (default: all)")
    command.add_argument("--seed", type=int, default=0, help="of the random draws (default: 0)")
    command.add_argument("--steps", type=int, help="default: the shipped weights' (with --data 2000)")
    command.add_argument(
        "--start-from", choices=DOMAIN_GAPS, help="weights to begin with (default: low for robust, else none)"
    )
    command.add_argument(
        "--restart", type=int, nargs="+", metavar="STEP", help="steps at which the learning rate starts anew"
    )
    command.add_argument(
        "--go-on", action="store_true", help="begin with the weights there, which end at a restart"
    )
    commands.add_file(command, "--data", metavar="FOLDER", help="the authors' bags, instead of the bench")

    command = commands.add("reproduce", "lmmap.cli.bench:reproduce", "regenerate every result of the book")
    command.add_argument(
        "--profile", choices=PROFILES, default="quick", help="decides the sequences' lengths"
    )
    command.add_argument(
        "--jobs", type=int, default=1, help="sequences at once; 12 GB each in the paper profile"
    )
    command.add_argument("--go-on", action="store_true", help="keep a sequence's packed results if they hold")
    commands.add_file(command, "--data", metavar="FOLDER", help="the authors' bags, instead of the bench")

    command = commands.add(
        "check", "lmmap.cli.bench:check", "compare results and pages with the committed ones"
    )
    command.add_argument("--update", action="store_true", help="make them the reference instead")

    odometry = commands.add("odometry", "", "exchange recordings and trajectories with other odometries")
    actions = odometry.add_subparsers(required=True, metavar="ACTION")
    text = "write a ROS 1 bag, PNG images, event frames, the camera and the truth (TUM)"
    command = actions.add_parser("export", help=text, description=text)
    command.set_defaults(run="lmmap.studies.odometry_files:export_command")
    commands.add_file(command, "recording", metavar=None)
    commands.add_file(command, "folder", metavar="DIR")
    commands.add_file(command, "--camera", help="calibration: our JSON, or YAML of OpenCV or ROS")
    command.add_argument("--overwrite", action="store_true", help="write into a folder that holds files")
    text = "relative errors of a TUM trajectory, scale aligned on its first 40 poses"
    command = actions.add_parser("score", help=text, description=text)
    command.set_defaults(run="lmmap.studies.odometry_files:score_command")
    commands.add_file(
        command, "trajectory", metavar=None, help="TUM file: t x y z qx qy qz qw, seconds and metres"
    )
    commands.add_file(
        command,
        "--reference",
        required=True,
        metavar="RECORDING",
        help="recording with its truth beside it, or a trajectory (.csv, .tum, .txt)",
    )
    command.add_argument("--json", action="store_true", help="print JSON")


def _add_authors(commands: _Commands) -> None:
    command = commands.add(
        "dataset",
        "lmmap.cli.authors:dataset",
        "the authors' published recordings: where, and what is here",
        DATASET,
    )
    command.add_argument("do", nargs="?", choices=("check",), help="default: say what the data set is")
    commands.add_file(command, "folder", nargs="?", metavar=None, help="folder of bags to check")
    command.add_argument("--json", action="store_true", help="print JSON")
    text = "find the port on the arm, the ring's radius and the camera from bags as published"
    command = commands.add("calibrate", "lmmap.cli.authors:calibrate", text, CALIBRATE)
    commands.add_file(command, "bags", nargs="+", metavar="BAG", help="not one that you will test on")
    command.add_argument("--modality", choices=MODALITIES, default="rgb", help="default: rgb")
    command.add_argument(
        "--rate", type=float, default=5.0, metavar="HZ", help="detections a second (default: 5)"
    )
    commands.add_file(command, "--camera", help="calibration (default: camera.json beside the bag)")
    commands.add_file(
        command, "--hand-eye", help="hand-eye calibration in YAML (default: sought beside the bag)"
    )
    command.add_argument(
        "--free", action="store_true", help="estimate the camera's place too, whatever a file says"
    )
    command.add_argument("--base", metavar="FRAME", help="the arm's base in /tf")
    command.add_argument("--effector", metavar="FRAME", help="the arm's other end in /tf")
    command.add_argument(
        "--on-arm", action="store_true", help="the camera rides on the arm, the port stands still"
    )
    command.add_argument(
        "--board", metavar="CxR", help="inner corners of a checkerboard: calibrate the camera instead"
    )
    command.add_argument(
        "--square", type=float, default=0.03, metavar="M", help="side of the board's squares"
    )
    commands.add_output(command, "default: rig.json or camera.json, beside the first bag")
    command.add_argument("--json", action="store_true", help="print JSON")
