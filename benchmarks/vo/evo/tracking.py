"""EVO's tracking: the event frame is aligned with the projected map by inverse compositional Lucas-Kanade.

With reference image M (the map as its last projection shows it), event frame I and the warp
``W(u; T) = pi(T pi^-1(u, d_u))``, each iteration finds the increment xi that minimises

    sum_u (M(W(u; xi)) - g I(W(u; T)))^2

and sets ``T <- T exp(xi)^-1``.  The Jacobian of M belongs to the reference and is computed once.  The gain g
makes up for the two images' different brightness.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

from .constants import Constants


@dataclass(frozen=True)
class Reference:
    """What of the map the camera sees from one pose: pixels with depth, brightness and Jacobian."""

    rotation: np.ndarray  # T_ref_world
    position: np.ndarray
    points: np.ndarray  # (N, 3) in the reference camera's frame
    brightness: np.ndarray  # (N,) M at the pixels
    jacobian: np.ndarray  # (6, N) of M to (translation, rotation)
    hessian: np.ndarray  # (6, 6) J^T J
    visible: float  # share of the map's points within the image
    mean_depth: float


@njit(cache=True, nogil=True)
def exponential(xi):
    """Rotation (3, 3) and translation (3,) of a twist (translation, rotation)."""
    v, w = xi[:3].copy(), xi[3:].copy()
    angle = np.sqrt(w @ w)
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    if angle < 1e-8:
        return np.eye(3) + W, v + 0.5 * (W @ v)
    a, b, c = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    Wv = W @ v
    return np.eye(3) + a * W + b * (W @ W), v + b * Wv + c * (W @ Wv)


def warp_jacobian(points, K) -> np.ndarray:
    """d pi(exp(xi) X) / d xi at xi = 0, (N, 2, 6), for points (N, 3) in the camera's frame."""
    x, y, z = points.T
    one, none = np.ones_like(z), np.zeros_like(z)
    u = K[0, 0] * np.stack([one / z, none, -x / z**2, -x * y / z**2, 1 + (x / z) ** 2, -y / z], -1)
    v = K[1, 1] * np.stack([none, one / z, -y / z**2, -1 - (y / z) ** 2, x * y / z**2, x / z], -1)
    return np.stack([u, v], 1)


def project_map(points, rotation, position, K, size_px, constants: Constants) -> Reference:
    """Project a map's points (N, 3; world) into a camera at ``T_ref_world`` and blur them to an image.

    The blur gives pixels beside the edges brightness, and the mean inverse depth of the points around them.
    """
    width, height = size_px
    camera = points @ rotation.T + position
    mask, inverse = np.zeros((height, width), np.float32), np.zeros((height, width), np.float32)
    inside = _splat(mask, inverse, camera, K)
    blur = constants.reference_blur_px
    image, weighted = cv2.GaussianBlur(mask, (0, 0), blur), cv2.GaussianBlur(inverse, (0, 0), blur)
    selected = image > constants.reference_brightness
    v, u = np.nonzero(selected)
    every = max(1, -(-len(u) // constants.reference_points))
    u, v = u[::every], v[::every]
    depth = image[v, u] / weighted[v, u]
    rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(len(u))], -1)
    gradient = np.stack([0.5 * cv2.filter2D(image, -1, np.array([[-1.0, 0, 1]])),
                         0.5 * cv2.filter2D(image, -1, np.array([[-1.0], [0], [1]]))], -1)[v, u]  # fmt: skip
    seen = rays * depth[:, None]
    jacobian = np.einsum("ni,nij->nj", gradient, warp_jacobian(seen, K))
    mean_depth = float(np.median(depth)) if len(depth) else np.nan
    visible, J = inside / max(len(points), 1), np.ascontiguousarray(jacobian.T, np.float32)
    return Reference(
        rotation,
        position,
        seen.astype(np.float32),
        image[v, u],
        J,
        jacobian.T @ jacobian,
        visible,
        mean_depth,
    )


