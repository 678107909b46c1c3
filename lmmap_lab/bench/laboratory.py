"""The laboratory's sequences, each drawn from its name: how the port moves, under which lamps, on what panel.

``augmented-N`` and ``realistic-N`` are for training, on covers that are no satellite's and on film.
``test-low``, ``test-medium`` and ``test-high`` are one unseen trajectory under three levels of light;
``test-low-1`` and so on are another trajectory.  ``hard-slow`` and ``hard-reflect`` are the hard cases;
``empty-N`` has no port.  ``speed-30-N`` is like a realistic sequence with a mean speed of 30 mm/s, on the
path of ``speed-150-N``.
"""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.types import Camera, InputError, Port, Pose

from . import cad, optics, renderer, skins

KINDS = re.compile(
    r"(augmented|realistic|empty|speed-(?P<mm_s>\d{1,3}(?:\.\d)?))-(\d+)|test-(low|medium|high)(?:-\d+)?"
    r"|hard-(slow|reflect)"
)
COLOCATED_M, EARTHSHINE_M, SUN_M = (0.035, -0.020, 0.0), (0.9, -0.7, 0.1), (-2.2, -0.7, -0.9)
# radiant intensities of the lamps (the colocated lamp has 1), and the gain from radiance to full scale of
# both sensors, which is the same in every light; `lmmap photometry` chose all three
EARTHSHINE, SUN, GAIN = 153.3, 2569.1, 0.03047
SECONDS = {  # length of a sequence; the paper has 80 min augmented, 20 min realistic, > 5000 empty frames
    "quick": {"augmented": 2.0, "realistic": 2.0, "speed": 2.0, "test": 6.0, "hard": 3.0, "empty": 3.0},
    "paper": {"augmented": 60.0, "realistic": 60.0, "speed": 20.0, "test": 210.0, "hard": 40.0,
              "empty": 255.0},
}  # fmt: skip


@dataclass(frozen=True)
class Sequence:
    """What decides a recording, except for its length.

    ``light`` is a level of light (low, medium, high) or ``reflect``; ``speed`` and ``wander`` scale the rate
    and the extent of the motion.
    """

    name: str
    light: str
    skin: str
    port: bool = True
    speed: float = 1.0
    wander: float = 1.0

    def rng(self, purpose: str) -> np.random.Generator:
        """Random numbers for one purpose; sequences that differ only in a test's light or in speed get the
        same."""
        group = re.sub(r"^test-(low|medium|high)|^speed-[\d.]+", lambda m: m[0].split("-")[0], self.name)
        return np.random.default_rng([zlib.crc32(group.encode()), zlib.crc32(purpose.encode())])


def sequence(name: str) -> Sequence:
    """The sequence of this name; raises `InputError` for an unknown one."""
    match = KINDS.fullmatch(name)
    if not match:
        raise InputError(
            f"sequence {name!r} is unknown: use augmented-N, realistic-N, test-low, test-medium, test-high, "
            "test-low-N and so on, hard-slow, hard-reflect, empty-N or speed-MM_PER_S-N"
        )
    kind, mm_s, number, level, hard = match.groups()
    if level:
        return Sequence(name, level, "mock-up")
    if hard == "slow":
        return Sequence(name, "low", "mock-up", speed=0.0, wander=0.3)
    if hard == "reflect":
        return Sequence(name, "reflect", "mock-up", wander=0.4)
    light = ("low", "medium", "high")[int(number) % 3]
    skin = "textured" if kind == "augmented" else ("mock-up" if int(number) % 2 else "film")
    seq = Sequence(name, light, skin, port=kind != "empty")
    return seq if mm_s is None else replace(seq, speed=1e-3 * float(mm_s) / mean_speed_m_s(seq))


def mean_speed_m_s(seq: Sequence) -> float:
    """Mean speed of the port's position over a minute."""
    t_s = np.linspace(0, 60, 601)
    position_m = sequence_motion(seq, t_s).position_m
    return float(np.mean(np.linalg.norm(np.diff(position_m, axis=0), axis=1)) / (t_s[1] - t_s[0]))


def sequence_motion(seq: Sequence, t_s) -> Pose:
    """``T_cam_port`` at times (N,) s: sums of slow sinusoids, within the reach and speed of an arm."""
    rng, t_s = seq.rng("motion"), np.asarray(t_s, float)

    def wander(mean, deviation):
        frequency, phase = rng.uniform(0.02, 0.08, 3), rng.uniform(0, 2 * np.pi, 3)
        waves = np.sin(2 * np.pi * frequency * seq.speed * t_s[:, None] + phase)
        return mean + deviation * seq.wander * np.sqrt(2 / 3) * waves.sum(1)

    training = not seq.name.startswith(("test", "hard"))
    depth = np.clip(wander(0.64, 0.16 if training else 0.13), 0.33, 1.2)
    x, y = wander(0, 0.20) * depth, wander(0, 0.14) * depth
    tilt = np.stack([wander(0, 0.30), wander(0, 0.30), np.zeros_like(t_s)], -1)
    yaw = wander(rng.uniform(0, 2 * np.pi), 0.8)
    if seq.name == "hard-slow":
        x, tilt = x + 0.0015 * (t_s - 20), tilt + np.array([0.25, 0.1, 0])
    facing = Rotation.from_rotvec([np.pi, 0, 0])
    turn = Rotation.from_rotvec(tilt) * facing * Rotation.from_rotvec(np.outer(yaw, [0, 0, 1]))
    return Pose(turn.as_matrix(), np.stack([x, y, depth], -1))


