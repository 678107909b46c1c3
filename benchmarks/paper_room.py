"""A paper port in a furnished room, path-traced: the clip of the chapter "Hold it in your hand".

    DRJIT_LIBLLVM_PATH=.../libLLVM.so python benchmarks/paper_room.py            # 5 minutes on two cores
    DRJIT_LIBLLVM_PATH=.../libLLVM.so python benchmarks/paper_room.py --steps    # its pictures of the making

The port is the sheets of `lmmap print`, folded by their own net.  A window and what the walls send back
light it, a hand holds it at its rim, and around it stand a sofa, a shelf, a table, a cup and a clock.  The
camera has a webcam's distortion, vignetting, noise and JPEG, and reads its rows one after the other: in the
part "wave" each band of rows has the pose of its own time, and the truth is that of the middle row.  Mitsuba
needs an LLVM that knows the processor; ``--variant scalar_rgb`` needs none and takes twice as long.  Writes
data/mini/paper-port.mp4 with its camera and truth.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import mitsuba_scene as shared
import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import bearings
from lmmap.recordings.pose_files import write_trajectory
from lmmap.types import Pose, Trajectory
from lmmap_lab.paper_port import net
from lmmap_lab.paper_port.experiments import CAMERA, COUNT, FACING, RATE_HZ, part_of, port_in, pose
from lmmap_lab.provenance import DATA, ROOT

mi, mesh, rgb = shared.mi, shared.mesh, shared.rgb
WIDE = 1.12  # of the pinhole image around that of the lens
BANDS, READOUT = 4, 0.6  # of rows, and the share of a frame's time that reading them takes
SAMPLES = 16
INK, PAPER, CARD, SKIN = 0.035, 0.82, (0.45, 0.36, 0.26), (0.62, 0.40, 0.30)
NOISE, GAIN, QUALITY = 1.0, 2.4, 88  # grey levels; exposure; of the JPEG
LIFT_M = 1e-4


def matt(colour):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(colour)}}


def printed(colour):
    """Laser print: matt, with a weak and broad reflection."""
    plastic = {"type": "roughplastic", "diffuse_reflectance": rgb(colour), "alpha": 0.35, "nonlinear": False}
    return {"type": "twosided", "bsdf": plastic}


def polygon(name, corners_m, bsdf):
    """A convex polygon (K, 3)."""
    faces = [[0, k, k + 1] for k in range(1, len(corners_m) - 1)]
    return mesh(name, np.asarray(corners_m, float), np.array(faces), mi.load_dict(bsdf))


def annulus(inner_m, outer_m, height_m, T, bsdf):
    circle = circle_points_m(1.0, 360)
    points = np.concatenate([inner_m * circle, outer_m * circle]) + np.array([0, 0, height_m])
    i, j = np.arange(360), np.roll(np.arange(360), -1)
    faces = np.concatenate([np.stack([i, i + 360, j + 360], -1), np.stack([i, j + 360, j], -1)])
    return mesh("ring", T @ points, faces, mi.load_dict(bsdf))


def box(centre, size, colour):
    to_world = (
        mi.ScalarTransform4f().translate(list(map(float, centre))).scale([s / 2 for s in map(float, size)])
    )
    return {"type": "cube", "to_world": to_world, "bsdf": matt(colour)}


def rod(a, b, radius, colour=SKIN):
    a, b = (list(map(float, p)) for p in (a, b))
    ends = {"type": "sphere", "center": b, "radius": radius, "bsdf": matt(colour)}
    return {"type": "cylinder", "p0": a, "p1": b, "radius": radius, "bsdf": matt(colour)}, ends


def paper(T: Pose, port) -> dict:
    """The sheets, glued: board, black square, ring, and the folded plate with its markers."""

    def square(half, height):
        return T @ np.array(
            [[-half, -half, height], [half, -half, height], [half, half, height], [-half, half, height]]
        )

    found = {
        "board": polygon("board", square(0.106, -0.002), matt(CARD)),
        "square": polygon("square", square(0.100, -LIFT_M), printed(INK)),
        "ring": annulus(port.ring_inner_radius_m, port.ring_outer_radius_m, 0.0, T, printed(PAPER)),
    }
    faces = net.plate_net(port)
    for k, (face, move) in enumerate(zip(faces, net.fold(faces), strict=True)):
        corners = net.moved(face.corners_m, move) + np.array([0, 0, port.plate_height_m + LIFT_M])
        if face.kind != net.TAB:
            found[f"face {k}"] = polygon("face", T @ corners, printed(INK))
    for k, corners in enumerate(port.marker_corners_m()):
        found[f"marker {k}"] = polygon("marker", T @ (corners + np.array([0, 0, 2 * LIFT_M])), printed(PAPER))
    return found


def hand(T: Pose, covers: bool) -> dict:
    """Four fingers in front of the board's lower right rim and a thumb behind; or over a marker."""
    found = {}
    aim = np.array([0.040, 0.014, 0.055]) if covers else np.array([0.064, -0.064, 0.009])
    for k in range(4):
        step = np.array([0.0135, 0.0135, 0]) * (k - 1.5)
        tip, knuckle = aim + step, aim + step + np.array([0.05, -0.05, 0.012])
        for i, part in enumerate(rod(T @ knuckle, T @ tip, 0.0085)):
            found[f"finger {k} {i}"] = part
    outward = np.array([1, -1, 0.0])
    palm, elbow = T @ (aim + 0.086 * outward - [0, 0, 0.012]), np.array([0.25, 0.55, 0.1])
    found["palm"], found["palm end"] = rod(T @ (aim + 0.055 * outward), palm, 0.034)
    found["arm"], found["arm end"] = rod(palm + elbow, palm, 0.042, (0.12, 0.2, 0.35))
    return found


