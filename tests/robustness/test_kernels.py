"""Compiled kernels that several processes share."""

import os
import subprocess
import sys

DRAW = """
import sys
import numpy as np
from lmmap_lab.bench import cad, renderer, skins
from lmmap.types import Camera, Port, Pose

camera, port = Camera(61, 41, 60.0, 60.0, 30.0, 20.0), Port.lm_map()
T_cam_port = Pose(np.diag([1.0, -1, -1]), [0, 0, 0.5])
skin = np.full((44, 68, skins.CHANNELS), 0.5, np.float32)
lamps = renderer.Lamps(np.zeros((1, 3)), np.ones((1, 3)), np.zeros(1))
scene = skin, lamps, np.zeros((41, 61, 3), np.float32)
for colours in map(int, sys.argv[1:]):
    skin, lamps, black = scene if colours == 3 else renderer.to_monochrome(*scene)
    rays = renderer.ray_grid(camera, 1)
    print(renderer.render(cad.solid(port), skin, lamps, T_cam_port, rays, black)[0].shape[-1])
"""


def test_kernels_that_different_processes_compiled_do_not_mix(tmp_path):
    """The second process takes one kernel from the cache and compiles the other; the third takes both."""
    for colours in (["3"], ["3", "1"], ["3", "1"]):
        run = subprocess.run([sys.executable, "-c", DRAW, *colours], capture_output=True, text=True,
                             env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)})  # fmt: skip
        assert (run.returncode, run.stdout.split()) == (0, colours), run.stderr
