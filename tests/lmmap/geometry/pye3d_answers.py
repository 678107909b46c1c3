"""The two circles that pye3d sees in each of sixty ellipses, for where its wheels do not install.

``python tests/lmmap/geometry/pye3d_answers.py`` makes ``pye3d.json`` beside this file anew.
"""

import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("pye3d.json")


def circles(ellipse, focal_px: float) -> np.ndarray:
    """Centre and normal (2, 2, 3) of both circles of radius 1 whose image is the ellipse.

    ``ellipse`` is its centre (u, v) from the principal point, its semi-axes, and the angle of the first.
    """
    from pye3d.cpp.projections import unproject_ellipse
    from pye3d.geometry.primitives import Ellipse

    u, v, major_px, minor_px, angle_rad = ellipse
    found = unproject_ellipse(Ellipse(np.array([u, v]), minor_px, major_px, angle_rad), focal_px)
    return np.array([[c.center, c.normal] for c in found])


def _ask(count: int, seed: int) -> list[list[float]]:
    """Ellipses of the port's ring, at tilts and places where pye3d is accurate.

    It drifts toward head-on, hence from 5 deg, and fails on axes along the image's and on ellipses about the
    principal point.
    """
    from strategies import CAMERA, PORT, in_view, pose

    from lmmap.geometry import conics

    rng, asked = np.random.default_rng(seed), []
    while len(asked) < count:
        tilt_rad, azimuth_rad = np.deg2rad(rng.uniform(5, 70)), rng.uniform(0, 2 * np.pi)
        T = pose(rng.uniform([60, 60], [286, 200]), rng.uniform(0.3, 1.2), tilt_rad, azimuth_rad)
        e = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA)
        centre_px = e.centre_px - CAMERA.K[:2, 2]
        if in_view(T, PORT, CAMERA) and abs(np.sin(2 * e.angle_rad)) > 0.02 and np.abs(centre_px).min() > 1:
            asked.append(np.round([*centre_px, *e.semi_axes_px, e.angle_rad], 9).tolist())
    return asked


if __name__ == "__main__":
    sys.path.append(str(FILE.parents[2]))  # of strategies
    from strategies import CAMERA

    asked, focal_px = _ask(60, seed=0), CAMERA.fx_px
    answers = {
        "made_by": f"tests/lmmap/geometry/{Path(__file__).name}, pye3d {version('pye3d')}, "
        f"Python {sys.version.split()[0]}",
        "focal_px": focal_px,
        "ellipses": asked,
        "circles": [np.round(circles(e, focal_px), 9).tolist() for e in asked],
    }
    lines = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in answers.items())
    FILE.write_text("{" + ",\n ".join(lines).replace("], [", "],\n  [") + "}\n")
