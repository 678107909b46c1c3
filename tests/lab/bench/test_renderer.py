"""Laws of light: linear, inverse square, no energy from nothing, shadows, retro-reflection."""

from dataclasses import replace

import numpy as np
import pytest
from strategies import facing_pose

from lmmap.types import Camera, Port
from lmmap_lab.bench import cad, optics, renderer, shading, skins

CAMERA, PORT = Camera(61, 41, 60.0, 60.0, 30.0, 20.0), Port.lm_map()
RAYS = renderer.ray_grid(CAMERA, 1)
BLACK = np.zeros((41, 61, 3), np.float32)
FRONTAL = facing_pose(0.0, 0.0, 0.0, [0.0, 0.0, 0.5])


def matt(albedo=0.5):
    skin = np.zeros((44, 68, skins.CHANNELS), np.float32)
    skin[..., skins.DIFFUSE], skin[..., skins.ROUGHNESS] = albedo, 1.0
    return skin


def lamp(position, intensity=1.0):
    return renderer.Lamps(np.array([position], float), np.full((1, 3), float(intensity)), np.zeros(1))


def panel_skin(skin, lamps, pose=FRONTAL):
    bare = cad.without_port(cad.solid(PORT))
    return renderer.render(bare, skin, lamps, pose, RAYS, BLACK)[0]


def panel_radiance(lamps, albedo=0.5, pose=FRONTAL):
    return panel_skin(matt(albedo), lamps, pose)


def test_lambert_by_hand():
    centre = panel_radiance(lamp([0, 0, 0]))[20, 30, 0]
    z = 0.5 + PORT.panel_depth_m
    ambient = renderer.AMBIENT * 0.5
    assert centre == pytest.approx(0.5 / np.pi / z**2 + ambient, rel=1e-3)


def test_inverse_square_and_linear():
    far = facing_pose(0.0, 0.0, 0.0, [0.0, 0.0, 2 * (0.5 + PORT.panel_depth_m) - PORT.panel_depth_m])
    ambient = renderer.AMBIENT * 0.5
    near, away = panel_radiance(lamp([0, 0, 0])), panel_radiance(lamp([0, 0, 0]), pose=far)
    assert (away[20, 30] - ambient) * 4 == pytest.approx(near[20, 30] - ambient, rel=1e-4)
    assert panel_radiance(lamp([0, 0, 0], 3.0)) == pytest.approx(3 * near, rel=1e-5)


@pytest.mark.parametrize("alpha", [0.15, 0.4, 0.9])
@pytest.mark.parametrize("nv", [0.2, 0.6, 1.0])
def test_white_microfacets_give_back_no_more_than_they_get(alpha, nv):
    """White furnace: at most all comes back; rough surfaces lose what bounces twice."""
    n = 400
    cos_l, phi = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n * 2 * np.pi)
    sin_l, sin_v = np.sqrt(1 - cos_l**2), np.sqrt(1 - nv**2)
    h = np.stack([sin_l * np.cos(phi) + sin_v, sin_l * np.sin(phi), cos_l + nv])
    h /= np.linalg.norm(h, axis=0)
    lobe = np.vectorize(lambda *cosines: shading.microfacet_lobe(*cosines, alpha**2, 0.0)[0])(
        cos_l, nv, h[2], h[0] * sin_v + h[2] * nv
    )
    total = np.sum(lobe * cos_l) * 2 * np.pi / n**2
    assert 0.3 < total <= 1.03


def test_plate_casts_a_shadow_on_the_ring_away_from_the_sun():
    solid = cad.solid(PORT)
    lamps = lamp([-1.0, 0.0, 0.1], 5.0)
    rays = renderer.ray_grid(Camera.davis346(), 1)
    backdrop = np.zeros((260, 346, 3), np.float32)
    radiance, cover = renderer.render(solid, matt(), lamps, FRONTAL, rays, backdrop)
    ring = cover[..., 0] == 1
    u = np.broadcast_to(np.arange(346), ring.shape)
    towards, away = radiance[ring & (u < 140), 0], radiance[ring & (u > 205), 0]
    assert np.mean(away < 0.2 * np.median(towards)) > 0.3
    assert np.mean(towards < 0.2 * np.median(towards)) < 0.05