def room(part: str) -> dict:
    """Walls, window, furniture; all in the camera's frame: x right, y down, z forward."""
    rng = np.random.default_rng(3)
    look = {
        "floor": box((0.1, 1.12, 0.9), (3.6, 0.04, 4.6), (0.36, 0.25, 0.16)),
        "ceiling": box((0.1, -1.42, 0.9), (3.6, 0.04, 4.6), 0.8),
        "back": box((0.1, -0.1, 2.92), (3.6, 2.6, 0.04), (0.66, 0.62, 0.55)),
        "front": box((0.1, -0.1, -1.3), (3.6, 2.6, 0.04), 0.6),
        "right": box((1.82, -0.1, 0.9), (0.04, 2.6, 4.6), (0.55, 0.60, 0.62)),
        "left": box((-1.62, -0.1, 0.9), (0.04, 2.6, 4.6), 0.62),
        "table": box((0.55, 0.62, 1.9), (1.5, 0.04, 0.8), (0.42, 0.27, 0.15)),
        "leg": box((1.2, 0.87, 1.6), (0.06, 0.46, 0.06), (0.3, 0.2, 0.1)),
        "shelf": box((-0.75, -0.05, 2.78), (0.95, 0.03, 0.24), (0.5, 0.38, 0.25)),
        "sofa": box((-0.9, 0.75, 2.2), (1.1, 0.5, 0.6), (0.20, 0.30, 0.34)),
        "sofa back": box((-0.9, 0.45, 2.5), (1.1, 0.5, 0.2), (0.22, 0.33, 0.37)),
        "cup": {"type": "cylinder", "p0": [0.42, 0.6, 1.75], "p1": [0.42, 0.5, 1.75], "radius": 0.042,
                "bsdf": matt((0.75, 0.2, 0.15))},
        "window": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([-1.58, -0.35, 0.6])
                   .rotate([0, 1, 0], 90).scale([0.6, 0.55, 1]),
                   "emitter": {"type": "area", "radiance": rgb((9.0, 9.6, 10.5))}},
    }  # fmt: skip
    for name, radius, depth, colour in (("clock rim", 0.17, 2.88, 0.05), ("clock face", 0.15, 2.875, 0.85)):
        turn = mi.ScalarTransform4f().translate([0.75, -0.62, depth]).rotate([0, 1, 0], 180).scale(radius)
        look[name] = {"type": "disk", "to_world": turn, "bsdf": matt(colour)}
    for k, deg in enumerate((60, 200)):
        d = np.array([np.sin(np.deg2rad(deg)), -np.cos(np.deg2rad(deg)), 0])
        centre = np.array([0.75, -0.62, 2.868])
        look[f"hand {k}"] = rod(centre, centre + 0.11 * d, 0.006, 0.05)[0]
    x = -1.18
    for k in range(14):
        wide, tall = rng.uniform(0.03, 0.06), rng.uniform(0.2, 0.32)
        look[f"book {k}"] = box(
            (x + wide / 2, -0.065 - tall / 2, 2.78), (wide, tall, 0.2), rng.uniform(0.08, 0.7, 3)
        )
        x += wide + 0.002
    if part == "lamp":  # a bright bulb held near the camera's line of sight
        look["bulb"] = {"type": "sphere", "center": [0.046, -0.046, 0.42], "radius": 0.012,
                        "emitter": {"type": "area", "radiance": rgb((160.0, 150.0, 125.0))}}  # fmt: skip
    return look


