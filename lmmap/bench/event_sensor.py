"""The bench's event sensor: the published v2e model (Hu, Liu & Delbruck 2021), one kernel.

Each pixel low-passes the logarithm of its intensity with a bandwidth that grows with the light, and
emits an event each time the result has moved one threshold from the last.  Threshold mismatch, leak,
shot noise and a refractory period are those of v2e; times are interpolated between renders.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from ..types import EVENT, Camera, frozen_array
from .compiler import njit


@dataclass(frozen=True)
class Sensor:
    """v2e's parameters; an effect set to zero is off (bandwidth: infinity)."""

    threshold: float = 0.30  # of ln(intensity): the middle of what DAVIS biases reach
    mismatch: float = 0.03  # standard deviation of the thresholds
    cutoff_hz: float = 300.0  # photoreceptor bandwidth in full light
    leak_hz: float = 0.1
    shot_hz: float = 0.5
    refractory_s: float = 0.0005
    hot_share: float = 2e-4  # of the pixels that fire by themselves
    hot_hz: float = 30.0
    dark: float = 2.0  # added to the intensity, in 8-bit units


class EventSensor:
    """State of the pixels between renders; call with each new intensity image."""

    def __init__(self, camera: Camera, sensor: Sensor, rng: np.random.Generator):
        self.sensor, self._rng = sensor, rng
        shape = (camera.height_px, camera.width_px)
        draw = rng.normal(sensor.threshold, sensor.mismatch, (2, *shape))
        self.thresholds = frozen_array(np.maximum(draw, 0.05), np.float32)
        self._state = None
        self._last_s = np.full(shape, -1.0)
        self._hot = np.flatnonzero(rng.random(shape) < sensor.hot_share)
        self._t_s = 0.0

    def __call__(self, intensity, t_us: int) -> np.ndarray:
        """Events since the last call, EVENT sorted by time; ``intensity`` in 8-bit units (H, W)."""
        s, t_s = self.sensor, t_us * 1e-6
        intensity = np.asarray(intensity, np.float32).reshape(self._last_s.shape)
        log = np.log(intensity + np.float32(s.dark))
        if self._state is None:
            self._state, self._t_s = (log.copy(), log.copy()), t_s
            return np.empty(0, EVENT)
        dt = t_s - self._t_s
        if dt <= 0:
            raise ValueError(f"EventSensor: times must increase, got {t_us} after {self._t_s * 1e6:.0f}")
        light = (np.minimum(intensity, 255) + 20) / 275
        stay = (
            np.exp(np.float32(-2 * np.pi * s.cutoff_hz * dt) * light) if s.cutoff_hz < np.inf else 0 * light
        )
        (lp, ref), (on, off) = self._state, self.thresholds
        now = log + stay * (lp - log)
        ref -= np.float32(s.leak_hz * dt) * on
        fires = np.flatnonzero((now - ref >= on) | (ref - now >= off))
        t, where, p = _fire(fires, lp.ravel(), now.ravel(), ref.ravel(), self._last_s.ravel(),
                            on.ravel(), off.ravel(), self._t_s, dt, s.refractory_s)  # fmt: skip
        lp[:] = now
        y, x = np.divmod(where, log.shape[1])
        events = np.concatenate([_pack(t, x, y, p), self._shots(light, dt)])
        self._t_s = t_s
        events = events[np.argsort(events["t_us"], kind="stable")]
        events["t_us"] = np.minimum(events["t_us"], t_us - 1)
        return events

    def state(self) -> dict:
        """Arrays that `restore` continues from, to the same events."""
        generator = json.dumps(self._rng.bit_generator.state)
        return {"lp": self._state[0], "ref": self._state[1], "last_s": self._last_s, "t_s": self._t_s,
                "generator": generator}  # fmt: skip

    def restore(self, state: dict) -> None:
        self._state = state["lp"].copy(), state["ref"].copy()
        self._last_s, self._t_s = state["last_s"].copy(), float(state["t_s"])
        self._rng.bit_generator.state = json.loads(str(state["generator"]))

    def _shots(self, light, dt: float) -> np.ndarray:
        """Shot noise and hot pixels of an interval, Poisson; the light thins out shot noise."""
        s, rng = self.sensor, self._rng
        shot = rng.integers(0, light.size, rng.poisson(s.shot_hz * dt * light.size))
        shot = shot[rng.random(len(shot)) < 1 - 0.75 * light.ravel()[shot]]
        hot = self._hot[rng.integers(0, max(len(self._hot), 1), rng.poisson(s.hot_hz * dt * len(self._hot)))]
        where = np.concatenate([shot, hot])
        when, p = self._t_s + rng.random(len(where)) * dt, rng.random(len(where)) < 0.5
        lp, ref = self._state
        ref.ravel()[where] = lp.ravel()[where]
        self._last_s.ravel()[where] = np.maximum(self._last_s.ravel()[where], when)
        y, x = np.divmod(where, light.shape[1])
        return _pack(when, x, y, p)


def _pack(t_s, x, y, p) -> np.ndarray:
    events = np.empty(len(t_s), EVENT)
    events["t_us"], events["x"], events["y"], events["p"] = t_s * 1e6, x, y, p
    return events


@njit(cache=True, nogil=True, error_model="numpy")
def _fire(fires, before, now, ref, last, on, off, t0, dt, refractory):
    """Events of the pixels that cross a threshold; ``ref`` and ``last`` are the sensor's own state."""
    capacity = 2 * len(fires) + 64
    t, where, p = np.empty(capacity), np.empty(capacity, np.int64), np.empty(capacity, np.bool_)
    n = 0
    for i in fires:
        rise, level = now[i] - before[i], ref[i]
        while now[i] - level >= on[i] or level - now[i] >= off[i]:
            up = now[i] > level
            level += on[i] if up else -off[i]
            share = (level - before[i]) / rise if rise != 0.0 else 1.0
            when = t0 + min(max(share, 0.0), 1.0) * dt
            if when - last[i] < refractory:
                level = now[i]  # a pixel held in reset follows the light
                break
            last[i] = when
            if n == len(t):
                t, where, p = _grow(t), _grow(where), _grow(p)
            t[n], where[n], p[n] = when, i, up
            n += 1
        ref[i] = level
    return t[:n], where[:n], p[:n]


@njit(cache=True)
def _grow(a):
    b = np.empty(2 * len(a), a.dtype)
    b[: len(a)] = a
    return b
