"""The two sheets as a PDF: vectors in millimetres, true to scale."""

from __future__ import annotations

import math
from importlib.metadata import version
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from lmmap.types import InputError, Port
from lmmap_readers.rig import scale_port

from . import net

PAPERS_MM = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
MARGIN_MM = 5.0  # which most printers leave white
FOOTER_MM = 58.0  # ruler and text
DARK_MM = 6.0  # of black around the ring, at least
RULER_MM = 100
LEAST_MARKER_MM = 1.0
GUIDE = "0.35"  # grey of lines on black, which show on paper and hardly in an image
STEPS = (
    "1  Print both sheets at 100 % on matt card. If the ruler is not 100 mm long: lmmap print --ruler LENGTH",
    "2  Sheet 1: cut out the black square, and glue it flat onto cardboard.",
    "3  Sheet 2: cut along the outline. Score the dashed lines; fold walls and grey tabs back, feet outward.",
    "4  Glue each grey tab behind the next wall. The plate now stands on its feet.",
    "5  Glue the feet onto the thin outline inside the ring, the white markers at the three ticks.",
)


def write_sheets(path: Path, port: Port, paper: str, name: str, scale: float) -> None:
    """Write the ring and the fold-up plate of a port that has its size on paper.

    Parameters
    ----------
    name, scale
        Printed on each sheet: the file of the unscaled port, and what it was scaled by.

    """
    size_mm, whole = np.array(PAPERS_MM[paper]), BytesIO()  # on a full disk matplotlib goes on, and trips
    with PdfPages(whole, metadata={"Title": f"lmmap: {name}", "CreationDate": None}) as pdf:
        for number, draw in enumerate((_ring_sheet, _plate_sheet), 1):
            figure = Figure(figsize=size_mm / 25.4, facecolor="none", layout="none")
            ax = figure.add_axes((0, 0, 1, 1))
            ax.set(xlim=(0, size_mm[0]), ylim=(0, size_mm[1]))
            ax.set_axis_off()
            draw(ax, port, size_mm)
            _footer(
                ax,
                f"sheet {number} of 2   port: {name}   scale {scale:g}   {paper}   lmmap {version('lmmap')}",
            )
            pdf.savefig(figure)
    path.write_bytes(whole.getvalue())


def check(path: Path, port: Port, paper: str, scale: float) -> None:
    """`InputError`, naming ``path``, unless the port can be folded from paper and both sheets fit; where they
    do not, it states the scale that does."""
    length, depth = 1e3 * np.array(port.marker_size_m)
    if min(length, depth) < LEAST_MARKER_MM:
        raise InputError(f"{path}: markers of {length:.2g} x {depth:.2g} mm, expected at least "
                         f"{LEAST_MARKER_MM:g} mm; without markers there is no rotation")  # fmt: skip
    if port.plate_height_m < 0:
        below_mm = -1e3 * port.plate_height_m
        raise InputError(f"{path}: a plate {below_mm:.1f} mm below the ring, expected at least level with "
                         "it; paper cannot be folded into a hole")  # fmt: skip
    half_side = net.paper_apothem_m(port) * math.tan(math.pi / net.plate_sides(port))
    if port.marker_size_m[0] / 2 > half_side or net.paper_apothem_m(port) > port.ring_inner_radius_m:
        raise InputError(
            f"{path}: the markers leave the plate, or the plate the ring; check the port's sizes"
        )
    if not _fits(port, paper):
        room = _room_mm(np.array(PAPERS_MM[paper]))
        smaller = (
            f for f in np.arange(99, 0, -1) / 100 if _fits(scale_port(port, f * port.ring_radius_m), paper)
        )
        largest = math.floor(100 * scale * next(smaller, 0.01)) / 100
        raise InputError(f"{path}: the port does not fit on {paper}, which has room for {room[0]:.0f} x "
                         f"{room[1]:.0f} mm; give --scale {largest:g}")  # fmt: skip


