"""The bench's event sensor: the published v2e model (Hu, Liu & Delbruck 2021), one kernel.

Each pixel low-passes the logarithm of its intensity with a bandwidth that grows with the light, and
emits an event each time the result has moved one threshold from the last.  Threshold mismatch, leak,
shot noise and a refractory period are those of v2e; times are interpolated between renders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from .core import EVENT, Camera, frozen_array


@dataclass(frozen=True)
class Sensor:
    """v2e's parameters; an effect set to zero is off (bandwidth: infinity)."""

    threshold: float = 0.30  # of ln(intensity): the middle of what DAVIS biases reach
    mismatch: float = 0.03  # standard deviation of the thresholds
    cutoff_hz: float = 300.0  # photoreceptor bandwidth in full light
    leak_hz: float = 0.1
    shot_hz: float = 0.5
    refractory_s: float = 0.0005
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
        self._t_s = 0.0

    def __call__(self, intensity, t_us: int) -> np.ndarray:
        """Events since the last call, EVENT sorted by time; ``intensity`` in 8-bit units (H, W)."""
        s, t_s = self.sensor, t_us * 1e-6
        log = np.log(np.asarray(intensity, np.float32) + np.float32(s.dark))
        if self._state is None:
            self._state, self._t_s = (log.copy(), log.copy()), t_s
            return np.empty(0, EVENT)
        dt = t_s - self._t_s
        if dt <= 0:
            raise ValueError(f"EventSensor: times must increase, got {t_us} after {self._t_s * 1e6:.0f}")
        light = (np.minimum(intensity, 255) + 20) / 275
        follow = (
            1 - np.exp(-2 * np.pi * s.cutoff_hz * light * dt) if np.isfinite(s.cutoff_hz) else light * 0 + 1
        )
        shots = self._rng.random(log.shape, np.float32) < s.shot_hz * dt * (1 - 0.75 * light)
        coin = self._rng.random(log.shape, np.float32)
        t, x, y, p = _step(log, follow, shots, coin, self._state[0], self._state[1], self._last_s,
                           self.thresholds, s.leak_hz * dt, self._t_s, dt, s.refractory_s)  # fmt: skip
        self._t_s = t_s
        events = np.empty(len(t), EVENT)
        order = np.argsort(t, kind="stable")
        events["t_us"] = np.minimum((t[order] * 1e6).astype(np.int64), t_us - 1)
        events["x"], events["y"], events["p"] = x[order], y[order], p[order]
        return events


@njit(cache=True)
def _step(log, follow, shots, coin, lp, ref, last, thresholds, leak, t0, dt, refractory):
    """One render's step; ``lp``, ``ref`` and ``last`` are the sensor's own state, updated in place."""
    height, width = log.shape
    capacity = 1 << 14
    t, x = np.empty(capacity), np.empty(capacity, np.int16)
    y, p = np.empty(capacity, np.int16), np.empty(capacity, np.bool_)
    n = 0
    for row in range(height):
        for column in range(width):
            on, off = thresholds[0, row, column], thresholds[1, row, column]
            before = lp[row, column]
            now = before + follow[row, column] * (log[row, column] - before)
            lp[row, column] = now
            ref[row, column] -= leak * on
            rise = now - before
            while True:
                gap = now - ref[row, column]
                if gap >= on:
                    level, polarity = ref[row, column] + on, True
                elif -gap >= off:
                    level, polarity = ref[row, column] - off, False
                else:
                    break
                share = (level - before) / rise if rise != 0.0 else 1.0
                when = t0 + min(max(share, 0.0), 1.0) * dt
                ref[row, column] = level
                if when - last[row, column] < refractory:
                    ref[row, column] = now  # a pixel held in reset follows the light
                    break
                last[row, column] = when
                if n == capacity:
                    capacity *= 2
                    t, x, y, p = _grow(t, n), _grow(x, n), _grow(y, n), _grow(p, n)
                t[n], x[n], y[n], p[n] = when, column, row, polarity
                n += 1
            if shots[row, column]:
                when = t0 + coin[row, column] * dt
                ref[row, column] = now
                if n == capacity:
                    capacity *= 2
                    t, x, y, p = _grow(t, n), _grow(x, n), _grow(y, n), _grow(p, n)
                t[n], x[n], y[n], p[n] = when, column, row, coin[row, column] * 2 % 1 < 0.5
                last[row, column] = max(last[row, column], when)
                n += 1
    return t[:n], x[:n], y[:n], p[:n]


@njit(cache=True)
def _grow(a, n):
    b = np.empty(2 * n, a.dtype)
    b[:n] = a
    return b
