"""The arguments of the ``lmmap`` command: what each subcommand takes, and which function does its work.

Functions are named here, not imported, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse

from .choices import DEFAULT_WEIGHTS, FLIPS, MODALITIES, PAPER_WEIGHTS, SHELLS, camera_or_file
from .commands import Commands

ESTIMATE = """examples:
  lmmap estimate run.bag --modality rgb --camera camchain.yaml -o poses.csv
  lmmap estimate run.aedat4 --modality event -o poses.csv --video overlay.mp4
  lmmap estimate run.aedat4 --modality event -o poses.csv --resume     after Ctrl-C
  lmmap estimate run.aedat4 --modality fused --track -o poses.csv      faster: searches near the track
  lmmap estimate run.aedat4 --modality event --track --between 500 -o poses.csv    poses from events, too
  lmmap estimate run.bag --modality fused --adapt 30 -o poses.csv      with networks adapted to its first 30 s
  lmmap estimate run.h5 --modality event --rate 10 -o camera.tum       a trajectory in TUM's format
  lmmap estimate bag --modality rgb -o poses.mcap --frame-id front_camera     for RViz and Foxglove
  lmmap estimate run.aedat4 --modality fused --rate 10 -o poses.csv    and each camera's poses beside it
"""
DRAW = """examples:
  lmmap draw run.aedat4 poses.csv --modality event -o overlay.mp4
  lmmap draw pictures --fps 30 poses.csv --modality rgb --camera camera.yaml -o overlay.mp4
"""
EVALUATE = """examples:
  lmmap evaluate demo.aedat4
  lmmap evaluate run.bag --camera camera.yaml --truth arm.tum --modality rgb --json
  lmmap evaluate demo.aedat4 --as-printed                     the paper's own procedure
"""
INFO = """examples:
  lmmap info run.aedat4                                       needs no calibration
  lmmap info run.bag --camera camera.yaml --json              also says whether the lens is in range
"""
LIVE = """examples:
  lmmap live 0 --view                                         from a webcam, with a page to look at
  lmmap live --modality event --camera camera.json            from an attached camera; Ctrl-C ends it
  lmmap live demo.aedat4 --modality rgb --seconds 5           a recording, at its own speed
  lmmap live demo.aedat4 --modality event --between 100       and 100 poses per second between the images
"""
COMPLETION = """examples:
  lmmap completion bash > ~/.local/share/bash-completion/completions/lmmap
  lmmap completion zsh > "${fpath[1]}/_lmmap"
