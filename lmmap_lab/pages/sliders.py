"""Figures with a slider in plain HTML, which needs no script file and no network, and a still for print."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO

import cv2
import matplotlib.pyplot as plt
import numpy as np

from .drawings import COLOUR

DOT_PX, LINE_PX = 2.2, 1.2  # widths, in pixels of the image
SHOW = ("const steps = [...this.closest('.steps').querySelectorAll('.step')];"
        "steps.forEach((step, k) => { step.hidden = k != this.value; });"
        "const label = steps[this.value].dataset.label;"
        "this.closest('.steps').querySelector('output').textContent = label;"
        "this.setAttribute('aria-valuetext', label);")  # fmt: skip

START_STRIP = ("document.querySelectorAll('.strip:not(.live)').forEach(strip => {"
               "strip.classList.add('live'); strip.querySelector('label').hidden = false;"
               "strip.querySelector('input').oninput(); });")  # fmt: skip


@dataclass(frozen=True)
class Step:
    """What one position of a slider shows: an image in [0, 1], grey or RGB, and curves over it.

    A curve is ``(name, points (M, 2) px, colour, "lines" or "markers")``, with NaN where a line is broken.
    Every step has the same names.
    """

    label: str
    title: str
    image: np.ndarray
    curves: tuple


def broken(lines_px) -> np.ndarray:
    """Lines (M, 2) as one curve of a `Step`, broken between them."""
    return np.concatenate([np.append(line, [[np.nan, np.nan]], 0) for line in lines_px])


def picture(fig) -> np.ndarray:
    """A figure as an image (H, W, 3) of a `Step`, in [0, 1], on white; closes the figure."""
    png = np.frombuffer(_png(fig, transparent=False, facecolor="white", dpi=130), np.uint8)
    return cv2.imdecode(png, cv2.IMREAD_COLOR)[..., ::-1] / 255


class Strip:
    """Steps side by side, which a script puts behind a slider; on paper and without scripts all are seen.

    The steps' titles say what the colours of the curves mean.
    """

    def __init__(self, steps: Sequence[Step], name: str):
        self.steps, self.name = list(steps), name

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        return {"text/html": self.html(), "image/png": base64.b64encode(self.still()).decode()}

    def html(self) -> str:
        """Every step, none hidden, the slider that the script shows, and the script."""
        views = _views(self.steps, self.name, range(len(self.steps)))
        slider = (f'<label hidden="">{escape(self.name)}: <input type="range" min="0" '
                  f'max="{len(self.steps) - 1}" step="1" value="0" oninput="{escape(SHOW)}"/> '
                  "<output></output></label>")  # fmt: skip
        return "\n".join(
            [
                '<div class="strip"><div class="steps">',
                *views,
                slider,
                f"</div></div><script>{START_STRIP}</script>",
            ]
        )

    def still(self) -> bytes:
        """All steps in two rows, PNG."""
        columns = -(-len(self.steps) // 2)
        drawn, axes = plt.subplots(2, columns, figsize=(7.6, 3.8))
        for ax in axes.flat:
            ax.set_axis_off()
        for ax, step in zip(axes.flat, self.steps, strict=False):
            _draw(ax, step)
            ax.set_title(step.label, fontsize=9)
        return _png(drawn)


class Slider:
    """Steps behind a slider, as the output of a notebook's cell.

    The slider is an ``<input type="range">``, so keys, touch and screen readers know it.  In print stands the
    step that is shown first.

    Parameters
    ----------
    steps
        At least one, all of one image size.
    name
        What the slider changes, such as "N"; it is the slider's label.
    start
        Index of the step that is shown first.
    """

    def __init__(self, steps: Sequence[Step], name: str, start: int = 0):
        self.steps, self.name, self.start = list(steps), name, start

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        return {"text/html": self.html(), "image/png": base64.b64encode(self.still()).decode()}

    def html(self) -> str:
        """Every step, of which all but one are hidden, their legend, and the slider."""
        views = _views(self.steps, self.name, [self.start])
        legend = [f'<span><i style="background: {COLOUR[colour]}"></i>{escape(curve)}</span>'
                  for curve, _, colour, _ in self.steps[0].curves]  # fmt: skip
        label = escape(self.steps[self.start].label)
        # a label is for the first control in it, and an output is one: the input comes first
        slider = (f'<label>{escape(self.name)}: <input type="range" min="0" '
                  f'max="{len(self.steps) - 1}" step="1" value="{self.start}" aria-valuetext="{label}" '
                  f'oninput="{escape(SHOW)}"/> <output>{label}</output></label>')  # fmt: skip
        return "\n".join(
            ['<div class="steps">', *views, f'<p class="key">{" ".join(legend)}</p>', slider, "</div>"]
        )

    def still(self) -> bytes:
        """The step that is shown first, PNG."""
        step = self.steps[self.start]
        drawn, ax = plt.subplots(figsize=(6, 4.5))
        _draw(ax, step)
        if step.curves:
            ax.set(xlabel="u (px)", ylabel="v (px)", title=step.title)
            ax.legend(loc="upper right")
        else:
            ax.set_axis_off()
        return _png(drawn)


def _draw(ax, step: Step) -> None:
    height, width = step.image.shape[:2]
    ax.imshow(_eight_bit(step.image), cmap="gray", vmin=0, vmax=255)
    for name, points_px, colour, mode in step.curves:
        style = "." if mode == "markers" else "-"
        ax.plot(*np.reshape(points_px, (-1, 2)).T, style, color=COLOUR[colour], label=name)
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal")


def _png(drawn, **options) -> bytes:
    file = BytesIO()
    drawn.savefig(file, format="png", **options)
    plt.close(drawn)
    return file.getvalue()


def _views(steps: Sequence[Step], name: str, shown: Sequence[int]) -> list[str]:
    """Every step; an image that several share is written once, if possible in one that is shown."""
    sources, holders = [_data_uri(step.image) for step in steps], {}
    for k in [*shown, *range(len(steps))]:
        holders.setdefault(sources[k], k)
    return [
        _view(step, f"{name} {step.label}", k in shown, source, holders[source] == k)
        for k, (step, source) in enumerate(zip(steps, sources, strict=True))
    ]


def _view(step: Step, said: str, shown: bool, source: str, holds: bool) -> str:
    height, width = step.image.shape[:2]
    name = "step-" + hashlib.sha256(source.encode()).hexdigest()[:12]
    size = f'x="-0.5" y="-0.5" width="{width}" height="{height}"'
    picture = f'<image id="{name}" {size} href="{source}"/>' if holds else f'<use href="#{name}"/>'
    paths = "".join(_path(*curve[1:]) for curve in step.curves)
    hidden = "" if shown else ' hidden=""'
    return (f'<div class="step" data-label="{escape(step.label)}"{hidden}>'
            f'<p class="said">{escape(step.title)}</p><svg viewBox="-0.5 -0.5 {width} {height}" role="img" '
            f'aria-label="{escape(said)}: {escape(step.title)}">{picture}{paths}</svg></div>')  # fmt: skip


def _path(points_px, colour: str, mode: str) -> str:
    points = np.reshape(points_px, (-1, 2))
    real = np.isfinite(points).all(-1)
    follows = np.concatenate([[False], real[:-1]]) if mode == "lines" else np.zeros(len(points), bool)
    dot = "" if mode == "lines" else "h0"  # with round ends a line of no length is a dot
    moves = [
        f"{'L' if f else 'M'}{u:.1f} {v:.1f}{dot}"
        for (u, v), f in zip(points[real], follows[real], strict=True)
    ]
    width = LINE_PX if mode == "lines" else DOT_PX
    return f'<path d="{"".join(moves)}" stroke="{COLOUR[colour]}" stroke-width="{width}"/>'


def _data_uri(image) -> str:
    values = _eight_bit(image)
    values = values[..., ::-1] if values.ndim == 3 else values
    picture = cv2.imencode(".png", values, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes()
    return "data:image/png;base64," + base64.b64encode(picture).decode()


def _eight_bit(image) -> np.ndarray:
    return (255 * np.clip(image, 0, 1)).astype(np.uint8)
