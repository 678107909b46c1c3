"""Images for choosing the robust set: another laboratory than the training's, and Mitsuba's pictures.

Other covers (copper, amber and black film, white cloth, solar cells), dull paint on the port, a worn ring,
warmer lamps, brighter things behind, a softer lens, another event sensor.  ``PICTURES`` come from Mitsuba:
its own rays, materials that the bench has no equation for, light from surface to surface.  Their names
neither train nor test anything.  Made once, kept in data/derived/validation; an interrupted run goes on.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from unittest import mock

import numpy as np

from lmmap.estimation.images import images
from lmmap.geometry.port import in_view
from lmmap.pipeline.image_estimator import settings_for
from lmmap.settings import PAPER
from lmmap.types import EVENT, Camera, Port, Pose, Recording, Trajectory
from lmmap_lab.bench import cad, labels, laboratory, optics, renderer, sequences, shading, skins
from lmmap_lab.bench.event_sensor import SensorSettings
from lmmap_lab.bench.varied import angle_about_port
from lmmap_lab.provenance import DERIVED_DATA
from lmmap_lab.training import dataset

sys.path.append(str(Path(__file__).resolve().parents[1] / "benchmarks"))  # where mitsuba_scene lies
SEQUENCES = [f"realistic-{i}" for i in range(1201, 1210)]
PICTURES = [f"realistic-{i}" for i in range(1210, 1217)]
FOLDER = DERIVED_DATA / "validation"
CAMERA, PORT = Camera.davis346(), Port.lm_map()
SECONDS, EACH = 0.7, 2  # length of a recording, and most images from it
HISTOGRAMS = {"event": 1.0, "event half": 0.5, "event double": 2.0}  # of the paper's N

# diffuse, specular, roughness, and how much of the film's relief
COVERS = {
    "copper": ([0.03, 0.02, 0.01], [0.95, 0.55, 0.35], 0.25, 1.0),
    "amber": ([0.10, 0.05, 0.01], [0.80, 0.45, 0.10], 0.18, 1.2),
    "black": ([0.03, 0.03, 0.03], [0.06, 0.06, 0.06], 0.35, 0.8),
    "cloth": ([0.75, 0.74, 0.70], [0.04, 0.04, 0.04], 0.60, 0.3),
    "cells": ([0.02, 0.03, 0.10], [0.08, 0.08, 0.12], 0.20, 0.1),
}
PAINT = np.zeros_like(renderer.PARTS)  # diffuse, specular, roughness of the port's parts
PAINT[cad.RING], PAINT[cad.MARKER] = (0.45, 0.06, 0.60), (0.40, 0.05, 0.50)
PAINT[cad.PLATE], PAINT[cad.PETAL], PAINT[cad.BODY] = (
    (0.35, 0.05, 0.50),
    (0.25, 0.06, 0.45),
    (0.2, 0.05, 0.4),
)
GAP_M, SECTORS, IN_GAP = 0.005, 6, 0.06  # between the film's pieces; what is left of the light there
PLAIN = SensorSettings(0.25, 0.04, 200.0, 0.2, 1.0, hot_share=4e-4)
WORLDS = {  # gaps in the ring's film, event sensor
    "plain": (0.0, PLAIN),
    "gaps": (GAP_M, PLAIN),
    "slow sensor": (0.0, SensorSettings(0.45, 0.05, 60.0, 0.1, 0.5)),
    "noisy sensor": (0.0, SensorSettings(0.25, 0.06, 200.0, 0.5, 6.0, hot_share=1e-3)),
}


def panel(seq, port):
    """The solid, and a cover that the training's laboratory does not have."""
    rng, kind = seq.rng("validation panel"), list(COVERS)[int(seq.name[-4:]) % len(COVERS)]
    centre_m = rng.uniform(-1, 1, 2) * [0.10, 0.05]
    diffuse, specular, roughness, relief = COVERS[kind]
    skin = skins.film(port.panel_size_m, -centre_m, rng)
    dirt = skin[..., :1] / skin[..., :1].mean()
    skin[..., skins.DIFFUSE], skin[..., skins.SPECULAR] = dirt * diffuse, specular
    skin[..., skins.ROUGHNESS] *= roughness / skin[..., skins.ROUGHNESS].mean()
    skin[..., skins.SLOPE] *= relief
    if kind == "cells":  # bright conductors between the cells
        row, column = np.indices(skin.shape[:2])
        skin[(row % 40 < 2) | (column % 80 < 2), skins.DIFFUSE] = 0.5
    return cad.solid(port, centre_m), skin


