"""The event sensor against its own equations: one effect at a time, and all in a plain transcription."""

from dataclasses import fields, replace

import numpy as np
import pytest

from lmmap.types import Camera
from lmmap_lab.bench.event_sensor import EventSensor, SensorSettings

CAMERA = Camera(32, 24, 30.0, 30.0, 15.5, 11.5)
OFF = {field.name: 0.0 for field in fields(SensorSettings)} | {"cutoff_hz": np.inf}
IDEAL = SensorSettings(**OFF | {"threshold": 0.2})


def flat(value):
    return np.full((24, 32), value, float)


def device(sensor, seed=0):
    return EventSensor(CAMERA, sensor, np.random.default_rng(seed))


def run(sensor, intensities, step_us=1000, seed=0):
    pixels = device(sensor, seed)
    return np.concatenate([pixels(image, i * step_us) for i, image in enumerate(intensities)])


def counts(events, polarity=None):
    """Events a pixel, (24, 32)."""
    events = events if polarity is None else events[events["p"] == polarity]
    return np.bincount(events["y"] * 32 + events["x"], minlength=24 * 32).reshape(24, 32)


def waves(steps=240, contrast=1.3):
    """A pattern of ripples that drifts over the pixels, in 8-bit units."""
    y, x = np.indices((24, 32))
    phase = 0.13 * np.arange(steps)[:, None, None]
    return 60 * np.exp(contrast * np.sin(0.4 * x + 0.25 * y - phase) * np.cos(0.21 * x - 0.5 * phase))


def transcription(sensor, thresholds, intensities, dt):
    """v2e's equations (Hu, Liu & Delbruck 2021) word by word, in double precision, without noise:

    lp += (1 - exp(-2 pi f (I + 20) / 275 dt)) (ln(I + dark) - lp); ref -= leak theta_on dt; an event each
    time lp is a threshold from ref, which then moves there; within the refractory period ref follows lp.
    """
    on, off = np.float64(thresholds)
    lp = ref = np.log(intensities[0] + sensor.dark)
    lp, ref, last = lp.copy(), ref.copy(), np.full(on.shape, -1.0)
    events = []
    for step, image in enumerate(intensities[1:]):
        before = lp
        rate = 2 * np.pi * sensor.cutoff_hz * (np.minimum(image, 255) + 20) / 275
        lp = before + (1 - np.exp(-rate * dt)) * (np.log(image + sensor.dark) - before)
        ref -= sensor.leak_hz * on * dt
        for v, u in np.ndindex(on.shape):
            while True:
                if lp[v, u] - ref[v, u] >= on[v, u]:
                    level, up = ref[v, u] + on[v, u], True
                elif ref[v, u] - lp[v, u] >= off[v, u]:
                    level, up = ref[v, u] - off[v, u], False
                else:
                    break
                rise = lp[v, u] - before[v, u]
                share = np.clip((level - before[v, u]) / rise, 0, 1) if rise else 1.0
                t = (step + share) * dt
                if t - last[v, u] < sensor.refractory_s:
                    ref[v, u] = lp[v, u]
                    break
                ref[v, u], last[v, u] = level, t
                events.append((t, u, v, up))
    return np.array(events, [("t", float), ("x", int), ("y", int), ("p", bool)])


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
    events = run(SensorSettings(), [np.exp(rng.normal(3, 1, (24, 32))) for _ in range(30)])
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
    times_us = events[(events["x"] == 0) & (events["y"] == 0)]["t_us"]
    assert np.diff(times_us).min() >= 2000 - 2


def test_time_must_increase():
    pixels = device(IDEAL)
    pixels(flat(1.0), 10)
    with pytest.raises(ValueError, match="increase"):
        pixels(flat(1.0), 10)


EFFECTS = {
    "none": {},
    "mismatch": {"mismatch": 0.05},
    "bandwidth": {"cutoff_hz": 60.0},
    "leak": {"leak_hz": 8.0},
    "refractory": {"refractory_s": 0.004},
    "dark": {"dark": 10.0},
    "all": {"mismatch": 0.05, "cutoff_hz": 60.0, "leak_hz": 8.0, "refractory_s": 0.004, "dark": 10.0},
}


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_totals_are_those_of_the_plain_equations(effect):
    """Every pixel's events, but for the few that single precision moves over a threshold."""
    sensor, images = replace(IDEAL, **effect), waves()
    events = run(sensor, images)
    plain = transcription(sensor, device(sensor).thresholds, images, 1e-3)
    assert len(plain) > 5000
    assert len(events) == pytest.approx(len(plain), rel=0.002)
    for polarity in (False, True):
        assert np.mean(counts(events, polarity) == counts(plain, polarity)) > 0.97
    assert np.percentile(events["t_us"], [10, 50, 90]) == pytest.approx(
        1e6 * np.percentile(plain["t"], [10, 50, 90]), abs=500
    )


