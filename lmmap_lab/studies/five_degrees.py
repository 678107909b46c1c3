"""What would make normals five degrees off, as those of the paper's Table I: noise, formulas, truths.

The bench's test trajectories are seen as ellipses.  Noise displaces these, a formula makes normals of them,
the paper's outlier filter runs over the normals, and they are compared with a truth that may be askew.
`five_degrees_fit` compares the medians and root mean squares of what is kept with the table's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import in_view
from lmmap.geometry.rotations import angle_between_rad
from lmmap.pipeline import circle
from lmmap.settings import PAPER
from lmmap.types import Camera, Ellipse, Port, Pose

from ..bench.laboratory import SECONDS, sequence, sequence_motion
from . import bootstrap, formula
from .table1 import BLOCK_S

EXACT = "exact"  # a reading beside `formula.READINGS`
FLATTEST = 0.03  # noise makes no ellipse narrower
LEAST_DEG = 1e-3  # of a prediction, for its logarithm
NOISE_PX = np.array([0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.3, 1.7, 2.4])


@dataclass(frozen=True)
class Scene:
    """Poses (N,) in the order of time, and the noise of their images.

    Attributes
    ----------
    T_cam_port : Pose
        True ones.
    follows : numpy.ndarray
        (N,) whether the pose before is the one a tenth of a second earlier.
    trajectory : numpy.ndarray
        (N,) the trajectory's number.
    noise : numpy.ndarray
        (N, 5) in the order of `chart`, for noise of 1 px.
    wrong : Mapping
        By reading, where (N,) the second-best candidate was chosen; nowhere for a reading that is absent.
    camera : Camera
        Without distortion.
    radius_m : float
        Of the ring.
    """

    T_cam_port: Pose
    follows: np.ndarray
    trajectory: np.ndarray
    noise: np.ndarray
    wrong: Mapping[str, np.ndarray] = field(default_factory=dict)
    camera: Camera = field(default_factory=Camera.davis346)
    radius_m: float = Port.lm_map().ring_radius_m


def bench_scene(lasting: float = 0.0, distance: float = 1.0, tilt: float = 1.0, seed: int = 0) -> Scene:
    """The bench's three test trajectories at 10 Hz, with the whole ring in view, and candidates chosen right.

    Independent noise of a contour's points is as large in the centre as in the ellipticity, and smaller by
    the root of two in the mean radius.

    Parameters
    ----------
    lasting
        Correlation of the noise of an image and the next.
    distance, tilt
        Factors of all distances, and of all angles between normal and line of sight.
    """
    camera, port = Camera.davis346(), Port.lm_map()
    t_s = np.arange(0, SECONDS["paper"]["test"], 1 / PAPER.rate_hz)
    motions = [sequence_motion(sequence(name), t_s) for name in ("test-low", "test-low-1", "test-low-2")]
    R, p = (np.concatenate([getattr(T, name) for T in motions]) for name in ("rotation", "position_m"))
    axis = np.cross(-p, R[..., 2])
    axis *= ((tilt - 1) * formula.tilt_to_sight_rad(Pose(R, p)) / np.linalg.norm(axis, axis=1))[:, None]
    T = Pose(Rotation.from_rotvec(axis).as_matrix() @ R, distance * p)
    seen = np.flatnonzero(in_view(T, port, camera))
    trajectory = seen // len(t_s)
    follows = np.r_[False, (np.diff(seen) == 1) & (np.diff(trajectory) == 0)]
    noise = np.random.default_rng(seed).standard_normal((len(seen), 5)) * [1, 1, 1, 1, np.sqrt(0.5)]
    for k in np.flatnonzero(follows & (lasting > 0)):
        noise[k] = lasting * noise[k - 1] + np.sqrt(1 - lasting**2) * noise[k]
    return Scene(T[seen], follows, trajectory, noise)


def chart(ellipse: Ellipse) -> np.ndarray:
    """Centre (2), ellipticity (2) and mean radius of ellipses, (..., 5) px: smooth where one is a circle."""
    major, minor = np.moveaxis(ellipse.semi_axes_px, -1, 0)
    twice = 2 * ellipse.angle_rad
    flat = ((major - minor) / 2)[..., None] * np.stack([np.cos(twice), np.sin(twice)], -1)
    return np.concatenate([ellipse.centre_px, flat, ((major + minor) / 2)[..., None]], -1)


def from_chart(values) -> Ellipse:
    """Inverse of `chart`."""
    flat, mean = np.linalg.norm(values[..., 2:4], axis=-1), np.maximum(values[..., 4], 1e-3)
    flat = np.minimum(flat, (1 - FLATTEST) / (1 + FLATTEST) * mean)
    angle_rad = np.arctan2(values[..., 3], values[..., 2]) / 2
    return Ellipse(values[..., :2], np.stack([mean + flat, mean - flat], -1), angle_rad)


def chosen(scene: Scene, reading: str, ratio: float, noise_px: float) -> tuple[Pose, np.ndarray]:
    """True poses (N,) behind a lens that makes nu over Z ``ratio`` times the bench's and leaves the images as
    they are, and the normals (N, 3) that are chosen."""
    T, camera, radius_m = formula.behind_lens(scene.T_cam_port, scene.camera, scene.radius_m, ratio)
    seen = from_chart(chart(circle_ellipse(T, radius_m, camera)) + noise_px * scene.noise)
    n = (circle.poses(seen, camera, radius_m).normal if reading == EXACT
         else formula.normals(seen, camera, radius_m, reading, T.position_m))  # fmt: skip
    order, every = np.argsort(angle_between_rad(n, T.normal[:, None]), 1), np.arange(len(n))
    wrong = scene.wrong.get(reading, np.zeros(len(n), bool))
    return T, n[every, order[every, wrong.astype(int)]]


def kept(normals, follows, limit_rad: float = PAPER.outlier_angle_rad) -> np.ndarray:
    """Which of the normals (N, 3) the paper's outlier filter keeps, (N,), while no yaw jumps."""
    close = follows & np.r_[False, angle_between_rad(normals[1:], normals[:-1]) <= limit_rad]
    return close & np.r_[False, close[:-1]]


