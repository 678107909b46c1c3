"""The bench's lens and image sensor: from radiance to the pixels of a frame."""

from __future__ import annotations

import cv2
import numpy as np

GLARE = 0.03  # share of the light that a lens scatters widely (veiling glare of small machine-vision lenses)
LUMINANCE = ((0.2126,), (0.7152,), (0.0722,))  # weights of linear red, green and blue (Rec. 709)


def blur(radiance, sigma_px: float) -> np.ndarray:
    """Radiance (H, W, colours) under a Gaussian point spread."""
    image = cv2.GaussianBlur(radiance, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)
    return image.reshape(radiance.shape)


def apply_lens(radiance, sigma_px: float) -> np.ndarray:
    """Radiance (H, W, colours) behind the lens: a Gaussian core, and wide glare scattered between its
    surfaces."""
    small = cv2.resize(radiance, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA)
    near, far = (cv2.GaussianBlur(small, (0, 0), s, borderType=cv2.BORDER_CONSTANT) for s in (2.0, 6.0))
    glare = cv2.resize(0.5 * (near + far), radiance.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    core = blur(radiance, sigma_px)
    return core + np.float32(GLARE) * (glare.reshape(radiance.shape) - core)


def luminance(radiance) -> np.ndarray:
    """What a pixel without colour filter sees: (..., 3) -> (..., 1)."""
    return radiance @ np.array(LUMINANCE, radiance.dtype)


def expose(radiance, gain: float, rng, full_well: float = 7000.0, read_noise: float = 25.0) -> np.ndarray:
    """8-bit frame: photo-electrons with shot and read noise (electrons), saturated and rounded."""
    electrons = np.minimum(radiance * gain, 4.0) * full_well
    noisy = electrons + rng.standard_normal(electrons.shape, np.float32) * np.sqrt(electrons + read_noise**2)
    return np.clip(np.rint(noisy * (255 / full_well)), 0, 255).astype(np.uint8)
