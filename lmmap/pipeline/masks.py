"""What the networks see in an image: the ring's mask, and the reflectors' mask where markers can be.

If the port is expected somewhere in the image, both networks run only on crops around that place, and a
network of both masks (`joint_network`) on one around all of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.markers import reach_m
from ..geometry.port import circle_points_m
from ..geometry.projection import project_points
from ..settings import OURS
from ..types import Camera, Ellipse, Port, Pose
from . import outline
from .crops import Box, at_once, mask_about, mask_within
from .joint_network import common


class Expected(NamedTuple):
    """Where the ring is expected: its undistorted ellipse, a box around the part of the mask that is used for
    it, and a box around the markers."""

    ellipse: Ellipse
    ring: Box
    markers: Box


class Seen(NamedTuple):
    """An image's ring mask and `outline.edges`, (H, W) each; if the port was expected somewhere, also the
    reflector mask around the expected markers, and on the whole image from a network of both masks."""

    ring: np.ndarray
    edges: np.ndarray
    reflectors: np.ndarray | None = None


def look(image: np.ndarray, ring_network, reflector_network, near: Expected | None = None) -> Seen:
    """Compute what is `Seen` of the port in an image before its ring is known."""
    both = common(ring_network, reflector_network)
    if both is not None:
        masks = mask_within(both, image, *near.ring.around(near.markers)) if near else both(image)
        return Seen(masks[ring_network.index], outline.edges(image), masks[reflector_network.index])
    if near is None:
        return Seen(ring_network(image), outline.edges(image))
    ring, (reflectors, edges) = at_once(
        lambda: mask_within(ring_network, image, *near.ring),
        lambda: (mask_within(reflector_network, image, *near.markers), outline.edges(image)),
    )
    return Seen(ring, edges, reflectors)


def reflector_mask(network, image: np.ndarray, T_cam_port: Pose, port: Port, camera: Camera,
                   border_px: float = OURS.marker_border_px) -> np.ndarray:  # fmt: skip
    """Reflector mask (H, W), computed where poses (N,) can have markers and zero elsewhere."""
    return mask_about(network, image, *markers_box_px(T_cam_port, port, camera, border_px))


def markers_box_px(
    T_cam_port: Pose, port: Port, camera: Camera, border_px: float = OURS.marker_border_px
) -> Box:
    """Box around everything that the markers and the search for them reach at poses (N,), at any yaw, plus a
    border."""
    disc = circle_points_m(reach_m(port), 36) + np.array([0, 0, port.plate_height_m])
    seen = project_points(T_cam_port, disc, camera).reshape(-1, 2)
    seen = seen[np.isfinite(seen).all(-1)]
    if not len(seen):
        return Box(np.zeros(2), np.array(camera.size_px) - 1)
    return Box(seen.min(0) - border_px, seen.max(0) + border_px)
