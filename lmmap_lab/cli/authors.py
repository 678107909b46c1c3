"""What the ``lmmap`` command does with the authors' recordings: dataset, calibrate, stand-ins."""

from __future__ import annotations

import json
import os
import re
import sys
import warnings
from argparse import Namespace
from collections import Counter
from itertools import product
from pathlib import Path

from tqdm import tqdm

from lmmap.cli.inputs import check_rate, leave_out
from lmmap.files import CAMERA, check_output, write_text
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import settings_for
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import FILTERS, weight_path
from lmmap.recordings.formats import open_stream
from lmmap.recordings.images import TIME_LISTS, pictures_in
from lmmap.recordings.stream import Stream
from lmmap.types import Camera, InputError, Port
from lmmap_readers.rig import RIG_FILE

from ..pages import beside_paper
from ..provenance import DERIVED_DATA
from ..rig import authors_bags, calibration, checkerboard, standin, tf
from ..rig.hand_eye_file import HandEyeFile, read_hand_eye
from ..studies import bag_estimates, on_authors_bags, table1
from ..training.recipe import FAST, Recipe
from . import measured_lens, measured_port


def dataset(a: Namespace) -> None:
    """Print what the data set is, or which of its bags a folder holds."""
    if a.do and not a.folder:
        raise InputError("dataset check: no folder given; name the one with the bags")
    if not a.do:
        leave_out(a, "dataset: what the data set is, is a text; without check", "json")
        print(f"The authors' recordings: University of Sydney eScholarship, {authors_bags.HANDLE}")
        print("about 144.5 GB of ROS 1 bags: /dvs/events and /dvs/image_raw (DAVIS 346), /tf "
              "and /joint_states (UR5e)\n")  # fmt: skip
        for line in (("study", "needs", "size"), *authors_bags.STUDIES):
            print("{:34}{:60}{}".format(*line))
        print("\nThen: lmmap dataset check FOLDER; lmmap calibrate BAG; make reproduce DATA=FOLDER")
        return
    count = len(authors_bags.list_bags(a.folder))
    rows = list(tqdm(authors_bags.check_bags(a.folder), "check", count, disable=None))
    if a.json:
        print(json.dumps(rows, indent=1))
    else:
        for r in rows:
            size = f"{r['gigabytes']:.2f} GB" if r["gigabytes"] >= 0.1 else f"{1e3 * r['gigabytes']:.0f} MB"
            length = f"{r['seconds']:.1f} s" if r["seconds"] is not None else ""
            print(
                f"{r['bag']:50} {size:>9} {length:>9}  {r['role']:12}{r['light']:8}{r['problem'] or 'usable'}"
            )
    good = [r for r in rows if not r["problem"]]
    have = Counter(r["role"] for r in good)
    hand_eye = authors_bags.hand_eye_file(a.folder)
    kinds = ", ".join(f"{n} {kind}" for kind, n in have.items()) or "none"
    where = hand_eye.relative_to(a.folder) if hand_eye else "none, the camera will be estimated"
    text = f"{len(good)} of {len(rows)} bags usable: {kinds}; hand-eye file: {where}"
    print(text, file=sys.stderr if a.json else sys.stdout)


