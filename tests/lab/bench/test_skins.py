"""Skins: physical ranges, determined by their generator, none like another."""

import numpy as np
import pytest

from lmmap_lab.bench import skins

SIZE_M = (0.34, 0.22)


def makers():
    film = {metal: lambda rng, m=metal: skins.film(SIZE_M, (0, 0), rng, m) for metal in skins.METALS}
    return [*film.values(), lambda rng: skins.textured_cover(SIZE_M, rng)]


@pytest.mark.parametrize("make", makers())
@pytest.mark.parametrize("seed", range(4))
def test_skin_is_physical_and_repeats(make, seed):
    skin = make(np.random.default_rng(seed))
    assert skin.shape == (220, 340, skins.CHANNELS) and skin.dtype == np.float32
    assert np.all(np.isfinite(skin))
    reflectance = skin[..., skins.DIFFUSE] + skin[..., skins.SPECULAR]
    assert reflectance.min() >= 0 and reflectance.max() <= 1.25
    assert skin[..., skins.ROUGHNESS].min() > 0.02 and skin[..., skins.ROUGHNESS].max() <= 1
    assert np.array_equal(skin, make(np.random.default_rng(seed)))
    assert not np.array_equal(skin, make(np.random.default_rng(seed + 100)))


def test_gold_is_yellow_and_film_is_creased(rng):
    gold = skins.film(SIZE_M, (0, 0), rng, "gold")[..., skins.SPECULAR].mean((0, 1))
    assert gold[0] > 1.5 * gold[2]
    slope = skins.film(SIZE_M, (0, 0), rng)[..., skins.SLOPE]
    assert 0.02 < slope.std() < 0.6


@pytest.mark.parametrize("cell", [4, 30, 500])
def test_noise_has_unit_variance(cell, rng):
    noise = skins.smooth_noise((120, 150), cell, rng)
    assert noise.shape == (120, 150)
    assert (noise.mean(), noise.std()) == pytest.approx((0, 1), abs=1e-3)
