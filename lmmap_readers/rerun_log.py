"""Estimates as a file for the Rerun viewer: camera, port, uncertainty, images and masks on one timeline."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.drawing.overlay import background
from lmmap.files import atomic, check_folder_of
from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import bearings, project
from lmmap.settings import OURS
from lmmap.types import Camera, Estimate, InputError, Port

SIGMAS = 2.0  # half axes of the ellipsoid of the position, in standard deviations


def _rerun():
    """The package ``rerun``, which only who asks for it needs; `InputError` where it is absent."""
    try:
        import rerun
    except ImportError:
        raise InputError("--rerun: no package rerun-sdk; pip install 'lmmap[rerun]'") from None
    return rerun


class RerunLog:
    """An ``.rrd`` file of estimates, all in the camera's frame; use it in a ``with`` block.

    Entities: ``camera/rgb`` and ``camera/event`` are the images, with the ring's ellipse and mask below them;
    ``camera/port`` is the pose, with the port's outline; ``camera/uncertainty`` the ellipsoid of its position
    at 2 standard deviations; ``status`` and ``confidence`` are the estimate's own.  What an estimate does not
    have is cleared at its time.
    """

    def __init__(self, path: Path, port: Port, camera: Camera):
        if path.suffix.lower() != ".rrd":
            raise InputError(f"{path}: cannot write '{path.suffix}'; name the file for Rerun .rrd")
        check_folder_of(path)
        self.path, self.camera, self._rr, self._log = path, camera, _rerun(), None
        self._held = ExitStack()
        ring_m = circle_points_m(port.ring_radius_m)
        self._outline_m = [np.vstack([line, line[:1]]) for line in (ring_m, *port.marker_corners_m())]

    def add(self, image: np.ndarray | None, estimate: Estimate, ring_mask: np.ndarray | None = None) -> None:
        """Log an estimate at its time, with its image if it has one."""
        self._log.set_time("time", duration=np.timedelta64(estimate.t_us, "us"))
        if image is not None:
            self._add_image(image, estimate, ring_mask)
        self._add_pose(estimate)
        self._log.log("status", self._rr.TextLog(str(estimate.status)))
        self._log.log("confidence", self._rr.Scalars(estimate.confidence))

    def _add_image(self, image, estimate: Estimate, ring_mask) -> None:
        rr, camera = self._rr, self.camera
        name = "camera/rgb" if image.ndim == 3 else "camera/event"
        self._log.log(
            name, rr.Pinhole(image_from_camera=camera.K, resolution=camera.size_px), rr.ViewCoordinates.RDF
        )
        self._log.log(name, rr.Image(background(image).astype(np.uint8)))
        if ring_mask is not None:
            is_ring = (ring_mask > OURS.mask_threshold).astype(np.uint8)
            self._log.log(f"{name}/ring", rr.SegmentationImage(is_ring))
        ellipse = rr.Clear(recursive=False)
        if estimate.ellipse is not None:  # free of distortion, which the image has
            rays = bearings(estimate.ellipse.points(90), replace(camera, distortion=()))
            ellipse = rr.LineStrips2D([project(rays, camera)])
        self._log.log(f"{name}/ellipse", ellipse)

    def _add_pose(self, estimate: Estimate) -> None:
        rr, T = self._rr, estimate.T_cam_port
        if T is None:
            self._log.log("camera/port", rr.Clear(recursive=True))
        else:
            self._log.log("camera/port", rr.Transform3D(translation=T.position_m, mat3x3=T.rotation))
            self._log.log("camera/port/outline", rr.LineStrips3D(self._outline_m))
        if T is None or estimate.covariance is None or not np.isfinite(estimate.covariance).all():
            self._log.log("camera/uncertainty", rr.Clear(recursive=False))
        else:
            half_m, quaternion_xyzw = ellipsoid(estimate.covariance[:3, :3])
            self._log.log("camera/uncertainty", rr.Ellipsoids3D(
                centers=[T.position_m], half_sizes=[half_m],
                quaternions=[rr.Quaternion(xyzw=quaternion_xyzw)]))  # fmt: skip

    def __enter__(self):
        self._log = self._rr.RecordingStream("lmmap")
        self._log.save(str(self._held.enter_context(atomic(self.path, keep=True))))
        self._log.log("camera", self._rr.ViewCoordinates.RDF, static=True)
        return self

    def __exit__(self, *error):
        self._log.flush()
        self._log.disconnect()
        self._held.__exit__(*error)


def ellipsoid(covariance) -> tuple[np.ndarray, np.ndarray]:
    """Half axes (3,) of a covariance's (3, 3) ellipsoid of `SIGMAS`, and the quaternion xyzw to its axes."""
    variances, axes = np.linalg.eigh(covariance)
    axes = axes * [1, 1, np.sign(np.linalg.det(axes))]
    return SIGMAS * np.sqrt(np.maximum(variances, 0)), Rotation.from_matrix(axes).as_quat()
