"""The labels: what the CAD and the pose predict is where the renderer draws it, to a tenth of a pixel.

Pictures are rendered with one ray through each of 10 x 10 parts of a pixel; edges run midway between rays.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from skimage.measure import approximate_polygon, find_contours
from strategies import CAMERA, PORT, WIDE, pose

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import project
from lmmap.types import Camera
from lmmap_lab.bench import cad, renderer, skins

FINE, TOLERANCE_PX = 10, 0.1
POSES = {
    "frontal": ((172.5, 129.5), 0.50, 0.0),
    "tilted": ((150.0, 120.0), 0.60, 0.7, 2.0, 0.5),
    "steep": ((190.0, 140.0), 0.55, 1.05, -0.8, 1.9),
    "far aside": ((250.0, 80.0), 0.90, 0.5, 0.3, -2.5),
}
BARE = {"plate_apothem": 0.0, "petals": np.zeros((0, 4, 3)), "stem": 1e-9}


def finely(solid, T, camera, radius_m=0.092, height_m=0.0, lamps=0):
    """Radiance, ring and marker masks around a disc of the port, and the way to the camera's pixels."""
    around = project(T @ (circle_points_m(radius_m) + np.array([0, 0, height_m])), camera)
    low, high = np.floor(around.min(0)).astype(int), np.ceil(around.max(0)).astype(int)
    width, height = (high - low) * FINE
    cx, cy = ((camera.K[:2, 2] - low) + 0.5) * FINE - 0.5
    fine = Camera(
        int(width), int(height), camera.fx_px * FINE, camera.fy_px * FINE, cx, cy, camera.distortion
    )
    skin = np.zeros((4, 4, skins.CHANNELS), np.float32)
    lamp = renderer.Lamps(np.zeros((lamps, 3)), np.ones((lamps, 3)), np.zeros(lamps))
    black = np.zeros((fine.height_px, fine.width_px, 3), np.float32)
    radiance, cover = renderer.render(solid, skin, lamp, T, renderer.ray_grid(fine, 1), black)
    return radiance, cover[..., 0] > 0.5, cover[..., 1] > 0.5, lambda p: (p + 0.5) / FINE - 0.5 + low


def outlines(mask, to_pixels):
    """Outlines of a mask's patches, midway between rays that hit and rays that miss."""
    mask = np.pad(mask.astype(np.float32), 1)  # what the window cuts is closed outside of it
    return [to_pixels(c[:, ::-1] - 1) for c in find_contours(mask, 0.5) if len(c) > 3 * FINE]


def corners_of(outline):
    """Where the straight sides of an outline meet, each side a line fitted to its middle part."""
    corner = np.argmax(np.sum((outline - outline.mean(0)) ** 2, 1))  # the polygon must not begin amid a side
    outline = np.concatenate([outline[corner:-1], outline[: corner + 1]])
    bent = approximate_polygon(outline, 0.3)[:-1]
    at = np.sort([np.argmin(np.sum((outline[:-1] - b) ** 2, 1)) for b in bent])
    lines = []
    for start, end in zip(at, [*at[1:], at[0] + len(outline) - 1], strict=True):
        trim = (end - start) // 6
        side = outline[np.arange(start + trim, end - trim + 1) % (len(outline) - 1)]
        normal = np.linalg.svd(side - side.mean(0))[2][1]
        lines.append((*normal, -normal @ side.mean(0)))
    met = np.cross(lines, np.roll(lines, 1, axis=0))
    return met[:, :2] / met[:, 2:]


def visible(solid, T, points):
    """Which points of the port's surface (N, 3) the camera sees."""
    eye = T.inverse.position_m
    way = points - eye
    distance = np.linalg.norm(way, axis=1)
    seen = [cad.hit_port(solid, *eye, *(w / d), d - 1e-6)[1] == cad.NOTHING
            for w, d in zip(way, distance, strict=True)]  # fmt: skip
    return np.array(seen)


@pytest.mark.parametrize("camera", [CAMERA, WIDE], ids=["pinhole", "distorted"])
@pytest.mark.parametrize("where", POSES.values(), ids=POSES)
def test_ring_is_drawn_where_it_projects(where, camera):
    T, full = pose(*where, camera=camera), cad.solid(PORT)
    bare = full._replace(**BARE)
    _, ring, _, to_pixels = finely(bare, T, camera)
    edge = [project(T @ circle_points_m(r, 3000), camera)
            for r in (PORT.ring_inner_radius_m, PORT.ring_outer_radius_m)]  # fmt: skip
    drawn = np.concatenate(outlines(ring, to_pixels))
    far, _ = cKDTree(np.concatenate(edge)).query(drawn)
    assert far.max() < TOLERANCE_PX  # nothing hides it: every drawn edge is a projected one
    _, ring, _, to_pixels = finely(full, T, camera)
    drawn = cKDTree(np.concatenate(outlines(ring, to_pixels)))
    for radius, points in zip((PORT.ring_inner_radius_m, PORT.ring_outer_radius_m), edge, strict=True):
        inward = np.sign(PORT.ring_radius_m - radius)
        seen = np.all([visible(full, T, circle_points_m(radius + inward * d, 3000)) for d in (1e-5, 1e-3)], 0)
        seen &= np.roll(seen, 20) & np.roll(
            seen, -20
        )  # not where a plate's or petal's edge rounds the corner
        assert seen.mean() > 0.3
        assert (
            drawn.query(points[seen])[0].max() < TOLERANCE_PX
        )  # and where plate and petals hide a part of it


@pytest.mark.parametrize("camera", [CAMERA, WIDE], ids=["pinhole", "distorted"])
@pytest.mark.parametrize("where", POSES.values(), ids=POSES)
@pytest.mark.parametrize("petals", [False, True], ids=["open", "hidden"])
def test_markers_corners_are_drawn_where_they_project(where, camera, petals):
    port = replace(PORT, plate_circumradius_m=0.0547)  # whose plate cuts nothing off the markers
    T, solid = pose(*where, camera=camera), cad.solid(port)
    solid = solid if petals else solid._replace(petals=np.zeros((0, 4, 3)))
    corners = port.marker_corners_m()
    centres = corners.mean(1, keepdims=True)
    inner = corners + 1e-4 * (centres - corners)
    share = np.linspace(0, 0.9, 10)[
        :, None, None, None
    ]  # of the way along the side from a corner to the next
    sides = (1 - share) * inner + share * np.roll(inner, -1, axis=1)
    whole = visible(solid, T, sides.reshape(-1, 3)).reshape(10, 3, 4).all(0)
    seen = whole & np.roll(whole, 1, axis=1)  # corners between two sides that nothing hides
    _, _, markers, to_pixels = finely(solid, T, camera, 0.056, port.plate_height_m)
    drawn = np.concatenate([corners_of(outline) for outline in outlines(markers, to_pixels)])
    distance, _ = cKDTree(drawn).query(project(T @ corners.reshape(-1, 3), camera))
    assert np.all(seen) or petals
    assert seen.sum() >= 4
    assert distance[seen.ravel()].max() < TOLERANCE_PX


def test_labels_are_what_shines():
    """Ring and markers, and nothing else, send a colocated lamp back."""
    T = pose(*POSES["tilted"])
    radiance, ring, markers, _ = finely(cad.solid(PORT), T, CAMERA, lamps=1)
    shines = radiance[..., 0] > 0.1 * np.median(radiance[ring, 0])
    assert np.mean(shines != (ring | markers)) < 1e-5