def calibrate(a: Namespace) -> None:
    """Calibrate a rig from bags, a camera from a checkerboard, or a port or a lens from a recording."""
    of_rig = "hand_eye", "free", "base", "effector", "on_arm"
    if a.measure_port or a.focal:
        what = "--port: measures a port" if a.measure_port else "--focal: measures a lens"
        leave_out(a, f"{what}, not a rig", "board", "square", *of_rig)
        check_rate("--rate", a.rate, "images")
        (measured_port.calibrate_port if a.measure_port else measured_lens.calibrate_lens)(a)
        return
    if a.board:
        leave_out(a, "--board: calibrates a camera, no rig", "modality", "rate", *of_rig)
        calibrate_board(a)
        return
    leave_out(a, "calibrate: no --board is given", "square")
    check_rate("--rate", a.rate, "detections")
    output = check_output(a.output or a.bags[0].parent / RIG_FILE, _inputs(a), overwrite=a.overwrite)
    hand_eye = _hand_eye(a)
    camera, port, detections = Camera.load(a.camera) if a.camera else None, Port.lm_map(), []
    motions = [tf.arm_motion(path, *ends) for path in a.bags for ends in [_ends(a, path, hand_eye)]]
    for path, motion in zip(a.bags, motions, strict=True):  # an arm that is missing is said before the work
        stream = open_stream(path, camera)
        estimator = Estimator(stream.camera, port, a.modality, "low", settings_for(stream.camera))
        kept = output.with_name(f"{output.stem}.{path.stem}-{a.modality}.csv")
        kept = bag_estimates.resumable_file(kept, path, a.rate, stream.camera)
        estimates = bag_estimates.detect(stream, estimator, a.rate, kept)
        if not estimates:
            raise InputError(f"{path}: holds no images for --modality {a.modality}; try the other")
        detections.append(calibration.collect_detections(estimates, motion))
    known = hand_eye.T_frame_cam.inverse if hand_eye and not a.free else None
    rig = calibration.calibrate_rig(detections, port, _ends(a, a.bags[0], hand_eye), known)
    rig.calibration["recordings"] = [path.name for path in a.bags]
    rig.save(output)
    if a.json:
        print(output.read_text(), end="")
    else:
        print(f"{output}: {describe(rig)}")


def describe(rig) -> str:
    """Describe a calibration in a few lines."""
    f, T = rig.calibration, rig.T_tip_port
    lines = [
        f"port on {rig.tip} at ({', '.join(f'{1e3 * v:.1f}' for v in T.position_m)}) mm, "
        f"known to {f['port_sigma_mm']:.1f} mm and {f['port_sigma_deg']:.2f} deg (yaw modulo 120)",
        f"ring's radius {1e3 * rig.ring_radius_m:.2f} mm, known to {f['radius_sigma_percent']:.2f} %; "
        f"arm's clock {1e3 * rig.delay_s:+.1f} ms, known to {f['delay_sigma_ms']:.1f} ms",
        f"camera {f['camera']}",
        f"{f['detections']} detections, {f['kept_percent']:.0f} % kept; held out, they miss by "
        f"{f['held_out_position_median_mm']:.1f} mm and {f['held_out_rotation_median_deg']:.2f} deg (median)",
    ]  # fmt: skip
    if "file_differs_mm" in f:
        lines[2] += (
            f", {f['file_differs_mm']:.0f} mm and {f['file_differs_deg']:.1f} deg from our own estimate"
        )
    elif f["camera_sigma_mm"]:
        lines[2] += f", known to {f['camera_sigma_mm']:.1f} mm and {f['camera_sigma_deg']:.2f} deg"
    if f.get("file_in_doubt"):
        lines.append("the hand-eye file and the detections do not agree: look at its frames, or use --free")
    return "\n  ".join(lines)


def calibrate_board(a: Namespace) -> None:
    """Calibrate a camera's intrinsics from recordings of a checkerboard."""
    size = re.fullmatch(r"(\d+)x(\d+)", a.board)
    if not size or min(map(int, size.groups())) < 3:
        raise InputError(
            f"--board {a.board}: give its inner corners as COLUMNSxROWS, such as 8x5, at least 3 each way"
        )
    output = check_output(a.output or a.bags[0].parent / CAMERA, _inputs(a), overwrite=a.overwrite)
    streams = [_views_of_board(path, a.camera) for path in a.bags]
    frames = (shot for stream in streams for shot in stream.timed_frames())
    frames = tqdm(frames, "checkerboard", unit=" frames", disable=None)
    try:
        camera, facts = checkerboard.calibrate_intrinsics(frames, tuple(map(int, size.groups())), a.square)
    except ValueError as error:
        names = ", ".join(map(str, a.bags))
        raise InputError(f"{names}: {error}; check --board, or record it nearer and longer") from None
    camera.save(output)
    if (corner_px := facts["corner_sigma_px"]) > checkerboard.WORST_CORNER_PX:
        text = f"the lens's distortion is known to {corner_px:.1f} px only at the image's corners"
        warnings.warn(f"{output}: {text}; show the board there, too", stacklevel=2)
    text = f"{facts['views']} views, {facts['rms_px']:.2f} px left; fx known to {facts['sigma_px'][0]:.1f} px"
    print(json.dumps(facts) if a.json else f"{output}: {text}")


