"""Arguments of the laboratory's subcommands: each function adds one, and is an entry point of its name."""

from __future__ import annotations

import os

from lmmap.cli.choices import DEFAULT_WEIGHTS, MODALITIES, SETS, present_set
from lmmap.cli.commands import Commands

# of modules that take seconds to import, while --help is to answer at once; tests compare them
FILTERS, PROFILES = ("ring", "reflector"), ("quick", "paper")
ADAPT_STEPS = 400
PAPERS = ("a4", "letter")
WRITTEN = (".aedat4", ".bag", ".h5", ".hdf5")  # how names of recordings end that can be written

ADAPT = """examples:
  lmmap adapt run.bag -o networks                    then: lmmap estimate run.bag --weights networks ...
  lmmap adapt run.aedat4 --modality event --seconds 30 -o networks
"""
SIMULATE = """examples:
  lmmap simulate --sequence test-medium --seconds 10 -o demo.aedat4
  lmmap simulate --sequence test-low test-high -o {}.bag
"""
DATASET = """examples:
  lmmap dataset                     what the data set is, and what each study needs of it
  lmmap dataset check recordings    which of its bags are in a folder, and whether they can be used
"""
PICTURES = """examples:
  lmmap pictures paper.pdf -o drawn                   its pictures, each at several focal lengths
  lmmap pictures photos -o drawn --modality rgb
"""
CALIBRATE = """examples:
  lmmap calibrate dataset_0307/dvs_calibration.bag --board 8x5 --square 0.03     writes camera.json
  lmmap calibrate normal__train.bag --hand-eye camera-to-robot-calibration_dvs.yaml
  lmmap calibrate T1_RA_0_ES_0_a.bag T2_RA_0_ES_1_a.bag --free -o rig.json
  lmmap calibrate clip.mp4 --focal                   a webcam's lens, from a minute of waving the port about
  lmmap calibrate own.aedat4 --port -o port.json     the dimensions of the port that it shows
"""
PRINT = """examples:
  lmmap print -o port.pdf                         two sheets; print them at 100 %
  lmmap print --paper letter --scale 0.5 -o half.pdf
  lmmap print --ruler 97.5 -o port.json           the port, if 100 mm of the ruler came out as 97.5
"""
EXPORT = """examples:
  lmmap export robust -o onnx       four networks, and lmmap.json with all else that a program needs
"""


def adapt(commands: Commands) -> None:
    text = "adapt the mask networks to the place that a recording shows, without ground truth"
    command = commands.add("adapt", "lmmap_lab.cli.adapting:run", text, ADAPT)
    commands.add_recording(command)
    text = "cameras to learn from and to adapt (default: both)"
    command.add_argument("--modality", choices=(*MODALITIES, "both"), default="both", help=text)
    commands.add_file(command, "--port", help="geometry of another port (JSON)")
    text = f"set of mask networks to begin with (default: {DEFAULT_WEIGHTS})"
    networks = command.add_mutually_exclusive_group()
    commands.add_networks(networks, text)
    text = "mask networks of your own to begin with"
    networks.add_argument("--weights", metavar="FOLDER", help=text)
    text = "learn from this many seconds of the recording (default: all)"
    command.add_argument("--seconds", type=float, help=text)
    text = "training steps for each network (default: %(default)s)"
    command.add_argument("--steps", type=int, default=ADAPT_STEPS, help=text)
    command.add_argument("--seed", type=int, default=0, help="seed of the random numbers (default: 0)")
    text = "learn even if nearly all poses are sure: the place may become harder later"
    command.add_argument("--always", action="store_true", help=text)
    text = "folder for the networks, to pass to --weights; the same call continues an interrupted one"
    commands.add_file(command, "-o", "--output", metavar="FOLDER", required=True, help=text)
    command.add_argument("--json", action="store_true", help="print the outcome as JSON")


