"""The bench's labels: true masks of the ring and the markers, by the CAD and the pose."""

from __future__ import annotations

import numpy as np

from lmmap.types import Camera, Port, Pose

from . import cad, renderer, skins


def label_masks(T_cam_port: Pose, port: Port, camera: Camera, rays=None) -> np.ndarray:
    """True masks of the ring and of the markers, with what hides them.

    Parameters
    ----------
    T_cam_port : one pose
    rays : lines of sight from `renderer.ray_grid`; default: four in each pixel

    Returns
    -------
    (2, H, W) bool : ring and markers; a pixel belongs to a mask if at least half of its rays hit that part
    """
    rays = renderer.ray_grid(camera, 4) if rays is None else rays
    no_lamps = renderer.Lamps(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    skin = np.zeros((2, 2, skins.CHANNELS), np.float32)
    black = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
    cover = renderer.render(cad.solid(port), skin, no_lamps, T_cam_port, rays, black)[1]
    return np.moveaxis(cover >= 0.5, -1, 0)