def lamps(seq: Sequence) -> renderer.Lamps:
    """The colocated lamp.  Medium light adds earthshine, a soft lamp; high light adds the sun instead, and in
    augmented sequences keeps both."""
    rng = seq.rng("lamps")
    position, intensity, radius = [COLOCATED_M], [np.ones(3)], [0.01]
    if seq.light == "medium" or (seq.light == "high" and seq.name.startswith("augmented")):
        position.append(EARTHSHINE_M)
        intensity.append(EARTHSHINE * np.array([0.97, 1.0, 1.03]))
        radius.append(0.24)
    if seq.light == "high":
        training = not seq.name.startswith("test")
        position.append(np.array(SUN_M) + training * rng.uniform(-0.6, 0.6, 3))
        intensity.append(SUN * (rng.uniform(0.4, 1.2) if training else 1.0) * np.array([1.0, 0.98, 0.95]))
        radius.append(0.10)
    if seq.light == "reflect":  # where the panel, were it a mirror, would throw the sun into the lens
        T_cam_port = sequence_motion(seq, np.array([5.0]))[0]
        ray = -T_cam_port.position_m / np.linalg.norm(T_cam_port.position_m)
        mirrored = 2 * (T_cam_port.normal @ ray) * T_cam_port.normal - ray
        position.append(T_cam_port.position_m + 2.5 * mirrored)
        intensity.append(2 * SUN * np.array([1.0, 0.98, 0.95]))
        radius.append(0.10)
    return renderer.Lamps(np.array(position, float), np.array(intensity, float), np.array(radius))


def panel(seq: Sequence, port: Port):
    """The port on its panel (`Solid`) and the panel's skin."""
    rng = seq.rng("panel")
    centre_m = rng.uniform(-1, 1, 2) * [0.10, 0.05]
    size_m = port.panel_size_m
    if seq.skin == "textured":
        skin = skins.textured_cover(size_m, rng)
    elif seq.skin == "film":
        metal = "gold" if rng.random() < 0.3 else "aluminium"
        skin = skins.film(size_m, -centre_m, rng, metal, pleated=seq.port)
    else:  # the one realistic mock-up, which training and test share, as in the paper
        rng = np.random.default_rng(zlib.crc32(b"mock-up"))
        centre_m = np.array([0.06, 0.02])
        skin = skins.film(size_m, -centre_m, rng, pleated=seq.port)
    solid = cad.solid(port, centre_m)
    return (solid if seq.port else cad.without_port(solid)), skin


def backdrop(seq: Sequence, camera: Camera, total_intensity: float) -> np.ndarray:
    """Radiance (H, W, 3) of the room behind the panel: dark, at times with a wall's edge, a cloth, a joint of
    the arm."""
    rng, (width, height) = seq.rng("backdrop"), camera.size_px
    v, u = np.indices((height, width), np.float32)
    light = np.full((height, width, 3), 0.002, np.float32)
    if rng.random() < 0.5:
        side, tint = rng.integers(2), np.array([1.0, rng.uniform(0.5, 1), rng.uniform(0.3, 1)])
        edge = rng.uniform(0.02, 0.25) * width + 0.1 * (v - height / 2) * rng.uniform(-1, 1)
        inside = (width - 1 - u if side else u) < edge
        light[inside] = rng.uniform(0.005, 0.05) * tint
    if rng.random() < 0.5:
        folds = 0.5 + 0.25 * skins.smooth_noise((height, width), rng.uniform(20, 60), rng)
        hem = rng.uniform(0.7, 1.0) * height + 12 * skins.smooth_noise((height, width), 90, rng)
        cloth = np.array([1.0, rng.uniform(0.4, 0.7), rng.uniform(0.2, 0.5)]) * rng.uniform(0.01, 0.06)
        light = np.where((v > hem)[..., None], np.clip(folds, 0.05, 1)[..., None] * cloth, light)
    if rng.random() < 0.5:
        centre, half = rng.uniform([0, 0.5 * height], [width, height]), rng.uniform(12, 45, 2)
        x, y = (u - centre[0]) / half[0], (v - centre[1]) / half[1]
        round_off = np.sqrt(np.clip(1 - x**2, 0, 1)) * rng.uniform(0.02, 0.08)
        light = np.where(((np.abs(x) < 1) & (np.abs(y) < 1))[..., None], round_off[..., None], light)
    return optics.blur(light.astype(np.float32) * np.float32(min(total_intensity, 40.0)), 1.0)