def simulate(commands: Commands) -> None:
    text = "record sequences of the bench, and their ground truth"
    command = commands.add("simulate", "lmmap_lab.cli.bench:simulate", text, SIMULATE)
    command.add_argument("--sequence", nargs="+", metavar="NAME", help="test-low, realistic-3, ...")
    text = "write stand-ins for the authors' bags into this folder instead"
    commands.add_file(command, "--as-published", metavar="FOLDER", help=text)
    command.add_argument("--seconds", type=float, help="length of each sequence (default: the profile's)")
    profile, text = os.environ.get("PROFILE", "quick"), "sets the default lengths"
    command.add_argument("--profile", choices=PROFILES, default=profile, help=text)
    commands.add_file(command, "--camera", help="calibration of another camera, distortion included")
    command.add_argument("--jobs", type=int, default=1, help="how many sequences to simulate at once")
    command.add_argument("--scheduler", metavar="ADDRESS", help="Dask cluster that does the work")
    text = f"recording to write, ending in {', '.join(WRITTEN)}; {{}} stands for the sequence's name"
    commands.add_output(command, text)


def photometry(commands: Commands) -> None:
    text = "calibrate exposure and lamps to the paper's saturation figures"
    command = commands.add("photometry", "lmmap_lab.cli.bench:calibrate_lamps", text)
    commands.add_output(command, "JSON file for the result and its provenance")


def train(commands: Commands) -> None:
    text = "train the mask networks, or continue an interrupted training"
    command = commands.add("train", "lmmap_lab.cli.bench:train", text)
    which = "which of the two networks, or both as one network (default: each by itself)"
    command.add_argument("--filter", choices=(*FILTERS, "joint"), help=which)
    command.add_argument("--modality", choices=MODALITIES, help="which images (default: both)")
    commands.add_networks(command, "which set of networks (default: all)")
    command.add_argument("--seed", type=int, default=0, help="seed of the random numbers (default: 0)")
    command.add_argument("--steps", type=int, help="default: the shipped weights' (with --data 2000)")
    command.add_argument(
        "--start-from", type=present_set, choices=SETS, help="weights to begin with (default: none)"
    )
    commands.add_file(command, "--data", metavar="FOLDER", help="the authors' bags, instead of the bench")


def export(commands: Commands) -> None:
    text = "write mask networks in ONNX, for other runtimes; needs onnx"
    command = commands.add("export", "lmmap_lab.cli.export:export", text, EXPORT)
    text = f"a shipped set ({', '.join(SETS)}), or a folder with files named like those of lmmap"
    command.add_argument("weights", metavar="WEIGHTS", help=text)
    commands.add_file(command, "-o", "--output", required=True, metavar="FOLDER", help="folder to make")


def print(commands: Commands) -> None:  # an entry point has its command's name
    text = "write the port as two sheets of paper to print, cut out and glue"
    command = commands.add("print", "lmmap_lab.cli.paper_port:print_port", text, PRINT)
    command.add_argument("--paper", choices=PAPERS, default="a4", help="default: a4")
    commands.add_file(command, "--port", help="geometry of another port (JSON)")
    text = "size of the sheets relative to the port (default: 1)"
    command.add_argument("--scale", type=float, default=1.0, metavar="S", help=text)
    text = "measured length of the printed 100 mm ruler: write the port at this size"
    command.add_argument("--ruler", type=float, metavar="MM", help=text)
    commands.add_output(command, "PDF to write; with --ruler the port's JSON", required=True)


def reproduce(commands: Commands) -> None:
    text = "regenerate every result of the book"
    command = commands.add("reproduce", "lmmap_lab.cli.bench:reproduce", text)
    text = "sets the length of the sequences"
    command.add_argument("--profile", choices=PROFILES, default="quick", help=text)
    text = "sequences to compute at once; 12 GB each in the paper profile"
    command.add_argument("--jobs", type=int, default=1, help=text)
    text = "keep packed results of sequences that are still valid"
    command.add_argument("--go-on", action="store_true", help=text)
    commands.add_file(command, "--data", metavar="FOLDER", help="the authors' bags, instead of the bench")
    text = "with --data: also adapt the default networks to the laboratory, without labels, and test them"
    command.add_argument("--adapt", action="store_true", help=text)


def check(commands: Commands) -> None:
    text = "compare results and pages with the committed reference"
    command = commands.add("check", "lmmap_lab.cli.bench:check", text)
    does = command.add_mutually_exclusive_group()
    does.add_argument(
        "--update", action="store_true", help="make the present results and pages the reference"
    )
    text = "recompute a sample of each packed result of earlier code; if it is equal, keep the result"
    does.add_argument("--carry", action="store_true", help=text)
    text = "with --carry: compare with a checkout of the code that made the results, on any processor"
    commands.add_file(command, "--beside", metavar="CHECKOUT", help=text)


