"""The port in a picture whose lens is unknown: one look at each of several focal lengths.

The networks know how wide the ring's stroke is in pixels, which a picture from somewhere shows at any width.
Each look resamples the whole picture as if it came through another lens.  The look with the most confident
pose counts, or without any the one in whose mask the ellipse stands out most.  Its distance is as wrong as
the assumed focal length; the ellipse is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.projection import project
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import Mask
from lmmap.pipeline.local_search import contrast
from lmmap.pipeline.network import SATURATION
from lmmap.settings import OURS, Settings
from lmmap.types import Camera, Ellipse, Estimate, Port, Pose

WIDTHS_PX = (122, 173, 245, 346, 489, 692, 979)  # of the looks: by the square root of 2 about the DAVIS's
MAX_ENLARGEMENT = 1.2  # of a picture: more would only blur it


class Look(NamedTuple):
    """What one focal length shows of a picture, in the pixels of ``camera``."""

    camera: Camera
    image: np.ndarray
    ring_mask: np.ndarray
    estimate: Estimate
    ring: Ellipse | None  # of the pose, or without one the mask's
    contrast: float  # of the mask along the ellipse to that beside it; minus infinity without an ellipse

    @property
    def pose_confidence(self) -> float:
        """Of the reported pose; without one zero."""
        return 0.0 if self.estimate.T_cam_port is None else self.estimate.confidence

    def ellipse_in(self, size_px) -> Ellipse | None:
        """The ring in the pixels of the picture of that size (width, height)."""
        if (e := self.ring) is None:
            return None
        scale = size_px[0] / self.camera.width_px
        return Ellipse((e.centre_px + 0.5) * scale - 0.5, e.semi_axes_px * scale, e.angle_rad)


def looks(picture: np.ndarray, modality: str, networks: tuple[Mask, Mask], settings: Settings = OURS,
          port: Port | None = None, widths_px: Sequence[int] = WIDTHS_PX) -> Iterator[Look]:  # fmt: skip
    """Looks at a picture (H, W, 3) u8 RGB, from the widest lens to the narrowest.

    Of modality ``"event"`` a pixel's grey value stands for a count, white for as many as the networks tell
    apart.  ``networks`` are those of the ring and of the reflectors.
    """
    port, (ring_network, reflector_network) = port or Port.lm_map(), networks
    height, width = picture.shape[:2]
    for look_px in [w for w in widths_px if w <= MAX_ENLARGEMENT * width] or [min(widths_px)]:
        size_px = look_px, max(round(height * look_px / width), 1)
        shrinks = look_px < width
        image = cv2.resize(picture, size_px, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
        if modality == "event":
            image = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32) * (SATURATION / 255)
        focal_px = settings.trained_focal_px
        camera = Camera(*size_px, focal_px, focal_px, *((n - 1) / 2 for n in size_px))
        mask = ring_network(image)
        filters = partial(_same, mask), reflector_network  # the mask is there already
        estimate = Estimator(camera, port, modality, filters, settings)(image)
        stands_out = -np.inf
        if (e := estimate.ellipse) is not None:
            alone = Ellipse(e.centre_px[None], e.semi_axes_px[None], np.array([e.angle_rad]))
            stands_out = float(contrast(alone, mask, camera)[0])
        ring = e if estimate.found is None else circle_ellipse(estimate.found, port.ring_radius_m, camera)
        yield Look(camera, image, mask, estimate, ring, stands_out)


def _same(mask: np.ndarray, _image) -> np.ndarray:
    return mask


def best_look(seen: Sequence[Look]) -> Look:
    """The look with the most confident pose; without any pose the one whose ellipse stands out most in its
    mask; without any ellipse the first one."""
    return max(seen, key=lambda look: (look.pose_confidence, look.contrast))


def markers_px(T_cam_port: Pose, port: Port, camera: Camera) -> np.ndarray:
    """Corners (M, 4, 2) of the projected markers."""
    corners_m = np.asarray(port.marker_corners_m())
    return project(T_cam_port @ corners_m.reshape(-1, 3), camera).reshape(*corners_m.shape[:2], 2)


def marker_scores(reflector_mask: np.ndarray, corners_px: np.ndarray) -> np.ndarray:
    """Mean of a mask (H, W) inside each of the quadrangles (M, 4, 2), shape (M,)."""
    means = []
    for corners in corners_px:
        inside = np.zeros(reflector_mask.shape, np.uint8)
        cv2.fillConvexPoly(inside, np.round(corners * 16).astype(np.int32), 1, shift=4)
        means.append(cv2.mean(reflector_mask, inside)[0])
    return np.array(means)