def misaligned(T: Pose, tilt_rad: float, on_camera: bool = False) -> np.ndarray:
    """Normals (N, 3) of a truth that one rotation tilts: of the port on the arm, or of the camera."""
    tip = Rotation.from_rotvec([tilt_rad, 0, 0]).as_matrix()
    return T.normal @ tip.T if on_camera else T.rotation @ tip[:, 2]


def errors_deg(scene: Scene, reading: str, ratio: float, noise_px: float,
               tilts_deg: Sequence[float] = (0,), on_camera: bool = False,
               limit_rad: float = PAPER.outlier_angle_rad) -> np.ndarray:  # fmt: skip
    """Angles (len(tilts_deg), N) between normals and misaligned truths; NaN where the filter rejects."""
    T, n = chosen(scene, reading, ratio, noise_px)
    good = kept(n, scene.follows, limit_rad)
    off = [angle_between_rad(n, misaligned(T, np.deg2rad(tilt), on_camera)) for tilt in tilts_deg]
    return np.where(good, np.rad2deg(off), np.nan)


def draws(scene: Scene, count: int, seed: int = 0) -> np.ndarray:
    """How often each pose is drawn, (count + 1, N): all once, then ``count`` times blocks of one trajectory,
    since the paper's test has one."""
    rng, lengths = np.random.default_rng(seed), np.bincount(scene.trajectory)
    blocks = bootstrap.block_counts(lengths, round(BLOCK_S * PAPER.rate_hz), count, rng)
    drawn = blocks * (scene.trajectory == rng.integers(0, len(lengths), (count, 1)))
    return np.concatenate([np.ones((1, len(scene.follows)), int), drawn])


def predictions(scene: Scene, reading: str, ratios, tilts_deg, counts, **options) -> np.ndarray:
    """Logarithms of median and RMSE (deg), and the share that is kept, (draws, ratios, tilts, noise, 3), at
    `NOISE_PX`; ``options`` as in `errors_deg`."""
    found = np.empty((len(ratios), len(tilts_deg), len(NOISE_PX), 3, len(counts)))
    for i, ratio in enumerate(ratios):
        for k, noise_px in enumerate(NOISE_PX):
            for j, values in enumerate(errors_deg(scene, reading, ratio, noise_px, tilts_deg, **options)):
                both = bootstrap.medians(values, counts), bootstrap.root_mean_squares(values, counts)
                share = bootstrap.shares(np.isfinite(values), np.ones(len(values), bool), counts)
                found[i, j, k] = *np.log(np.maximum(both, LEAST_DEG)), share
    return np.moveaxis(found, -1, 0)
