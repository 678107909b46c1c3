"""The figure of the chapter on notation: camera and port, each with its axes."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d import proj3d

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import bearings, project
from lmmap.types import Camera, Port, Pose

from .drawings import COLOUR, draw_port

AXES = 0.1 * np.eye(3)  # m
AXIS_COLOURS = [COLOUR[name] for name in ("event", "truth", "rgb")]
VIEW_M = 0.15  # distance of the corners that the drawing gives the camera's view


def draw_frames(T_cam_port: Pose, port: Port, camera: Camera):
    """Figure of a port before a camera, in space and in the image, with the axes of both frames."""
    fig = plt.figure(figsize=(7.6, 3.2), layout="none")
    _draw_space(fig.add_axes([0, 0.02, 0.58, 0.96], projection="3d", computed_zorder=False),
                T_cam_port, port, camera)  # fmt: skip
    _draw_image(fig.add_axes([0.63, 0.14, 0.36, 0.76]), T_cam_port, port, camera)
    return fig


def _draw_space(ax, T_cam_port: Pose, port: Port, camera: Camera) -> None:
    width, height = camera.size_px
    corners_px = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    view = VIEW_M * bearings(corners_px, camera)
    ring, markers = circle_points_m(port.ring_radius_m), port.marker_corners_m()
    for loop in (ring, *markers):
        ax.plot(*_upright(T_cam_port @ _closed(loop)).T, color=COLOUR["ink"], lw=1.5)
    for corner in view:
        ax.plot(*_upright([np.zeros(3), corner]).T, color=COLOUR["ink"], lw=0.7)
    ax.plot(*_upright(_closed(view)).T, color=COLOUR["ink"], lw=0.7)
    poses = {"cam": Pose.identity(), "port": T_cam_port}
    for pose in poses.values():
        for ends, colour in zip(_ends(pose), AXIS_COLOURS, strict=True):
            ax.plot(*_upright(ends).T, color=colour, lw=2)
    ax.set_aspect("equal")
    ax.set_label("camera and port in space, each with its axes")
    ax.view_init(elev=35, azim=-75)
    ax.set_axis_off()
    for (name, pose), at in zip(poses.items(), ((-18, 0), (38, -32)), strict=True):
        flat = [np.transpose(proj3d.proj_transform(*_upright(x).T, ax.get_proj()))[:, :2]
                for x in _ends(pose)]  # fmt: skip
        _name_axes(ax, flat)
        ax.annotate(name, flat[0][0], at, textcoords="offset points", ha="center", va="center")


def _draw_image(ax, T_cam_port: Pose, port: Port, camera: Camera) -> None:
    draw_port(ax, T_cam_port, port, camera, COLOUR["ink"])
    lines_px = [project(ends, camera) for ends in _ends(T_cam_port)]
    for line_px, colour in zip(lines_px, AXIS_COLOURS, strict=True):
        ax.plot(*line_px.T, color=colour, lw=2)
    ax.set(xlim=(-0.5, camera.width_px - 0.5), ylim=(camera.height_px - 0.5, -0.5), aspect="equal")
    _name_axes(ax, lines_px)
    ax.set(xlabel="u (px)", ylabel="v (px)", title="what the camera sees")


def _ends(pose: Pose) -> list[np.ndarray]:
    """First and last point (2, 3) of each axis of a frame."""
    return [pose @ np.stack([np.zeros(3), axis]) for axis in AXES]


def _name_axes(ax, lines: Sequence[np.ndarray]) -> None:
    """Write x, y and z beyond the ends of three lines (2, 2) in the drawing's plane, clear of the lines."""
    for line, colour, name in zip(lines, AXIS_COLOURS, "xyz", strict=True):
        along = np.diff(ax.transData.transform(line), axis=0)[0]
        ax.annotate(name, line[1], 14 * along / np.linalg.norm(along), textcoords="offset points",
                    color=colour, ha="center", va="center")  # fmt: skip


def _upright(points_m) -> np.ndarray:
    """Points (..., 3) of the camera's frame, whose y is down, in the drawing's, whose third axis is up."""
    return np.asarray(points_m)[..., [0, 2, 1]] * [1, 1, -1]


def _closed(loop: np.ndarray) -> np.ndarray:
    """A loop's points (N, 3) with the first again at the end."""
    return np.vstack([loop, loop[:1]])
