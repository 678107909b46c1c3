"""Recordings of the bench: a camera looks at a sequence of the laboratory, image by image, event by event.

Everything random is drawn from the sequence's name, so a recording is a function of its name and length.
Long ones keep their parts as they grow; an interrupted one goes on from there, to the same bytes.
"""

from __future__ import annotations

import shutil
import zipfile
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from ..files import atomic
from ..geometry.port import circle_points_m
from ..geometry.projection import project
from ..types import EVENT, Camera, InputError, Port, Recording, Trajectory
from . import event_sensor, optics, renderer
from .laboratory import GAIN, SECONDS, Sequence, backdrop, lamps, panel, sequence, sequence_motion

EXPOSURE_US, SUB_EXPOSURES = 8000, 2
LENS_BLUR_PX = 0.6
STEP_PX = 0.9  # image motion between renders
FRAME_HZ, TRUTH_HZ = 20, 200
THREADS = 2
PART_S = 5.0  # what an interruption may cost


def render_times_us(seq: Sequence, port: Port, camera: Camera, seconds: float) -> np.ndarray:
    """Times between which nothing visible of panel or port moves by more than about `STEP_PX`."""
    t = np.arange(0, seconds + 1e-9, 0.001)
    poses = sequence_motion(seq, t)
    size = np.array(camera.size_px)
    speed = np.zeros(len(t) - 1)
    for point in _visible_points_m(port):
        pixel = project(poses @ point, camera)
        inside = np.all(np.abs(pixel - (size - 1) / 2) < size / 2 + STEP_PX, -1)
        moved = np.linalg.norm(np.diff(pixel, axis=0), axis=-1)
        speed = np.maximum(speed, np.where(inside[1:] | inside[:-1], moved, 0))
    travelled = np.concatenate([[0], np.cumsum(np.clip(speed, STEP_PX / 20, STEP_PX))])
    steps = np.interp(np.arange(0, travelled[-1], STEP_PX), travelled, t)
    return np.unique((steps * 1e6).astype(np.int64))


def _visible_points_m(port: Port) -> np.ndarray:
    """A grid over the panel and the corners of the petals' tips, (N, 3)."""
    x, y = (np.linspace(-size / 2, size / 2, 7) for size in port.panel_size_m)
    grid = np.stack([*np.meshgrid(x, y), np.full((7, 7), -port.panel_depth_m)], -1).reshape(-1, 3)
    radius = port.plate_circumradius_m * np.cos(np.pi / 6) + port.petal_lean_m
    height = np.array([0, 0, port.plate_height_m + port.petal_rise_m])
    return np.concatenate([grid, circle_points_m(radius, 6) + height])


def stream(seq: Sequence, camera: Camera, port: Port, seconds: float, device, skip=0) -> Iterator[tuple]:
    """Yield ``(t_us, events since the last, frame or None)`` in order, without the first ``skip``.

    Images are rendered ahead on threads; ``device`` (`EventSensor`) makes events of them here, in order.
    """
    solid, skin = panel(seq, port)
    light = lamps(seq)
    still = backdrop(seq, camera, light.intensity[:, 0].sum())
    colour, mono = (skin, light, still), renderer.to_monochrome(skin, light, still)
    rays = renderer.ray_grid(camera, 1), renderer.ray_grid(camera, SUB_EXPOSURES)

    def look(T_cam_port, what, ray):
        return renderer.render(solid, what[0], what[1], T_cam_port, ray, what[2])[0]

    def image(job):
        t_us, poses, frame = job
        if not frame:
            return t_us, optics.apply_lens(look(poses, mono, rays[0]), LENS_BLUR_PX) * (255 * GAIN), None
        parts = [look(T, colour, rays[1][k : k + 1]) for k, T in enumerate(poses)]
        radiance = optics.apply_lens(np.mean(parts, 0), LENS_BLUR_PX)
        return t_us, None, optics.expose(radiance, GAIN, seq.rng(f"frame {seq.light} {t_us}"))

    first = sequence_motion(seq, np.zeros(1))[0]
    for what, ray in zip((mono, colour), rays, strict=True):  # compiled before there are threads
        renderer.render(solid, *what[:2], first, ray[:, :1, :1].copy(), what[2][:1, :1].copy())
    for t_us, intensity, frame in _ahead(image, _jobs(seq, camera, port, seconds)[skip:]):
        yield t_us, device(intensity, t_us) if frame is None else np.empty(0, EVENT), frame


def _jobs(seq: Sequence, camera: Camera, port: Port, seconds: float) -> list[tuple]:
    """All renders in the order of time: ``(t_us, pose or sub-exposures' poses, is a frame)``."""
    steps_us = render_times_us(seq, port, camera, seconds)
    frames_us = np.arange(EXPOSURE_US, seconds * 1e6 - EXPOSURE_US, 1e6 / FRAME_HZ).astype(np.int64)
    parts_us = ((np.arange(SUB_EXPOSURES) + 0.5) / SUB_EXPOSURES - 0.5) * EXPOSURE_US
    steps = [
        (t, pose, False) for t, pose in zip(steps_us, sequence_motion(seq, steps_us * 1e-6), strict=True)
    ]
    times = frames_us[:, None] + parts_us
    poses = sequence_motion(seq, times.ravel() * 1e-6)
    frames = [(t, poses[i * SUB_EXPOSURES : (i + 1) * SUB_EXPOSURES], True) for i, t in enumerate(frames_us)]
    return sorted(steps + frames, key=lambda job: (job[0], job[2]))


