"""Poses between images: figures of the chapter on both cameras."""

from __future__ import annotations

import numpy as np

from lmmap.pipeline.histograms import histogram
from lmmap.types import Port, Recording

from ..studies.between_images import METHODS, Followed
from .drawings import COLOUR, outlines_px
from .sliders import Step, broken

COLOURS = dict(zip(METHODS, ("paper", "ours", "event"), strict=True))
SHOWN_US = 8000  # of events, under an outline


def recent(recording: Recording, t_us: int) -> np.ndarray:
    """Histogram in [0, 1] of the events of the last `SHOWN_US`."""
    events = recording.events
    last = events[slice(*np.searchsorted(events["t_us"], [t_us - SHOWN_US, t_us]))]
    return np.minimum(histogram(last["x"], last["y"], recording.camera.size_px) / 3, 1)


def steps(followed: Followed, recording: Recording, port: Port, every: int, from_us: int) -> list[Step]:
    """Where the last image and the track with events place the port, over the newest events, now and then."""
    shown, made = (METHODS[0], METHODS[-1]), []

    def outline_px(T):
        return broken(outlines_px(T, port, recording.camera, [port.ring_outer_radius_m]))

    for k in range(np.searchsorted(followed.t_us, from_us), len(followed.t_us), every):
        t_us = int(followed.t_us[k])
        now = [followed.estimates[method][k] for method in shown]
        if not all(now):
            continue
        curves = tuple((method, outline_px(e.T_cam_port), COLOURS[method], "lines")
                       for method, e in zip(shown, now, strict=True))  # fmt: skip
        age_ms = 1e-3 * (t_us - now[0].t_us)
        made.append(Step(f"{1e-3 * t_us:.0f} ms", f"the last image's pose is {age_ms:.0f} ms old",
                         recent(recording, t_us), curves))  # fmt: skip
    return made


def draw_speeds(ax, speeds, column: str) -> None:
    """Median errors of the committed table by speed."""
    for method, rows in speeds.sort_values("speed_mm_s").groupby("method", sort=False):
        ax.loglog(rows.speed_mm_s, rows[column], "o-", color=COLOUR[COLOURS[method]], label=method)
    ax.set_xticks(sorted(speeds.speed_mm_s.unique()), [f"{v:g}" for v in sorted(speeds.speed_mm_s.unique())])