def radiance(t: float, rows: tuple[int, int], samples: int, seed: int) -> np.ndarray:
    """Some rows of the pinhole image at a time in images."""
    part, (width, height) = part_of(int(t)), size_px()
    T = pose(t)
    film = {"type": "hdrfilm", "width": width, "height": height, "crop_offset_x": 0, "crop_offset_y": rows[0],
            "crop_width": width, "crop_height": rows[1] - rows[0], "pixel_format": "rgb",
            "component_format": "float32", "rfilter": {"type": "box"}}  # fmt: skip
    fov = float(2 * np.rad2deg(np.arctan(width / (2 * CAMERA.fx_px))))
    sensor = {"type": "perspective", "fov": fov, "fov_axis": "x", "near_clip": 1e-3, "film": film,
              "to_world": mi.ScalarTransform4f(np.diag([-1.0, -1, 1, 1])),
              "sampler": {"type": "independent", "sample_count": samples}}  # fmt: skip
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": 5}, "sensor": sensor, **room(part),
             **paper(T, port_in(part)), **hand(T, part == "cover")}  # fmt: skip
    return np.array(mi.render(mi.load_dict(scene), seed=seed))


def size_px() -> tuple[int, int]:
    return tuple(2 * round(WIDE * side / 2) for side in CAMERA.size_px)


def frame_light(image: int, samples: int) -> np.ndarray:
    """What reaches the sensor in an image, (H, W, 3): through the lens, darker in the corners."""
    width, height = size_px()
    if part_of(image) == "wave":
        edges = np.linspace(0, height, BANDS + 1).round().astype(int)
        late = [READOUT * ((k + 0.5) / BANDS - 0.5) for k in range(BANDS)]
        pinhole = np.concatenate(
            [
                radiance(max(image + dt, 0), (a, b), samples, image * BANDS + k)
                for k, (dt, a, b) in enumerate(zip(late, edges[:-1], edges[1:], strict=True))
            ]
        )
    else:
        pinhole = radiance(image, (0, height), samples, image)
    pixels = np.stack(np.meshgrid(*map(np.arange, CAMERA.size_px)), -1).astype(float)
    rays = bearings(pixels, CAMERA)
    at = CAMERA.fx_px * rays[..., :2] / rays[..., 2:] + [(width - 1) / 2, (height - 1) / 2]
    vignette = (rays[..., 2] / np.linalg.norm(rays, axis=-1)) ** 4
    light = cv2.remap(pinhole, at.astype(np.float32), None, cv2.INTER_LINEAR)
    return cv2.GaussianBlur(light, (0, 0), 0.7) * vignette[..., None]


