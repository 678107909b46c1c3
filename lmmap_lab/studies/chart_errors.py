"""How far a true circle is from an estimate, in the estimate's chart of cones."""

from __future__ import annotations

import numpy as np

from lmmap.geometry.conics import circle_conic, cone
from lmmap.refinement.uncertainty import cone_chart
from lmmap.types import Camera, Pose


def chart_error(T_cam_port: Pose, truth: Pose, radius_m: float, camera: Camera) -> np.ndarray:
    """The true circle's chart minus the estimate's, (5,), in the axes of the estimate's cone."""
    _, E, m, w = cone_chart(T_cam_port, radius_m, camera)
    l_true, E_true = cone(circle_conic(truth, radius_m, camera), camera.K)
    relative = E.T @ E_true
    axis = relative[:, 2]
    y = axis[:2] * np.arccos(np.clip(axis[2], -1, 1)) / max(np.hypot(*axis[:2]), 1e-300)
    first = relative[:2, 0] - axis[:2] * relative[2, 0] / (1 + axis[2])  # e1, turned back with the axis
    azimuth = np.arctan2(first[1], first[0])
    m_true = (l_true[0] + l_true[1]) / 2
    length = (l_true[0] - l_true[1]) / (m_true - l_true[2])
    w_true = length * np.array([np.cos(2 * azimuth), np.sin(2 * azimuth)])
    return np.concatenate([y, [0.5 * np.log(m_true / -l_true[2] / m)], w_true - [w, 0]])


def chart_nees(T_cam_port: Pose, truth: Pose, chart, radius_m: float, camera: Camera) -> float:
    """Normalised squared error of the cone: chi-square with 5 degrees of freedom if ``chart`` is right."""
    d = chart_error(T_cam_port, truth, radius_m, camera)
    return float(d @ np.linalg.solve(chart, d))
