"""Static scenes on which EVO must work: rooms of textured planes and boxes, seen by the bench's event sensor.

The world's axes are the camera's at rest: x right, y down, z forward; lengths are metres.  A scene is a
function of its name, and so is the camera's motion.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from lmmap.types import EVENT, Camera, Pose, Recording, Trajectory
from lmmap_lab.bench import optics
from lmmap_lab.bench.event_sensor import EventSensor, SensorSettings

from .rooms import Room, room

SUPERSAMPLING = 2  # rays per pixel along each axis
LENS_BLUR_PX, STEP_PX, TRUTH_HZ = 0.6, 0.9, 200  # as in `lmmap_lab.bench.sequences`
FULL_SCALE = 220.0  # 8-bit units of a white surface


@dataclass(frozen=True)
class Scene:
    """A room, and how a camera moves in it; ``speed`` multiplies all frequencies of the motion."""

    name: str
    seconds: float
    speed: float
    sway_m: tuple[float, float, float]
    turn_rad: tuple[float, float, float]
    layout: str
    slides_first: bool = True


SCENES = (
    Scene("boxes-slow", 20.0, 1.0, (0.45, 0.25, 0.20), (0.06, 0.08, 0.10), "boxes"),
    Scene("boxes-fast", 10.0, 3.0, (0.45, 0.25, 0.20), (0.06, 0.08, 0.10), "boxes"),
    Scene("desk-slow", 20.0, 1.0, (0.35, 0.20, 0.20), (0.08, 0.08, 0.10), "desk"),
    Scene("corner-fast", 12.0, 2.5, (0.40, 0.25, 0.25), (0.08, 0.10, 0.12), "corner"),
)
TURNING = (  # from the first moment on, which is hard on a start from a plane
    Scene("boxes-turning", 6.0, 2.0, (0.45, 0.25, 0.20), (0.06, 0.08, 0.10), "boxes", False),
    Scene("desk-turning", 6.0, 2.0, (0.35, 0.20, 0.20), (0.08, 0.08, 0.10), "desk", False),
    Scene("corner-turning", 6.0, 2.0, (0.40, 0.25, 0.25), (0.08, 0.10, 0.12), "corner", False),
)


def scene(name: str) -> Scene:
    """The scene of a name; ``KeyError`` if there is none."""
    return {s.name: s for s in (*SCENES, *TURNING)}[name]


def motion(s: Scene, t_s) -> Pose:
    """``T_cam_world`` at times (N,): sums of three sinusoids along and about each axis.

    With ``slides_first`` the camera begins with a slide: rotation sets in between 1 and 3 s (divided by the
    speed), which EVO's start from a fronto-parallel plane asks for; see `odometry.Odometry`.
    """
    rng, t_s = np.random.default_rng(zlib.crc32(f"motion {s.name}".encode())), np.asarray(t_s, float)

    def waves(amplitude):
        frequency_hz, phase = rng.uniform(0.06, 0.22, 3), rng.uniform(0, 2 * np.pi, 3)
        return amplitude / 2 * np.sin(2 * np.pi * s.speed * frequency_hz * t_s[:, None] + phase).sum(1)

    position = np.stack([waves(a) for a in s.sway_m], -1)
    onset = np.clip((s.speed * t_s - 1) / 2, 0, 1)[:, None] if s.slides_first else 1.0
    turn = np.stack([waves(a) for a in s.turn_rad], -1) * onset**2 * (3 - 2 * onset)
    rotation = Rotation.from_rotvec(turn).as_matrix()
    return Pose(rotation, position).inverse


def render(where: Room, T_cam_world: Pose, camera: Camera, supersampling: int = SUPERSAMPLING):
    """Reflectance and depth (m; infinite where nothing is) at each sub-pixel, (s H, s W) each."""
    n = supersampling
    K = camera.K.copy()
    K[:2] *= n
    K[:2, 2] += (n - 1) / 2
    edges = T_cam_world.rotation @ where.frames
    edges[:, :, 2] += T_cam_world.position_m
    shape = (n * camera.height_px, n * camera.width_px)
    inverse_depth, at = np.zeros(shape, np.float32), np.zeros((*shape, 2), np.float32)
    number = np.full(shape, -1, np.int32)
    corners = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1.0]]).T
    for k, frame in enumerate(edges):
        points = K @ frame @ corners
        if (points[2] < 1e-3).all() or abs(np.linalg.det(frame)) < 1e-9:
            continue
        box = np.array([0, 0, shape[1], shape[0]])
        if (points[2] > 1e-3).all():
            u, v = points[:2] / points[2]
            box = np.array(
                [max(u.min(), 0), max(v.min(), 0), min(u.max() + 1, shape[1]), min(v.max() + 1, shape[0])]
            )
        if (box[2:] > box[:2]).all():
            _rasterise(np.linalg.inv(K @ frame), box.astype(np.int64), k, inverse_depth, at, number)
    sizes = np.array([texture.shape for texture in where.textures])
    start = np.concatenate([[0], np.cumsum(sizes.prod(1))])
    flat = np.concatenate([texture.ravel() for texture in where.textures])
    with np.errstate(divide="ignore"):
        return _shade(number, at, flat, start, sizes), 1 / inverse_depth


def depth_image(s: Scene, T_cam_world: Pose, camera: Camera) -> np.ndarray:
    """True depth (m) at pixel centres, (H, W)."""
    return render(room(s.layout), T_cam_world, camera, 1)[1]


def simulate(s: Scene, camera: Camera | None = None, seconds: float | None = None) -> Recording:
    """Record a scene's events and true motion; no frames."""
    camera, seconds = camera or Camera.davis346(), s.seconds if seconds is None else seconds
    device = EventSensor(
        camera, SensorSettings(), np.random.default_rng(zlib.crc32(f"events {s.name}".encode()))
    )
    where, parts = room(s.layout), [np.empty(0, EVENT)]
    for t_us in _render_times_us(s, where, camera, seconds).tolist():
        reflectance = render(where, motion(s, [t_us * 1e-6])[0], camera)[0]
        image = cv2.resize(reflectance, camera.size_px, interpolation=cv2.INTER_AREA)
        parts.append(device(optics.apply_lens(image, LENS_BLUR_PX) * FULL_SCALE, t_us))
    truth_us = np.arange(0, seconds * 1e6 + 1, 1e6 / TRUTH_HZ).astype(np.int64)
    none = np.empty((0, camera.height_px, camera.width_px, 3), np.uint8)
    truth = Trajectory(truth_us, motion(s, truth_us * 1e-6))
    return Recording(s.name, camera, np.concatenate(parts), none, np.empty(0, np.int64), truth)


