"""The data set's sequences, each from its name alone: who moves how, under which lamps, on what skin.

``augmented-N`` (covers that are no satellite's), ``realistic-N`` (film, training), ``test-low``,
``test-medium``, ``test-high`` (one unseen trajectory, three levels of light), ``hard-slow``,
``hard-reflect``, ``empty-N`` (no port).
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from . import dvs, materials, scene, shading
from .core import EVENT, Camera, InputError, Port, Pose, Recording, Trajectory
from .geometry import project

KINDS = re.compile(r"(augmented|realistic|empty)-(\d+)|test-(low|medium|high)|hard-(slow|reflect)")
COLOCATED_M, EARTHSHINE_M, SUN_M = (0.035, -0.020, 0.0), (0.9, -0.7, 0.1), (-2.2, -0.7, -0.9)
EARTHSHINE, SUN = 14.0, 170.0  # radiant intensities; the colocated lamp's is 1
GAIN = 0.12  # radiance to the RGB sensor's full scale: one exposure for every light
EXPOSURE_US = 8000
DVS_SCALE = 25.0  # radiance to the event sensor's 8-bit units
LENS_BLUR_PX = 0.6
STEP_PX = 0.7  # image motion between renders
FRAME_HZ, TRUTH_HZ = 20, 200


@dataclass(frozen=True)
class Sequence:
    """All that decides a recording; ``seconds`` is its default length."""

    name: str
    light: str
    skin: str
    port: bool = True
    seconds: float = 10.0
    speed: float = 1.0
    wander: float = 1.0

    def rng(self, what: str) -> np.random.Generator:
        """An independent stream per purpose; the three test sequences share theirs."""
        group = "test" if self.name.startswith("test-") else self.name
        return np.random.default_rng([zlib.crc32(group.encode()), zlib.crc32(what.encode())])


def sequence(name: str) -> Sequence:
    """The sequence of a name; `InputError` if there is none."""
    match = KINDS.fullmatch(name)
    if not match:
        raise InputError(
            f"sequence {name!r} is unknown: use augmented-N, realistic-N, test-low, test-medium, test-high, "
            "hard-slow, hard-reflect or empty-N"
        )
    kind, number, level, hard = match.groups()
    if level:
        return Sequence(name, level, "mock-up")
    if hard == "slow":
        return Sequence(name, "low", "mock-up", speed=0.0, wander=0.3)
    if hard == "reflect":
        return Sequence(name, "reflect", "mock-up", wander=0.4)
    light = ("low", "medium", "high")[int(number) % 3]
    skin = "textured" if kind == "augmented" else ("mock-up" if int(number) % 2 else "film")
    return Sequence(name, light, skin, port=kind != "empty")


def motion(seq: Sequence, t_s) -> Pose:
    """``T_cam_port`` at times (N,): sums of slow sinusoids, within an arm's reach and speed."""
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


