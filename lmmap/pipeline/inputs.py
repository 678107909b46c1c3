"""Checks of an estimator's inputs: every message names the argument, what was expected and what came."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..types import Camera

REMEDIES = {2: "repeat the grey values: np.dstack([image] * 3)", 4: "leave the fourth channel out"}


def check_image(image, modality: str, camera: Camera) -> None:
    """Raise ValueError unless the image is the camera's: (H, W, 3) u8 RGB, or a histogram (H, W) of counts.

    The order of the channels cannot be checked: images that OpenCV reads are BGR and must be converted.
    """
    shape = camera.size_px[::-1]
    kinds = {"rgb": f"(H, W, 3) = {(*shape, 3)} uint8 RGB", "event": f"(H, W) = {shape} event counts"}
    expected = kinds[modality]
    if not isinstance(image, np.ndarray):
        raise ValueError(f"image: expected a numpy array {expected}, got {type(image).__name__}")
    got = f"image: expected {expected}, got {image.shape} {image.dtype}"
    if image.shape[:2] != shape:
        raise ValueError(f"{got}; the camera's calibration is for images of {shape}")
    if modality == "event":
        if image.ndim != 2:
            raise ValueError(f"{got}; frames are for modality='rgb'")
        if image.dtype.kind not in "iuf" or (
            image.dtype.kind != "u" and not (image.min() >= 0 and image.max() < np.inf)
        ):
            raise ValueError(f"{got}; counts are numbers from 0")
        return
    if image.shape[2:] != (3,):
        channels = image.shape[2] if image.ndim == 3 else image.ndim
        raise ValueError(f"{got}; {REMEDIES.get(channels, 'give three channels')}")
    if image.dtype != np.uint8:
        scale = "scale 0 to 1 by np.uint8(np.round(255 * image))"
        raise ValueError(f"{got}; {scale if image.dtype.kind == 'f' else 'give uint8'}")


def as_camera(camera: Camera | str | Path | None) -> Camera:
    """The camera itself, or that of a calibration file; for None, the bench's DAVIS 346."""
    if camera is None:
        return Camera.davis346()
    return camera if isinstance(camera, Camera) else Camera.load(camera)
