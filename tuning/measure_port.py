"""Measures the port on the pictures that its authors drew their estimate on, in green, with their own model.

    python tuning/measure_port.py FOLDER

FOLDER holds the pictures, or is the paper's PDF.  Every picture with the port's lines in green is used, and
two are needed; they are the authors' and do not ship.  A wire model is fitted to all of them together, one
pose a picture and one geometry, with the focal length of the bench's camera.  Other focal lengths show what
depends on it.  A picture is taken as the sensor's whole width: the enlargement of 16 / 13 that repeated rows
and columns show in the two would be a focal length 0.4 % longer.

Values and intervals come from draws, with replacement, of the pieces of line that count.  Each draw has its
own way to tell a line's pixels, and its fit begins at a place of its own: lines that all but coincide,
as the plate's sides and the markers' outer edges, change places at no cost.  The value is the draws' mean.

Programs that fill polygons fill the pixels that their sides run through, so a window's sides are taken to run
through the centres of its outermost pixels, as lines do.  The windows in the paper's line drawing and in the
photograph of the mock-up are of that size, too.  If the fill ended at the outer sides of its pixels, windows
would be half a pixel larger all around, and their intervals reach as far as that.

The tables are data/results/port.csv, in units of the ring's outer radius and in mm, and port-outlines.json,
the pixels and the fitted lines.  It takes a minute.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import green_lines
import numpy as np
import pandas as pd
from wire_fit import FOCAL_PX, SEED, Fit, Overlay, at_focal, beside, measured
from wire_model import COUNT, DIMENSIONS, PIECE_COUNT, SEGMENTS

from lmmap.errors import InputError
from lmmap_lab.provenance import DATA, save_json, save_table
from lmmap_lab.studies.pdf import pictures

TABLE, OUTLINES = (DATA / "results" / name for name in ("port.csv", "port-outlines.json"))
FOCALS_PX = (424, 383, 345, FOCAL_PX, 310, 277)  # lenses of 7.8 to 5.1 mm
RING_MM = 80.0  # the paper's nu, the radius of the ring's centre line
DRAWS = 80
# Port.lm_map() before this measurement: read off the paper's line drawing, its height guessed by eye
DRAWING_OUTER_M = 0.0876
DRAWING_M = {
    "ring_inner": 0.0724, "plate_height": 0.046, "marker_inner": 0.0283, "marker_outer": 0.0447,
    "marker_half_length": 0.02545, "plate_circumradius": 0.052, "petal_rise": 0.029, "petal_lean": 0.0136,
    "petal_half_width_at_plate": 0.026, "petal_half_width_at_tip": 0.016,
}  # fmt: skip
# on the same drawing, in units of the ring's outer radius; that model had no windows
WINDOWS = {"window_centre": 0.303, "window_half_radial": 0.106, "window_half_tangential": 0.129}
# another fit to the same two pictures, by other code, with the decimals that it states
EARLIER = {
    "ring_inner": "0.791", "plate_height": "0.404", "marker_inner": "0.350", "marker_outer": "0.530",
    "marker_half_length": "0.300", "plate_circumradius": "0.61", "window_centre": "0.355",
    "window_half_radial": "0.115", "window_half_tangential": "0.14", "petal_rise": "0.287",
    "petal_lean": "0.139", "petal_half_width_at_plate": "0.283", "petal_half_width_at_tip": "0.126",
}  # fmt: skip
DRAWING = {name: value_m / DRAWING_OUTER_M for name, value_m in DRAWING_M.items()}
START = np.array([(DRAWING | WINDOWS)[name] for name in DIMENSIONS])


def say(line: str) -> None:
    print(f"port: {line}", flush=True)


def seen_in(source: Path) -> list[list[Overlay]]:
    """The overlays in a folder or PDF, once for each of the ways to see green lines.

    Raises
    ------
    InputError
        If there are fewer than two.
    """
    found = [(name, picture) for name, picture in pictures(source) if green_lines.overlay(name, picture)]
    if len(found) < 2:
        what = f"only {found[0][0]} has" if found else "no picture has"
        raise InputError(f"{source}: {what} the port's lines drawn in green; give two such pictures or more")
    say(f"used {', '.join(name for name, _ in found)}")
    seen = [[green_lines.overlay(*picture, way) for picture in found] for way in green_lines.WAYS]
    return [overlays for overlays in seen if all(overlays)]


def drawn_anew(seen: list[list[Overlay]], x, draws: int) -> np.ndarray:
    """All unknowns (D, ...) from pieces of line drawn with replacement.

    Each draw sees green in one of the ways, and its fit begins beside ``x``.
    """
    rng, fits, values = np.random.default_rng(SEED), [Fit(overlays) for overlays in seen], []
    pieces, total = [fit.pieces(x) for fit in fits], PIECE_COUNT * len(seen[0])
    free = np.arange(len(x)) < len(x) - 1
    for draw in range(draws):
        way = rng.integers(len(fits))
        times = np.bincount(rng.integers(0, total, total), minlength=total)
        rows = np.repeat(np.arange(len(pieces[way])), times[pieces[way]])
        found, _ = fits[way].solve(beside(x, rng), free, rows, steps=15)
        values.append(found)
        if (draw + 1) % 10 == 0:
            say(f"{draw + 1} of {draws} draws")
    return np.array(values)


def fills_larger(x) -> np.ndarray:
    """How much larger each dimension is if filled windows end at the outer sides of their pixels, (13,)."""
    pixel = np.mean(x[COUNT + 5 : -1 : 6]) / np.exp(x[-1])  # in units of the ring's outer radius
    return np.char.startswith(DIMENSIONS, "window_half") * pixel / 2


def in_mm(dimensions) -> np.ndarray:
    """Dimensions (..., 13) in mm: the ring's centre line, between its circles, has the radius `RING_MM`."""
    return dimensions * (2 * RING_MM / (1 + np.asarray(dimensions)[..., :1]))