def _render_times_us(s: Scene, where: Room, camera: Camera, seconds: float) -> np.ndarray:
    """Times between which no visible point moves by more than about `STEP_PX`."""
    t_s = np.arange(0, seconds + 1e-9, 0.01)
    poses, speed_px = motion(s, t_s), np.zeros(len(t_s) - 1)
    u, v = (
        a.ravel() for a in np.meshgrid(np.arange(0, camera.width_px, 15), np.arange(0, camera.height_px, 15))
    )
    rays = np.linalg.inv(camera.K) @ np.stack([u, v, np.ones(len(u))])
    for k in range(len(speed_px)):
        depth = render(where, poses[k], camera, 1)[1][v, u]
        seen = np.isfinite(depth)
        points = (poses[k + 1] @ poses[k].inverse) @ (rays * depth).T[seen]
        pixel = (points @ camera.K.T)[:, :2] / points[:, 2:]
        speed_px[k] = np.linalg.norm(pixel - np.stack([u, v], -1)[seen], axis=1).max()
    travelled = np.concatenate([[0], np.cumsum(np.maximum(speed_px, STEP_PX / 20))])
    return np.unique((np.interp(np.arange(0, travelled[-1], STEP_PX), travelled, t_s) * 1e6).astype(np.int64))


@njit(cache=True, error_model="numpy")
def _rasterise(H, box, number, inverse_depth, at, numbers):
    """Where a rectangle is nearest: its number and the place on it.  H maps pixels to (a, b, 1) / depth."""
    for v in range(box[1], box[3]):
        for u in range(box[0], box[2]):
            w = H[2, 0] * u + H[2, 1] * v + H[2, 2]
            if w <= inverse_depth[v, u]:
                continue
            a = (H[0, 0] * u + H[0, 1] * v + H[0, 2]) / w
            b = (H[1, 0] * u + H[1, 1] * v + H[1, 2]) / w
            if 0.0 <= a <= 1.0 and 0.0 <= b <= 1.0:
                inverse_depth[v, u], numbers[v, u] = w, number
                at[v, u, 0], at[v, u, 1] = a, b


@njit(cache=True, error_model="numpy")
def _shade(number, at, flat, start, sizes):
    """Bilinear look-up of the textures; 0 where there is no surface."""
    image = np.zeros(number.shape, np.float32)
    for v in range(number.shape[0]):
        for u in range(number.shape[1]):
            k = number[v, u]
            if k < 0:
                continue
            rows, columns = sizes[k, 0], sizes[k, 1]
            x, y = at[v, u, 0] * (columns - 1), at[v, u, 1] * (rows - 1)
            i, j = min(int(y), rows - 2), min(int(x), columns - 2)
            p, x, y = start[k] + i * columns + j, x - j, y - i
            image[v, u] = (1 - y) * ((1 - x) * flat[p] + x * flat[p + 1]) + y * (
                (1 - x) * flat[p + columns] + x * flat[p + columns + 1]
            )
    return image
