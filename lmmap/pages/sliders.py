"""Plotly figures with a slider that need no network, and a still picture of each for print."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from io import BytesIO

import cv2
import matplotlib.pyplot as plt
import numpy as np

from .drawings import COLOUR

FAINT = "rgba(124, 124, 124, 0.25)"  # the ink, for lines on light and dark


class Interactive:
    """A plotly figure as the output of a notebook's cell.

    Pages draw it with the plotly.js that comes with the book, and JupyterLab with its own; in print stands a
    still picture of how it begins.
    """

    def __init__(self, fig, div_id: str):
        fig.update_layout(template="none", paper_bgcolor="rgba(0,0,0,0)", plot_bgcolor="rgba(0,0,0,0)",
                          font_color=COLOUR["ink"])  # fmt: skip
        fig.update_xaxes(gridcolor=FAINT, zerolinecolor=FAINT)
        fig.update_yaxes(gridcolor=FAINT, zerolinecolor=FAINT)
        fig.update_layout(sliders=[{"bgcolor": FAINT, "bordercolor": FAINT}] * len(fig.layout.sliders))
        self.fig, self.div_id = fig, div_id

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        html = self.fig.to_html(
            include_plotlyjs=False, full_html=False, div_id=self.div_id, config={"displayModeBar": False}
        )
        return {
            "text/html": html,
            "image/png": still(self.fig),
            "application/vnd.plotly.v1+json": self.fig.to_plotly_json(),
        }


def still(fig) -> str:
    """The image and the plane curves that a plotly figure shows at first, as a PNG in base64."""
    drawn, ax = plt.subplots(figsize=(6, 4.5))
    for image in fig.layout.images:
        png = np.frombuffer(base64.b64decode(image.source.split(",")[1]), np.uint8)
        ax.imshow(cv2.imdecode(png, cv2.IMREAD_COLOR_RGB))
    for curve in fig.data:
        if curve.type == "scatter" and curve.visible in (None, True):
            style = "." if curve.mode == "markers" else "-"
            ax.plot(curve.x, curve.y, style, color=curve.line.color or curve.marker.color, label=curve.name)
    u, v = fig.layout.xaxis, fig.layout.yaxis
    ax.set(xlabel=u.title.text, ylabel=v.title.text, xlim=u.range, ylim=v.range, aspect="equal",
           title=fig.layout.title.text or "")  # fmt: skip
    ax.legend(loc="upper right")
    file = BytesIO()
    drawn.savefig(file, format="png")
    plt.close(drawn)
    return base64.b64encode(file.getvalue()).decode()


@dataclass(frozen=True)
class Step:
    """What one position of a slider shows: an image (H, W) in [0, 1], and curves over it.

    A curve is ``(name, points (M, 2) px, colour, "lines" or "markers")``, with NaN where a line is broken.
    Every step has the same names.
    """

    label: str
    title: str
    image: np.ndarray
    curves: tuple


def step_through(steps: list[Step], prefix: str, start: int = 0):
    """Plotly figure with a slider through steps, whose labels follow ``prefix``; ``start`` is shown first."""
    import plotly.graph_objects as go

    fig, each = go.Figure(), len(steps[0].curves)
    for k, step in enumerate(steps):
        for name, points_px, colour, mode in step.curves:
            points = np.round(np.reshape(points_px, (-1, 2)), 1)
            u, v = np.where(np.isnan(points), None, points).T.tolist()  # JSON has no NaN
            dots = {"color": COLOUR[colour], "size": 5}
            fig.add_scatter(x=u, y=v, name=name, mode=mode, visible=k == start,
                            line={"color": COLOUR[colour]}, marker=dots)  # fmt: skip
    sources = [_data_uri(step.image) for step in steps]
    height, width = steps[0].image.shape
    fig.add_layout_image(source=sources[start], xref="x", yref="y", x=-0.5, y=-0.5, sizex=width, sizey=height,
                         sizing="stretch", layer="below")  # fmt: skip
    buttons = [
        {"label": step.label, "method": "update",
         "args": [{"visible": [n // each == k for n in range(each * len(steps))]},
                  {"title.text": step.title, "images[0].source": sources[k]}]}
        for k, step in enumerate(steps)
    ]  # fmt: skip
    fig.update_layout(height=520, title={"text": steps[start].title, "font": {"size": 14}},
                      margin={"l": 45, "r": 30, "t": 75, "b": 110},  # right: half of the last label
                      legend={"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom"},
                      sliders=[{"currentvalue": {"prefix": prefix}, "active": start, "steps": buttons,
                                "pad": {"t": 45}}])  # fmt: skip
    fig.update_xaxes(title="u (px)", range=[-0.5, width - 0.5], constrain="domain", showgrid=False)
    fig.update_yaxes(title="v (px)", range=[height - 0.5, -0.5], scaleanchor="x", showgrid=False)
    return fig


def _data_uri(image) -> str:
    grey = (255 * np.clip(image, 0, 1)).astype(np.uint8)
    return "data:image/png;base64," + base64.b64encode(cv2.imencode(".png", grey)[1].tobytes()).decode()
