"""Variations of training images: what exposure, lens, sensor, storage and clutter do to real ones.

Images are float32: frames (H, W, 3) in [0, 255], linear in light, or histograms (H, W) of counts.  Masks are
(H, W) bool of one filter, or u8 with a bit for each of both.  No function writes into its arguments; each
draws from its argument ``rng``.
"""

from __future__ import annotations

import cv2
import numpy as np

HISTOGRAM_EVENTS = (0.5, 2.0)  # of the paper's N: what the robust filters see
STROKE_PX = (1, 3)  # width of the lines that stand for seams and scratches


def each_mask(mask):
    """Masks (..., M, H, W) bool: the one mask (..., H, W) bool, or those of the bits of both filters."""
    if mask.dtype == bool:
        return mask[..., None, :, :]
    return np.stack([mask & 1, mask >> 1 & 1], -3).astype(bool)


def flip(arrays, rng):
    """All arrays after the same random quarter turns and, half of the time, mirrored."""
    turns, mirror = rng.integers(4), rng.random() < 0.5
    turned = [np.rot90(a, turns) for a in arrays]
    return [a[:, ::-1] if mirror else a for a in turned]


def expose(frame, rng, brightness: float = 0.35, balance: float = 0.08):
    """Another exposure and white balance: a log-normal gain of all channels, and one of each."""
    gain = np.exp(rng.normal(0, brightness) + rng.normal(0, balance, 3))
    return np.clip(frame * gain, 0, 255).astype(np.float32)


def tint(frame, rng, strength: float = 0.5):
    """A colour cast that changes slowly over the frame, as from coloured film and walls."""
    corners = np.exp(rng.normal(0, strength, (3, 3, 3))).astype(np.float32)
    field = cv2.resize(corners, frame.shape[1::-1], interpolation=cv2.INTER_CUBIC)
    return np.clip(frame * np.maximum(field, 0), 0, 255)


def blur(image, rng, most_px: float = 1.2):
    """Defocus, or one time in three the blur of motion along a line of up to 5 px."""
    if rng.random() < 1 / 3:
        size, angle = int(rng.choice([3, 5])), rng.uniform(0, np.pi)
        kernel, reach = np.zeros((size, size), np.float32), (size - 1) / 2
        for s in np.linspace(-reach, reach, 4 * size):
            kernel[round(reach + s * np.sin(angle)), round(reach + s * np.cos(angle))] = 1
        return cv2.filter2D(image, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REFLECT)
    return cv2.GaussianBlur(image, (0, 0), rng.uniform(0.2, most_px), borderType=cv2.BORDER_REFLECT)


def compress(frame, rng, qualities=(30, 95)):
    """A frame after JPEG compression."""
    code = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(*qualities))]
    _, data = cv2.imencode(".jpg", np.clip(frame, 0, 255).astype(np.uint8), code)
    return cv2.imdecode(data, cv2.IMREAD_COLOR).astype(np.float32)


def noise(frame, rng, most: float = 6.0):
    """Read noise of a random strength, in grey levels."""
    sigma = rng.uniform(0, most)
    return np.clip(frame + sigma * rng.standard_normal(frame.shape, np.float32), 0, 255)


def hot_pixels(image, rng, value: float, share: float = 0.001):
    """Single pixels stuck at up to ``value``."""
    stuck = rng.random(image.shape[:2]) < rng.uniform(0, share)
    out = image.copy()
    out[stuck] = rng.uniform(0.5, 1) * value
    return out


def clutter(image, mask, other, rng):
    """The image and its mask with a polygon of another picture over them, as cloth and objects hide things.

    ``other`` is an image of the same size without anything to find in it.
    """
    height, width = mask.shape
    centre, reach = rng.uniform(0, [width, height]), rng.uniform(0.1, 0.35) * width
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 9)))
    radii = reach * rng.uniform(0.5, 1, len(angles))
    corners = centre + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], -1)
    cover = cv2.fillPoly(np.zeros(mask.shape, np.uint8), [np.rint(corners).astype(np.int32)], 1).astype(bool)
    image = np.where(cover if image.ndim == 2 else cover[..., None], other, image)
    return image, np.where(cover, False, mask)


def seams(image, mask, rng, most: int = 4):
    """Lines across the ring, like the gaps between the pieces of its retro-reflective film.

    They are dark in a frame, silent or busy in a histogram.  The mask stays: a gap is part of the ring.
    """
    active, out = np.argwhere(mask), image.copy()
    if not len(active):
        return out
    lines = np.zeros(mask.shape, np.uint8)
    for row, column in active[rng.integers(0, len(active), rng.integers(1, most + 1))]:
        angle, reach = rng.uniform(0, np.pi), rng.uniform(3, 10)
        step = np.rint(reach * np.array([np.cos(angle), np.sin(angle)])).astype(int)
        ends = [tuple(int(v) for v in (column, row) + sign * step) for sign in (-1, 1)]
        cv2.line(lines, ends[0], ends[1], 1, int(rng.integers(*STROKE_PX)))
    at = (lines > 0) & (mask > 0)
    out[at] = out[at] * rng.uniform(0, 0.5) if image.ndim == 3 else rng.poisson(rng.uniform(0, 4), at.sum())
    return out


def thin(counts, rng, least: float = 0.6):
    """A histogram without some of its events, each lost with the same chance, as by a slower sensor."""
    return rng.binomial(counts.astype(np.int64), rng.uniform(least, 1)).astype(np.float32)


def noise_events(counts, rng, most: float = 0.15):
    """Background activity: Poisson counts of a random rate, events per pixel."""
    return counts + rng.poisson(rng.uniform(0, most), counts.shape).astype(np.float32)


def _sometimes(rng, chance, change, image, *more):
    """``change(image, *more)`` with this chance, else the image."""
    return change(image, *more) if rng.random() < chance else image


def robust_frame(frame, mask, other, rng):
    """A frame and its mask after all variations, each by chance; ``other`` is as in `clutter`."""
    if rng.random() < 0.3:
        frame, mask = clutter(frame, mask, other, rng)
    frame = _sometimes(rng, 0.4, seams, frame, mask, rng)
    frame = _sometimes(rng, 0.4, tint, frame, rng)
    frame = expose(frame, rng, 0.5, 0.2)
    frame = _sometimes(rng, 0.4, blur, frame, rng)
    frame = _sometimes(rng, 0.4, noise, frame, rng)
    frame = _sometimes(rng, 0.3, hot_pixels, frame, rng, 255.0)
    return _sometimes(rng, 0.3, compress, frame, rng).astype(np.float32), mask


def robust_histogram(counts, mask, other, rng):
    """A histogram and its mask after all variations, each by chance; ``other`` is as in `clutter`."""
    if rng.random() < 0.3:
        counts, mask = clutter(counts, mask, other, rng)
    counts = _sometimes(rng, 0.4, seams, counts, mask, rng)
    counts = _sometimes(rng, 0.5, thin, counts, rng)
    counts = _sometimes(rng, 0.5, noise_events, counts, rng)
    return _sometimes(rng, 0.3, hot_pixels, counts, rng, 30.0).astype(np.float32), mask