def _views_of_board(path: Path, camera) -> Stream:
    """A recording of a board; pictures need no times, and a camera no calibration from before."""
    untimed = path.is_dir() and pictures_in(path) and not any((path / name).is_file() for name in TIME_LISTS)
    with warnings.catch_warnings():
        if camera is None:
            warnings.filterwarnings("ignore", ".* calibration ")
        return open_stream(path, camera, checked=camera is not None, fps=1.0 if untimed else None)


def _inputs(a: Namespace) -> list[Path | None]:
    return [*a.bags, a.camera, a.hand_eye]


def _hand_eye(a: Namespace) -> HandEyeFile | None:
    path = a.hand_eye or next((f for p in list(Path(os.path.realpath(a.bags[0])).parents)[:2]
                               if (f := authors_bags.hand_eye_file(p, deep=False))), None)  # fmt: skip
    return read_hand_eye(path) if path else None


def _ends(a: Namespace, path: Path, hand_eye: HandEyeFile | None) -> tuple[str, str]:
    """The arm's (root, tip) by the command line, else by the hand-eye file, else as a UR names them."""
    base, effector = (hand_eye.base, hand_eye.effector) if hand_eye else tf.arm_ends(path)
    base, effector = a.base or base, a.effector or effector
    on_arm = a.on_arm or bool(hand_eye and hand_eye.on_arm)
    return (effector, base) if on_arm else (base, effector)


def simulate(a: Namespace) -> None:
    """Write stand-ins for the published recordings."""
    if a.seconds is not None and not 0.2 <= a.seconds <= 60:
        raise InputError(f"--seconds {a.seconds:g}: the stand-in's arm follows for 0.2 to 60 s")
    standin.write_set(a.as_published, a.seconds or 6.0)


def train(a: Namespace) -> None:
    """Train filters on a folder of bags, and keep them where ``reproduce --data`` looks for them."""
    from ..training import train  # torch's optimisers take a second to import

    chosen = {"steps": a.steps or 2000, "start_from": a.start_from or ""}
    chosen |= {} if a.start_from else {"rate": FAST}
    gaps = [a.networks] if a.networks else table1.DOMAIN_GAPS
    names, modalities = [a.filter] if a.filter else FILTERS, [a.modality] if a.modality else CHANNELS
    for gap in gaps:
        pieces, folder = on_authors_bags.training_set(a.data, gap, lambda line: print(line, flush=True))
        out = on_authors_bags.output(a.data) / f"weights-{gap}"
        for name, modality in product(names, modalities):
            recipe = Recipe(name, modality, gap, a.seed, **chosen, data=out.parent.name)
            path = out / weight_path(name, modality, "low").name  # as `Estimator` looks for a folder's
            train.train(recipe, folder, lambda line: print(line, flush=True), path, pieces)
            print(f"{path}: written")


def reproduce(a: Namespace) -> None:
    """Run the paper's studies on a folder of bags, and print the table at the end."""
    out = on_authors_bags.reproduce(a.data, lambda line: print(line, flush=True), a.adapt)
    text = beside_paper.results_text(out, DERIVED_DATA / a.profile)
    write_text(out / "told.txt", text + "\n")
    print(f"\n{text}")