def lamps(seq: Sequence) -> shading.Lamps:
    """Colocated; + earthshine (a soft box of four parts) in medium light; + sun in high light."""
    rng = seq.rng("lamps")
    position, intensity, radius = [COLOCATED_M], [np.ones(3)], [0.01]
    if seq.light == "medium" or (seq.light == "high" and seq.name.startswith("augmented")):
        corners = 0.12 * np.array([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
        position += list(np.array(EARTHSHINE_M) + corners)
        intensity += [EARTHSHINE / 4 * np.array([0.97, 1.0, 1.03])] * 4
        radius += [0.12] * 4
    if seq.light == "high":
        training = not seq.name.startswith("test")
        position.append(np.array(SUN_M) + training * rng.uniform(-0.6, 0.6, 3))
        intensity.append(SUN * (rng.uniform(0.4, 1.2) if training else 1.0) * np.array([1.0, 0.98, 0.95]))
        radius.append(0.10)
    if seq.light == "reflect":  # where the panel, were it a mirror, would throw the sun into the lens
        T_cam_port = motion(seq, np.array([5.0]))[0]
        ray = -T_cam_port.position_m / np.linalg.norm(T_cam_port.position_m)
        mirrored = 2 * (T_cam_port.normal @ ray) * T_cam_port.normal - ray
        position.append(T_cam_port.position_m + 2.5 * mirrored)
        intensity.append(2 * SUN * np.array([1.0, 0.98, 0.95]))
        radius.append(0.10)
    return shading.Lamps(np.array(position, float), np.array(intensity, float), np.array(radius))


def panel(seq: Sequence, port: Port):
    """The solid and the skin of a sequence."""
    rng = seq.rng("panel")
    centre_m = rng.uniform(-1, 1, 2) * [0.10, 0.05]
    size_m = port.panel_size_m
    if seq.skin == "textured":
        skin = materials.textured(size_m, rng)
    elif seq.skin == "film":
        skin = materials.film(size_m, -centre_m, rng, "gold" if rng.random() < 0.3 else "aluminium")
    else:  # the one realistic mock-up, which training and test share, as in the paper
        rng = np.random.default_rng(zlib.crc32(b"mock-up"))
        centre_m = np.array([0.06, 0.02])
        skin = materials.film(size_m, -centre_m, rng)
    solid = scene.solid(port, centre_m)
    return (solid if seq.port else solid._replace(bound_radius2=-1.0)), skin


def backdrop(seq: Sequence, camera: Camera, total_intensity: float) -> np.ndarray:
    """Radiance (H, W, 3) of the still room: dark, with a few dim soft-edged things."""
    rng = seq.rng("backdrop")
    shape = (camera.height_px, camera.width_px)
    light = np.full((*shape, 3), 0.002, np.float32)
    for _ in range(rng.integers(0, 4)):
        edge = np.clip(
            20 * materials.smooth_noise(shape, rng.uniform(80, 250), rng) - rng.uniform(10, 40), 0, 1
        )
        colour = rng.uniform(0.005, 0.06) * np.array([1.0, rng.uniform(0.5, 1), rng.uniform(0.3, 1)])
        light += edge[..., None] * colour.astype(np.float32)
    return shading.blur(light * np.float32(min(total_intensity, 40.0)), 1.0)


def render_times_us(seq: Sequence, port: Port, camera: Camera, seconds: float) -> np.ndarray:
    """Times between which no point of panel or ring moves by more than about `STEP_PX`."""
    t = np.arange(0, seconds + 1e-9, 0.001)
    poses = motion(seq, t)
    x, y = np.array(port.panel_size_m) / 2
    corners = np.array([[x, y, 0], [-x, y, 0], [x, -y, 0], [-x, -y, 0], [0, 0, port.plate_height_m]])
    points = project(np.einsum("nij,kj->nki", poses.rotation, corners) + poses.position_m[:, None], camera)
    near = np.abs(points[1:] - np.array(camera.size_px) / 2).max(-1) < camera.width_px
    speed = np.where(near, np.linalg.norm(np.diff(points, axis=0), axis=-1), 0).max(1)
    travelled = np.concatenate([[0], np.cumsum(np.clip(speed, STEP_PX / 20, STEP_PX))])
    steps = np.interp(np.arange(0, travelled[-1], STEP_PX), travelled, t)
    return np.unique((steps * 1e6).astype(np.int64))


def stream(seq: Sequence, camera: Camera, port: Port, seconds: float) -> Iterator[tuple]:
    """Yield ``(t_us, events since the last, frame or None)`` in the order of time."""
    solid, skin = panel(seq, port)
    light, rng = lamps(seq), seq.rng("noise " + seq.light)
    still = backdrop(seq, camera, light.intensity[:, 0].sum())
    rays = shading.ray_grid(camera, 2)
    sensor = dvs.EventSensor(camera, dvs.Sensor(), rng)

    def look(t_us):
        T_cam_port = motion(seq, np.array([t_us * 1e-6]))[0]
        return shading.render(solid, skin, light, T_cam_port, rays, still)[0]

    frames_us = np.arange(EXPOSURE_US, seconds * 1e6 - EXPOSURE_US, 1e6 / FRAME_HZ).astype(np.int64)
    steps_us = render_times_us(seq, port, camera, seconds)
    for t_us in np.union1d(steps_us, frames_us):
        radiance = look(t_us)
        intensity = shading.luminance(shading.blur(radiance, LENS_BLUR_PX)) * DVS_SCALE
        events, frame = sensor(intensity, int(t_us)), None
        if t_us in frames_us:
            ends = [look(t_us + side * EXPOSURE_US // 3) for side in (-1, 1)]
            mean = shading.blur((radiance + ends[0] + ends[1]) / 3, LENS_BLUR_PX)
            frame = shading.expose(mean, GAIN, rng)
        yield int(t_us), events, frame


def duration_s(seq: Sequence, seconds: float | None) -> float:
    """The asked length, or the sequence's own; `InputError` if it makes no sense."""
    seconds = seq.seconds if seconds is None else seconds
    if not (np.isfinite(seconds) and 0 < seconds <= 3600):
        raise InputError(f"sequence {seq.name}: cannot last {seconds} s; give --seconds from 0.2 to 3600")
    return seconds


def simulate(name: str, seconds: float | None = None, progress=None) -> Recording:
    """Record a sequence with a DAVIS 346 looking at an LM-MAP; ``progress(seconds_done)``.

    Raises
    ------
    InputError
        For an unknown name or a length that is not positive.
    """
    seq, camera, port = sequence(name), Camera.davis346(), Port.lm_map()
    seconds = duration_s(seq, seconds)
    events, frames, frames_us = [], [], []
    for t_us, some, frame in stream(seq, camera, port, seconds):
        events.append(some)
        if frame is not None:
            frames.append(frame)
            frames_us.append(t_us)
        if progress:
            progress(t_us * 1e-6)
    truth_us = np.arange(0, seconds * 1e6 + 1, 1e6 / TRUTH_HZ).astype(np.int64)
    truth = Trajectory(truth_us, motion(seq, truth_us * 1e-6)) if seq.port else None
    frames = np.stack(frames) if frames else np.empty((0, camera.height_px, camera.width_px, 3), np.uint8)
    all_events = np.concatenate(events) if events else np.empty(0, EVENT)
    return Recording(name, camera, all_events, frames, np.array(frames_us, np.int64), truth)


def label_masks(T_cam_port: Pose, port: Port, camera: Camera, rays=None) -> np.ndarray:
    """Binary masks (2, H, W) of ring and markers by the CAD and the pose, with occlusion."""
    rays = shading.ray_grid(camera, 4) if rays is None else rays
    none = shading.Lamps(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    skin = np.zeros((2, 2, materials.CHANNELS), np.float32)
    black = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
    cover = shading.render(scene.solid(port), skin, none, T_cam_port, rays, black)[1]
    return np.moveaxis(cover >= 0.5, -1, 0)
