"""What each set of filters finds in the published pictures of the real port, against what a person measured.

    python tuning/judge_pictures.py FOLDER [PICTURE ...]

FOLDER holds the eight pictures under the names in data/paper/pictures.csv; they are the authors' and do not
ship.  A person marked the ring's outer edge on enlargements (data/paper/picture-points.csv) before any filter
had seen the picture, and an ellipse is fitted to these points.  Of named pictures only the rows are renewed.
Nothing is chosen by this table.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import product
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from lmmap.pipeline import ellipse
from lmmap.pipeline.weights import SETS, load_networks
from lmmap.settings import OURS
from lmmap.types import Camera, Ellipse, Port
from lmmap_lab.provenance import DATA, load_json, save_json, save_table
from lmmap_lab.studies.any_lens import Look, best_look, looks, marker_scores, markers_px
from lmmap_lab.studies.pdf import pictures

TABLE, OUTLINES = (DATA / "results" / name for name in ("pictures.csv", "picture-outlines.json"))
RIGHT_CENTRE_PX, RIGHT_AXES = 4.0, 0.12  # of a ring that is right; pixels as the DAVIS's
MARKER_NEAR = 0.15  # of the ring's semi-major axis, between a marker's centre and where a person sees it
DRAWN = 60  # grey levels by which the green of the authors' lines exceeds red and blue


def main(folder: Path, *names: str) -> None:
    what = pd.read_csv(DATA / "paper" / "pictures.csv").set_index("picture")
    networks = {m: {gap: load_networks(gap, m, "float32") for gap in SETS} for m in ("rgb", "event")}
    rows, outlines = kept(names)
    for name, picture in pictures(folder):
        if name in (names or what.index):
            more, outlines[name] = judge(name, picture, what.loc[name], networks[what.modality[name]])
            rows = pd.concat([rows, more])
            print(more.to_string(), flush=True)
    save_table(TABLE, rows.sort_values("picture", kind="stable"))
    save_json(OUTLINES, outlines)


def kept(names) -> tuple[pd.DataFrame | None, dict]:
    """Of an earlier run, the rows and outlines of all pictures but those named."""
    if not names:
        return None, {}
    rows = pd.read_csv(TABLE)
    return rows[~rows.picture.isin(names)], load_json(OUTLINES)


def judge(name: str, picture: np.ndarray, facts: pd.Series, networks: dict) -> tuple[pd.DataFrame, dict]:
    """Rows of one picture, and the outlines of what is found in it."""
    marked = pd.read_csv(DATA / "paper" / "picture-points.csv").query("picture == @name")
    edge, seen = (marked[marked.kind == kind][["u_px", "v_px"]].to_numpy() for kind in ("edge", "marker"))
    outer = ellipse.fit(edge) if len(edge) else None
    variants = {"drawn": picture, "taken out": without_lines(picture)} if facts.lines else {"none": picture}
    rows, outlines = [], {"size_px": picture.shape[1::-1], "outer": _as_list(outer)}
    for (lines, image), (gap, pair), local in product(variants.items(), networks.items(), (False, True)):
        settings = replace(OURS, local_search=local)
        look = best_look([*looks(image, facts.modality, pair, settings)])
        columns = {"picture": name, "lines": lines, "filters": gap, "local_search": local}
        rows.append(columns | judged(look, image, pair[1], outer, seen))
        if local and lines != "taken out":
            outlines[gap] = outlined(look, image.shape[1::-1])
    return pd.DataFrame(rows), outlines


def without_lines(picture: np.ndarray) -> np.ndarray:
    """A picture (H, W, 3) without the green lines that were drawn on it, filled in from beside them."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    drawn = (green > red + DRAWN) & (green > blue + DRAWN)
    return cv2.inpaint(picture, cv2.dilate(drawn.astype(np.uint8), np.ones((3, 3))), 3, cv2.INPAINT_TELEA)


def judged(look: Look, picture, reflector_network, outer: Ellipse | None, seen) -> dict:
    """The columns of one look; without an ``outer`` edge that a person sees, finding none is right."""
    e, size_px, port = look.estimate, picture.shape[1::-1], Port.lm_map()
    columns = {"look_px": look.camera.width_px if e.ellipse else np.nan, "status": e.status}
    columns |= {"contrast": look.contrast if e.ellipse else np.nan, "confidence": e.confidence}
    columns |= {"ring_right": (e.ellipse is None) == (outer is None)}
    if e.ellipse and outer is not None:
        ring = look.ellipse_in(size_px)
        widened = ring.semi_axes_px * port.ring_outer_radius_m / port.ring_radius_m
        found = Ellipse(ring.centre_px, widened, ring.angle_rad)
        centre_px, ratio = apart(found, outer, size_px[0])
        columns |= {"centre_px": centre_px, "major_ratio": ratio[0], "minor_ratio": ratio[1]}
        columns["ring_right"] = is_right(centre_px, ratio)
    columns |= {"markers_seen": len(seen), "markers_found": 0, "pose_plausible": False}
    pose = e.T_cam_port or e.doubtful
    if pose is not None:
        corners = markers_px(pose, port, look.camera)
        scores = marker_scores(reflector_network(look.image), corners)
        columns["markers_found"] = int((scores >= OURS.min_marker_score).sum())
        if len(seen):
            centres = (corners.mean(1) + 0.5) * size_px[0] / look.camera.width_px - 0.5
            nearest = np.linalg.norm(centres[:, None] - seen, axis=-1).min(0)
            columns["pose_plausible"] = bool(nearest.max() < MARKER_NEAR * outer.semi_axes_px[0])
    return columns


def apart(found: Ellipse, outer: Ellipse, width_px: float) -> tuple[float, np.ndarray]:
    """How far the outer edge that was found is from the true one, in a picture of this width: distance of the
    centres in the DAVIS's pixels, and ratio of the semi-axes (2,)."""
    to_davis = Camera.davis346().width_px / width_px
    centre_px = float(np.hypot(*(found.centre_px - outer.centre_px))) * to_davis
    return centre_px, found.semi_axes_px / outer.semi_axes_px


def is_right(centre_px: float, ratio: np.ndarray) -> bool:
    """Whether rings that are so far `apart` are one."""
    return centre_px < RIGHT_CENTRE_PX and bool(np.all(np.abs(ratio - 1) < RIGHT_AXES))


def outlined(look: Look, size_px) -> dict:
    """The look's ellipse, and the outlines of its ring mask, in the picture's pixels."""
    scale = size_px[0] / look.camera.width_px
    active = (look.ring_mask > OURS.mask_threshold).astype(np.uint8)
    shapes = cv2.findContours(active, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    kept = [cv2.approxPolyDP(c, 0.7, True)[:, 0] for c in shapes if cv2.contourArea(c) > 12]
    mask = [" ".join(f"{u:.1f},{v:.1f}" for u, v in (shape + 0.5) * scale - 0.5) for shape in kept]
    return {"ellipse": _as_list(look.ellipse_in(size_px)), "mask": mask, "status": str(look.estimate.status)}


def _as_list(ring: Ellipse | None) -> list[float] | None:
    if ring is None:
        return None
    return np.round([*ring.centre_px, *ring.semi_axes_px, ring.angle_rad], 3).tolist()


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
