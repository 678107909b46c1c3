"""What EVO makes: keyframes with their maps, and the poses of a track."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.types import Pose, Trajectory

from . import mapping


@dataclass
class Keyframe:
    """A semi-dense map and where it was made: ``T_cam_world`` of its reference camera.

    Tracking uses ``points``, which are cleaned less.
    """

    t_us: int
    rotation: np.ndarray
    position: np.ndarray
    map: mapping.DepthMap
    points: np.ndarray  # (N, 3) in the world
    mean_depth: float


@dataclass
class Track:
    """One map's life: poses ``T_cam_world`` since its bootstrap, and the keyframes made."""

    t_us: list[int] = field(default_factory=list)
    rotation: list[np.ndarray] = field(default_factory=list)
    position: list[np.ndarray] = field(default_factory=list)
    event: list[int] = field(default_factory=list)  # in the middle of each pose's frame
    keyframes: list[Keyframe] = field(default_factory=list)  # without the plane
    ready_us: int | None = None  # when the bootstrap was over
    lost: bool = False

    def last(self, count: int) -> Track:
        """The last poses as a track of their own, without keyframes."""
        parts = (values[-count:] for values in (self.t_us, self.rotation, self.position, self.event))
        return Track(*parts)

    def trajectory(self) -> Trajectory:
        """Poses from the end of the bootstrap on."""
        since = len(self.t_us) if self.ready_us is None else int(np.searchsorted(self.t_us, self.ready_us))
        rotation, position = np.array(self.rotation[since:]), np.array(self.position[since:])
        return Trajectory(self.t_us[since:], Pose(rotation.reshape(-1, 3, 3), position.reshape(-1, 3)))


def orthonormal(R: np.ndarray) -> np.ndarray:
    """The rotation nearest to a matrix that is almost one."""
    return 0.5 * R @ (3 * np.eye(3) - R.T @ R)


def interpolate(events, track: Track) -> tuple[np.ndarray, np.ndarray]:
    """Poses at event numbers, between the track's: (N, 3, 3) and (N, 3)."""
    known, rotation, position = (np.array(a) for a in (track.event, track.rotation, track.position))
    k = np.clip(np.searchsorted(known, events) - 1, 0, len(known) - 2)
    share = np.clip((events - known[k]) / (known[k + 1] - known[k]), 0, 1)[:, None]
    turn = Rotation.from_matrix(rotation[k + 1] @ np.swapaxes(rotation[k], -1, -2)).as_rotvec()
    R = Rotation.from_rotvec(share * turn).as_matrix() @ rotation[k]
    return R, position[k] + share * (position[k + 1] - position[k])