def _ahead(function, jobs, depth: int = 6):
    """Results of ``function`` over ``jobs``, in order, computed a few ahead on `THREADS` threads."""
    with ThreadPoolExecutor(THREADS) as pool:
        waiting = deque(pool.submit(function, job) for job in jobs[:depth])
        for job in jobs[depth:]:
            yield waiting.popleft().result()
            waiting.append(pool.submit(function, job))
        while waiting:
            yield waiting.popleft().result()


def duration_s(seq: Sequence, seconds: float | None, profile: str = "quick") -> float:
    """The asked length, or the profile's; `InputError` if it makes no sense."""
    seconds = SECONDS[profile][seq.name.split("-")[0]] if seconds is None else seconds
    if not (np.isfinite(seconds) and 0 < seconds <= 3600):
        raise InputError(f"sequence {seq.name}: cannot last {seconds} s; give --seconds from 0.2 to 3600")
    return seconds


def simulate(name: str, seconds: float | None = None, progress=None, *, camera: Camera | None = None,
             parts: Path | None = None, sensor: event_sensor.Sensor | None = None) -> Recording:  # fmt: skip
    """Record a sequence with a camera (default: DAVIS 346) looking at an LM-MAP.

    Parameters
    ----------
    name, seconds
        The sequence and its length (default: the quick profile's).
    progress
        Called with the seconds done.
    parts
        A folder for what is done so far: the same call goes on from there.  It is the caller's to remove.
    sensor
        Parameters of the event sensor.

    Raises
    ------
    InputError
        For an unknown name, a length that is not positive, a folder that cannot be written.
    """
    seq, port = sequence(name), Port.lm_map()
    camera = Camera.davis346() if camera is None else camera
    seconds = duration_s(seq, seconds)
    device = event_sensor.EventSensor(camera, sensor or event_sensor.Sensor(), seq.rng("events " + seq.light))
    done = _resume(parts, device, f"{name} {seconds} {camera} {device.sensor}")
    skip, begun_us = (int(done[-1][k]) for k in ("images", "t_us")) if done else (0, 0)
    part = {"events": [], "frames": [], "frames_t_us": []}
    for images, (t_us, some, frame) in enumerate(stream(seq, camera, port, seconds, device, skip), skip + 1):
        if frame is None:
            part["events"].append(some)
        else:
            part["frames"].append(frame)
            part["frames_t_us"].append(t_us)
        if t_us - begun_us > PART_S * 1e6:
            done.append(_joined(part, camera))
            part, begun_us = {key: [] for key in part}, t_us
            if parts is not None:
                _keep(parts / f"{len(done) - 1:04d}.npz", done[-1] | device.state(), images=images, t_us=t_us)
        if progress:
            progress(t_us * 1e-6)
    done.append(_joined(part, camera))
    events, frames, frames_us = (np.concatenate([d[key] for d in done]) for key in part)
    truth_us = np.arange(0, seconds * 1e6 + 1, 1e6 / TRUTH_HZ).astype(np.int64)
    truth = Trajectory(truth_us, sequence_motion(seq, truth_us * 1e-6)) if seq.port else None
    return Recording(name, camera, events, frames, frames_us, truth)


def _joined(part: dict, camera: Camera) -> dict:
    none = np.empty((0, camera.height_px, camera.width_px, 3), np.uint8)
    return {
        "events": np.concatenate([np.empty(0, EVENT), *part["events"]]),
        "frames": np.stack(part["frames"]) if part["frames"] else none,
        "frames_t_us": np.array(part["frames_t_us"], np.int64),
    }


def _keep(path: Path, arrays: dict, **counts) -> None:
    """Save a part with the sensor's state behind it, whole or not at all."""
    with atomic(path) as temporary:
        np.savez(temporary, **counts, **arrays)


def _resume(folder: Path | None, device, made_of: str) -> list[dict]:
    """The parts of an earlier call for the same thing, and the sensor put into the state behind them."""
    if folder is None:
        return []
    try:
        label = folder / "made-of.txt"
        if folder.exists() and not (label.exists() and label.read_text() == made_of):
            shutil.rmtree(folder)
        folder.mkdir(exist_ok=True)
        label.write_text(made_of)
    except OSError as error:
        raise InputError(f"{folder}: cannot write ({error.strerror}); choose another output folder") from None
    done, last = [], None
    for path in sorted(folder.glob("*.npz")):
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
                last = dict(data)
        except (ValueError, OSError, KeyError, zipfile.BadZipFile):  # cut short: made anew
            break
        done.append(last)
    if last is not None:
        device.restore(last)
    return done
