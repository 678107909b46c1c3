"""Run EVO on the textured scenes of `evo.scenes` and write data/results/odometry/evo-scenes.csv.

evo_scenes.py [SCENE ...]

Scenes that are named replace their own rows of the table, and the others stay; each row names the revision
that made it.  Speed is ``two_cores_mev_per_s``: processor times of both threads of one run, and tracking's
waits for maps, as if each thread had a core of its own.  ``wall_mev_per_s`` is what the clock on the wall
said, beside all else that the machine did.  Both begin when the start is over.

Errors are absolute, after one similarity: its scale and place are those of the first 40 poses at 20 Hz from
the end of the bootstrap on, as in `lmmap_lab.studies.trajectory_errors`.  The depth of a map's point is
compared with the nearest true surface within a pixel, for an edge between two surfaces belongs to the nearer.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from lmmap.geometry.rotations import rotation_angle_rad
from lmmap.types import Camera, Pose, Trajectory
from lmmap_lab.provenance import DERIVED_DATA, ROOT, commit, fingerprint, load_table, save_table
from lmmap_lab.studies.odometry import ALIGNED_POSES, FOLDER
from lmmap_lab.studies.trajectory_errors import umeyama

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # so that the package has one name, vo.evo

from vo.evo import scenes
from vo.evo.constants import Constants
from vo.evo.odometry import Odometry
from vo.evo.track import Track

RATE_HZ = 20
STARTS = ("fronto-parallel", "homography")
CAMERA = Camera.davis346()


def events(scene: scenes.Scene) -> np.ndarray:
    """A scene's events, simulated once."""
    path = DERIVED_DATA / "evo" / f"{scene.name}-{fingerprint(code=(scenes.simulate,))[:12]}.npy"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, scenes.simulate(scene, CAMERA).events)
    return np.load(path)


def nearest_depth_m(scene: scenes.Scene, T_cam_world: Pose) -> np.ndarray:
    """Depth (H, W) of the nearest surface in each pixel's neighbourhood of 3 x 3."""
    return cv2.erode(scenes.depth_image(scene, T_cam_world, CAMERA), np.ones((3, 3)))


def pose_errors(scene: scenes.Scene, track: Trajectory) -> tuple[np.ndarray, np.ndarray, float]:
    """Position errors (m), rotation errors (deg), and the scale of the first poses."""
    ticks = np.arange(track.t_us[0], track.t_us[-1], 1e6 / RATE_HZ).astype(np.int64)
    es, gt = track.at(ticks).inverse, scenes.motion(scene, ticks * 1e-6).inverse
    first = slice(0, ALIGNED_POSES)
    scale = umeyama(es.position_m[first], gt.position_m[first])[0]
    u, _, v = np.linalg.svd((gt.rotation[first] @ np.swapaxes(es.rotation[first], -1, -2)).mean(0))
    position = scale * es.position_m @ (u @ v).T
    position += (gt.position_m[first] - position[first]).mean(0)
    turned = np.swapaxes(u @ v @ es.rotation, -1, -2) @ gt.rotation
    return np.linalg.norm(position - gt.position_m, axis=1), np.rad2deg(rotation_angle_rad(turned)), scale


def depth_errors(scene: scenes.Scene, track: Track, scale: float) -> np.ndarray:
    """Relative depth errors of all points of the maps made from the end of the bootstrap on."""
    parts = []
    for keyframe in (k for k in track.keyframes if k.t_us >= track.ready_us):
        true_m = nearest_depth_m(scene, scenes.motion(scene, [keyframe.t_us * 1e-6])[0])
        seen = keyframe.map.depth > 0
        parts.append(np.abs(scale * keyframe.map.depth[seen] / true_m[seen] - 1))
    return np.concatenate(parts)


def row(scene: scenes.Scene, start: str) -> dict:
    """EVO's results on a scene, from a start on a plane; errors are those of its longest track."""
    stream, odometry = events(scene), Odometry(CAMERA, Constants(bootstrap_plane=start))
    tracks = odometry.run(stream)
    times = odometry.times
    mev = times.frames * odometry.constants.events_per_step / 1e6
    per_mev = 1 / mev if mev else np.nan
    facts = {
        "scene": scene.name,
        "start": start,
        "seconds": scene.seconds,
        "mev_per_s": len(stream) / 1e6 / scene.seconds,
        "tracked_to_end": int(len(tracks) == 1 and not tracks[0].lost),
        "tracks": len(tracks),
        "bootstrap_cpu_s": times.bootstrap_s,
        "tracking_cpu_s_per_mev": times.tracking_s * per_mev,
        "mapping_cpu_s_per_mev": times.mapping_s * per_mev,
        "two_cores_mev_per_s": mev / times.two_cores_s if mev else np.nan,
        "wall_mev_per_s": mev / times.wall_s if mev else np.nan,
    }
    usable = [t for t in tracks if t.ready_us is not None and t.t_us[-1] - t.ready_us > 2.5e6]
    if not usable:
        return facts
    track = max(usable, key=lambda t: t.t_us[-1] - t.ready_us)
    trajectory = track.trajectory()
    position_m, rotation_deg, scale = pose_errors(scene, trajectory)
    depth_m = np.median(scenes.depth_image(scene, scenes.motion(scene, [track.ready_us * 1e-6])[0], CAMERA))
    depth = depth_errors(scene, track, scale)
    return facts | {
        "ready_s": track.ready_us * 1e-6,
        "tracked_s": (track.t_us[-1] - track.ready_us) * 1e-6,
        "keyframes": len(track.keyframes),
        "scene_depth_m": depth_m,
        "position_error_percent": 100 * position_m.mean() / depth_m,
        "largest_position_error_percent": 100 * position_m.max() / depth_m,
        "rotation_error_deg": rotation_deg.mean(),
        "depth_error_percent": 100 * depth.mean(),
        "median_depth_error_percent": 100 * np.median(depth),
    }


def main(*names: str) -> None:
    cv2.setNumThreads(1)  # its own threads' time would be counted nowhere
    path, chosen = FOLDER / "evo-scenes.csv", names or [s.name for s in (*scenes.SCENES, *scenes.TURNING)]
    before = load_table(path) if path.exists() else pd.DataFrame({"scene": []})
    rows = before[~before.scene.isin(chosen)].to_dict("records")
    for name, start in itertools.product(chosen, STARTS):
        rows.append(row(scenes.scene(name), start) | {"commit": commit()})
        print("evo: " + ", ".join(f"{k} {v}" for k, v in rows[-1].items()), flush=True)
    order = [s.name for s in (*scenes.SCENES, *scenes.TURNING)]
    rows.sort(key=lambda r: (order.index(r["scene"]), STARTS.index(r["start"])))
    save_table(path, pd.DataFrame(rows), camera="DAVIS 346")
    print(f"evo: {path.relative_to(ROOT)} written")


if __name__ == "__main__":
    main(*sys.argv[1:])
