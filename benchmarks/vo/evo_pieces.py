"""Why EVO fails on the docking sequences: its parts alone, on short pieces.

evo_pieces.py FOLDER

FOLDER holds the recordings that `make vo` has simulated, SEQUENCE.h5.  Each piece is given to EVO as it is;
to its mapping with the true poses; and to its tracking with the true depth of the first view as the first
map.  A room of `evo.scenes` is the control.  Writes data/results/odometry/evo-pieces.csv.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from numba import njit

from lmmap.geometry.projection import bearings
from lmmap.geometry.rotations import rotation_angle_rad
from lmmap.recordings.formats import open_recording
from lmmap.types import Camera, Port, Pose, Trajectory
from lmmap_lab.bench import cad, laboratory
from lmmap_lab.provenance import save_table
from lmmap_lab.studies.odometry import FOLDER, SEQUENCES

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # so that the package has one name, vo.evo

from evo_scenes import CAMERA, events
from vo.evo import scenes
from vo.evo.odometry import Odometry

STARTS_S, SECONDS = (0.0, 10.0, 20.0, 30.0), 2.0
CONTROL = {"boxes-fast": (0.0, 5.0), "corner-fast": (0.0, 5.0)}
ASTRAY = 0.1  # of the depth: a track from the true map is astray beyond this position error


@njit(cache=True)
def _depth(solid, R, origin, rays):
    """Depth along the camera's axis of the first surface at each pixel, (H, W) m; infinite where none."""
    out = np.full(rays.shape[:2], np.inf)
    for v in range(rays.shape[0]):
        for u in range(rays.shape[1]):
            d = R.T @ rays[v, u]
            panel = cad.hit_panel(solid, origin[0], origin[1], origin[2], d[0], d[1], d[2])[0]
            port = cad.hit_port(solid, origin[0], origin[1], origin[2], d[0], d[1], d[2], panel)[0]
            if port < cad.FAR_M:
                out[v, u] = port * rays[v, u, 2]
    return out


@cache
def _solid(sequence: str) -> cad.Solid:
    return laboratory.panel(laboratory.sequence(sequence), Port.lm_map())[0]


def port_depth_m(sequence: str, T_cam_port: Pose, camera: Camera) -> np.ndarray:
    """Depth (H, W) of the bench's port and panel."""
    v, u = np.indices(camera.size_px[::-1])
    rays = bearings(np.stack([u, v], -1), camera)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return _depth(_solid(sequence), T_cam_port.rotation, T_cam_port.inverse.position_m, rays)


def row(name: str, start_s: float, piece, truth: Trajectory, depth_m) -> dict:
    """What becomes of a piece's events; ``depth_m(T_cam_world)`` is the true depth."""
    tracks = Odometry(CAMERA).run(piece)
    ready = [t for t in tracks if t.ready_us is not None]
    times_us = piece["t_us"][[0, -1]]
    T_first, T_last = (truth.at(times_us[[k]])[0] for k in (0, 1))
    turn_deg = np.rad2deg(rotation_angle_rad(T_last.rotation @ T_first.rotation.T))
    true_m = cv2.erode(depth_m(T_last), np.ones((3, 3)))  # an edge belongs to the nearer surface
    mean_m = float(np.median(true_m[np.isfinite(true_m)]))
    keyframe, errors = Odometry(CAMERA).map_along(piece, truth, mean_m), np.empty(0)
    if keyframe is not None:
        seen = keyframe.map.depth > 0
        errors = np.abs(keyframe.map.depth[seen] / true_m[seen] - 1)
    return {
        "sequence": name,
        "start_s": start_s,
        "seconds": SECONDS,
        "events": len(piece),
        "turn_deg_per_s": turn_deg / SECONDS,
        "bootstraps_begun": len(tracks),
        "bootstraps_done": len(ready),
        "losses": sum(t.lost for t in tracks),
        "followed_s": max(t.t_us[-1] - t.t_us[0] for t in tracks) * 1e-6,
        "map_points": len(errors),
        "map_within_5_percent": 100 * np.mean(errors < 0.05) if len(errors) else np.nan,
        "map_median_error_percent": 100 * np.median(errors) if len(errors) else np.nan,
        "followed_from_truth_s": followed_from_truth_s(piece, truth, depth_m, mean_m),
    }


def followed_from_truth_s(piece, truth: Trajectory, depth_m, mean_m: float) -> float:
    """How long tracking from the true first map is within `ASTRAY` of the true position, in s."""
    odometry = Odometry(CAMERA)
    start_us = piece["t_us"][[odometry.constants.bootstrap_events // 2]]
    T_start = truth.at(start_us)[0]
    first_m = depth_m(T_start)
    track = odometry.run(piece, np.where(np.isfinite(first_m), first_m, 0.0))[0]
    estimated = Pose(np.array(track.rotation), np.array(track.position)).inverse
    true = T_start @ truth.at(np.array(track.t_us)).inverse
    off = np.linalg.norm(estimated.position_m - true.position_m, axis=1) > ASTRAY * mean_m
    last = int(np.argmax(off)) if off.any() else len(off) - 1
    return float((track.t_us[last] - start_us[0]) * 1e-6)


def pieces(recording_events, start_s: float):
    t_us = recording_events["t_us"]
    begin_us = t_us[0] + start_s * 1e6
    return recording_events[slice(*np.searchsorted(t_us, [begin_us, begin_us + SECONDS * 1e6]))]


def main(folder: str) -> None:
    rows = []
    for name, starts_s in CONTROL.items():
        scene = scenes.scene(name)
        t_us = np.arange(0, scene.seconds * 1e6, 5000).astype(np.int64)
        truth = Trajectory(t_us, scenes.motion(scene, t_us * 1e-6))
        for start_s in starts_s:
            piece = pieces(events(scene), start_s)
            rows.append(row(name, start_s, piece, truth, lambda T, s=scene: scenes.depth_image(s, T, CAMERA)))
            print(f"evo: {rows[-1]}", flush=True)
    for name in SEQUENCES:
        recording = open_recording(Path(folder) / f"{name}.h5")
        for start_s in STARTS_S:
            piece = pieces(recording.events, start_s)
            rows.append(
                row(name, start_s, piece, recording.truth, lambda T, n=name: port_depth_m(n, T, CAMERA))
            )
            print(f"evo: {rows[-1]}", flush=True)
    save_table(FOLDER / "evo-pieces.csv", pd.DataFrame(rows), seconds=SECONDS)


if __name__ == "__main__":
    main(*sys.argv[1:])