def test_ring_returns_a_colocated_lamp_to_the_camera():
    solid = cad.solid(PORT)
    rays = renderer.ray_grid(Camera.davis346(), 1)
    backdrop = np.zeros((260, 346, 3), np.float32)

    def ring_radiance(position):
        radiance, cover = renderer.render(solid, matt(), lamp(position), FRONTAL, rays, backdrop)
        return np.median(radiance[cover[..., 0] == 1, 0])

    assert ring_radiance([0, 0, 0]) > 10 * ring_radiance([0.3, 0, 0])


def test_cover_is_the_projected_annulus():
    solid = cad.solid(PORT)._replace(plate_apothem=0.0, petals=np.zeros((0, 4, 3)), stem=0.0)
    camera = Camera.davis346()
    pose = facing_pose(0.0, 0.0, 0.0, [0, 0, 0.5])
    backdrop = np.zeros((260, 346, 3), np.float32)
    rays = renderer.ray_grid(camera, 4)
    cover = renderer.render(solid, matt(), lamp([0, 0, 0]), pose, rays, backdrop)[1]
    area = np.pi * (PORT.ring_outer_radius_m**2 - PORT.ring_inner_radius_m**2) * (324 / 0.5) ** 2
    assert cover[..., 0].sum() == pytest.approx(area, rel=0.01)


def test_exposure_is_linear_then_saturates(rng):
    grey = np.full((200, 200, 3), 0.4, np.float32)
    frame = optics.expose(grey, 1.0, rng)
    assert frame.mean() == pytest.approx(0.4 * 255, rel=0.005)
    assert frame.std() == pytest.approx(255 * np.sqrt(0.4 * 7000 + 25**2) / 7000, rel=0.1)
    assert np.all(optics.expose(5 * grey, 1.0, rng) == 255)


def test_lamp_behind_the_panel_lights_nothing_that_the_camera_sees():
    """Film leans toward the lamp and petals look at it, but the panel is between."""
    skin = matt()
    skin[..., skins.SLOPE] = 0.8
    pose = facing_pose(0.6, 0.3, 0.0, [0.0, 0.0, 0.5])
    behind = lamp(pose @ np.array([0.3, 0.2, -PORT.panel_depth_m - 0.05]))
    rays, black = renderer.ray_grid(Camera.davis346(), 1), np.zeros((260, 346, 3), np.float32)
    radiance, _ = renderer.render(cad.solid(PORT), skin, behind, pose, rays, black)
    assert radiance.max() <= renderer.AMBIENT * 0.55 * (1 + 1e-6)


@pytest.mark.parametrize("roughness", [0.05, 0.15, 0.4])
def test_lamp_with_a_size_is_the_mean_over_its_disc(roughness, rng):
    """A glossy panel shows a lamp of 60 mm as it would show points spread over it, mirrored and aside."""
    skin = matt(0.0)
    skin[..., skins.SPECULAR], skin[..., skins.ROUGHNESS] = 0.9, roughness
    disc = 0.06 * np.sqrt((np.arange(2000) + 0.5) / 2000) * np.exp(2j * np.pi * 0.618034 * np.arange(2000))
    points = np.stack([disc.real, disc.imag, 0 * disc.real], -1)
    many = panel_skin(skin, renderer.Lamps(points, np.full((2000, 3), 1 / 2000), np.zeros(2000)))
    wide = panel_skin(skin, lamp([0, 0, 0])._replace(radius_m=np.full(1, 0.06)))
    point = panel_skin(skin, lamp([0, 0, 0]))
    assert wide == pytest.approx(many, rel=0.03)
    assert point[20, 30, 0] > (1 + (0.5 * 0.06 / 0.509 / roughness) ** 2) * 0.98 * many[20, 30, 0]