"""


def parser(complete_files=None) -> argparse.ArgumentParser:
    """The parser of the command line.

    Parameters
    ----------
    complete_files
        shtab's marker for arguments that are files, when a completion script is made.
    """
    commands = Commands(complete_files)
    for add in (_estimate, _draw, _evaluate, _info, _live, _completion):
        add(commands)
    commands.add_installed()
    return commands.parser


def _estimate(commands: Commands) -> None:
    text = "estimate the port's pose in each frame or histogram of a recording"
    command = commands.add("estimate", "lmmap.cli.estimation:estimate", text, ESTIMATE)
    commands.add_recording(command)
    _add_estimation(commands, command, required=True)
    text = ("poses to write, each as soon as it is known; in a .bag (ROS 1) or .mcap (ROS 2) those of status "
            "ok, on /tf and as PoseWithCovarianceStamped on /port_pose")  # fmt: skip
    commands.add_output(command, text, required=True)
    _add_frames(command)
    text = "format of the poses (default: tum if the name ends in .tum, else csv)"
    command.add_argument("--format", choices=("csv", "tum"), help=text)
    text = "overlay to write, .mp4 or .avi; takes two or three times as long"
    commands.add_file(command, "--video", help=text)
    commands.add_file(command, "--rerun", help="file to write for the Rerun viewer, .rrd; needs rerun-sdk")
    command.add_argument(
        "--track", action="store_true", help="search only where earlier images predict the port"
    )
    _add_between(command, "with --track")
    text = "adapt the networks to this many seconds of the recording; needs the laboratory"
    command.add_argument("--adapt", type=float, metavar="SECONDS", help=text)
    text = "continue an interrupted --output; OUTPUT.made-of beside it records how it was made"
    command.add_argument("--resume", action="store_true", help=text)
    command.add_argument("--json", action="store_true", help="print the summary as JSON")


def _draw(commands: Commands) -> None:
    text = "draw poses on the images from which they were estimated, as a video"
    command = commands.add("draw", "lmmap.cli.drawing:draw", text, DRAW)
    commands.add_recording(command)
    commands.add_file(command, "poses", metavar=None, help="CSV that lmmap estimate wrote")
    command.add_argument("--modality", choices=MODALITIES, required=True, help="as for the estimate")
    commands.add_file(command, "--port", help="as for the estimate")
    command.add_argument("--rate", type=float, metavar="HZ", help="as for the estimate")
    command.add_argument("--events", type=int, metavar="N", help="as for the estimate")
    _add_flip(command)
    text = "video to write: .mp4, which browsers play, or .avi; or .rrd for Rerun"
    commands.add_output(command, text, required=True)


def _evaluate(commands: Commands) -> None:
    text = "measure errors and detection rates on a recording whose truth is known"
    command = commands.add("evaluate", "lmmap.cli.evaluation:evaluate", text, EVALUATE)
    commands.add_recording(command)
    commands.add_file(command, "--truth", help="CSV or TUM (default: RECORDING's .truth.csv or .truth.tum)")
    _add_estimation(commands, command, required=False)
    text = f"run the paper's own procedure, on each camera by itself (default networks: {PAPER_WEIGHTS})"
    command.add_argument("--as-printed", action="store_true", help=text)
    command.add_argument("--json", action="store_true", help="print JSON")


def _info(commands: Commands) -> None:
    text = "show what a recording holds and whether it is sound"
    command = commands.add("info", "lmmap.cli.info:info", text, INFO)
    commands.add_recording(command)
    command.add_argument("--json", action="store_true", help="print JSON")


def _live(commands: Commands) -> None:
    text = "estimate poses live, from a camera or from a recording that is played back"
    command = commands.add("live", "lmmap.cli.live:live", text, LIVE)
    text = "recording to play, or a camera: 0, /dev/video0, rtsp://... (default: an attached event camera)"
    commands.add_recording(command, nargs="?", type=camera_or_file, help=text)
    _add_estimation(commands, command, required=False, live=True)
    command.set_defaults(modality="rgb")
    command.add_argument("--view", action="store_true", help="show the images on a local web page")
    commands.add_output(command, "poses to write as well: CSV, or .tum, .bag or .mcap by the name's ending")
    _add_frames(command)
    command.add_argument("--seconds", type=float, help="stop after this many seconds")
    _add_between(command, "with --modality event")
    command.add_argument("--json", action="store_true", help="print each pose as a line of JSON")


def _completion(commands: Commands) -> None:
    text = "print the completion script for a shell"
    command = commands.add("completion", "lmmap.cli.completion:completion", text, COMPLETION)
    command.add_argument("shell", choices=SHELLS)


def _add_frames(command) -> None:
    text = "name of the camera's optical frame (x right, y down) in a bag (default: camera)"
    command.add_argument("--frame-id", metavar="NAME", help=text)
    command.add_argument("--child-frame-id", metavar="NAME", help="name of the port's frame (default: port)")


def _add_between(command, when: str) -> None:
    text = f"{when}: between images, also track the port by its events, with this many poses per second"
    command.add_argument("--between", type=float, metavar="HZ", help=text)


def _add_flip(command) -> None:
    text = "mirror images along x or y or turn them by 180 degrees: event:x, rgb:180, or x for both cameras"
    command.add_argument("--flip", action="append", choices=FLIPS, metavar="[CAMERA:]FLIP", help=text)


def _add_estimation(commands: Commands, command, required: bool, live: bool = False) -> None:
    choices = MODALITIES if live else (*MODALITIES, "fused")
    text = "which images to use" if required else "which images to use (default: all)"
    command.add_argument("--modality", choices=choices, required=required, help=text)
    commands.add_file(command, "--port", help="geometry of another port (JSON)")
    _add_flip(command)
    if not live:  # which takes the newest image
        text = "estimates per second (default: one for every frame, or every N events)"
        command.add_argument("--rate", type=float, metavar="HZ", help=text)
    text = "events in a histogram (default: 0.39 per pixel)"
    command.add_argument("--events", type=int, metavar="N", help=text)
    text = f"set of mask networks (default: {DEFAULT_WEIGHTS})"
    networks = command.add_mutually_exclusive_group()
    commands.add_networks(networks, text)
    text = "folder of your own mask networks, in files named like those of lmmap"
    networks.add_argument("--weights", metavar="FOLDER", help=text)
