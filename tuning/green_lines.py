"""The pixels of pure green lines and filled windows that were drawn over a picture.

Pictures are compressed with less resolution in colour than in brightness: a line's colour runs into the
pixels beside it, and what remains on a thin line is pale.  Its brightness stays where it is.  So a line's
pixels are those as bright as pure green that have some green in them; beside a line they are darker or
brighter.
"""

from __future__ import annotations

import cv2
import numpy as np
from wire_fit import Overlay

from lmmap.geometry.projection import rescale_px
from lmmap.types import Camera

WIDTH_PX = Camera.davis346().width_px
BRIGHTNESS = 150  # of pure green: 0.587 of 255
# of a line's pixel, in grey levels: how far both differences of colour are below zero at least, and how far
# its brightness is from that of pure green at most
WAYS = ((10, 45), (7, 45), (15, 45), (10, 30), (10, 60))
FILLED, FILLED_EDGE = 50, 25  # least green inside a filled window, and of its outermost pixels
LEAST_LINES, LEAST_WINDOW = 300, 30  # pixels of all lines in a picture, and of each window
GAP_PX, THICK_PX = 12.0, 4.0  # between lines of one drawing, and of the thickest line


def overlay(name: str, picture: np.ndarray, way=WAYS[0]) -> Overlay | None:
    """Lines and windows of a picture (H, W, 3) u8 in pixels of a DAVIS 346; None if it has too few."""
    least, tolerance = way
    to_davis = WIDTH_PX / picture.shape[1]
    brightness, red, blue = np.moveaxis(cv2.cvtColor(picture, cv2.COLOR_RGB2YCrCb).astype(int), -1, 0)
    green, bright = 128 - np.maximum(red, blue), np.abs(brightness - BRIGHTNESS) <= tolerance
    windows = _windows((green > FILLED) & bright, (green > FILLED_EDGE) & bright, to_davis)
    if windows is None:
        return None
    drawn = (green > least) & bright
    drawn &= _part_of_most(_grown(drawn, _square(GAP_PX / to_davis)), drawn)
    lines = drawn & ~_grown(windows, _square(3))
    edges = windows & (cv2.erode(windows.astype(np.uint8), _square(3)) == 0)
    if lines.sum() < LEAST_LINES:
        return None
    lines_px, edges_px = (rescale_px(np.argwhere(mask)[:, ::-1], to_davis) for mask in (lines, edges))
    return Overlay(name, (WIDTH_PX, picture.shape[0] * to_davis), lines_px, edges_px)


def _windows(filled, filled_or_edge, to_davis: float) -> np.ndarray | None:
    """The three largest areas that are wider than lines; None if there are fewer.

    What is narrow goes, and with it the corners and perhaps the outermost pixels; these come back.
    """
    wide = cv2.morphologyEx(filled.astype(np.uint8), cv2.MORPH_OPEN, _square(THICK_PX / to_davis))
    _, parts, facts, _ = cv2.connectedComponentsWithStats(wide)
    areas = facts[1:, cv2.CC_STAT_AREA] * to_davis**2
    largest = np.argsort(-areas, kind="stable")[:3]
    if len(largest) < 3 or areas[largest[-1]] < LEAST_WINDOW:
        return None
    return filled_or_edge & _grown(
        np.isin(parts, 1 + largest), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    )


def _part_of_most(joined, counted) -> np.ndarray:
    """The connected part of a mask that holds the most pixels of another mask."""
    _, parts = cv2.connectedComponents(joined.astype(np.uint8))
    return parts == 1 + np.bincount(parts[counted], minlength=2)[1:].argmax()


def _square(side: float) -> np.ndarray:
    """Of the odd number of pixels that is nearest."""
    return np.ones((2 * round((side - 1) / 2) + 1,) * 2, np.uint8)


def _grown(mask, shape) -> np.ndarray:
    return cv2.dilate(mask.astype(np.uint8), shape) > 0
