"""Laboratories of other materials, lamps and sensors, drawn from a number, to train the robust filters.

``varied-N`` is a sequence whose port, panel, paint, lamps, backdrop, lens and event sensor are each drawn at
random from wide ranges (domain randomization, Tobin et al. 2017).  Motion and kind of light are those of the
laboratory's own sequences.  High light has half of them, for it is the hard one.  ``printed-N`` is one in
high light whose cover is printed, of any gloss.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import cv2
import numpy as np

from lmmap.types import Camera, Port, Pose, Recording

from . import cad, laboratory, optics, renderer, sequences, skins
from .event_sensor import SensorSettings

NAME = re.compile(r"(varied|printed)-(\d+)")
# number of the laboratory's sequence whose motion and light ``varied-0`` and ``printed-0`` have
FIRST, FIRST_PRINTED = 60_000, 70_000
LEVELS = ("low", "medium", "high")  # of the laboratory's training sequences, by their number modulo 3
LIGHTS = ("low", "medium", "high", "high")  # of varied-N, by N modulo 4
SECONDS = {"low": 0.7, "medium": 0.7, "high": 0.4}  # length: in high light many events come early
COATED = [cad.RING, cad.MARKER]
PAINTED = [cad.PLATE, cad.PETAL, cad.BODY]


def light_of(number: int) -> str:
    """The kind of light of ``varied-NUMBER``."""
    return LIGHTS[number % len(LIGHTS)]


def base_sequence(name: str) -> laboratory.Sequence:
    """The laboratory's sequence whose motion and kind of light a varied one has; nothing else uses it."""
    which, number = NAME.fullmatch(name)[1], int(NAME.fullmatch(name)[2])
    if which == "printed":
        return laboratory.sequence(f"augmented-{FIRST_PRINTED + 3 * number + LEVELS.index('high')}")
    kind = "augmented" if number // len(LIGHTS) % 3 == 0 else "realistic"
    light = light_of(number)
    return laboratory.sequence(f"{kind}-{FIRST + 3 * number + LEVELS.index(light)}")


def record_varied(name: str, seconds: float | None = None, port: Port | None = None) -> Recording:
    """A recording of a port in the laboratory of this name; by default a short one of `draw_port`."""
    seq = base_sequence(name)
    rng = seq.rng("varied")
    cover = printed_panel if name.startswith("printed") else panel
    setup = sequences.Setup(cover, lamps, backdrop, PaintedPort.draw(rng), rng.uniform(0.4, 1.1))
    return sequences.simulate(
        seq.name,
        seconds or SECONDS[seq.light],
        sensor=draw_sensor(rng),
        setup=setup,
        port=port or draw_port(seq),
    )


def draw_port(seq) -> Port:
    """An LM-MAP of other dimensions about the same centre line: mock-ups differ from their CAD.

    The windows keep their place; where the markers leave less room, they are narrower.
    """
    port, rng = Port.lm_map(), seq.rng("varied port")
    half_width_m = rng.uniform(0.8, 1.15) * (port.ring_outer_radius_m - port.ring_inner_radius_m) / 2
    tangential_m, radial_m = port.marker_size_m * rng.uniform(0.9, 1.1, 2)
    marker_radius_m = port.marker_radius_m * rng.uniform(0.95, 1.05)
    apothem_m = (marker_radius_m + radial_m / 2) * rng.uniform(1, 1.06)
    half_period = port.yaw_period_rad / 2  # between a marker and a window
    free_m = 2 * (marker_radius_m - radial_m / 2) * np.sin(half_period) - tangential_m * np.cos(half_period)
    window_m = min(port.window_size_m[0], free_m), port.window_size_m[1]
    return replace(
        port,
        ring_inner_radius_m=port.ring_radius_m - half_width_m,
        ring_outer_radius_m=port.ring_radius_m + half_width_m,
        marker_size_m=(tangential_m, radial_m),
        marker_radius_m=marker_radius_m,
        plate_circumradius_m=apothem_m / np.cos(np.pi / (2 * port.symmetry)),
        window_size_m=window_m,
        plate_height_m=port.plate_height_m * rng.uniform(0.75, 1.3),
        petal_widths_m=tuple(port.petal_widths_m * rng.uniform(0.8, 1.2, 2)),
        petal_rise_m=port.petal_rise_m * rng.uniform(0.8, 1.2),
        petal_lean_m=port.petal_lean_m * rng.uniform(0.7, 1.3),
    )