def odometry(commands: Commands) -> None:
    group = commands.add("odometry", "", "exchange recordings and trajectories with other odometries")
    actions = group.add_subparsers(required=True, metavar="ACTION")
    text = "write a ROS 1 bag, PNG images, event frames, the camera and the truth (TUM)"
    command = actions.add_parser("export", help=text, description=text)
    command.set_defaults(run="lmmap_lab.studies.odometry_files:export_command")
    commands.add_recording(command)
    commands.add_file(command, "folder", metavar="DIR")
    command.add_argument("--overwrite", action="store_true", help="write into a folder that holds files")
    text = "print the relative errors of a TUM trajectory, scaled by its first 40 poses"
    command = actions.add_parser("score", help=text, description=text)
    command.set_defaults(run="lmmap_lab.studies.odometry_files:score_command")
    text = "TUM file: t x y z qx qy qz qw, seconds and metres"
    commands.add_file(command, "trajectory", metavar=None, help=text)
    text = "recording with its truth beside it, or a trajectory (.csv, .tum, .txt)"
    commands.add_file(command, "--reference", required=True, metavar="RECORDING", help=text)
    command.add_argument("--json", action="store_true", help="print JSON")


def dataset(commands: Commands) -> None:
    text = "say where the authors published their recordings, or check a copy"
    command = commands.add("dataset", "lmmap_lab.cli.authors:dataset", text, DATASET)
    command.add_argument(
        "do", nargs="?", choices=("check",), help="check a copy (default: describe the data set)"
    )
    commands.add_file(command, "folder", nargs="?", metavar=None, help="folder of bags to check")
    command.add_argument("--json", action="store_true", help="print JSON")


def calibrate(commands: Commands) -> None:
    text = "calibrate the port's mounting on the arm, the ring's radius and the camera from the authors' bags"
    command = commands.add("calibrate", "lmmap_lab.cli.authors:calibrate", text, CALIBRATE)
    text = "bags to calibrate from, none of which you test on"
    commands.add_file(command, "bags", nargs="+", metavar="BAG", help=text)
    command.add_argument("--modality", choices=MODALITIES, default="rgb", help="default: rgb")
    text = "detections per second (default: 5)"
    command.add_argument("--rate", type=float, default=5.0, metavar="HZ", help=text)
    commands.add_file(command, "--camera", help="calibration (default: camera.json beside the bag)")
    text = "hand-eye calibration in YAML (default: the one beside the bag)"
    commands.add_file(command, "--hand-eye", help=text)
    text = "also estimate the camera's pose, whatever a file says"
    command.add_argument("--free", action="store_true", help=text)
    command.add_argument("--base", metavar="FRAME", help="the arm's base in /tf")
    command.add_argument("--effector", metavar="FRAME", help="the arm's other end in /tf")
    text = "the camera is mounted on the arm, and the port stands still"
    command.add_argument("--on-arm", action="store_true", help=text)
    text = "inner corners of a checkerboard: calibrate the camera instead"
    command.add_argument("--board", metavar="CxR", help=text)
    text = "side of the board's squares"
    command.add_argument("--square", type=float, default=0.03, metavar="M", help=text)
    text = "measure the port's dimensions instead, from one recording of any format"
    command.add_argument("--port", action="store_true", dest="measure_port", help=text)
    text = "measure the camera's focal length and first radial coefficient, from a port waved about"
    command.add_argument("--focal", action="store_true", help=f"{text}; with --port, measure both")
    commands.add_output(
        command, "default: rig.json, camera.json, port.json or CLIP.camera.json, beside the first bag"
    )
    command.add_argument("--json", action="store_true", help="print JSON")


def pictures(commands: Commands) -> None:
    text = "draw the port that each set of mask networks finds in pictures of unknown lenses"
    command = commands.add("pictures", "lmmap_lab.cli.pictures:pictures", text, PICTURES)
    commands.add_file(command, "source", metavar="PDF-or-FOLDER", help="a PDF, or a folder of pictures")
    command.add_argument("--modality", choices=MODALITIES, help="frames or histograms (default: try both)")
    commands.add_file(command, "--port", help="geometry of another port (JSON)")
    text = "folder for the drawings, one for each picture and camera"
    commands.add_output(command, text, required=True, metavar="FOLDER")