def align(image, reference: Reference, rotation, position, K, constants: Constants, free: int = 6):
    """Pose ``T_cam_ref`` that aligns an event frame, from a first guess.

    The first ``free`` components of the increment are estimated: 3 for translation alone, 6 for all.
    Returns rotation, position, the cosine between both images over the pixels warped (their similarity), and
    the mean motion of these pixels (px).
    """
    if len(reference.points) < constants.reference_fewest:
        return rotation, position, 0.0, 0.0
    c, r = constants, reference
    return _iterate(image, r.points, r.brightness, r.jacobian, r.hessian, np.ascontiguousarray(rotation),
                    np.ascontiguousarray(position), K, r.mean_depth, free, c.iterations, c.smallest_step,
                    c.damping)  # fmt: skip


@njit(cache=True, nogil=True)
def _iterate(image, points, brightness, J, H, R, t, K, depth, free, iterations, smallest_step, damping):
    """Lucas-Kanade's iterations; translation is solved for in units of the depth.

    ``H = J^T J`` is that of all pixels, also where the warp leads out of the image: their residual counts as
    none, which shortens a step and does not move the solution.
    """
    scale = np.array([depth, depth, depth, 1.0, 1.0, 1.0])
    A = (H * np.outer(scale, scale))[:free, :free].copy()
    trace = np.trace(A)
    for i in range(free):
        A[i, i] += damping * A[i, i] + 1e-9 * trace + 1e-12
    inverse, xi = np.linalg.inv(A), np.zeros(6)
    warped, kept = np.empty_like(brightness), np.empty_like(brightness)
    similarity, shift_px = 0.0, 0.0
    for _ in range(iterations):
        shift_px = _warp(warped, kept, image, points, brightness, R, t, K)
        product, power = np.dot(kept, warped), np.dot(warped, warped)
        similarity = product / max(np.sqrt(power * np.dot(kept, kept)), 1e-9)
        residual = np.float32(product / max(power, 1e-9)) * warped - kept
        step = inverse @ (scale[:free] * np.dot(J, residual)[:free])
        xi[:free] = scale[:free] * step
        dR, dt = exponential(-xi)
        t = R @ dt + t
        R = R @ dR
        if np.abs(step).max() < smallest_step:
            break
    return R, t, similarity, shift_px


@njit(cache=True, nogil=True)
def _splat(mask, inverse, camera, K):
    """Draw points as single pixels, the nearest in front; returns how many are inside."""
    inside = 0
    for k in range(len(camera)):
        x, y, z = camera[k]
        if z <= 1e-6:
            continue
        u, v = int(np.rint(K[0, 0] * x / z + K[0, 2])), int(np.rint(K[1, 1] * y / z + K[1, 2]))
        if 0 <= u < mask.shape[1] and 0 <= v < mask.shape[0]:
            inside += 1
            mask[v, u] = 1.0
            inverse[v, u] = max(inverse[v, u], 1 / z)
    return inside


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _warp(warped, kept, image, points, brightness, R, t, K):
    """Event frame at the warped pixels, the map's brightness there (both 0 outside), and the mean motion."""
    height, width = image.shape
    P, p = (K @ R).astype(np.float32), (K @ t).astype(np.float32)
    fu, fv, cu, cv = np.float32(K[0, 0]), np.float32(K[1, 1]), np.float32(K[0, 2]), np.float32(K[1, 2])
    moved, n = np.float32(0), 0
    for k in range(len(points)):
        X, Y, Z = points[k, 0], points[k, 1], points[k, 2]
        z = P[2, 0] * X + P[2, 1] * Y + P[2, 2] * Z + p[2]
        u = (P[0, 0] * X + P[0, 1] * Y + P[0, 2] * Z + p[0]) / z
        v = (P[1, 0] * X + P[1, 1] * Y + P[1, 2] * Z + p[1]) / z
        if not (z > 0 and u >= 0 and v >= 0 and u < width - 1 and v < height - 1):
            warped[k] = kept[k] = 0
            continue
        c, r = np.int32(u), np.int32(v)
        a, b = u - c, v - r
        top = (1 - a) * image[r, c] + a * image[r, c + 1]
        warped[k] = (1 - b) * top + b * ((1 - a) * image[r + 1, c] + a * image[r + 1, c + 1])
        kept[k] = brightness[k]
        du, dv = u - fu * X / Z - cu, v - fv * Y / Z - cv
        moved += np.sqrt(du * du + dv * dv)
        n += 1
    return moved / max(n, 1)
