"""Measures the ring in the pictures that its authors drew their estimate on, beside the pose that they drew.

    python tuning/measure_overlays.py FOLDER

FOLDER is that of tuning/measure_port.py.  The drawn pose is that of the wire model, fitted to the green
lines.  The ring beneath has edges of its own between them (`lmmap_lab.rig.ring_edges`), and they have a pose,
too: the exact one.  The readings of the paper's formula say where its estimate would be.  Truth, arm and
hand-eye calibration have no part in it.

Intervals come from draws.  Each has its own pieces of line, level of an edge, way to tell green, and arcs of
the ring, with replacement.  `GLARE` is cut out by its place.  The focal length is the bench's, and that with
which the printed formula fits Table I.  The photograph of the mock-up has no drawn pose, so it says nothing.

The table is data/results/overlays.csv, and overlays.json holds the edges.  It takes two minutes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from green_lines import WAYS
from measure_port import START, drawn_anew, seen_in
from scipy.spatial.transform import Rotation
from wire_fit import FOCAL_PX, SEED, at_focal, measured
from wire_model import COUNT

from lmmap.errors import InputError
from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.projection import project
from lmmap.geometry.rotations import angle_between_rad
from lmmap.pipeline import circle
from lmmap.types import Camera, Port, Pose
from lmmap_lab.provenance import DATA, save_json, save_table
from lmmap_lab.rig.ring_edges import ANGLES, Edges, pose_of
from lmmap_lab.rig.ring_edges import measured as measured_ring
from lmmap_lab.studies import formula
from lmmap_lab.studies.five_degrees import EXACT, chart, from_chart
from lmmap_lab.studies.five_degrees_study import COMMITTED
from lmmap_lab.studies.pdf import pictures

TABLE, EDGES = (DATA / "results" / f"overlays.{kind}" for kind in ("csv", "json"))
LEVELS = (0.3, 0.4, 0.5, 0.6, 0.7)
DRAWS = 40
ARCS = 12  # of the ring, drawn with replacement
GLARE = {"rgb-estimate-overlaid": ((150, 56, 203, 76), (201, 27, 218, 44))}  # left, top, right, bottom: px


def drawn_pose(x, number: int, port: Port) -> Pose:
    """The pose in a picture by a fit's unknowns, whose lengths are in units of the ring's outer radius."""
    turn, position = np.split(x[COUNT + 6 * number : COUNT + 6 * number + 6], 2)
    return Pose(Rotation.from_rotvec(turn).as_matrix(), port.ring_outer_radius_m * position)


def hidden(picture, way, glare) -> tuple[np.ndarray, np.ndarray]:
    """Brightness (H, W) of a picture, and where lines or glare hide the ring, in its own pixels."""
    least, tolerance = way
    brightness, red, blue = np.moveaxis(cv2.cvtColor(picture, cv2.COLOR_RGB2YCrCb).astype(int), -1, 0)
    covered = (128 - np.maximum(red, blue) > least) & (np.abs(brightness - 150) <= tolerance)
    for box in glare:
        left, top, right, bottom = np.round(np.array(box) * picture.shape[1] / 346).astype(int)
        covered[top:bottom, left:right] = True
    return brightness, covered


def camera_of(picture, focal_px: float) -> Camera:
    """The camera of a picture that shows a DAVIS 346's whole width, in the picture's own pixels."""
    height, width = picture.shape[:2]
    return Camera(width, height, *[focal_px * width / 346] * 2, (width - 1) / 2, (height - 1) / 2)


def some_arcs(seen: Edges, rng: np.random.Generator) -> Edges:
    """Edges of arcs of the ring that are drawn with replacement."""
    arc = seen.place * ARCS // ANGLES
    return seen[np.concatenate([np.flatnonzero(arc == k) for k in rng.integers(0, ARCS, ARCS)])]


def least_tilts_deg(T: Pose, camera: Camera, port: Port) -> dict[str, float]:
    """The smallest tilt to the line of sight that each reading gives any ring at a place."""
    tilts_rad, azimuths_deg = np.deg2rad(np.arange(0, 30, 0.5)), np.arange(0, 360, 10)
    tilt, azimuth = (v.ravel() for v in np.meshgrid(tilts_rad, azimuths_deg))
    sight = T.position_m / np.linalg.norm(T.position_m)
    across = Rotation.from_rotvec(np.deg2rad(azimuth)[:, None] * sight).apply(
        np.cross(sight, [0, 1, 0]) / np.hypot(*sight[[0, 2]])
    )
    normal = -Rotation.from_rotvec(tilt[:, None] * across).apply(sight)
    facing = Rotation.from_rotvec([np.pi, 0, 0]).as_matrix()
    axis = np.cross(-np.array([0, 0, 1.0]), normal)
    axis *= (
        angle_between_rad(-np.array([0, 0, 1.0]), normal) / np.maximum(np.linalg.norm(axis, axis=1), 1e-12)
    )[:, None]
    many = Pose(Rotation.from_rotvec(axis).as_matrix() @ facing, np.broadcast_to(T.position_m, normal.shape))
    ellipses = circle_ellipse(many, port.ring_radius_m, camera)
    normals = {reading: formula.normals(ellipses, camera, port.ring_radius_m, reading, many.position_m)
               for reading in formula.READINGS}  # fmt: skip
    return {r: float(np.rad2deg(angle_between_rad(-sight, n).min())) for r, n in normals.items()}


def beside(drawn: Pose, seen: Pose, camera: Camera, port: Port, to_davis: float) -> dict[str, float]:
    """How the drawn pose lies to the seen ring: ``offset_px`` between the images of the ring's centre and its
    ellipse's centre, how far from the first toward the second the drawn centre is, ``along_px``, and the
    printed one, ``printed_along_px``; and the angles (deg) of the drawn normal to each reading's nearest."""
    nu = port.ring_radius_m
    ellipse = circle_ellipse(seen, nu, camera)
    centre = project(seen.position_m, camera)
    offset = ellipse.centre_px - centre
    offset_px = np.linalg.norm(offset)
    printed_m = circle.paper_poses(ellipse, camera, nu).position_m[0]
    along, printed = (
        (project(p, camera) - centre) @ offset / offset_px for p in (drawn.position_m, printed_m)
    )
    far_m, drawn_m = (np.linalg.norm(T.position_m) for T in (seen, drawn))
    values = {"offset_px": to_davis * offset_px, "along_px": to_davis * along,
              "printed_along_px": to_davis * printed,
              "nearer_percent": 100 * (1 - drawn_m / far_m),
              EXACT: angle_between_rad(seen.normal, drawn.normal)}  # fmt: skip
    for reading in formula.READINGS:
        normals = formula.normals(ellipse, camera, nu, reading, seen.position_m)
        values[reading] = angle_between_rad(normals, drawn.normal).min()
    angles = (EXACT, *formula.READINGS)
    values = {key: float(np.rad2deg(v) if key in angles else v) for key, v in values.items()}
    return values | {"printed less exact": values["printed"] - values[EXACT]}