@pytest.mark.parametrize("effect", [e for e in EFFECTS if e != "none"])
def test_each_effect_matters_alone_and_is_off_at_zero(effect):
    images = waves(120)
    ideal, changed = run(IDEAL, images), run(replace(IDEAL, **EFFECTS[effect]), images)
    assert not np.array_equal(ideal, changed)
    off = {name: OFF[name] for name in EFFECTS[effect]}
    assert np.array_equal(ideal, run(replace(IDEAL, **EFFECTS[effect] | off), images))


@pytest.mark.parametrize(
    "field", [f.name for f in fields(SensorSettings) if not f.name.startswith(("hot", "shot", "leak"))]
)
def test_only_noise_and_leak_stir_a_still_scene(field):
    value = getattr(SensorSettings(), field)
    assert len(run(replace(IDEAL, **{field: value}), [flat(80.0)] * 100, step_us=10_000)) == 0


@pytest.mark.parametrize("sign", [1, -1])
def test_step_over_mismatched_thresholds(sign):
    """Each pixel fires as often as its own threshold fits into the contrast."""
    sensor = replace(IDEAL, mismatch=0.04)
    on, off = device(sensor).thresholds
    events = run(sensor, [flat(50.0), flat(50.0 * np.exp(sign * 1.5))])
    expected = np.floor(1.5 / (on if sign > 0 else off))
    assert np.mean(counts(events, sign > 0) == expected) > 0.995
    assert not np.any(counts(events, sign < 0))
    assert np.std(on) == pytest.approx(0.04, rel=0.1)
    assert abs(np.corrcoef(on.ravel(), off.ravel())[0, 1]) < 0.15


@pytest.mark.parametrize("light", [5.0, 80.0])
def test_low_pass_answers_a_step_exponentially(light):
    """Events by time t: what (ln I1 - ln I0) (1 - exp(-2 pi f (I1 + 20) / 275 t)) holds of thresholds."""
    sensor = replace(IDEAL, cutoff_hz=20.0, threshold=0.0501)
    events = run(sensor, [flat(light / 4)] + [flat(light)] * 60, step_us=1000)
    t_s = np.arange(1, 61) * 1e-3
    level = np.log(4) * (1 - np.exp(-2 * np.pi * 20.0 * (light + 20) / 275 * t_s))
    seen = [np.sum(events["t_us"] < t * 1e6) / (24 * 32) for t in t_s]
    assert level[-1] > 5 * 0.0501
    assert np.mean(np.isclose(seen, np.floor(level / 0.0501))) > 0.95
    assert events["p"].all()


@pytest.mark.parametrize("light", [0.0, 100.0, 255.0])
def test_shot_noise_thins_out_in_the_light(light):
    rate = 20 * (1 - 0.75 * (light + 20) / 275)
    events = run(replace(IDEAL, shot_hz=20.0, dark=1.0), [flat(light)] * 1001)
    expected = rate * 24 * 32
    assert abs(len(events) - expected) < 5 * np.sqrt(expected)
    assert abs(np.sum(events["p"]) - len(events) / 2) < 3 * np.sqrt(len(events))
    spread = counts(events)
    assert spread.var() / spread.mean() == pytest.approx(1, abs=0.25)  # Poisson


def test_shot_noise_does_not_depend_on_the_rendering_rate():
    sensor = replace(IDEAL, shot_hz=20.0, dark=1.0)
    fast, slow = run(sensor, [flat(50.0)] * 1001, 1000), run(sensor, [flat(50.0)] * 201, 5000)
    assert len(fast) == pytest.approx(len(slow), rel=0.06)


def test_leak_fires_on_events_one_period_apart():
    events = run(replace(IDEAL, leak_hz=10.0), [flat(50.0)] * 550, step_us=1000)
    times_us = events[(events["x"] == 7) & (events["y"] == 3)]["t_us"]
    assert np.diff(times_us) == pytest.approx(100_000, abs=1001)  # to one render


def test_refractory_period_is_the_only_thing_lost():
    """A ramp of one threshold a millisecond; a pause of 2.5 ms leaves about every third event."""
    ramp = [flat(50 * np.exp(0.2001 * i)) for i in range(31)]
    free, held = run(IDEAL, ramp), run(replace(IDEAL, refractory_s=0.0025), ramp)
    times_us = held[(held["x"] == 0) & (held["y"] == 0)]["t_us"]
    assert np.diff(times_us).min() >= 2500 - 2
    assert len(free) == 30 * 24 * 32
    assert 30 / 4 <= len(times_us) <= 30 / 2.5 + 1
