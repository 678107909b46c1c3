"""The robust set's validation: conditions leave the truth alone."""

import numpy as np
import pytest
import validate_robust
import validation_world as world
from strategies import PORT, pose
from validation_conditions import CONDITIONS, covered

from lmmap.geometry.conics import circle_ellipse
from lmmap.refinement.contour import Contour
from lmmap.types import Ellipse, Status
from lmmap_lab.bench import labels, laboratory, renderer, sequences

SHAPE = (96, 116)
V, U = np.indices(SHAPE)
MASKS = np.array([abs(np.hypot(V - 48, U - 58) - 30) < 3, abs(V - 48) + abs(U - 58) < 6])
CHANGES = [(m, n) for m, conditions in CONDITIONS.items() for n, c in conditions.items() if c.change]


@pytest.fixture
def image(rng):
    return {
        "rgb": rng.integers(20, 120, (*SHAPE, 3)).astype(float),
        "event": rng.poisson(1.5, SHAPE).astype(float),
    }


@pytest.mark.parametrize(("modality", "name"), CHANGES)
def test_a_condition_changes_the_image_and_not_the_truth(modality, name, image, rng):
    before = image[modality].copy()
    changed, masks = CONDITIONS[modality][name].change(image[modality], MASKS, rng)
    assert changed.shape == before.shape
    assert not np.allclose(changed, before, atol=1)
    assert np.array_equal(image[modality], before)
    if CONDITIONS[modality][name].change is not covered:
        assert np.array_equal(masks, MASKS)


@pytest.mark.parametrize("modality", CONDITIONS)
def test_cloth_hides_a_part_of_the_ring_and_nothing_else(modality, image, rng):
    for _ in range(10):
        changed, masks = covered(image[modality], MASKS, rng)
        assert 0 < masks[0].sum() < MASKS[0].sum()
        assert not (masks & ~MASKS).any()
        same = changed == image[modality]
        same = same if same.ndim == 2 else same.all(-1)
        assert not (masks.any(0) & ~same).any()


def test_gaps_are_dark_and_stay_ring():
    """A worn ring has less light on its ring only; in a gap next to none; its mask is whole."""
    T, camera = pose((172, 130), 0.6, 0.3), world.CAMERA
    rays = renderer.ray_grid(camera, 1)
    ring = labels.label_masks(T, PORT, camera)[0]
    cover = np.stack([ring, 0 * ring], -1).astype(np.float32)
    light = np.ones((*ring.shape, 3), np.float32)

    def left(gap_m):
        radiance, seen = world.worn(lambda *scene: (light, cover), gap_m)(None, None, None, T, rays, None)
        assert np.array_equal(seen, cover)
        assert np.array_equal(radiance[~ring], light[~ring])
        return radiance[ring][:, 0]

    whole, gapped = left(0.0), left(world.GAP_M)
    dark = np.isclose(gapped, world.IN_GAP)
    assert np.array_equal(whole[~dark], gapped[~dark])
    share = world.SECTORS * world.GAP_M / (2 * np.pi * PORT.ring_radius_m)
    assert dark.mean() == pytest.approx(share, rel=0.3)


def test_the_other_setup_leaves_the_laboratory_as_it_is():
    other, own = world.other_setup(0.0), sequences.Setup()
    assert other.panel is world.panel and other.lens_blur_px != own.lens_blur_px
    assert own == sequences.OUR_SETUP and own.panel is laboratory.panel and own.render is renderer.render


def test_an_ellipse_counts_only_where_the_ring_is():
    T = pose((172, 130), 0.6, 0.5)
    true = circle_ellipse(T, PORT.ring_radius_m, world.CAMERA)

    def accepted(shift_px, factor):
        ellipse = Ellipse(
            true.centre_px + np.array([shift_px, 0]), true.semi_axes_px * factor, true.angle_rad
        )
        return validate_robust.is_ring(Contour(ellipse, np.zeros((0, 2)), 0.1), T)

    assert accepted(0.0, 1.0)
    assert accepted(1.5, 1.03)
    assert not accepted(2.5, 1.0)
    assert not accepted(0.0, 1.07)
    assert not validate_robust.is_ring(Status.NO_RING, T)
