"""``lmmap calibrate CLIP --focal``: a camera's focal length from a port that is waved in front of it."""

from __future__ import annotations

import json
import math
import warnings
from argparse import Namespace
from dataclasses import replace

from lmmap.files import check_output
from lmmap.recordings.formats import open_stream
from lmmap.settings import OURS
from lmmap.types import InputError, Port
from lmmap_readers.webcam import assumed

from ..rig.lens import Lens, measure_lens

DOUBTFUL = 0.03  # standard deviation of the focal length, in units of it
SIGMAS_95 = 1.96


def calibrate_lens(a: Namespace) -> None:
    """Write a camera's file beside the clip, and print how well the camera is known."""
    if len(a.bags) > 1 or a.modality != "rgb":
        raise InputError("--focal: measures from the frames of one recording; give one, and no --modality")
    path = a.bags[0]
    output = check_output(
        a.output or path.with_suffix(".camera.json"), [path, a.camera], overwrite=a.overwrite
    )
    stream = open_stream(path, a.camera, checked=False)
    if not (stream.camera or stream.source.size_px):
        raise InputError(f"{path}: holds no frames; give a video")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the start is assumed
        camera = stream.camera or assumed(stream.source.size_px, path)
    stream = replace(stream, name=str(path), camera=camera, checked=True)
    lens = measure_lens(stream, Port.lm_map(), OURS.weights, a.rate)
    lens.camera.save(output)
    print(json.dumps(facts(lens), indent=1) if a.json else f"{output}: {describe(lens)}")
    if not lens.settled or lens.focal_sigma_px > DOUBTFUL * lens.camera.fx_px:
        text = "the views hardly determine the focal length: record tilted ones, near, far and in all corners"
        warnings.warn(text, stacklevel=2)


def facts(lens: Lens) -> dict:
    """The measured values and their 95 % intervals."""
    f, margin = lens.camera.fx_px, SIGMAS_95 * lens.focal_sigma_px
    return {
        "focal_px": f, "focal_95_px": [f - margin, f + margin],
        "view_deg": math.degrees(2 * math.atan(lens.camera.width_px / (2 * f))),
        "k1": lens.camera.distortion[0] if lens.k1_known else None, "k1_sigma": lens.k1_sigma,
        "images": lens.images, "agree": lens.agree,
    }  # fmt: skip


def describe(lens: Lens) -> str:
    """The measured values and their 95 % intervals in one line."""
    found = facts(lens)
    low, high = found["focal_95_px"]
    k1 = f"k1 {found['k1']:+.3f} +- {SIGMAS_95 * lens.k1_sigma:.3f}" if lens.k1_known else "k1 is not known"
    return (f"focal length {found['focal_px']:.1f} px (95 %: {low:.1f} to {high:.1f}), a view of "
            f"{found['view_deg']:.1f} degrees; {k1}; {lens.agree} of {lens.images} images agree")  # fmt: skip
