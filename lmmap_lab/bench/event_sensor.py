"""The bench's event sensor: the model v2e (Hu, Liu & Delbruck 2021).

Each pixel low-passes the logarithm of its intensity with a bandwidth that grows with the light.  It emits an
event each time the result has moved by one threshold since its last event.  Threshold mismatch, leak, shot
noise and a refractory period are those of v2e; times are interpolated between rendered images.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from lmmap.types import EVENT, Camera, frozen_array

from .compiler import njit


@dataclass(frozen=True)
class SensorSettings:
    """Parameters of v2e.  Zero turns an effect off; an infinite ``cutoff_hz`` turns the low pass off."""

    threshold: float = 0.30  # change of ln(intensity): the middle of what DAVIS biases reach
    mismatch: float = 0.03  # standard deviation of the thresholds
    cutoff_hz: float = 300.0  # photoreceptor bandwidth in full light
    leak_hz: float = 0.1  # ON events of a pixel by its leak
    shot_hz: float = 0.5  # noise events of a pixel in the dark
    refractory_s: float = 0.0005  # pause of a pixel after an event
    hot_share: float = 2e-4  # share of the pixels that fire by themselves
    hot_hz: float = 30.0  # events of such a pixel
    dark: float = 2.0  # added to the intensity, in 8-bit units


class EventSensor:
    """The pixels' state between images; call it with each new intensity image.

    Parameters
    ----------
    settings : v2e's parameters
    rng : draws thresholds and hot pixels now, and noise at each call
    """

    def __init__(self, camera: Camera, settings: SensorSettings, rng: np.random.Generator):
        self.settings, self._rng = settings, rng
        shape = (camera.height_px, camera.width_px)
        draw = rng.normal(settings.threshold, settings.mismatch, (2, *shape))
        self.thresholds = frozen_array(np.maximum(draw, 0.05), np.float32)
        self._state = None
        self._last_s = np.full(shape, -1.0)
        self._hot = np.flatnonzero(rng.random(shape) < settings.hot_share)
        self._t_s = 0.0

    def __call__(self, intensity, t_us: int) -> np.ndarray:
        """Events since the last call, (N,) EVENT sorted by time; ``intensity`` (H, W) is in 8-bit units."""
        s, t_s = self.settings, t_us * 1e-6
        intensity = np.asarray(intensity, np.float32).reshape(self._last_s.shape)
        log = np.log(intensity + np.float32(s.dark))
        if self._state is None:
            self._state, self._t_s = (log.copy(), log.copy()), t_s
            return np.empty(0, EVENT)
        dt = t_s - self._t_s
        if dt <= 0:
            raise ValueError(f"EventSensor: times must increase, got {t_us} after {self._t_s * 1e6:.0f}")
        light = (np.minimum(intensity, 255) + 20) / 275
        rate = np.float32(-2 * np.pi * s.cutoff_hz * dt)
        stay = np.exp(rate * light) if s.cutoff_hz < np.inf else 0 * light  # first-order low pass
        (lp, ref), (on, off) = self._state, self.thresholds
        now = log + stay * (lp - log)
        ref -= np.float32(s.leak_hz * dt) * on
        firing = np.flatnonzero((now - ref >= on) | (ref - now >= off))
        t, pixel, p = _fire(firing, lp.ravel(), now.ravel(), ref.ravel(), self._last_s.ravel(),
                            on.ravel(), off.ravel(), self._t_s, dt, s.refractory_s)  # fmt: skip
        lp[:] = now
        y, x = np.divmod(pixel, log.shape[1])
        events = np.concatenate([_pack(t, x, y, p), self._noise_events(light, dt)])
        self._t_s = t_s
        events = events[np.argsort(events["t_us"], kind="stable")]
        events["t_us"] = np.minimum(events["t_us"], t_us - 1)
        return events

    def state(self) -> dict:
        """Arrays from which `restore` goes on to the same events."""
        generator = json.dumps(self._rng.bit_generator.state)
        return {"lp": self._state[0], "ref": self._state[1], "last_s": self._last_s, "t_s": self._t_s,
                "generator": generator}  # fmt: skip

    def restore(self, state: dict) -> None:
        """Go on from what `state` returned."""
        self._state = state["lp"].copy(), state["ref"].copy()
        self._last_s, self._t_s = state["last_s"].copy(), float(state["t_s"])
        self._rng.bit_generator.state = json.loads(state["generator"])

    def _noise_events(self, light, dt: float) -> np.ndarray:
        """Poisson events of shot noise and hot pixels in an interval; light thins out shot noise."""
        s, rng = self.settings, self._rng
        shot = rng.integers(0, light.size, rng.poisson(s.shot_hz * dt * light.size))
        shot = shot[rng.random(len(shot)) < 1 - 0.75 * light.ravel()[shot]]
        hot = self._hot[rng.integers(0, max(len(self._hot), 1), rng.poisson(s.hot_hz * dt * len(self._hot)))]
        pixel = np.concatenate([shot, hot])
        t_s, p = self._t_s + rng.random(len(pixel)) * dt, rng.random(len(pixel)) < 0.5
        lp, ref = self._state
        ref.ravel()[pixel] = lp.ravel()[pixel]
        self._last_s.ravel()[pixel] = np.maximum(self._last_s.ravel()[pixel], t_s)
        y, x = np.divmod(pixel, light.shape[1])
        return _pack(t_s, x, y, p)


def _pack(t_s, x, y, p) -> np.ndarray:
    events = np.empty(len(t_s), EVENT)
    events["t_us"], events["x"], events["y"], events["p"] = t_s * 1e6, x, y, p
    return events


@njit(nogil=True, error_model="numpy")
def _fire(firing, before, now, ref, last, on, off, t0, dt, refractory):
    """Times, pixels and polarities of the events of pixels that cross a threshold; writes into the sensor's
    state ``ref`` and ``last``."""
    capacity = 2 * len(firing) + 64
    t, pixel, p = np.empty(capacity), np.empty(capacity, np.int64), np.empty(capacity, np.bool_)
    n = 0
    for i in firing:
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
                t, pixel, p = _grow(t), _grow(pixel), _grow(p)
            t[n], pixel[n], p[n] = when, i, up
            n += 1
        ref[i] = level
    return t[:n], pixel[:n], p[:n]


@njit()
def _grow(a):
    larger = np.empty(2 * len(a), a.dtype)
    larger[: len(a)] = a
    return larger
