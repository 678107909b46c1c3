"""Skins: physical ranges, determined by their generator, none like another."""

import numpy as np
import pytest

from lmmap.bench import skins as materials

SIZE_M = (0.34, 0.22)


def skins():
    film = {metal: lambda rng, m=metal: materials.film(SIZE_M, (0, 0), rng, m) for metal in materials.METALS}
    return [*film.values(), lambda rng: materials.textured_cover(SIZE_M, rng)]


@pytest.mark.parametrize("make", skins())
@pytest.mark.parametrize("seed", range(4))
def test_skin_is_physical_and_repeats(make, seed):
    skin = make(np.random.default_rng(seed))
    assert skin.shape == (220, 340, materials.CHANNELS) and skin.dtype == np.float32
    assert np.all(np.isfinite(skin))
    reflectance = skin[..., materials.DIFFUSE] + skin[..., materials.SPECULAR]
    assert reflectance.min() >= 0 and reflectance.max() <= 1.25
    assert skin[..., materials.ROUGHNESS].min() > 0.02 and skin[..., materials.ROUGHNESS].max() <= 1
    assert np.array_equal(skin, make(np.random.default_rng(seed)))
    assert not np.array_equal(skin, make(np.random.default_rng(seed + 100)))


def test_gold_is_yellow_and_film_is_creased(rng):
    gold = materials.film(SIZE_M, (0, 0), rng, "gold")[..., materials.SPECULAR].mean((0, 1))
    assert gold[0] > 1.5 * gold[2]
    slope = materials.film(SIZE_M, (0, 0), rng)[..., materials.SLOPE]
    assert 0.02 < slope.std() < 0.6


@pytest.mark.parametrize("cell", [4, 30, 500])
def test_noise_has_unit_variance(cell, rng):
    noise = materials.smooth_noise((120, 150), cell, rng)
    assert noise.shape == (120, 150)
    assert (noise.mean(), noise.std()) == pytest.approx((0, 1), abs=1e-3)
