"""A camera's intrinsics from views of a checkerboard (Zhang 2000, by OpenCV)."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from lmmap.types import Camera

VIEW_INTERVAL_US = 250_000  # views closer in time are nearly equal
MOST_VIEWS, LEAST_VIEWS = 60, 8
STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-4)


def find_corners_px(frame: np.ndarray, corners: tuple[int, int]) -> np.ndarray | None:
    """Inner corners (N, 2) px of a board with (columns, rows) of them in a frame (H, W, 3) u8, or None."""
    grey = cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH + cv2.CALIB_CB_NORMALIZE_IMAGE + cv2.CALIB_CB_FAST_CHECK
    is_found, points = cv2.findChessboardCorners(grey, corners, flags=flags)
    if not is_found:
        return None
    spacing = np.linalg.norm(np.diff(points.reshape(corners[1], corners[0], 2), axis=1), axis=-1).min()
    half = int(np.clip(spacing / 3, 1, 5))
    return cv2.cornerSubPix(grey, points, (half, half), (-1, -1), STOP).reshape(-1, 2)


def calibrate_intrinsics(timed_frames: Iterable, corners: tuple[int, int], square_m: float,
                         interval_us: int = VIEW_INTERVAL_US) -> tuple[Camera, dict]:  # fmt: skip
    """The camera of ``(t_us, frame)`` that show a checkerboard.

    Parameters
    ----------
    corners : inner corners of the board, (columns, rows)
    square_m : side of a square; it does not change the intrinsics

    Returns
    -------
    Camera, and a dict of ``views``, ``rms_px`` and ``sigma_px`` (of fx, fy, cx, cy)

    Raises
    ------
    ValueError
        If too few views show the whole board.
    """
    views, size_px, due_us = [], None, -np.inf
    for t_us, frame in timed_frames:
        if t_us < due_us:
            continue
        size_px, points = frame.shape[1::-1], find_corners_px(frame, corners)
        if points is not None:
            views.append(points.astype(np.float32))
            due_us = t_us + interval_us
    if len(views) < LEAST_VIEWS:
        size = f"{corners[0]} x {corners[1]}"
        raise ValueError(
            f"the whole board of {size} inner corners is seen in {len(views)} views, {LEAST_VIEWS} are needed"
        )
    views = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, MOST_VIEWS).astype(int))]
    board = np.zeros((corners[0] * corners[1], 3), np.float32)
    board[:, :2] = square_m * np.mgrid[: corners[0], : corners[1]].T.reshape(-1, 2)
    rms_px, K, D, *_, sigma, _, _ = cv2.calibrateCameraExtended(
        [board] * len(views),
        views,
        size_px,
        None,
        None,
        flags=cv2.CALIB_FIX_K3,  # the views of a narrow lens do not decide it
    )
    values = [float(v) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2])]
    camera = Camera(*map(int, size_px), *values, tuple(float(d) for d in D.ravel()[:4]))
    return camera, {"views": len(views), "rms_px": float(rms_px), "sigma_px": sigma.ravel()[:4].tolist()}