def _fits(port: Port, paper: str) -> bool:
    """Whether the ring with its dark margin and the net of the plate fit above the footer."""
    ring_mm = 2e3 * port.ring_outer_radius_m + 2 * DARK_MM
    net_mm = 2e3 * np.abs(np.concatenate([face.corners_m for face in net.plate_net(port)])).max(0)
    return bool(np.all(np.maximum(ring_mm, net_mm) <= _room_mm(np.array(PAPERS_MM[paper]))))


def _room_mm(size_mm: np.ndarray) -> np.ndarray:
    return size_mm - 2 * MARGIN_MM - [0, FOOTER_MM]


def _centre_mm(size_mm: np.ndarray) -> np.ndarray:
    """The middle of the room above the footer."""
    return np.array([size_mm[0] / 2, size_mm[1] - MARGIN_MM - _room_mm(size_mm)[1] / 2])


def _ring_sheet(ax, port: Port, size_mm) -> None:
    """The ring on a black square, and where the plate's feet go."""
    centre, half = _centre_mm(size_mm), _room_mm(size_mm).min() / 2
    square = centre + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    ax.add_patch(Polygon(square, facecolor="black", linewidth=0))
    for radius_m, colour in ((port.ring_outer_radius_m, "white"), (port.ring_inner_radius_m, "black")):
        ax.add_patch(Circle(centre, 1e3 * radius_m, facecolor=colour, linewidth=0))
    plate = 1e3 * net.plate_net(port)[0].corners_m
    ax.add_patch(Polygon(centre + plate, fill=False, edgecolor=GUIDE, linewidth=0.4))
    for k in range(port.symmetry):
        direction = np.array([math.cos(k * port.yaw_period_rad), math.sin(k * port.yaw_period_rad)])
        ends = centre + 1e3 * np.multiply.outer([0.92, 1.0], net.paper_apothem_m(port) * direction)
        ax.plot(*ends.T, color=GUIDE, linewidth=0.8)


def _plate_sheet(ax, port: Port, size_mm) -> None:
    """The net of the plate with its markers."""
    centre, faces = _centre_mm(size_mm), net.plate_net(port)
    for face in faces:
        grey = face.kind == net.TAB
        ax.add_patch(Polygon(centre + 1e3 * face.corners_m, facecolor="0.8" if grey else "black",
                             edgecolor="0.5" if grey else "black", linewidth=0.3))  # fmt: skip
        if grey:
            middle = centre + 1e3 * face.corners_m.mean(0)
            along = face.corners_m[1] - face.corners_m[0]
            turn = (math.degrees(math.atan2(along[1], along[0])) + 90) % 180 - 90
            ax.text(*middle, "glue", rotation=turn, ha="center", va="center", fontsize=7)
    for face in faces[1:]:
        ax.plot(*(centre + 1e3 * face.corners_m[:2]).T, color="0.6", linewidth=0.4, dashes=(6, 4))
    for corners in port.marker_corners_m():
        ax.add_patch(Polygon(centre + 1e3 * corners[:, :2], facecolor="white", linewidth=0))


def _footer(ax, text: str) -> None:
    """A ruler of 100 mm, the five steps and what this is."""
    left, base = MARGIN_MM + 7, MARGIN_MM + 46
    ax.plot([left, left + RULER_MM], [base, base], color="black", linewidth=0.5)
    for mm in range(RULER_MM + 1):
        height = 5 if mm % 50 == 0 else 3.5 if mm % 10 == 0 else 2
        ax.plot([left + mm, left + mm], [base, base + height], color="black", linewidth=0.3)
    ax.text(left + RULER_MM + 4, base, "100 mm: measure it", fontsize=9, va="bottom")
    for k, line in enumerate(STEPS):
        ax.text(left, base - 5 - 7 * k, line, fontsize=8.5, va="top")
    ax.text(left, MARGIN_MM + 1, text, fontsize=8, va="bottom", color="0.3")
