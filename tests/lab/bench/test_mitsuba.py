"""The renderer against Mitsuba 3 on a small picture; `benchmarks/bench_mitsuba.py` compares at length."""

import mitsuba_scene as peer
import numpy as np
import pytest
from strategies import PORT, pose

from lmmap.types import Camera
from lmmap_lab.bench import cad, laboratory, renderer, skins
from lmmap_lab.training.mask_quality import iou

SMALL = Camera(116, 88, 108.0, 108.0, 57.5, 43.5)
POSES = {"frontal": ((60, 40), 0.45, 0.0), "tilted": ((50, 45), 0.6, 0.8, 1.0, 0.7)}
BLACK = np.zeros((88, 116, 3), np.float32)


def both(solid, skin, lamps, T):
    """Our radiance and cover, and Mitsuba's radiance and surfaces: lamps as points, no ambient light."""
    lamps = lamps._replace(radius_m=0 * lamps.radius_m)
    rays = renderer.ray_grid(SMALL, 1)
    radiance, cover = renderer.render(solid, skin, lamps, T, rays, BLACK, ambient=0.0)
    theirs = peer.render(solid, skin, peer.points(lamps, T), T, SMALL)
    return radiance, cover, theirs, peer.surfaces(solid, skin, T, SMALL)


@pytest.mark.parametrize("name", ["test-low", "test-medium", "test-high", "augmented-4"])
@pytest.mark.parametrize("where", POSES.values(), ids=POSES)
def test_same_light_and_same_masks(name, where):
    seq = laboratory.sequence(name)
    solid, skin = laboratory.panel(seq, PORT)
    T = pose(*where, camera=SMALL)
    radiance, cover, theirs, seen = both(solid, skin, laboratory.lamps(seq), T)
    median, p95 = peer.disagreement(radiance, theirs, seen)
    assert median < 0.03 and p95 < 0.15
    for i, surface in enumerate((cad.RING, cad.MARKER)):
        assert np.any(seen == surface)
        assert iou(cover[..., i] > 0.5, seen == surface) > 0.98


def test_port_alone_agrees_to_a_thousandth():
    """Without textures nothing is left to interpolate: every lit pixel of the port and of a plain panel."""
    skin = np.zeros((8, 8, skins.CHANNELS), np.float32)
    skin[..., skins.DIFFUSE], skin[..., skins.SPECULAR], skin[..., skins.ROUGHNESS] = 0.2, 0.5, 0.3
    lamps = renderer.Lamps(
        np.array([[0.04, 0, 0], [-0.8, 0.5, -0.2]]), np.array([[1.0, 1, 1], [9, 6, 3]]), np.zeros(2)
    )
    T = pose(*POSES["tilted"], camera=SMALL)
    radiance, _, theirs, seen = both(cad.solid(PORT), skin, lamps, T)
    median, p95 = peer.disagreement(radiance, theirs, seen)
    assert median < 1e-4 and p95 < 1e-3


def test_the_comparison_sees_a_wrong_renderer():
    """A tenth more roughness on the film is no longer the same light."""
    seq = laboratory.sequence("test-high")
    solid, skin = laboratory.panel(seq, PORT)
    T = pose(*POSES["frontal"], camera=SMALL)
    _, _, theirs, seen = both(solid, skin, laboratory.lamps(seq), T)
    rougher = skin.copy()
    rougher[..., skins.ROUGHNESS] *= 1.1
    radiance, *_ = both(solid, rougher, laboratory.lamps(seq), T)
    assert peer.disagreement(radiance, theirs, seen)[0] > 0.03
