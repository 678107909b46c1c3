"""Samples whose poses are known: those of `training.dataset`, and the pose of each image beside its masks."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import joblib
import numpy as np

from lmmap.geometry.projection import project
from lmmap.geometry.rotations import rotation_z
from lmmap.types import Camera, Port, Pose, Recording

from ..bench import sequences, varied
from ..provenance import fingerprint
from ..training import dataset
from ..training.batches import events_of, vary
from ..training.recipe import Recipe


def posed_samples(recording: Recording, count: int, port: Port) -> dict[str, np.ndarray]:
    """`dataset.sample_recording`, and ``rgb_poses``, ``event_poses`` (N, 3, 4): rotation and position."""
    arrays, at = dataset.sample_recording(recording, count, port), recording.truth.at
    frames_us = recording.frames_t_us[dataset.spread(len(recording.frames), count)]
    for modality, t_us in (("rgb", frames_us), ("event", dataset.sample_events(recording, count)[1])):
        poses = at(np.array(t_us, np.int64))
        arrays[f"{modality}_poses"] = np.concatenate([poses.rotation, poses.position_m[..., None]], -1)
    return arrays


def port_of(name: str) -> Port:
    """The port of a training sequence."""
    is_varied = varied.NAME.fullmatch(name)
    return varied.draw_port(varied.base_sequence(name)) if is_varied else Port.lm_map()


def make(names: Iterable[str], folder: Path, jobs: int = -1, report=print) -> None:
    """Simulate sequences and write their samples into ``folder/NAME``; those that are there are kept."""
    absent = [name for name in names if not (folder / name).is_dir()]
    tasks = [joblib.delayed(_make)(name, folder) for name in absent]
    for i, path in enumerate(joblib.Parallel(jobs, return_as="generator_unordered")(tasks), 1):
        report(f"samples: {path.name}, {i} of {len(absent)}")


def _make(name: str, folder: Path) -> Path:
    port, code = port_of(name), (sequences.simulate, varied.record_varied, posed_samples)
    if varied.NAME.fullmatch(name):
        recording, count = varied.record_varied(name, port=port), dataset.VARIED_SAMPLES
    else:
        recording, count = sequences.simulate(name, dataset.SEQUENCE_SECONDS), dataset.SAMPLES
    samples = posed_samples(recording, count, port)
    return dataset.write_samples(folder / name, samples, fingerprint(code=code))


class PosedSamples(dataset.Samples):
    """Samples as `make` writes them; ``most`` of them, drawn by ``seed``."""

    def __init__(self, names: list[str], filter_name: str, modality: str, folder: Path,
                 most: int | None = None, seed: int = 0):  # fmt: skip
        super().__init__(names, filter_name, modality, folder)
        if most is not None and most < len(self):
            chosen = np.random.default_rng(seed).permutation(len(self))[:most]
            self._places = [self._places[i] for i in sorted(chosen)]

    def pose(self, index: int) -> Pose:
        """``T_cam_port``."""
        name, i = self._places[index]
        matrix = self._array(name, "_poses")[i]
        return Pose(matrix[:, :3], matrix[:, 3])

    def port(self, index: int) -> Port:
        """The port that the image shows."""
        return port_of(self._places[index][0])


def roll(T_cam_port: Pose, angle_rad: float, mirror: bool, camera: Camera) -> tuple[np.ndarray, Pose]:
    """Pixels (3, 3), as a homography, and pose as another camera sees them: turned about the optical axis,
    and before that mirrored.  A mirror image of the port is the port, for it is symmetric about the marker's
    direction.
    """
    R, p = T_cam_port.rotation, T_cam_port.position_m
    turn, flip = rotation_z(angle_rad), np.diag([-1.0 if mirror else 1.0, 1.0, 1.0])
    if mirror:
        R, p = flip @ R @ np.diag([1.0, -1.0, 1.0]), flip @ p
    matrix, centre = turn @ flip, np.array([camera.cx_px, camera.cy_px])
    matrix[:2, 2] = centre - matrix[:2, :2] @ centre
    return matrix, Pose(turn @ R, turn @ p)


def warp(image: np.ndarray, matrix: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """Move the pixels of a frame, or of a histogram or mask whose values stay, by a homography (3, 3)."""
    flags = cv2.INTER_LINEAR if image.ndim == 3 else cv2.INTER_NEAREST
    return cv2.warpPerspective(image, matrix, size_px, flags=flags).astype(np.float32)


def turned_sample(samples: PosedSamples, recipe: Recipe, camera: Camera, rng):
    """Image and mask of a sample as they are, and what turns them by any angle: the pixels' homography, with
    the pose and the port after it.  The lens has to be alike in all directions."""
    while True:  # a port out of the image has no pose to learn
        index, angle_rad, mirror = rng.integers(len(samples)), rng.uniform(-np.pi, np.pi), rng.random() < 0.5
        matrix, pose = roll(samples.pose(index), angle_rad, mirror, camera)
        events = events_of(recipe, rng)
        at = project(pose.position_m, camera)
        if np.all((at > 0) & (at < camera.size_px)):
            mask = samples.mask(index).astype(np.uint8)
            return samples.image(index, events), mask, matrix, pose, samples.port(index)


def varied_image(image: np.ndarray, mask: np.ndarray, recipe: Recipe, rng) -> np.ndarray:
    """An image as a recipe varies it, with something plain and dark as cover."""
    return vary(image, mask > 0, np.zeros_like(image), recipe, rng)[0]
