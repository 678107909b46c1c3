"""What may befall an image in reality, as conditions to judge the filters under.

Rendered where that is possible (gaps, sensors, Mitsuba), and else made by other means than the training's
variations (a disc for defocus, not a Gaussian; photo-electrons; striped cloth), so that no filter is asked
for just what it has practised.  A change leaves the true masks alone, except where it hides the port.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import cv2
import numpy as np
import validation_world as world


class Condition(NamedTuple):
    """What is looked at, and what befalls it: ``change(image, masks, rng) -> image, masks``."""

    kind: str
    world: str = "plain"
    change: Callable | None = None


def gains(*channels):
    return lambda frame, masks, rng: (frame * np.array(channels), masks)


def cast(frame, masks, rng):
    """Warm light from one corner, cold light from the other."""
    across = np.add.outer(*(np.linspace(0, 0.5, n) for n in frame.shape[:2]))[..., None]
    return frame * ((1 - across) * [1.4, 1.0, 0.6] + across * [0.6, 1.0, 1.5]), masks


def kernel(weights):
    weights = np.array(weights, float) / np.sum(weights)
    return lambda image, masks, rng: (cv2.filter2D(image, -1, weights, borderType=cv2.BORDER_REFLECT), masks)


def shot_noise(frame, masks, rng):
    """Two photo-electrons a grey level, and 4 electrons of read noise."""
    return (rng.poisson(2 * frame) + rng.normal(0, 4, frame.shape)) / 2, masks


def compressed(frame, masks, rng):
    bgr = np.ascontiguousarray(frame[..., ::-1]).astype(np.uint8)
    data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 20])[1]
    return cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1], masks


def stuck(value):
    def change(image, masks, rng):
        out = image.copy()
        out[rng.random(image.shape[:2]) < 1e-3] = value
        return out, masks

    return change


def covered(image, masks, rng):
    """A strip of striped cloth over a part of the ring; what it hides leaves the masks."""
    v, u = np.indices(masks.shape[1:])
    ring = np.argwhere(masks[0])
    row, column = ring[rng.integers(len(ring))]
    a, half = rng.uniform(0, np.pi), rng.uniform([10, 30], [20, 60])
    x, y = u - column, v - row
    x, y = x * np.cos(a) + y * np.sin(a), y * np.cos(a) - x * np.sin(a)
    hides, stripe = (abs(x) < half[0]) & (abs(y) < half[1]), x // 5 % 2 > 0
    if image.ndim == 3:
        cloth = np.where(stripe[..., None], rng.uniform(20, 200, 3), rng.uniform(5, 100, 3))
        return np.where(hides[..., None], cloth, image), masks & ~hides
    return np.where(hides, rng.poisson(np.where(stripe, 2.0, 0.2)), image), masks & ~hides


DISC = np.hypot(*np.indices((5, 5)) - 2) <= 1.9
CONDITIONS = {
    "rgb": {
        "as rendered": Condition("rgb"),
        "Mitsuba": Condition("rgb", "Mitsuba"),
        "dark": Condition("rgb", change=gains(0.3, 0.3, 0.3)),
        "bright": Condition("rgb", change=gains(3, 3, 3)),
        "white balance": Condition("rgb", change=gains(1.5, 1, 0.6)),
        "colour cast": Condition("rgb", change=cast),
        "cloth": Condition("rgb", change=covered),
        "defocus": Condition("rgb", change=kernel(DISC)),
        "shake": Condition("rgb", change=kernel(np.eye(5))),
        "noise": Condition("rgb", change=shot_noise),
        "JPEG": Condition("rgb", change=compressed),
        "hot pixels": Condition("rgb", change=stuck(255)),
        "gaps": Condition("rgb", "gaps"),
    },
    "event": {
        "as rendered": Condition("event"),
        "N half": Condition("event half"),
        "N double": Condition("event double"),
        "slow sensor": Condition("event", "slow sensor"),
        "noisy sensor": Condition("event", "noisy sensor"),
        "cloth": Condition("event", change=covered),
        "hot pixels": Condition("event", change=stuck(40)),
        "gaps": Condition("event", "gaps"),
    },
}


def cases(condition: Condition) -> Iterator[tuple]:
    """Yield ``(image, masks, pose)`` under a condition; frames u8 as a camera gives them."""
    for i, (_, image, masks, T) in enumerate(world.taken(condition.kind, condition.world)):
        if condition.change:
            changed, masks = condition.change(image.astype(float), masks, np.random.default_rng(i))
            image = np.clip(np.rint(changed), 0, np.iinfo(image.dtype).max).astype(image.dtype)
        yield image, masks, T
