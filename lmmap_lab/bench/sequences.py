"""Recordings of the bench: a camera looks at a sequence of the laboratory, image by image, event by event.

Everything random is drawn from the sequence's name, so a recording depends on its name and length alone.  A
long recording keeps finished parts on disk; an interrupted one goes on from them and ends in the same bytes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import project
from lmmap.types import EVENT, Camera, InputError, Port, Pose, Recording, Trajectory

from . import laboratory, optics, part_files, renderer
from .event_sensor import EventSensor, SensorSettings
from .laboratory import GAIN, SECONDS, Sequence, sequence, sequence_motion

EXPOSURE_US, SUB_EXPOSURES = 8000, 2
LENS_BLUR_PX = 0.6
STEP_PX = 0.9  # image motion between renders
FRAME_HZ, TRUTH_HZ = 20, 200
THREADS = 2
PART_S = 5.0  # seconds of recording that an interruption may cost


def render_times_us(
    seq: Sequence, port: Port, camera: Camera, seconds: float, step_px: float = STEP_PX
) -> np.ndarray:
    """Times between which nothing visible of panel or port moves by more than about ``step_px``."""
    t = np.arange(0, seconds + 1e-9, 0.001)
    poses = sequence_motion(seq, t)
    size = np.array(camera.size_px)
    speed = np.zeros(len(t) - 1)
    for point in _visible_points_m(port):
        pixel = project(poses @ point, camera)
        inside = np.all(np.abs(pixel - (size - 1) / 2) < size / 2 + step_px, -1)
        moved = np.linalg.norm(np.diff(pixel, axis=0), axis=-1)
        speed = np.maximum(speed, np.where(inside[1:] | inside[:-1], moved, 0))
    travelled = np.concatenate([[0], np.cumsum(np.clip(speed, step_px / 20, step_px))])
    steps = np.interp(np.arange(0, travelled[-1], step_px), travelled, t)
    return np.unique((steps * 1e6).astype(np.int64))


def _visible_points_m(port: Port) -> np.ndarray:
    """A grid over the panel and the corners of the petals' tips, (N, 3)."""
    x, y = (np.linspace(-size / 2, size / 2, 7) for size in port.panel_size_m)
    grid = np.stack([*np.meshgrid(x, y), np.full((7, 7), -port.panel_depth_m)], -1).reshape(-1, 3)
    radius = port.plate_circumradius_m * np.cos(np.pi / 6) + port.petal_lean_m
    height = np.array([0, 0, port.plate_height_m + port.petal_rise_m])
    return np.concatenate([grid, circle_points_m(radius, 6) + height])


@dataclass(frozen=True)
class Setup:
    """The parts of the laboratory that a recording is made with; a script may put others in their place.

    ``panel(seq, port)``, ``lamps(seq)`` and ``backdrop(seq, camera, total_intensity)`` are as in
    `laboratory`, and ``render`` is as in `renderer`.
    """

    panel: Callable = laboratory.panel
    lamps: Callable = laboratory.lamps
    backdrop: Callable = laboratory.backdrop
    render: Callable = renderer.render
    lens_blur_px: float = LENS_BLUR_PX
    frame_hz: float = FRAME_HZ
    step_px: float = STEP_PX


OUR_SETUP = Setup()


def stream(seq: Sequence, camera: Camera, port: Port, seconds: float, sensor, skip: int = 0,
           setup: Setup = OUR_SETUP, keep: Callable[[View], bool] | None = None
           ) -> Iterator[tuple]:  # fmt: skip
    """Yield ``(t_us, events since the last image, frame or None)`` in order, without the first ``skip``, or
    only of the images to ``keep``.

    Threads render a few images ahead; ``sensor`` (an `EventSensor`) makes events of them here, in order.
    """
    solid, skin = setup.panel(seq, port)
    lamps = setup.lamps(seq)
    backdrop = setup.backdrop(seq, camera, lamps.intensity[:, 0].sum())
    colour = skin, lamps, backdrop
    monochrome = renderer.to_monochrome(skin, lamps, backdrop)
    event_rays, frame_rays = renderer.ray_grid(camera, 1), renderer.ray_grid(camera, SUB_EXPOSURES)

    def radiance(T_cam_port, scene, rays):
        skin, lamps, backdrop = scene
        return setup.render(solid, skin, lamps, T_cam_port, rays, backdrop)[0]

    def image(view: View):
        if not view.is_frame:
            intensity = optics.apply_lens(radiance(view.poses, monochrome, event_rays), setup.lens_blur_px)
            return view.t_us, intensity * (255 * GAIN), None
        parts = [radiance(T, colour, frame_rays[k : k + 1]) for k, T in enumerate(view.poses)]
        mean = optics.apply_lens(np.mean(parts, 0), setup.lens_blur_px)
        return view.t_us, None, optics.expose(mean, GAIN, seq.rng(f"frame {seq.light} {view.t_us}"))

    T_first = sequence_motion(seq, np.zeros(1))[0]
    for scene, rays in ((monochrome, event_rays), (colour, frame_rays)):  # compile before threads start
        corner = *scene[:2], scene[2][:1, :1].copy()
        radiance(T_first, corner, rays[:, :1, :1].copy())
    views = list(filter(keep, _views(seq, camera, port, seconds, setup)))
    for t_us, intensity, frame in _compute_ahead(image, views[skip:]):
        yield t_us, sensor(intensity, t_us) if frame is None else np.empty(0, EVENT), frame


