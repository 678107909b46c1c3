"""The event sensor against its own equations, one effect at a time."""

from dataclasses import replace

import numpy as np
import pytest

from lmmap.core import Camera
from lmmap.dvs import EventSensor, Sensor

CAMERA = Camera(32, 24, 30.0, 30.0, 15.5, 11.5)
IDEAL = Sensor(threshold=0.2, mismatch=0, cutoff_hz=np.inf, leak_hz=0, shot_hz=0, refractory_s=0, dark=0)


def flat(value):
    return np.full((24, 32), value, float)


def run(sensor, intensities, step_us=1000, seed=0):
    device = EventSensor(CAMERA, sensor, np.random.default_rng(seed))
    return np.concatenate([device(image, i * step_us) for i, image in enumerate(intensities)])


def test_still_scene_gives_no_event():
    assert len(run(IDEAL, [flat(50.0)] * 20)) == 0


@pytest.mark.parametrize("steps", [1, 3, 7])
@pytest.mark.parametrize("sign", [1, -1])
def test_contrast_of_n_thresholds_gives_n_events(steps, sign):
    events = run(IDEAL, [flat(50.0), flat(50.0 * np.exp(sign * 0.2 * (steps + 0.5)))])
    assert len(events) == steps * 24 * 32
    assert np.all(events["p"] == (sign > 0))


def test_crossing_times_are_interpolated():
    events = run(IDEAL, [flat(50.0), flat(50.0 * np.exp(0.2 * 4.0001))], step_us=4000)
    first = events[(events["x"] == 3) & (events["y"] == 5)]
    assert first["t_us"] == pytest.approx([1000, 2000, 3000, 4000], abs=2)


def test_slow_and_fast_rendering_of_a_ramp_agree():
    fast = run(IDEAL, [flat(50 * np.exp(2.05 * s)) for s in np.linspace(0, 1, 101)], step_us=100)
    slow = run(IDEAL, [flat(50 * np.exp(2.05 * s)) for s in np.linspace(0, 1, 11)], step_us=1000)
    assert len(fast) == len(slow) == 10 * 24 * 32


def test_time_never_runs_backward_and_pixels_are_inside(rng):
    events = run(Sensor(), [np.exp(rng.normal(3, 1, (24, 32))) for _ in range(30)])
    assert len(events) > 1000
    assert np.all(np.diff(events["t_us"]) >= 0)
    assert events["x"].min() >= 0 and events["x"].max() < 32
    assert events["y"].min() >= 0 and events["y"].max() < 24


def test_bandwidth_delays_what_the_dark_sees():
    sensor = replace(IDEAL, cutoff_hz=300.0)
    bright = run(sensor, [flat(100.0)] + [flat(200.0)] * 5)
    dark = run(sensor, [flat(1.0)] + [flat(2.0)] * 5)
    assert dark["t_us"].size > 0
    assert dark["t_us"].mean() > bright["t_us"].mean()


def test_leak_and_shot_noise_have_their_rates():
    leak = run(replace(IDEAL, leak_hz=5.0), [flat(50.0)] * 1101)
    assert len(leak) == 5 * 24 * 32  # 5.5 leaks a pixel
    assert np.all(leak["p"])
    shot = run(replace(IDEAL, shot_hz=20.0), [flat(0.0) + 1e-9] * 1001)
    assert len(shot) == pytest.approx(20 * (1 - 0.75 * 20 / 275) * 24 * 32, rel=0.05)


def test_refractory_period_bounds_the_rate():
    sensor = replace(IDEAL, refractory_s=0.002)
    events = run(sensor, [flat(50 * np.exp(0.5 * i)) for i in range(21)])
    one = events[(events["x"] == 0) & (events["y"] == 0)]["t_us"]
    assert np.diff(one).min() >= 2000 - 2


def test_time_must_increase():
    device = EventSensor(CAMERA, IDEAL, np.random.default_rng(0))
    device(flat(1.0), 10)
    with pytest.raises(ValueError, match="increase"):
        device(flat(1.0), 10)