def to_grey_levels(light: np.ndarray) -> np.ndarray:
    """Light in [0, 1] as sRGB has it, in [0, 255]."""
    x = np.clip(light, 0, 1)
    return 255 * np.where(x < 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def sensor(light: np.ndarray, rng) -> np.ndarray:
    """A frame (H, W, 3) u8: sRGB, noise, JPEG."""
    noisy = to_grey_levels(GAIN * light) + NOISE * rng.standard_normal(light.shape)
    jpeg = cv2.imencode(
        ".jpg", noisy.clip(0, 255).astype(np.uint8)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
    )[1]
    return cv2.imdecode(jpeg, cv2.IMREAD_COLOR_RGB)


def steps(samples: int) -> np.ndarray:
    """Four pictures side by side (H, W, 3) u8: printed, cut and folded half, folded, glued."""
    lying = Pose(
        (Rotation.from_euler("x", -38, degrees=True) * FACING).as_matrix(), np.array([0, 0.02, 0.62])
    )
    port, pictures = port_in("wave"), []
    left, right = np.array([-0.112, 0.0, 0.0]), np.array([0.112, 0.0, 0.0])
    for number, (share, place) in enumerate(((0.0, right), (0.5, right), (1.0, right), (1.0, 0 * right))):
        ring_at = left if number < 3 else 0 * left
        look = {"table": rectangle(lying, 0 * left, (1.4, 1.0), -0.004, (0.42, 0.28, 0.16)),
                "window": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([-1.2, -1, 0.3])
                           .rotate([0, 1, 0], 90).rotate([1, 0, 0], 35).scale(0.5),
                           "emitter": {"type": "area", "radiance": rgb((9.0, 9.4, 10.0))}},
                "sky": {"type": "constant", "radiance": rgb(0.25)}}  # fmt: skip
        if number == 0:
            look["sheet 1"] = rectangle(lying, left, (0.210, 0.297), -0.002, PAPER)
            look["sheet 2"] = rectangle(lying, right, (0.210, 0.297), -0.002, PAPER)
        look["square"] = rectangle(lying, ring_at, (0.2, 0.2), -0.001, INK)
        moved = Pose(lying.rotation, lying @ ring_at)
        look["ring"] = annulus(port.ring_inner_radius_m, port.ring_outer_radius_m, 0.0, moved, matt(PAPER))
        faces = [replace(face, angle_rad=share * face.angle_rad) for face in net.plate_net(port)]
        moves = net.fold(faces)
        rise = -min(
            net.moved(face.corners_m, move)[:, 2].min() for face, move in zip(faces, moves, strict=True)
        )
        up = place + np.array([0, 0, rise + 10 * LIFT_M])
        for k, (face, move) in enumerate(zip(faces, moves, strict=True)):
            if face.kind == net.TAB and share == 1:  # behind a wall
                continue
            ink = 0.5 if face.kind == net.TAB else INK
            look[f"face {k}"] = polygon("face", lying @ (net.moved(face.corners_m, move) + up), matt(ink))
        for k, corners in enumerate(port.marker_corners_m()):
            flat = corners * [1, 1, 0] + [0, 0, 2 * LIFT_M]
            look[f"marker {k}"] = polygon("marker", lying @ (flat + up), matt(PAPER))
        film = {
            "type": "hdrfilm",
            "width": 360,
            "height": 250,
            "pixel_format": "rgb",
            "rfilter": {"type": "box"},
        }
        seen = {"type": "perspective", "fov": 46.0, "fov_axis": "x", "near_clip": 1e-3, "film": film,
                "to_world": mi.ScalarTransform4f(np.diag([-1.0, -1, 1, 1])),
                "sampler": {"type": "independent", "sample_count": samples}}  # fmt: skip
        scene = {"type": "scene", "integrator": {"type": "path", "max_depth": 4}, "sensor": seen, **look}
        pictures.append(to_grey_levels(np.array(mi.render(mi.load_dict(scene), seed=number))))
    return np.hstack(pictures).clip(0, 255).astype(np.uint8)


def rectangle(T: Pose, centre, size, height, colour):
    """A sheet of a width and a height at a place of a plane."""
    x, y = np.array(size) / 2
    corners = np.array([[-x, -y, height], [x, -y, height], [x, y, height], [-x, y, height]]) + centre
    return polygon("sheet", T @ corners, matt(colour))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=DATA / "mini" / "paper-port.mp4")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument(
        "--steps", action="store_true", help="write the pictures of the making alone, as JPEG"
    )
    parser.add_argument("--only", type=int, help="write this image alone, as PNG")
    a = parser.parse_args()
    mi.set_variant(a.variant)
    rng = np.random.default_rng(0)
    if a.steps:
        picture = steps(3 * a.samples)[..., ::-1]
        cv2.imwrite(
            str(ROOT / "book" / "_static" / "paper-steps.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 88]
        )
        return
    if a.only is not None:
        cv2.imwrite(str(a.output), sensor(frame_light(a.only, a.samples), rng)[..., ::-1])
        return
    kept, key = None, None
    codec = cv2.VideoWriter_fourcc(*"mp4v")  # which OpenCV writes fast and small
    video = cv2.VideoWriter(str(a.output), cv2.CAP_FFMPEG, codec, RATE_HZ, CAMERA.size_px)
    for image in range(COUNT):
        print(f"\r{image + 1} of {COUNT}", end="", file=sys.stderr)
        part, now = part_of(image), pose(image)
        new = (part, *now.position_m)
        if part == "wave" or new != key:
            kept, key = frame_light(image, a.samples), new
        video.write(sensor(kept, rng)[..., ::-1])
    video.release()
    t_us = np.round(np.arange(COUNT) * 1e6 / RATE_HZ).astype(np.int64)
    poses = [pose(image) for image in range(COUNT)]
    T = Pose(np.stack([p.rotation for p in poses]), np.stack([p.position_m for p in poses]))
    write_trajectory(Trajectory(t_us, T), a.output.with_suffix(".truth.csv"))
    CAMERA.save(a.output.with_suffix(".camera.json"))


if __name__ == "__main__":
    main()