def table(draws, larger, by_focal) -> pd.DataFrame:
    """A row for each dimension, from draws (D, 13), `fills_larger`, and what focal lengths change (F, 13).

    An earlier figure is within an interval if a number is that would be rounded to it.
    """
    value, names = draws.mean(0), pd.Series(DIMENSIONS)
    low, high = np.percentile(draws, 2.5, 0), np.percentile(draws + larger, 97.5, 0)
    mm_low, mm_high = np.percentile(in_mm(draws), 2.5, 0), np.percentile(in_mm(draws + larger), 97.5, 0)
    rows = pd.DataFrame({
        "dimension": names, "drawing": names.map(DRAWING), "overlays": value, "low": low, "high": high,
        "focal_low": value + by_focal.min(0), "focal_high": value + by_focal.max(0),
        "mm": in_mm(value), "mm_low": mm_low, "mm_high": mm_high,
        "earlier_fit": names.map(EARLIER).astype(float),
    })  # fmt: skip
    half = np.array([0.5 * 10.0 ** -len(EARLIER[name].partition(".")[2]) for name in DIMENSIONS])
    return rows.assign(within_interval=rows.earlier_fit.between(rows.low - half, rows.high + half))


def outlines(overlays: list[Overlay], x) -> dict[str, dict]:
    """By picture, the pixels that were used and the fitted lines, in pixels of a DAVIS 346."""
    breaks = 1 + np.flatnonzero(SEGMENTS[1:, 0] != SEGMENTS[:-1, 1])
    lines = [np.append(part[:, 0], part[-1, 1]) for part in np.split(SEGMENTS, breaks)]
    corners_px = [Fit(overlays).corners_px(x, k) for k in range(len(overlays))]
    return {
        seen.name: {"lines": _text(seen.lines_px), "windows": _text(seen.windows_px),
                    "model": [_text(corners[line]) for line in lines]}
        for seen, corners in zip(overlays, corners_px, strict=True)
    }  # fmt: skip


def _text(points_px) -> str:
    return " ".join(f"{u:.1f},{v:.1f}" for u, v in points_px)


def run(source: Path) -> None:
    """Measure, print and write; raises `InputError`."""
    seen = seen_in(source)
    overlays = seen[0]
    x = measured(overlays, START)
    median_px = [float(np.median(pairs.distance_px)) for pairs in Fit(overlays).pairs(x)]
    say(f"median distances {', '.join(f'{d:.2f}' for d in median_px)} px of a DAVIS 346")
    there, costs, by_focal = x, {}, {}
    for focal_px in FOCALS_PX:
        there, costs[f"{focal_px:.0f}"] = at_focal(overlays, there, focal_px)
        by_focal[focal_px] = there
        say(f"focal length {focal_px:.0f} px: cost {costs[f'{focal_px:.0f}']:.1f}, plate {there[1]:.3f} high")
    best_px = min(by_focal, key=lambda focal_px: costs[f"{focal_px:.0f}"])
    there, costs["free"] = at_focal(overlays, by_focal[best_px], None)
    say(f"free, {np.exp(there[-1]):.0f} px: cost {costs['free']:.1f}, plate {there[1]:.3f} high")
    changes = (np.array(list(by_focal.values())) - by_focal[FOCAL_PX])[:, :COUNT]
    rows = table(drawn_anew(seen, x, DRAWS)[:, :COUNT], fills_larger(x), changes)
    print(rows.to_string(index=False, float_format="%.3f"))
    save_table(TABLE, rows, pictures=[overlay.name for overlay in overlays], focal_px=FOCAL_PX, draws=DRAWS,
               free_focal_px=round(float(np.exp(there[-1])), 1), seed=SEED,
               costs={name: round(cost, 1) for name, cost in costs.items()},
               median_distances_px=np.round(median_px, 3).tolist())  # fmt: skip
    save_json(OUTLINES, outlines(overlays, x))


def main() -> None:
    parser = argparse.ArgumentParser(description="Measures the port on its authors' overlays.")
    parser.add_argument("source", metavar="FOLDER", type=Path, help="the pictures, or the paper's PDF")
    arguments = parser.parse_args()
    try:
        run(arguments.source)
    except InputError as error:
        sys.exit(f"measure_port: {error}")


if __name__ == "__main__":
    main()
