"""``lmmap calibrate --port``: the dimensions of a port, measured from a recording of it."""

from __future__ import annotations

import json
import warnings
from argparse import Namespace
from dataclasses import replace

from lmmap.cli.inputs import input_files
from lmmap.files import check_output
from lmmap.recordings.formats import open_stream
from lmmap.types import InputError, Port

from ..rig import port_views
from ..rig.port_calibration import PortFit
from ..rig.port_outline import DIMENSIONS, dimensions_m, windows_share

PORT_FILE = "port.json"


def calibrate_port(a: Namespace) -> None:
    """Write a port's file, and print a table of what was measured."""
    if len(a.bags) > 1:
        raise InputError(
            f"--port: measures from one recording, got {len(a.bags)}; give the one of most views"
        )
    path, standard = a.bags[0], Port.lm_map()
    output = check_output(a.output or path.parent / PORT_FILE, input_files(a), overwrite=a.overwrite)
    stream = open_stream(path, a.camera)
    span, rate_hz = stream.source.span_us, a.rate
    if span and span[1] > span[0]:
        rate_hz = min(rate_hz, port_views.MOST_LOOKED_AT / (1e-6 * (span[1] - span[0])))
    fit, views = port_views.measure_port(
        replace(stream, name=str(path)), standard, a.modality, rate_hz=rate_hz, focal=a.focal
    )
    fit.port.save(output)
    focal_px = stream.camera.fx_px if a.focal else None
    if a.json:
        print(json.dumps(facts(fit, views, standard, focal_px), indent=1))
    else:
        print(f"{output}: {describe(fit, views, standard, focal_px)}")
    for line in port_views.undetermined(fit, a.focal):
        warnings.warn(line, stacklevel=2)


def facts(fit: PortFit, views: port_views.Views, standard: Port, focal_px: float | None) -> dict:
    """What was measured: value, standard deviation and the standard port's value of each dimension, in
    metres, and of the focal length along x, in pixels."""
    values = zip(dimensions_m(fit.port), fit.sigma_m, dimensions_m(standard), strict=True)
    rows = {f"{name}, m": list(map(float, row)) for name, row in zip(DIMENSIONS, values, strict=True)}
    if focal_px is not None:
        rows["focal length, px"] = [focal_px * fit.focal_ratio, focal_px * fit.focal_ratio_sigma, focal_px]
    return {
        "dimensions": {name: dict(zip(("value", "sigma", "standard"), row, strict=True))
                       for name, row in rows.items()},
        "images": views.statuses.total(), "measured": len(fit.kept), "agree": int(fit.kept.sum()),
        "mask_offset_px": fit.offset_px.tolist(), "edge_sigma_px": fit.residual_px.tolist(),
    }  # fmt: skip


def describe(fit: PortFit, views: port_views.Views, standard: Port, focal_px: float | None) -> str:
    """The measured dimensions in a table, in millimetres and pixels, and a note of what was not measured."""
    found = facts(fit, views, standard, focal_px)
    lines = [
        f"{found['agree']} of {found['measured']} chosen images agree, of {found['images']} looked at",
        f"{'':20}{'measured':>12}{'+-':>8}{'standard':>12}",
    ]
    for name, row in found["dimensions"].items():
        name, unit = name.split(", ")
        scale, unit = (1e3, "mm") if unit == "m" else (1, unit)
        value, sigma, usual = (scale * row[key] for key in ("value", "sigma", "standard"))
        lines.append(f"{name:20}{value:9.2f} {unit}{sigma:8.2f}{usual:9.2f} {unit}")
    lines.append(
        f"the ring's centre line keeps its {1e3 * fit.port.ring_radius_m:.1f} mm, which no image shows; the "
        f"plate's circumradius follows the markers to {1e3 * fit.port.plate_circumradius_m:.1f} mm; all else "
        "is the standard port's"
    )
    if (share := windows_share(fit.port, standard)) < 0.999:
        lines.append(f"its windows would overlap the markers, so they are drawn at {share:.0%} of their size")
    return "\n  ".join(lines)