def draw_sensor(rng) -> SensorSettings:
    """An event sensor of any bias within what DAVIS cameras are set to, from quiet to noisy."""
    return SensorSettings(
        threshold=rng.uniform(0.15, 0.5), mismatch=rng.uniform(0.02, 0.07),
        cutoff_hz=_log_uniform(rng, 60, 500), leak_hz=_log_uniform(rng, 0.02, 0.5),
        shot_hz=_log_uniform(rng, 0.1, 8), hot_share=_log_uniform(rng, 5e-5, 1e-3))  # fmt: skip


def _log_uniform(rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(*np.log([low, high]))))


def _hue(rng, least: float) -> np.ndarray:
    """A colour of brightness 1 with all channels over ``least``; a third are grey."""
    return np.ones(3) if rng.random() < 1 / 3 else rng.permutation([1.0, *rng.uniform(least, 1, 2)])


def panel(seq, port: Port):
    """The port on its panel, under film or cloth of any colour and gloss, patched with other materials."""
    rng = seq.rng("varied panel")
    centre_m = rng.uniform(-1, 1, 2) * [0.10, 0.05]
    if seq.skin == "textured":
        return cad.solid(port, centre_m), skins.textured_cover(port.panel_size_m, rng)
    skin = skins.film(port.panel_size_m, -centre_m, rng)
    skin[..., skins.SLOPE] *= rng.uniform(0, 1.5)
    _coat(skin, rng)
    shape = np.array(skin.shape[:2])
    for _ in range(rng.integers(0, 4)):
        size = (shape * rng.uniform(0.1, 0.6, 2)).astype(int)
        row, column = rng.integers(0, shape - size)
        _coat(skin[row : row + size[0], column : column + size[1]], rng)
    return cad.solid(port, centre_m), skin


def printed_panel(seq, port: Port):
    """The port on a printed cover, from matt paper to lacquer and metal, flat or wavy."""
    rng = seq.rng("printed panel")
    skin = skins.textured_cover(port.panel_size_m, rng)
    skin[..., skins.SPECULAR] = _log_uniform(rng, 0.03, 0.7) * _hue(rng, 0.6)
    skin[..., skins.ROUGHNESS] = _log_uniform(rng, 0.05, 0.6)
    skin[..., skins.SLOPE] *= rng.uniform(0, 4)
    return cad.solid(port, rng.uniform(-1, 1, 2) * [0.10, 0.05]), skin


def _coat(skin, rng) -> None:
    """Give a part of a skin another material in place: metal, or anything from black to white."""
    metal = rng.random() < 0.4
    dirt = skin[..., :1] / skin[..., :1].mean()
    diffuse, specular = (0.1, rng.uniform(0.3, 0.95)) if metal else (0.85, 0.06)
    skin[..., skins.DIFFUSE] = np.clip(dirt * rng.uniform(0.01, diffuse) * _hue(rng, 0.1), 0, 0.9)
    skin[..., skins.SPECULAR] = specular * _hue(rng, 0.1)
    skin[..., skins.ROUGHNESS] *= rng.uniform(0.08, 0.5) / skin[..., skins.ROUGHNESS].mean()


