"""The figure with a slider of the chapter on histograms."""

from __future__ import annotations

import numpy as np

from lmmap.pipeline.histograms import histogram
from lmmap.settings import PAPER
from lmmap.types import Camera

from .sliders import Step


def window_steps(events, counts, camera: Camera, outline_px) -> list[Step]:
    """Histograms of the last N of some events, for each N.

    Parameters
    ----------
    events : (M,) EVENT
    counts : the N to show
    outline_px : the ring's true outline (K, 2) in pixels at a time in microseconds
    """
    steps = []
    for count in counts:
        window = events[-count:]
        image = histogram(window["x"], window["y"], camera.size_px)
        image = image / max(1, 8 * count / PAPER.events_per_window)
        first, last = (outline_px(window["t_us"][k]) for k in (0, -1))
        shift_px = np.linalg.norm(last - first, axis=-1).mean()
        duration_ms = (window["t_us"][-1] - window["t_us"][0]) * 1e-3
        title = f"{duration_ms:.1f} ms, in which the ring moves {shift_px:.1f} px"
        rings = (
            ("ring at the first event", first, "rival", "lines"),
            ("ring at the last event", last, "truth", "lines"),
        )
        steps.append(Step(f"{count:,}", title, image, rings))
    return steps