def noise_deg(seen: Pose, camera: Camera, port: Port, to_davis: float, rng) -> float:
    """Root mean square angle by which noise of 1 px of a DAVIS 346 turns the exact normal."""
    noisy = chart(circle_ellipse(seen, port.ring_radius_m, camera)) + rng.standard_normal((500, 5)) / to_davis
    both = circle.poses(from_chart(noisy), camera, port.ring_radius_m)
    return float(np.rad2deg(np.sqrt(np.mean(angle_between_rad(both.normal, seen.normal).min(1) ** 2))))


def run(source: Path) -> None:
    """Measure, print and write; raises `InputError`."""
    port, rng = Port.lm_map(), np.random.default_rng(SEED)
    found = seen_in(source)
    names = [overlay.name for overlay in found[0]]
    shown = {name: picture for name, picture in pictures(source) if name in names}
    x = measured(found[0], START)
    anew = drawn_anew(found, x, DRAWS)
    study = pd.read_csv(COMMITTED).query("variation == 'as it is'").set_index("hypothesis")
    fitted = study.nu_over_z
    lenses = {
        "ours": FOCAL_PX,
        "fitted": FOCAL_PX * fitted["printed, our lens"] / fitted["printed, any lens"],
    }
    rows, kept = [], {}
    for lens, focal_px in lenses.items():
        there = at_focal(found[0], x, focal_px)[0]
        for number, name in enumerate(names):
            picture = shown[name]
            camera, to_davis = camera_of(picture, focal_px), 346 / picture.shape[1]
            start, base = (drawn_pose(values, number, port) for values in (there, x))
            draws = []
            for values in (x, *anew):
                T = drawn_pose(values, number, port)
                drawn = Pose(T.rotation @ base.rotation.T @ start.rotation,
                             T.position_m / base.position_m * start.position_m)  # fmt: skip
                first = not draws
                way, level = (WAYS[0], 0.5) if first else (WAYS[rng.integers(len(WAYS))], rng.choice(LEVELS))
                covered = hidden(picture, way, GLARE.get(name, ()))
                seen, ring, spread, left = measured_ring(*covered, drawn, port, camera, level)
                sight = drawn.position_m / np.linalg.norm(drawn.position_m)
                draws.append({"drawn_tilt": np.rad2deg(angle_between_rad(drawn.normal, -sight))})
                if not len(left):
                    continue
                if not first:
                    ring, spread, _ = pose_of(some_arcs(seen, rng), ring, port, camera)
                draws[-1] |= beside(drawn, ring, camera, port, to_davis) | {"spread_px": to_davis * spread}
                if first:
                    draws[-1] |= {"edges": len(seen.side), "left_px": to_davis * np.median(np.abs(left)),
                                  "noise_of_1_px": noise_deg(ring, camera, port, to_davis, rng)}  # fmt: skip
                    kept |= {name: _text((seen.points_px + 0.5) * to_davis - 0.5)} if lens == "ours" else {}
            table = pd.DataFrame(draws)
            for what in table.columns:
                low, high = table[what].iloc[1:].quantile([0.025, 0.975])
                rows.append((name, lens, focal_px, what, table[what].iloc[0], low, high))
            for reading, tilt in least_tilts_deg(start, camera, port).items():
                rows.append((name, lens, focal_px, f"least tilt, {reading}", tilt, np.nan, np.nan))
    table = pd.DataFrame(rows, columns=["picture", "lens", "focal_px", "what", "value", "low", "high"])
    print(table.to_string(index=False, float_format="%.2f"))
    save_table(TABLE, table, draws=DRAWS, seed=SEED, levels=LEVELS)
    save_json(EDGES, kept)


def _text(points_px) -> str:
    return " ".join(f"{u:.1f},{v:.1f}" for u, v in points_px)


def main() -> None:
    parser = argparse.ArgumentParser(description="Measures the ring beside the authors' drawn pose.")
    parser.add_argument("source", metavar="FOLDER", type=Path, help="the pictures, or the paper's PDF")
    arguments = parser.parse_args()
    try:
        run(arguments.source)
    except InputError as error:
        sys.exit(f"measure_overlays: {error}")


if __name__ == "__main__":
    main()