def lamps(seq) -> renderer.Lamps:
    """The laboratory's lamps moved, of other colours and strengths, at times with one more from the side."""
    light, rng = laboratory.lamps(seq), seq.rng("varied lamps")
    away_m = np.linalg.norm(light.position_m, axis=1, keepdims=True)
    position_m = light.position_m + rng.uniform(0, 0.25) * away_m * rng.standard_normal((len(away_m), 3))
    gain = np.exp(rng.normal(0, 0.5, (len(away_m), 1)))
    intensity, radius_m = light.intensity * gain * _hue(rng, 0.4), light.radius_m
    if seq.light != "low" and rng.random() < 0.3:
        side_m = rng.uniform([-2, -1.5, -0.8], [2, 1.5, 0.2])
        position_m = np.vstack([position_m, side_m])
        intensity = np.vstack([intensity, _log_uniform(rng, 0.1, 0.7) * intensity.max(0)])
        radius_m = np.append(radius_m, rng.uniform(0.03, 0.25))
    return renderer.Lamps(position_m, intensity, radius_m)


def backdrop(seq, camera: Camera, total_intensity: float) -> np.ndarray:
    """The laboratory's room with covers of any pattern, discs and rings in it."""
    light, rng = laboratory.backdrop(seq, camera, total_intensity), seq.rng("varied backdrop")
    height, width = light.shape[:2]
    cover = skins.textured_cover((width * skins.TEXEL_M, height * skins.TEXEL_M), rng)[..., skins.DIFFUSE]
    shown = np.zeros((height, width), np.uint8)
    for _ in range(rng.integers(0, 5)):
        centre = tuple(int(c) for c in rng.uniform(0, [width, height]))
        if rng.random() < 0.5:
            cv2.circle(shown, centre, int(rng.uniform(10, 80)), 1, int(rng.choice([-1, 3, 6])))
        else:
            box = centre, tuple(rng.uniform(20, 150, 2)), rng.uniform(0, 180)
            cv2.fillPoly(shown, [cv2.boxPoints(box).astype(np.int32)], 1)
    brightness = rng.uniform(0.02, 0.25) * min(total_intensity, 40.0)
    light = np.where(shown[..., None], cover * brightness, light)
    return optics.blur(light.astype(np.float32), 1.0)


def angle_about_port(T_cam_port: Pose, rays) -> np.ndarray:
    """Angle (H, W) about the port's axis of where rays (H, W, 3) meet the ring's plane z = 0."""
    eye_m, direction = T_cam_port.inverse.position_m, rays @ T_cam_port.rotation
    x, y = np.moveaxis(eye_m[:2] - eye_m[2] * direction[..., :2] / direction[..., 2:], -1, 0)
    return np.arctan2(y, x)


@dataclass(frozen=True)
class PaintedPort:
    """`renderer.render` of a port of other paint, whose ring and markers return less light than new film.

    Attributes
    ----------
    parts : as `renderer.PARTS`
    worn, waves, phase_rad
        Share of the light that the film returns around the ring: ``worn (1 + waves sin(2 angle + phase))``.
    """

    parts: np.ndarray
    worn: float
    waves: float
    phase_rad: float

    @classmethod
    def draw(cls, rng) -> PaintedPort:
        """Paint and wear at random."""
        parts = renderer.PARTS.copy()
        parts[PAINTED] = np.stack(
            [rng.uniform(0.03, 0.7, 3), rng.uniform(0.03, 0.3, 3), rng.uniform(0.2, 0.7, 3)], -1
        )
        parts[COATED] = rng.uniform(0.15, 0.6), rng.uniform(0.03, 0.1), rng.uniform(0.3, 0.7)
        return cls(parts, rng.uniform(0.4, 1.1), rng.uniform(0, 0.4), rng.uniform(0, 2 * np.pi))

    def __call__(self, solid, skin, light, T_cam_port, rays, behind):
        scene = solid, skin, light, T_cam_port, rays, behind
        radiance, cover = renderer.render(*scene, parts=self.parts)
        angle_rad = angle_about_port(T_cam_port, rays[0])
        returned = self.worn * (1 + self.waves * np.sin(2 * angle_rad + self.phase_rad))
        lost = cover.sum(-1, keepdims=True) * (1 - returned[..., None])
        return (radiance * (1 - lost)).astype(np.float32), cover
