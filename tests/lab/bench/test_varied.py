"""Varied laboratories: drawn from their number alone, each another, with a port of its own."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from lmmap.geometry.port import circle_points_m
from lmmap.types import Camera, Port
from lmmap_lab.bench import labels, laboratory, renderer, sequences, varied

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


def test_ports_differ_from_their_cad_as_mock_ups_do_and_keep_the_rings_centre_line():
    cad_port, ports = (
        Port.lm_map(),
        [varied.draw_port(varied.base_sequence(f"varied-{n}")) for n in range(300)],
    )
    assert ports[3] == varied.draw_port(varied.base_sequence("varied-3"))
    middle_m = [(p.ring_inner_radius_m + p.ring_outer_radius_m) / 2 for p in ports]
    assert {p.ring_radius_m for p in ports} == {cad_port.ring_radius_m}
    np.testing.assert_allclose(middle_m, cad_port.ring_radius_m)
    width_m = np.array([p.ring_outer_radius_m - p.ring_inner_radius_m for p in ports])
    scales = {"plate_height_m": (0.75, 1.3), "marker_radius_m": (0.95, 1.05), "petal_rise_m": (0.8, 1.2)}
    drawn = [(width_m / (cad_port.ring_outer_radius_m - cad_port.ring_inner_radius_m), (0.8, 1.15))]
    drawn += [([getattr(p, n) / getattr(cad_port, n) for p in ports], ends) for n, ends in scales.items()]
    drawn += [([p.marker_size_m[i] / cad_port.marker_size_m[i] for p in ports], (0.9, 1.1)) for i in (0, 1)]
    for factors, (low, high) in drawn:  # evenly over its range, so that both ends are nearly reached
        assert low <= min(factors) < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < max(factors) <= high
    held = [p.marker_radius_m + p.marker_size_m[1] / 2 <= p.apothem_m * (1 + 1e-9) for p in ports]
    assert all(held)  # on the plate


def test_windows_are_as_wide_as_in_the_cad_where_the_markers_leave_room():
    ports = [varied.draw_port(varied.base_sequence(f"varied-{n}")) for n in range(300)]
    wide_m = Port.lm_map().window_size_m[0]
    narrower = [p for p in ports if p.window_size_m[0] < wide_m]
    assert 0 < len(narrower) < 0.4 * len(ports) and {p.window_size_m[0] for p in ports} >= {wide_m}
    for port in narrower[:10]:  # a wider one would overlap a marker
        with pytest.raises(ValueError, match="overlap the markers"):
            replace(port, window_size_m=(1.001 * port.window_size_m[0], port.window_size_m[1]))


def test_a_recording_shows_the_port_that_it_is_made_with():
    """Frames of a port with a wide ring are lit where only that ring is."""
    wide = replace(Port.lm_map(), ring_outer_radius_m=0.11, ring_inner_radius_m=0.06)
    seen = {}
    for name, port in (("cad", None), ("wide", wide)):
        recording = sequences.simulate("realistic-1", 0.2, port=port)
        seen[name] = recording.frames[1].astype(float).mean(-1)
    T_cam_port = recording.truth.at(recording.frames_t_us[1:2])[0]
    masks = [labels.label_masks(T_cam_port, port, TINY)[0] for port in (Port.lm_map(), wide)]
    new = masks[1] & ~masks[0]
    assert new.sum() > 500 and (seen["wide"] - seen["cad"])[new].mean() > 20


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