class View(NamedTuple):
    """An image to render: for the event sensor with one pose, or a frame with those of its sub-exposures."""

    t_us: int
    poses: Pose
    is_frame: bool


def _views(seq: Sequence, camera: Camera, port: Port, seconds: float, setup: Setup) -> list[View]:
    """All images in the order of time."""
    steps_us = render_times_us(seq, port, camera, seconds, setup.step_px)
    frames_us = np.arange(EXPOSURE_US, seconds * 1e6 - EXPOSURE_US, 1e6 / setup.frame_hz).astype(np.int64)
    parts_us = ((np.arange(SUB_EXPOSURES) + 0.5) / SUB_EXPOSURES - 0.5) * EXPOSURE_US
    steps = [View(t, T, False) for t, T in zip(steps_us, sequence_motion(seq, steps_us * 1e-6), strict=True)]
    times = frames_us[:, None] + parts_us
    poses = sequence_motion(seq, times.ravel() * 1e-6)
    frames = [View(t, poses[i * SUB_EXPOSURES : (i + 1) * SUB_EXPOSURES], True)
              for i, t in enumerate(frames_us)]  # fmt: skip
    return sorted(steps + frames, key=lambda view: (view.t_us, view.is_frame))


def _compute_ahead(function, arguments, depth: int = 6):
    """Results of ``function`` over ``arguments``, in order, computed a few ahead on `THREADS` threads."""
    with ThreadPoolExecutor(THREADS) as pool:
        waiting = deque(pool.submit(function, argument) for argument in arguments[:depth])
        for argument in arguments[depth:]:
            yield waiting.popleft().result()
            waiting.append(pool.submit(function, argument))
        while waiting:
            yield waiting.popleft().result()


def duration_s(seq: Sequence, seconds: float | None, profile: str = "quick") -> float:
    """The asked length, or the profile's; `InputError` if it makes no sense."""
    seconds = SECONDS[profile][seq.name.split("-")[0]] if seconds is None else seconds
    if not (np.isfinite(seconds) and 0 < seconds <= 3600):
        raise InputError(f"sequence {seq.name}: cannot last {seconds} s; give --seconds from 0.2 to 3600")
    return seconds


def simulate(name: str, seconds: float | None = None, progress=None, *, camera: Camera | None = None,
             parts: Path | None = None, sensor: SensorSettings | None = None,
             setup: Setup = OUR_SETUP, port: Port | None = None,
             keep: Callable[[View], bool] | None = None) -> Recording:  # fmt: skip
    """Record a sequence with a camera (default: DAVIS 346) that looks at a port (default: LM-MAP).

    Parameters
    ----------
    name, seconds
        The sequence and its length (default: the quick profile's).
    progress
        Called with the seconds done.
    parts
        A folder that keeps finished parts, so that the same call goes on after an interruption.  The caller
        removes it.
    sensor
        Parameters of the event sensor.
    setup
        Other lamps, panels, and so on than the laboratory's.
    keep
        Images that are rendered, by default all.  Frames do not depend on each other; events depend on all
        images before them.

    Raises
    ------
    InputError
        For an unknown name, a length that is not positive, a folder that cannot be written.
    """
    seq, port = sequence(name), port or Port.lm_map()
    camera = Camera.davis346() if camera is None else camera
    seconds = duration_s(seq, seconds)
    event_sensor = EventSensor(camera, sensor or SensorSettings(), seq.rng("events " + seq.light))
    made_of = f"{name} {seconds} {camera} {port} {event_sensor.settings}"
    finished = part_files.resume(parts, event_sensor, made_of)
    skip, part_start_us = (int(finished[-1][k]) for k in ("images", "t_us")) if finished else (0, 0)
    part = {"events": [], "frames": [], "frames_t_us": []}
    images = stream(seq, camera, port, seconds, event_sensor, skip, setup, keep)
    for count, (t_us, events, frame) in enumerate(images, skip + 1):
        if frame is None:
            part["events"].append(events)
        else:
            part["frames"].append(frame)
            part["frames_t_us"].append(t_us)
        if t_us - part_start_us > PART_S * 1e6:
            finished.append(part_files.join(part, camera))
            part, part_start_us = {key: [] for key in part}, t_us
            if parts is not None:
                state = {"images": count, "t_us": t_us, **event_sensor.state()}
                part_files.keep(parts, len(finished) - 1, finished[-1] | state)
        if progress:
            progress(t_us * 1e-6)
    finished.append(part_files.join(part, camera))
    events, frames, frames_us = (np.concatenate([done[key] for done in finished]) for key in part)
    truth_us = np.arange(0, seconds * 1e6 + 1, 1e6 / TRUTH_HZ).astype(np.int64)
    truth = Trajectory(truth_us, sequence_motion(seq, truth_us * 1e-6)) if seq.port else None
    return Recording(name, camera, events, frames, frames_us, truth)
