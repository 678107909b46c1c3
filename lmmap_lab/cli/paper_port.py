"""``lmmap print``: the sheets of a paper port, or its dimensions as printed."""

from __future__ import annotations

from argparse import Namespace

from lmmap.cli.inputs import leave_out
from lmmap.files import atomic, check_output
from lmmap.types import InputError, Port
from lmmap_readers.rig import scale_port

from ..paper_port.sheets import RULER_MM, check, write_sheets

SCALES, RULERS_MM = (0.05, 20.0), (50.0, 150.0)


def print_port(a: Namespace) -> None:
    """Write the sheets as a PDF or, for a ruler that was measured, the port's JSON."""
    check_range("--scale", a.scale, SCALES, "a scale")
    if a.ruler is not None:
        check_range("--ruler", a.ruler, RULERS_MM, "the printed ruler's length in mm")
        leave_out(a, "--ruler: writes the port, not its sheets", "paper")
    wanted = ".pdf" if a.ruler is None else ".json"
    if a.output.suffix.lower() != wanted:
        what = "the sheets are a PDF" if a.ruler is None else "with --ruler it is the port"
        raise InputError(f"{a.output}: {what}; name it *{wanted}")
    output = check_output(a.output, [a.port], overwrite=a.overwrite)
    port = Port.load(a.port) if a.port else Port.lm_map()
    printed = scale_port(port, port.ring_radius_m * a.scale * (a.ruler or RULER_MM) / RULER_MM)
    if a.ruler is not None:
        printed.save(output)
    else:
        check(output, printed, a.paper, a.scale)
        with atomic(output) as temporary:
            write_sheets(temporary, printed, a.paper, a.port.name if a.port else "LM-MAP", a.scale)
    ring_mm = f"its ring is {2e3 * printed.ring_outer_radius_m:.1f} mm wide"
    if a.ruler is not None:
        print(f"{output}: {ring_mm}; give it as --port {output}")
        return
    print(f"{output}: two sheets of {a.paper}; {ring_mm}")
    if a.scale != 1 or a.port:
        given = f" --port {a.port}" if a.port else ""
        command = f"lmmap print{given} --scale {a.scale:g} --ruler 100 -o port.json"
        print(f"this is not the built-in port: run '{command}', then give --port port.json")


def check_range(name: str, value: float, limits: tuple[float, float], what: str) -> None:
    """Raise `InputError` unless an option's value lies within its limits."""
    if not limits[0] <= value <= limits[1]:
        raise InputError(f"{name} {value:g}: give {what} between {limits[0]:g} and {limits[1]:g}")
