"""``lmmap info``: what a recording holds, whether it is sound, and what would be estimated from it."""

from __future__ import annotations

import json
from argparse import Namespace

from .. import plugins
from ..pipeline.rescale import is_short, trained_range_m
from ..recordings.formats import format_name
from ..types import Camera, InputError, Port
from .choices import DEFAULT_WEIGHTS
from .inputs import find_rig, open_input
from .progress import RED, add_colour

FAULTS = ("backward_steps", "frames_backward", "out_of_range", "hot_pixels")
UNKNOWN = {
    "sensor": "none that lmmap knows has this size",
    "exposure_ms": "not stated",
    "focal_px": "no calibration; give one with --camera",
}


def info(a: Namespace) -> None:
    """Print what a recording holds, and its health; faults, which are errors elsewhere, are counted here.

    No calibration is needed: without one, only the lens is unknown.
    """
    stream = open_input(a, checked=False)
    facts = {"format": format_name(a.recording), "sensor": None} | stream.source.details()
    facts |= plugins.needed("health", "info")(stream)
    if not facts["events"] and not facts["frames"]:
        raise InputError(f"{a.recording}: holds neither events nor frames; record again")
    if of_size := plugins.reader("sensors"):
        facts["sensor"] = of_size((facts["width_px"], facts["height_px"])) or None
    if facts["frames"]:
        facts.setdefault("exposure_ms", None)
    rig = find_rig(a)
    facts["truth"] = facts["truth"] or rig is not None
    facts |= _lens(stream.camera, rig.port if rig else Port.lm_map())
    facts["would_estimate"] = {"rgb": facts["frames"], "event": facts["windows"]}
    facts["networks"] = DEFAULT_WEIGHTS
    if a.json:
        print(json.dumps(facts, indent=1))
        return
    for name, value in facts.items():
        text = add_colour(_text(name, value), RED) if name in FAULTS and value else _text(name, value)
        print(f"{name.replace('_', ' '):18} {text}")


def _lens(camera: Camera | None, port: Port) -> dict:
    """The focal length, the distances from which the networks know the port through the lens, and whether
    it is as long as in the training."""
    if camera is None:
        return {"focal_px": None}
    near_far_m = [round(m, 3) for m in trained_range_m(camera, port)]
    return {"focal_px": camera.fx_px, "port_known_at_m": near_far_m, "lens_in_range": not is_short(camera)}


def _text(name: str, value) -> str:
    """A fact as it is printed for people."""
    if value is None:
        return UNKNOWN[name]
    if name == "port_known_at_m":
        return "{:.2f} to {:.2f}".format(*value)
    if name == "would_estimate":
        return f"{value['rgb']} frames (--modality rgb), {value['event']} histograms (--modality event)"
    if name.endswith("_at_s"):
        return "{:.3f} to {:.3f}".format(*value)
    if isinstance(value, list):
        return ", ".join(value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
