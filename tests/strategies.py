"""Random worlds that the tests share."""

import os

import numpy as np
import pytest
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lmmap.geometry.port import in_view
from lmmap.geometry.projection import project
from lmmap.geometry.rotations import angle_between_rad, rotation_z
from lmmap.settings import OURS
from lmmap.tracking.edges import Edges
from lmmap.types import EVENT, Camera, Ellipse, InputError, Port, Pose

CAMERA = Camera.davis346()
WIDE = Camera(346, 260, 324.0, 320.0, 170.0, 131.0, (-0.35, 0.12, 0.001, -0.0008, 0.02))
PORT = Port.lm_map()


def pose(centre_px, distance_m, tilt_rad, azimuth_rad=0.0, yaw_rad=0.0, camera=CAMERA) -> Pose:
    """Port centred on a pixel, its normal tilted from the line of sight toward an azimuth."""
    x, y = (np.asarray(centre_px) - camera.K[:2, 2]) / np.diag(camera.K)[:2]
    back = -np.array([x, y, 1.0]) / np.sqrt(x * x + y * y + 1)
    right = np.cross(back, [0, 1, 0])
    right = right / np.linalg.norm(right)
    side = np.cos(azimuth_rad) * right + np.sin(azimuth_rad) * np.cross(back, right)
    n = np.cos(tilt_rad) * back + np.sin(tilt_rad) * side
    x_axis = np.cross([0, 1, 0], n)
    x_axis = x_axis / np.linalg.norm(x_axis)
    rotation = np.stack([x_axis, np.cross(n, x_axis), n], 1) @ rotation_z(yaw_rad)
    return Pose(rotation, -distance_m * back)


def facing_pose(tilt_rad, azimuth_rad, yaw_rad, position_m) -> Pose:
    """A port that looks along the camera's axis, tilted about an axis in the image plane, then turned."""
    tilt = Rotation.from_rotvec(tilt_rad * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0]))
    turn = tilt * Rotation.from_rotvec([np.pi, 0, 0]) * Rotation.from_rotvec([0, 0, yaw_rad])
    return Pose(turn.as_matrix(), position_m)


def visible_poses(min_tilt_deg=0.0, max_tilt_deg=65.0, max_distance_m=1.2):
    """Poses with the whole ring in the DAVIS' view."""
    return st.builds(
        lambda u, v, z, tilt, azimuth, yaw: pose((u, v), z, np.deg2rad(tilt), azimuth, yaw),
        st.floats(60, 286), st.floats(60, 200), st.floats(0.3, max_distance_m),
        st.floats(min_tilt_deg, max_tilt_deg), st.floats(0, 2 * np.pi), st.floats(0, 2 * np.pi),
    ).filter(lambda T: in_view(T, PORT, CAMERA))  # fmt: skip


def ellipses(min_ratio=0.3, max_ratio=1.0):
    return st.builds(
        lambda u, v, a, ratio, angle: Ellipse([u, v], [a, a * ratio], angle),
        st.floats(80, 260), st.floats(60, 200), st.floats(20, 90),
        st.floats(min_ratio, max_ratio), st.floats(0, np.pi, exclude_max=True),
    )  # fmt: skip


def rotations():
    angle = st.floats(-np.pi, np.pi)
    return st.tuples(angle, angle, angle).map(_rotation)


def rigid_poses():
    metre = st.floats(-2, 2)
    return st.builds(lambda R, x, y, z: Pose(R, [x, y, z]), rotations(), metre, metre, metre)


def _rotation(angles):
    a, b, c = angles
    tilt = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    return rotation_z(a) @ tilt @ rotation_z(c)


def seeds():
    return st.integers(0, 2**32 - 1)


def cut(events: np.ndarray, rng, pieces: int = 7) -> list[np.ndarray]:
    """An array in random pieces, some of them empty."""
    return np.split(events, np.sort(rng.integers(0, len(events) + 1, pieces - 1)))


def off(T: Pose, truth: Pose) -> tuple[float, float]:
    """How far a pose is from the true one: angle between the normals in deg, distance in mm."""
    return (float(np.rad2deg(angle_between_rad(T.normal, truth.normal))),
            float(1e3 * np.linalg.norm(T.position_m - truth.position_m)))  # fmt: skip


def moved(T, step) -> Pose:
    """A pose after a small step (6,): position, then rotation on the left."""
    return Pose(Rotation.from_rotvec(step[3:]).as_matrix() @ T.rotation, T.position_m + step[:3])


def edge_events(rng, t_us, T, velocity, count=400, clutter=0, camera=CAMERA):
    """Events of edges at a pose: where an edge moves, of the polarity that it makes, a little outward."""
    edges = Edges.of(PORT)
    rate = edges.jacobian(T, camera) @ velocity
    usable = edges.visible(T, PORT, camera) & (np.abs(rate) > 5)
    b = rng.choice(np.flatnonzero(usable), count) if usable.any() else np.zeros(0, int)
    out = project(T @ (edges.points_m + 1e-4 * edges.outward), camera) - project(T @ edges.points_m, camera)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    pixels = project(T @ edges.points_m, camera)[b] + OURS.between.outward_px * out[b]
    pixels = np.concatenate([pixels + rng.normal(0, 0.5, pixels.shape),
                             rng.uniform(0, np.array(camera.size_px) - 1, (clutter, 2))])  # fmt: skip
    events = np.zeros(len(pixels), EVENT)
    events["x"], events["y"] = np.rint(pixels).astype(int).T
    events["p"] = np.concatenate([rate[b] > 0, rng.random(clutter) < 0.5])
    events["t_us"] = t_us + np.arange(len(events)) % 100
    return np.sort(events, order="t_us")


def line(function, *arguments) -> str:
    """The message of a function that refuses its input, in one line."""
    with pytest.raises(InputError) as refused:
        function(*arguments)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def unreadable(folder) -> list[tuple]:
    """Paths of what is no file or too large, made in a folder, each with words that refuse it."""
    (folder / "device").symlink_to("/dev/zero")
    os.mkfifo(folder / "pipe")
    with (folder / "sparse").open("wb") as file:
        file.truncate(2**33)
    refused = {"device": "a device or a pipe", "pipe": "a device or a pipe", "sparse": "8589934592 bytes",
               "none": "no such file"}  # fmt: skip
    return [(folder / name, words) for name, words in refused.items()]
