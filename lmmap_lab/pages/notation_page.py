"""The figure of the chapter on notation: camera and port, each with its axes."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import bearings, project
from lmmap.types import Camera, Port, Pose

from .drawings import COLOUR, draw_port

AXES = 0.1 * np.eye(3)  # m
AXIS_COLOURS = [COLOUR[name] for name in ("event", "truth", "rgb")]
VIEW_M = 0.2  # distance of the corners that the drawing gives the camera's view


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
    for pose, name, below_m in ((Pose.identity(), "cam", 0.05), (T_cam_port, "port", 0.14)):
        for axis, colour, label in zip(AXES, AXIS_COLOURS, "xyz", strict=True):
            ends = _upright([pose.position_m, pose @ axis])
            ax.plot(*ends.T, color=colour, lw=2)
            ax.text(*ends[1], f" {label}", color=colour)
        ax.text(*_upright(pose.position_m) - [0, 0, below_m], name, color=COLOUR["ink"], ha="center")
    ax.set_aspect("equal")
    ax.set_label("camera and port in space, each with its axes")
    ax.view_init(elev=22, azim=-55)
    ax.set_axis_off()


def _draw_image(ax, T_cam_port: Pose, port: Port, camera: Camera) -> None:
    draw_port(ax, T_cam_port, port, camera, COLOUR["ink"])
    for axis, colour, label in zip(AXES, AXIS_COLOURS, "xyz", strict=True):
        ends = project(T_cam_port @ np.stack([np.zeros(3), axis]), camera)
        ax.plot(*ends.T, color=colour, lw=2)
        ax.text(*ends[1], f" {label}", color=colour)
    ax.set(xlim=(-0.5, camera.width_px - 0.5), ylim=(camera.height_px - 0.5, -0.5), aspect="equal")
    ax.set(xlabel="u (px)", ylabel="v (px)", title="what the camera sees")


def _upright(points_m) -> np.ndarray:
    """Points (..., 3) of the camera's frame, whose y is down, in the drawing's, whose third axis is up."""
    return np.asarray(points_m)[..., [0, 2, 1]] * [1, 1, -1]


def _closed(loop: np.ndarray) -> np.ndarray:
    """A loop's points (N, 3) with the first again at the end."""
    return np.vstack([loop, loop[:1]])
