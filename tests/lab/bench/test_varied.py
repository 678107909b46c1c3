"""Varied laboratories: drawn from their number alone, each another, around a port of the same geometry."""

from functools import partial

import numpy as np
import pytest

from lmmap.geometry.port import circle_points_m
from lmmap.types import Camera, Port
from lmmap_lab.bench import laboratory, renderer, varied

NAMES = [f"varied-{n}" for n in range(24)]
TINY = Camera.davis346()


def scene(name, paint):
    """Radiance and cover of a coarse view of a sequence's first moment."""
    seq, port = varied.base_sequence(name), Port.lm_map()
    rays = renderer.ray_grid(TINY, 1)[:, ::4, ::4].copy()
    solid, skin = varied.panel(seq, port)
    light = varied.lamps(seq)
    behind = varied.backdrop(seq, TINY, light.intensity[:, 0].sum())[::4, ::4].astype(np.float32)
    T_cam_port = laboratory.sequence_motion(seq, np.zeros(1))[0]
    return paint(solid, skin, light, T_cam_port, rays, np.ascontiguousarray(behind))


def test_a_name_is_one_laboratory():
    first, second = (
        varied.PaintedPort.draw(varied.base_sequence("varied-3").rng("varied")) for _ in range(2)
    )
    assert np.array_equal(first.parts, second.parts) and first.worn == second.worn
    assert np.array_equal(scene("varied-3", first)[0], scene("varied-3", second)[0])


def test_laboratories_differ_and_half_have_high_light():
    bases = [varied.base_sequence(name) for name in NAMES]
    assert len({seq.name for seq in bases}) == len(bases)
    assert sum(seq.light == "high" for seq in bases) == len(bases) / 2
    covers = [varied.panel(seq, Port.lm_map())[1].mean((0, 1)) for seq in bases[:6]]
    assert len(np.unique(np.round(covers, 4), axis=0)) == len(covers)


def test_paint_and_wear_leave_the_geometry_and_new_film_leaves_the_light():
    """New film and the laboratory's paint are the renderer's; worn film darkens ring and markers alone."""
    new = varied.PaintedPort(renderer.PARTS, 1.0, 0.0, 0.0)
    radiance, cover = scene("varied-1", new)
    expected, expected_cover = scene("varied-1", renderer.render)
    assert np.array_equal(radiance, expected) and np.array_equal(cover, expected_cover)
    dull, same_cover = scene("varied-1", varied.PaintedPort(renderer.PARTS, 0.5, 0.0, 0.0))
    assert np.array_equal(same_cover, cover)
    coated = cover.sum(-1)
    assert np.allclose(dull[coated == 1], 0.5 * radiance[coated == 1])
    assert np.array_equal(dull[coated == 0], radiance[coated == 0]) and (coated == 1).any()


def test_other_paint_changes_the_picture_but_not_what_is_where():
    drawn = varied.PaintedPort.draw(np.random.default_rng(1))
    radiance, cover = scene("varied-2", drawn)
    plain, plain_cover = scene("varied-2", partial(renderer.render, parts=renderer.PARTS))
    assert np.array_equal(cover, plain_cover) and not np.allclose(radiance, plain)
    assert np.isfinite(radiance).all() and radiance.min() >= 0


def test_a_ray_to_a_point_of_the_ring_has_the_points_angle():
    T_cam_port = laboratory.sequence_motion(varied.base_sequence("varied-1"), np.zeros(1))[0]
    points_m = circle_points_m(Port.lm_map().ring_radius_m, 24).reshape(4, 6, 3)
    rays = T_cam_port @ points_m
    angle_rad = varied.angle_about_port(T_cam_port, rays / np.linalg.norm(rays, axis=-1, keepdims=True))
    expected_rad = np.arctan2(points_m[..., 1], points_m[..., 0])
    assert np.allclose(np.exp(1j * angle_rad), np.exp(1j * expected_rad))


@pytest.mark.parametrize("seed", range(5))
def test_sensors_lie_within_what_cameras_are_set_to(seed):
    sensor = varied.draw_sensor(np.random.default_rng(seed))
    assert 0.15 <= sensor.threshold <= 0.5 and 60 <= sensor.cutoff_hz <= 500 and sensor.shot_hz <= 8
