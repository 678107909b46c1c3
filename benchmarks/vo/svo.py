"""One run of SVO (svo-cpp 1.5.0, GPL-3) on an exported recording, in a process of its own.

svo.py FOLDER MODALITY START_S TRAJECTORY
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

import numpy as np
import svo_cpp
from frames import Frames, TrackFile

WIDTH, HEIGHT = 336, 256  # SVO wants multiples of 16: the middle of 346 x 260
PATIENCE = 20  # frames of relocalising after which a user would press 'reset'; it never does itself
SETTINGS = {  # its defaults are for 752 x 480 px and never start at this size
    "grid_size": 15,
    "max_fts": 400,
    "init_min_disparity": 30.0,
    "quality_min_fts": 25,
    "quality_max_drop_fts": 150,
    "triang_min_corner_score": 5.0,
    "kfselect_mindist": 0.08,
    "core_n_kfs": 5,
    "max_n_kfs": 30,
    "loba_num_iter": 5,
}


def pose(T_f_w) -> np.ndarray:
    """Position and quaternion_xyzw of the camera in the map.

    The bindings return the rotation in a type that Python cannot read, so it is read where the object
    keeps it: a pointer after the object's head, then quaternion and translation.  The inverse that the
    library computes itself must agree, or the run ends.
    """
    address = ctypes.c_void_p.from_address(id(T_f_w) + object.__basicsize__).value
    x, y, z, w, *t = (ctypes.c_double * 7).from_address(address)
    u, t = np.array([x, y, z]), np.array(t)
    position = -(t - 2 * w * np.cross(u, t) + 2 * np.cross(u, np.cross(u, t)))  # -R^T t
    if not np.allclose(position, np.ravel(T_f_w.inverse().translation()), atol=1e-9):
        raise RuntimeError("svo-cpp keeps its poses elsewhere than this script reads them")
    return np.array([*position, -x, -y, -z, w])


def main(folder: str, modality: str, start_s: str, output: str, *_) -> None:
    frames, tracks = Frames(Path(folder), modality, float(start_s)), TrackFile(Path(output))
    c = frames.camera
    left, top = (c["width_px"] - WIDTH) // 2, (c["height_px"] - HEIGHT) // 2
    svo_cpp.set_svo_config(SETTINGS)
    camera = svo_cpp.PinholeCamera(WIDTH, HEIGHT, c["fx_px"], c["fy_px"], c["cx_px"] - left, c["cy_px"] - top)
    svo = svo_cpp.SVO(camera)
    svo.start()
    lost = 0
    for t_s, image in frames:
        svo.addImage(np.ascontiguousarray(image[top : top + HEIGHT, left : left + WIDTH]), t_s)
        stage = svo.stage()
        tracked = stage == svo_cpp.Stage.DEFAULT_FRAME
        lost = lost + 1 if stage == svo_cpp.Stage.RELOCALIZING else 0
        if not tracked and not lost:
            tracks.leave_map()
        tracks.add(t_s, pose(svo.lastFrame().T_f_w) if tracked else None)
        if lost > PATIENCE or stage == svo_cpp.Stage.PAUSED:
            svo.reset()
            svo.start()
            tracks.leave_map()
    tracks.summary()


if __name__ == "__main__":
    main(*sys.argv[1:])
