"""What `living_room` draws into its photographs: a port of paper, fingers over its rim, and round decoys."""

from __future__ import annotations

import cv2
import numpy as np

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import project
from lmmap.types import Camera, Port, Pose
from lmmap_lab.paper_port import net

PORT = Port.lm_map()
SUPER = 2  # samples a pixel along each axis


def fill(image, points_px, colour) -> None:
    if np.all(np.isfinite(points_px)) and np.abs(points_px).max() < 1e4:
        fixed = np.round((SUPER * (np.asarray(points_px) + 0.5) - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(image, [fixed], [float(c) for c in colour], cv2.LINE_8, 4)


def paper_port(image, T: Pose, camera: Camera, light, ink: float) -> None:
    """Board, black square, ring and folded plate (reflectances times light), from the back to the front."""
    normal = T.normal

    def shade(n, reflectance):
        return reflectance * light["colour"] * (0.45 + 0.55 * max(float(n @ light["from"]), 0.0))

    def draw(corners_m, reflectance, n=normal):
        steps = np.linspace(0, 1, 12, endpoint=False)[:, None]
        sides = zip(corners_m, np.roll(corners_m, -1, 0), strict=True)
        many = np.concatenate([a + steps * (b - a) for a, b in sides])
        fill(image, project(T @ many, camera), shade(n, reflectance))

    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    draw(0.106 * square, np.array(light["card"]))
    draw(0.100 * square, ink)
    for radius_m, reflectance in ((PORT.ring_outer_radius_m, 0.85), (PORT.ring_inner_radius_m, ink)):
        fill(image, project(T @ circle_points_m(radius_m, 240), camera), shade(normal, reflectance))
    faces = net.plate_net(PORT)
    for face, move in list(zip(faces, net.fold(faces), strict=True))[::-1]:
        corners = net.moved(face.corners_m, move) + np.array([0, 0, PORT.plate_height_m])
        outward = T.rotation @ move[0][:, 2]
        if face.kind != net.TAB and outward @ (T @ corners.mean(0)) < 0:
            draw(corners, ink, outward)
    for corners in PORT.marker_corners_m():
        draw(corners, 0.85)


def fingers(image, T: Pose, camera: Camera, rng) -> None:
    """Up to four fingers from outside over a place at the board's rim."""
    around = rng.uniform(0, 2 * np.pi)
    inward = np.array([-np.cos(around), -np.sin(around), 0.0])
    across = np.array([-inward[1], inward[0], 0.0])
    colour = rng.uniform(0.25, 1.0) * np.array([235, 190, 165.0])
    rim_m = rng.uniform(0.080, 0.105)
    for k in range(rng.integers(1, 5)):
        tip = -rim_m * inward + 0.019 * (k - 1.5) * across + [0, 0, 0.006]
        ends = project(T @ np.array([tip, tip - 0.25 * inward]), camera)
        if not np.isfinite(ends).all():
            continue
        width = SUPER * 0.017 * camera.fx_px / T.position_m[2]
        a, b = (tuple(int(v) for v in np.clip(SUPER * p, -9999, 9999)) for p in ends)
        for share, tone in ((1.0, 0.75), (0.75, 1.0)):
            cv2.line(image, a, b, (tone * colour).tolist(), max(int(share * width), 1), cv2.LINE_8)


def decoy(image, centre, radius, rng) -> str:
    """A round thing that is no port, seen at a slant: its kind."""
    kind = ("cup", "clock", "plate", "tape", "dial", "target")[rng.integers(6)]
    slant, turn = rng.uniform(0.5, 1.0), rng.uniform(0, np.pi)
    spin = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def at(radii, angles):
        on_it = np.stack([radii * np.cos(angles), slant * radii * np.sin(angles)], -1)
        return centre + radius * (on_it @ spin.T)

    def disc(share, colour, shift=0.0):
        circle = at(share, np.linspace(0, 2 * np.pi, 180))
        fill(image, circle + np.array([0, shift * radius]), colour)

    def bar(inner, outer, angle, half, colour):
        corners = np.array([[inner, -half], [outer, -half], [outer, half], [inner, half]])
        turned = corners @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        fill(image, centre + radius * (turned * [1, slant]) @ spin.T, colour)

    dark, white = rng.uniform(0, 60, 3), rng.uniform(190, 255) * rng.uniform(0.9, 1, 3)
    if kind == "cup":
        disc(1.0, rng.uniform(60, 255, 3), 0.25), disc(1.0, white), disc(0.88, dark + np.array([40, 25, 10]))
    elif kind == "clock":
        disc(1.0, dark), disc(0.9, white)
        for k in range(12):
            bar(0.72, 0.84, k * np.pi / 6, 0.02 + 0.02 * (k % 3 == 0), dark)
        for length, half in ((0.5, 0.035), (0.75, 0.025)):
            bar(-0.1, length, rng.uniform(0, 2 * np.pi), half, dark)
    elif kind == "plate":
        disc(1.0, white), disc(0.97, 0.9 * white), disc(0.66, white), disc(0.62, 0.93 * white)
    elif kind == "tape":
        behind = dark + rng.uniform(0, 120, 3)
        disc(1.0, rng.uniform(120, 255, 3)), disc(0.97, rng.uniform(150, 255) * np.ones(3))
        disc(0.75, behind)
    elif kind == "dial":  # a white ring on black with bars inside, but not the port's
        disc(1.2, dark), disc(1.0, white), disc(rng.uniform(0.7, 0.9), dark)
        for _ in range(rng.integers(0, 6)):
            inner = rng.uniform(0, 0.5)
            outer, around = inner + rng.uniform(0.05, 0.3), rng.uniform(0, 2 * np.pi)
            bar(inner, outer, around, rng.uniform(0.03, 0.3), white)
    else:
        for k, share in enumerate(np.linspace(1, 0.15, rng.integers(3, 8))):
            disc(share, white if k % 2 else dark)
    return kind
