"""The bench's speed against real time, in which the real laboratory records, and the cost of each stage.

    python benchmarks/bench_bench.py              # about a minute; bench_mitsuba.py compares with Mitsuba

Stages are measured for one image on one thread.
"""

from __future__ import annotations

import time

import numpy as np

from lmmap.types import Camera, Port
from lmmap_lab.bench import event_sensor, laboratory, optics, renderer, sequences

SECONDS, LIGHTS = 5.0, ("low", "medium", "high")


def against_real_time() -> None:
    sequences.simulate("test-low", 0.2)  # the first call compiles
    for light in LIGHTS:
        wall, cpu = time.perf_counter(), time.process_time()
        recording = sequences.simulate(f"test-{light}", SECONDS)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        rate = len(recording.events) / SECONDS / 1e6
        print(
            f"test-{light:7} {SECONDS / wall:5.2f} x real time, {cpu / SECONDS:.2f} CPU s/s, {rate:.2f} Mev/s"
        )


def stages(repeats: int = 15) -> None:
    seq, camera, port = laboratory.sequence("test-medium"), Camera.davis346(), Port.lm_map()
    (solid, skin), lamps = laboratory.panel(seq, port), laboratory.lamps(seq)
    poses = laboratory.sequence_motion(seq, np.arange(repeats + 1) * 0.01)
    still = laboratory.backdrop(seq, camera, lamps.intensity[:, 0].sum())
    mono, rays = renderer.to_monochrome(skin, lamps, still), [renderer.ray_grid(camera, n) for n in (1, 2)]
    sensor, rng = (
        event_sensor.EventSensor(camera, event_sensor.SensorSettings(), seq.rng("events")),
        seq.rng("frame"),
    )
    walls = {"event image": [], "lens": [], "event sensor": [], "colour image": [], "exposure": []}

    def look(what, pose, ray):
        return renderer.render(solid, what[0], what[1], pose, ray, what[2])[0]

    def timed(name, function):
        start = time.perf_counter()
        result = function()
        walls[name].append(1e3 * (time.perf_counter() - start))
        return result

    for i, pose in enumerate(poses):
        light = timed("event image", lambda p=pose: look(mono, p, rays[0]))
        light = timed("lens", lambda x=light: optics.apply_lens(x, sequences.LENS_BLUR_PX))
        timed("event sensor", lambda x=light, i=i: sensor(x * (255 * laboratory.GAIN), 10_000 * (i + 1)))
        colour = timed("colour image", lambda p=pose: look((skin, lamps, still), p, rays[1]))
        timed("exposure", lambda x=colour: optics.expose(x, laboratory.GAIN, rng))
    for name, wall in walls.items():
        print(f"{name:14} {np.median(wall[1:]):6.2f} ms")


if __name__ == "__main__":
    against_real_time()
    stages()