def whole(lamps, T, rays, solid=None, skin=None):
    black = np.zeros((*rays.shape[1:3], 3), np.float32)
    return renderer.render(solid or cad.solid(PORT), matt() if skin is None else skin, lamps, T, rays, black)


DAVIS = renderer.ray_grid(Camera.davis346(), 1)
PAIR = renderer.Lamps(
    np.array([[0.03, 0, 0], [-1, 0.4, -0.3]]), np.array([[1.0, 1, 1], [9, 7, 5]]), np.full(2, 0.3)
)


def test_twice_the_light_and_half_the_exposure_is_the_same_frame():
    tilted = facing_pose(0.5, 0.4, 0.3, [0.02, 0.01, 0.5])
    once = whole(PAIR, tilted, DAVIS)[0]
    twice = whole(PAIR._replace(intensity=2 * PAIR.intensity), tilted, DAVIS)[0]
    assert twice == pytest.approx(2 * once, rel=1e-6)
    frames = [optics.expose(light, g, np.random.default_rng(3)) for light, g in ((once, 0.2), (twice, 0.1))]
    assert np.mean(frames[0] != frames[1]) < 1e-3 and 5 < frames[0].mean() < 250


def test_lights_add():
    tilted = facing_pose(0.5, 0.4, 0.3, [0.02, 0.01, 0.5])
    parts = [whole(renderer.Lamps(*(field[i : i + 1] for field in PAIR)), tilted, DAVIS)[0] for i in (0, 1)]
    assert whole(PAIR, tilted, DAVIS)[0] == pytest.approx(sum(parts), rel=1e-5, abs=1e-6)


def test_a_third_of_a_turn_changes_nothing():
    """Light, shadows and labels of the port; the panel is larger than the view."""
    port = replace(PORT, panel_size_m=(3.0, 3.0))
    lamps = renderer.Lamps(np.array([[-0.6, 0.3, 0.1]]), np.array([[5.0, 4, 3]]), np.zeros(1))
    poses = [facing_pose(0.4, 1.0, 0.2 + k * PORT.yaw_period_rad, [0.02, 0.01, 0.5]) for k in range(3)]
    turned = [whole(lamps, T, DAVIS, cad.solid(port)) for T in poses]
    for radiance, cover in turned[1:]:
        same = np.isclose(radiance, turned[0][0], rtol=1e-4, atol=1e-5).all(-1)
        assert np.mean(~same) < 2e-4  # rays along an edge
        assert np.mean(cover != turned[0][1]) < 2e-4


def test_mirrored_light_gives_the_mirrored_picture():
    """The port is its own mirror image about the plane through marker 0."""
    pictures, mirrored = (whole(lamp([0.2, y, 0.1], 3.0), FRONTAL, DAVIS) for y in (0.35, -0.35))
    for a, b in zip(pictures, mirrored, strict=True):
        assert np.mean(~np.isclose(a, b[::-1], rtol=1e-4, atol=1e-5)) < 2e-4
    assert np.mean(~np.isclose(pictures[0], mirrored[0], rtol=1e-2)) > 0.2  # the lamp does matter


def test_the_ring_too_falls_with_the_square_of_distance():
    """Lamp and camera at one place, so the return's angle stays zero."""
    near, far = (whole(lamp([0, 0, 0]), facing_pose(0, 0, 0, [0, 0, z]), DAVIS) for z in (1.0, 2.0))
    ambient = renderer.AMBIENT * (0.30 + 0.04)
    values = [radiance[cover[..., 0] == 1, 0] - ambient for radiance, cover in (near, far)]
    assert values[0].mean() / values[1].mean() == pytest.approx(4, rel=0.02)
