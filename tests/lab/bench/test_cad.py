"""Rays against the CAD: what is hit where, and what hides what."""

from dataclasses import replace

import numpy as np
import pytest

from lmmap.refinement import verify
from lmmap.types import Port
from lmmap_lab.bench import cad

SOLID = cad.solid(Port.lm_map())


def look_down(x, y, height=1.0):
    t, what, *normal = cad.hit_port(SOLID, x, y, height, 1e-12, 1e-12, -1.0, np.inf)
    return height - t, what, normal


@pytest.mark.parametrize(
    "x, y, surface, height",
    [
        (0.080, 0.0, cad.RING, 0.0),
        (-0.080, 0.0, cad.RING, 0.0),
        (0.0393, 0.0, cad.MARKER, 0.0361),
        (0.0393, 0.0267, cad.MARKER, 0.0361),
        (0.0393, 0.0269, cad.PLATE, 0.0361),
        (-0.0425, 0.0, cad.PLATE, 0.0361),  # markers sit at 0, 120 and 240 deg, windows opposite them
        (-0.0317, 0.0126, cad.PLATE, 0.0361),
        (0.0, 0.0, cad.PLATE, 0.0361),
    ],
)
def test_straight_down(x, y, surface, height):
    hit_height, hit_surface, normal = look_down(x, y)
    assert hit_surface == surface
    assert hit_height == pytest.approx(height, abs=1e-9)
    assert normal == [0, 0, 1]


@pytest.mark.parametrize("x", [-0.0215, -0.0317, -0.0419])
@pytest.mark.parametrize("y", [-0.0124, 0.0, 0.0124])
def test_a_window_lets_rays_through_and_a_port_without_windows_does_not(x, y):
    assert look_down(x, y)[1] == cad.NOTHING  # as far as the panel
    closed = cad.solid(replace(Port.lm_map(), window_size_m=(0.0, 0.0)))
    assert cad.hit_port(closed, x, y, 1.0, 1e-12, 1e-12, -1.0, np.inf)[1] == cad.PLATE


def test_the_ring_is_seen_through_a_window():
    """Over the plate's near side and down through the window at -x, to the ring beyond it."""
    eye, window, shown = np.array([0.15, 0.0, 0.2]), (-0.0317, 0.0), []
    ray = np.array([*window, Port.lm_map().plate_height_m]) - eye
    hit = eye - eye[2] / ray[2] * ray
    assert SOLID.ring_inner < -hit[0] < SOLID.ring_outer
    for port in (Port.lm_map(), replace(Port.lm_map(), window_size_m=(0.0, 0.0))):
        shown.append(cad.hit_port(cad.solid(port), *eye, *(ray / np.linalg.norm(ray)), np.inf)[1])
    assert shown == [cad.RING, cad.PLATE]


def test_between_plate_and_ring_is_only_the_panel():
    assert look_down(-0.060, 0.0)[1] == cad.NOTHING
    distance, *normal = cad.hit_panel(SOLID, -0.06, 0.0, 1.0, 1e-12, 1e-12, -1.0)
    assert distance == pytest.approx(1.009)
    assert normal == [0, 0, 1]


def test_petal_rises_over_the_marker_side_and_hides_the_ring_behind_it():
    height, surface, _ = look_down(0.055, 0.0)
    port = Port.lm_map()
    share = (0.055 - port.apothem_m) / port.petal_lean_m
    assert surface == cad.PETAL
    assert height == pytest.approx(port.plate_height_m + share * port.petal_rise_m, abs=1e-9)
    direction = np.array([0.080, 0.0, 0.0]) - [-0.08, 0.0, 0.15]  # over the plate, down to the far ring
    direction /= np.linalg.norm(direction)
    hidden = cad.hit_port(SOLID, -0.08, 0.0, 0.15, *direction, np.inf)[1]
    assert hidden in (cad.PLATE, cad.MARKER)


def test_three_fold_symmetry(rng):
    c, s = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for _ in range(300):
        eye = rng.uniform([-0.3, -0.3, 0.2], [0.3, 0.3, 0.8])
        ray = rng.uniform([-0.1, -0.1, 0], [0.1, 0.1, 0.05]) - eye
        ray /= np.linalg.norm(ray)
        hit = cad.hit_port(SOLID, *eye, *ray, np.inf)
        turned_hit = cad.hit_port(SOLID, *(turn @ eye), *(turn @ ray), np.inf)
        assert hit[1] == turned_hit[1]
        if hit[1] != cad.NOTHING:
            assert hit[0] == pytest.approx(turned_hit[0], abs=1e-9)


def test_bounding_sphere_loses_nothing(rng):
    """Every surface point of the port, seen from outside, is hit or hidden, never missed."""
    a = rng.uniform(0, 2 * np.pi, 200)
    for x, y in 0.0875 * np.stack([np.cos(a), np.sin(a)], -1):
        assert look_down(x, y)[1] == cad.RING


@pytest.mark.parametrize("azimuth", [0.0, 0.9, 2.0, 3.1])
@pytest.mark.parametrize("windows", [True, False])
def test_what_is_hidden_is_what_a_ray_against_the_cad_does_not_reach(rng, azimuth, windows):
    """Points of ring and markers; the module that estimates has its own code for what is hidden."""
    port = Port.lm_map() if windows else replace(Port.lm_map(), window_size_m=(0.0, 0.0))
    solid = cad.solid(port)
    eye = 0.5 * np.array([np.sin(0.9) * np.cos(azimuth), np.sin(0.9) * np.sin(azimuth), np.cos(0.9)])
    angle, r = rng.uniform(0, 2 * np.pi, 2000), rng.uniform(0, 0.089, 2000)
    points_m = np.stack([r * np.cos(angle), r * np.sin(angle), np.zeros(2000)], -1)
    rays, distance_m = points_m - eye, np.linalg.norm(points_m - eye, axis=1)
    bare = solid._replace(stem=1e-9, ring_inner=1e-9, ring_outer=2e-9)
    met = [cad.hit_port(bare, *eye, *(ray / d), d - 1e-3)[1] in (cad.PLATE, cad.MARKER, cad.PETAL)
           for ray, d in zip(rays, distance_m, strict=True)]  # fmt: skip
    behind = verify.hidden(points_m, eye, port)
    assert 0.1 < behind.mean() < 0.9
    np.testing.assert_array_equal(behind, met)