def lamps(seq):
    """The training's lamps moved, warmer, of other intensities."""
    light, rng = laboratory.lamps(seq), seq.rng("validation lamps")
    away_m = np.linalg.norm(light.position_m, axis=1, keepdims=True)
    colour = [1.0, rng.uniform(0.75, 1), rng.uniform(0.5, 1)]
    gain = np.exp(rng.normal(0, 0.3, (len(away_m), 1)))
    return light._replace(position_m=light.position_m + 0.12 * away_m * rng.standard_normal((len(away_m), 3)),
                          intensity=light.intensity * gain * colour)  # fmt: skip


def backdrop(seq, camera, total_intensity):
    """The training's room, and striped cloth on boxes of any colour in it."""
    light, rng = laboratory.backdrop(seq, camera, total_intensity), seq.rng("validation backdrop")
    v, u = np.indices(light.shape[:2])
    for _ in range(3):
        centre, half, a = rng.uniform(0, camera.size_px), rng.uniform(20, 70, 2), rng.uniform(0, np.pi)
        x, y = u - centre[0], v - centre[1]
        x, y = x * np.cos(a) + y * np.sin(a), y * np.cos(a) - x * np.sin(a)
        colour = rng.uniform(0.02, 0.2) * rng.uniform(0.2, 1, 3) * min(total_intensity, 40.0)
        stripes = np.where(x // rng.uniform(4, 15) % 2, 1, rng.uniform(0.2, 0.8))[..., None]
        light = np.where(((abs(x) < half[0]) & (abs(y) < half[1]))[..., None], stripes * colour, light)
    return optics.blur(light.astype(np.float32), 1.0)


def worn(render, gap_m):
    """`renderer.render` with a ring whose film has lost half its light, unevenly, and has gaps."""

    def rendered(solid, skin, light, T_cam_port, rays, behind):
        radiance, cover = render(solid, skin, light, T_cam_port, rays, behind)
        angle = angle_about_port(T_cam_port, rays[0])
        left = 0.5 + 0.15 * np.sin(2 * angle + 1)
        period = 2 * np.pi / SECTORS
        left[(angle + 0.3) % period * PORT.ring_radius_m < gap_m] = IN_GAP
        return radiance * (1 - cover[..., :1] * (1 - left[..., None])).astype(np.float32), cover

    return rendered


def of_turn(name: str) -> tuple:
    """Gap and sensor of the world whose turn it is at a sequence of the bench."""
    return list(WORLDS.values())[int(name.split("-")[1]) // 3 % len(WORLDS)]


def other_setup(gap_m: float) -> sequences.Setup:
    """All of this in place of the bench's own, with gaps of this width in the ring's film."""
    render = worn(partial(renderer.render, parts=PAINT), gap_m)
    return sequences.Setup(panel, lamps, backdrop, render, lens_blur_px=0.9, frame_hz=5)


def recorded(name: str, world: str) -> Recording:
    gap_m, sensor = WORLDS[world]
    return sequences.simulate(name, SECONDS, sensor=sensor, setup=other_setup(gap_m))


def pictured(name: str) -> Recording:
    """Frames by Mitsuba, as a recording without events."""
    import mitsuba_scene as peer
    import mitsuba_shapes as materials

    seq = laboratory.sequence(name)
    (solid, skin), light = panel(seq, PORT), lamps(seq)
    total = light.intensity.sum(0)
    behind, dome = backdrop(seq, CAMERA, light.intensity[:, 0].sum()), renderer.AMBIENT * total
    truth = laboratory.sequence_motion(seq, np.arange(0, 60, 0.5))
    truth = truth[np.flatnonzero(in_view(truth, PORT, CAMERA))]
    truth, frames = truth[np.linspace(0, len(truth) - 1, EACH).astype(int)], []
    covers = (
        {"type": "roughconductor", "material": "Cu", "distribution": "beckmann", "alpha": 0.2},
        {"type": "principled", "base_color": peer.rgb([0.8, 0.4, 0.1]), "metallic": 0.5, "roughness": 0.4,
         "clearcoat": 0.6},
        {"type": "roughplastic", "diffuse_reflectance": peer.rgb([0.5, 0.5, 0.45]), "alpha": 0.15},
    )  # fmt: skip

    def bsdf(layer, diffuse, specular, alpha):
        if isinstance(alpha, float):
            return {"type": "roughplastic", "diffuse_reflectance": diffuse, "alpha": 0.3}
        return covers[int(seq.name[-4:]) % len(covers)]

    changes = [(materials, "material", bsdf), (renderer, "PARTS", PAINT), (shading, "RETRO_PEAK_SR", 5.0),
               (shading, "RETRO_WIDTH_RAD", np.deg2rad(4.0))]  # fmt: skip
    with ExitStack() as stack:
        for place, what, value in changes:
            stack.enter_context(mock.patch.object(place, what, value))
        for i, T in enumerate(truth):
            lit = [*peer.spheres(light, T), {"type": "constant", "radiance": peer.rgb(dome)}]
            path = {"type": "path", "max_depth": 3, "hide_emitters": True}
            radiance = 0
            for layer, lights, by, rays in (("half", lit, path, 25), ("retro", lit[:-1], peer.direct(), 4)):
                room = peer.scene(solid, skin, layer, lights, by, T, CAMERA, rays, True)
                radiance = radiance + np.array(peer.mi.render(room))
            nothing = peer.surfaces(solid, skin, T, CAMERA) == cad.NOTHING
            radiance = np.where(nothing[..., None], behind, radiance).astype(np.float32)
            radiance = optics.apply_lens(radiance, 0.9)
            frames.append(optics.expose(radiance, laboratory.GAIN, seq.rng(f"picture {i}")))
    times_us = np.arange(EACH, dtype=np.int64) * 1_000_000
    return Recording(
        name, CAMERA, np.empty(0, EVENT), np.array(frames), times_us, Trajectory(times_us, truth)
    )


def shots(recording: Recording, kind: str) -> dict[str, np.ndarray]:
    """Images of one kind with the ring in view, spread evenly; true masks (N, 2, H, W) and poses."""
    modality, settings = (
        kind.split()[0],
        settings_for(CAMERA, int(PAPER.events_per_window * HISTOGRAMS.get(kind, 1))),
    )
    span_us, looks = recording.truth.t_us, []
    for t_us, image in images(recording, modality, settings):
        T = recording.truth.at(np.clip([t_us], span_us[0], span_us[-1]))
        if in_view(T, PORT, CAMERA)[0]:
            looks.append((image, T[0]))
    looks = [looks[i] for i in np.unique(np.linspace(0, len(looks) - 1, min(EACH, len(looks))).astype(int))]
    masks = [labels.label_masks(T, PORT, CAMERA) for _, T in looks]
    size = CAMERA.size_px[::-1]
    return {
        kind: np.array([i for i, _ in looks]).reshape(-1, *size, *([3] if kind == "rgb" else [])),
        f"{kind} masks": np.array(masks, bool).reshape(-1, 2, *size),
        f"{kind} rotation": np.array([T.rotation for _, T in looks]).reshape(-1, 3, 3),
        f"{kind} position_m": np.array([T.position_m for _, T in looks]).reshape(-1, 3),
    }


def make(report=print) -> None:
    """All images, in the memory of one recording."""
    jobs = [(n, w) for w in WORLDS for n in SEQUENCES] + [(n, "Mitsuba") for n in PICTURES]
    absent = [(n, w) for n, w in jobs if not (FOLDER / f"{n}-{w}").is_dir()]
    for done, (name, world) in enumerate(absent, 1):
        kinds = ["rgb"] if world == "Mitsuba" else ["rgb", *(HISTOGRAMS if world == "plain" else ["event"])]
        recording = pictured(name) if world == "Mitsuba" else recorded(name, world)
        arrays = {k: v for kind in kinds for k, v in shots(recording, kind).items()}
        dataset.write_samples(FOLDER / f"{name}-{world}", arrays)
        report(f"validation: {name}, {world}, {done} of {len(absent)}")


def taken(kind: str, world: str) -> Iterator[tuple[str, np.ndarray, np.ndarray, Pose]]:
    """Yield ``(sequence, image, masks (2, H, W), pose)`` of what `make` has kept."""
    for name in PICTURES if world == "Mitsuba" else SEQUENCES:
        parts = ("", " masks", " rotation", " position_m")
        arrays = [np.load(FOLDER / f"{name}-{world}" / f"{kind}{part}.npy") for part in parts]
        for image, masks, rotation, position_m in zip(*arrays, strict=True):
            yield name, image, masks, Pose(rotation, position_m)
