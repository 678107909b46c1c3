"""A camera's intrinsics from views of a checkerboard (Zhang 2000, by OpenCV)."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from lmmap.types import Camera

VIEW_INTERVAL_US = 250_000  # views closer in time are nearly equal
MOVED_PX = 2.0  # by which a board's corners differ, on average, in views that count as two
WORST_FOCAL = 0.05  # standard deviation of a focal length, beyond which the views do not tell it
WORST_CORNER_PX = 1.0  # of the lens's distortion at the image's corners, beyond which that is said
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
    Camera, and a dict of ``views``, ``rms_px``, ``sigma_px`` (of fx, fy, cx, cy) and ``corner_sigma_px``, of
    where the distortion puts the image's corners

    Raises
    ------
    ValueError
        If too few views that differ show the whole board, or if they leave the focal length open.
    """
    views, size_px, due_us = [], None, -np.inf
    for t_us, frame in timed_frames:
        if t_us < due_us:
            continue
        if size_px not in (None, frame.shape[1::-1]):
            raise ValueError(f"images of {size_px} and of {frame.shape[1::-1]} px")
        size_px, points = frame.shape[1::-1], find_corners_px(frame, corners)
        if points is not None:
            due_us = t_us + interval_us
            if all(np.linalg.norm(points - view, axis=1).mean() > MOVED_PX for view in views):
                views.append(points.astype(np.float32))
    if len(views) < LEAST_VIEWS:
        size = f"{corners[0]} x {corners[1]}"
        raise ValueError(
            f"the whole board of {size} inner corners is seen in {len(views)} views that differ, and "
            f"{LEAST_VIEWS} are needed"
        )
    views = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, MOST_VIEWS).astype(int))]
    board = np.zeros((corners[0] * corners[1], 3), np.float32)
    board[:, :2] = square_m * np.mgrid[: corners[0], : corners[1]].T.reshape(-1, 2)
    boards, no_k3 = [board] * len(views), cv2.CALIB_FIX_K3  # the views of a narrow lens do not decide it
    rms_px, K, D, turns, places = cv2.calibrateCamera(boards, views, size_px, None, None, flags=no_k3)
    covariance = rms_px**2 / 2 * _covariance(board, turns, places, K, D)
    values, sigma = [float(v) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2])], np.sqrt(np.diag(covariance))
    if not np.all(sigma[:2] < WORST_FOCAL * np.abs(values[:2])):
        raise ValueError(
            f"a focal length of {values[0]:.0f} px is known to {sigma[0]:.0f} px only: the board is nearly "
            "parallel to the image in all views, so tilt it by 20 to 40 degrees, to all sides"
        )
    camera = Camera(*map(int, size_px), *values, tuple(float(d) for d in D.ravel()[:4]))
    r = (
        max(np.hypot(x - values[2], y - values[3]) for x in (0, size_px[0]) for y in (0, size_px[1]))
        / values[0]
    )
    radial = values[0] * np.array([r**3, r**5])  # how k1 and k2 move a corner
    facts = {"views": len(views), "rms_px": float(rms_px), "sigma_px": sigma[:4].tolist(),
             "corner_sigma_px": float(np.sqrt(radial @ covariance[4:6, 4:6] @ radial))}  # fmt: skip
    return camera, facts


def _covariance(board_m: np.ndarray, turns, places, K: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Covariance (8, 8) of fx, fy, cx, cy, k1, k2, p1, p2 with corners known to 1 px, the poses unknown.

    OpenCV's own leaves the directions out that views hardly tell: of a board that was never tilted it says
    0.0 px for a focal length that is 40 % off.
    """
    information = np.zeros((8, 8))
    for turn, place in zip(turns, places, strict=True):
        J = cv2.projectPoints(board_m, turn, place, K, D)[1]
        pose, lens = np.linalg.qr(J[:, :6])[0], J[:, 6:14]
        lens = lens - pose @ (pose.T @ lens)  # what no pose of the board explains
        information += lens.T @ lens
    scale = 1 / np.sqrt(np.diag(information))
    known, axes = np.linalg.eigh(information * np.outer(scale, scale))
    return (axes / np.maximum(known, 1e-15)) @ axes.T * np.outer(scale, scale)
