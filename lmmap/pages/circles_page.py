"""The figure with sliders of the chapter on circles."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.conics import circle_conic, circle_ellipse
from ..geometry.port import circle_points_m
from ..geometry.projection import project
from ..pipeline import circle
from ..types import Camera, Pose
from .drawings import COLOUR

NAMES = {"the ring": "truth", "its twin": "rival", "printed": "paper"}  # and their colours


def two_circles(radius_m: float, camera: Camera, tilts_deg, distances_m):
    """Plotly figure of three circles in space and their images, with sliders for tilt and distance.

    The circles are the ring, the other circle that projects to the same ellipse, and the one that the paper's
    printed formula makes of that ellipse.
    """
    from plotly.subplots import make_subplots

    fig = make_subplots(1, 2, specs=[[{"type": "scene"}, {"type": "xy"}]], column_widths=[0.5, 0.5])
    circles = {(t, z): list(_three_circles(t, z, radius_m, camera)) for t in tilts_deg for z in distances_m}
    start = tilts_deg[len(tilts_deg) // 2], distances_m[len(distances_m) // 2]
    for z in distances_m:
        for k, (name, colour) in enumerate(NAMES.items()):
            circle_m, contour_px, label = circles[start[0], z][k]
            line = {"color": COLOUR[colour], "width": 4 - k}
            style = {"mode": "lines", "line": line, "visible": z == start[1]}
            x, y, depth = circle_m.T
            fig.add_scatter3d(x=x, y=depth, z=-y, name=name, showlegend=False, **style, row=1, col=1)
            u, v = contour_px.T
            fig.add_scatter(x=u, y=v, name=label, **style, row=1, col=2)

    def tilt_step(t):
        curves = [curve for z in distances_m for curve in circles[t, z]]
        update = {
            "x": [c for circle_m, px, _ in curves for c in (circle_m[:, 0].tolist(), px[:, 0].tolist())],
            "y": [c for circle_m, px, _ in curves for c in (circle_m[:, 2].tolist(), px[:, 1].tolist())],
            "z": [c for circle_m, _, _ in curves for c in ((-circle_m[:, 1]).tolist(), None)],
            "name": [label for _, _, label in curves for _ in range(2)],
        }
        return {"label": f"{t:g}°", "method": "restyle", "args": [update]}

    def distance_step(z):
        return {"label": f"{z:g} m", "method": "restyle",
                "args": [{"visible": [other == z for other in distances_m for _ in range(6)]}]}  # fmt: skip

    place = {"x": 0.02, "len": 0.44, "pad": {"t": 45}}
    fig.update_layout(
        height=500, margin={"l": 0, "r": 0, "t": 10, "b": 140}, legend={"x": 0.55, "y": 1.0},
        sliders=[
            {"currentvalue": {"prefix": "tilt "}, "active": tilts_deg.index(start[0]),
             "steps": [tilt_step(t) for t in tilts_deg], **place},
            {"currentvalue": {"prefix": "distance "}, "active": distances_m.index(start[1]),
             "steps": [distance_step(z) for z in distances_m], **place, "x": 0.54},
        ],
        scene={"aspectmode": "data", "xaxis_title": "x (m)", "yaxis_title": "depth (m)",
               "zaxis_title": "up (m)", "camera": {"eye": {"x": 2.0, "y": -0.6, "z": 0.7}}},
    )  # fmt: skip
    fig.update_xaxes(title="u (px)", range=[0, camera.width_px])
    fig.update_yaxes(title="v (px)", range=[camera.height_px, 0], scaleanchor="x")
    return fig


def _three_circles(tilt_deg: float, distance_m: float, radius_m: float, camera: Camera):
    """Points in space (N, 3), points in the image (N, 2) and a label, of each circle of `two_circles`."""
    turn = Rotation.from_rotvec([0, np.deg2rad(tilt_deg), 0]) * Rotation.from_rotvec([np.pi, 0, 0])
    truth = Pose(turn.as_matrix(), [0.0, 0.0, distance_m])
    contour = circle_ellipse(truth, radius_m, camera)
    pair, printed = circle.poses(contour, camera, radius_m), circle.paper_poses(contour, camera, radius_m)
    nearest = int(np.argmax(pair.normal @ truth.normal))
    poses = truth, pair[1 - nearest], printed[nearest]
    x = np.column_stack([contour.points(), np.ones(360)])
    for T, name in zip(poses, NAMES, strict=True):
        Cx = x @ circle_conic(T, radius_m, camera)
        gap_px = np.abs(np.sum(x * Cx, 1) / (2 * np.linalg.norm(Cx[:, :2], axis=1))).max()
        points_m = T @ circle_points_m(radius_m, 40)[np.r_[:40, 0]]
        yield points_m.round(4), project(points_m, camera).round(1), f"{name}: {gap_px:.2f} px"
