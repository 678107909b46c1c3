"""Figures in which moving a slider teaches: plotly, offline, and a still of them for print."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from io import BytesIO

import cv2
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.conics import five_point_conics, matrix, normalise, sampson_distance, to_pixels
from ..geometry.projection import circle_conic, circle_ellipse, circle_points_m, ellipse_from_conic, project
from ..pipeline import circle, ellipse
from ..pipeline.histograms import histogram
from ..settings import OURS, PAPER, Settings
from ..types import Camera, Ellipse, Pose
from .drawings import COLOUR

FAINT = "rgba(124, 124, 124, 0.25)"  # the ink, for lines on light and dark


class Interactive:
    """A plotly figure in a notebook: on pages it needs no network, as plotly.js comes with the book;
    JupyterLab draws it too; paper gets a still of how it begins."""

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
    """The image and the plane curves that a plotly figure shows at first, PNG in base64."""
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
    """What one position of a slider shows: an image (H, W) in [0, 1], and named curves over it,
    ``(name, points (M, 2) px, colour, "lines" or "markers")``, the same names at each step."""

    label: str
    title: str
    image: np.ndarray
    curves: tuple


def step_through(steps: list[Step], prefix: str, start: int = 0):
    """Plotly figure of images with a slider through them."""
    import plotly.graph_objects as go

    fig, each = go.Figure(), len(steps[0].curves)
    for k, step in enumerate(steps):
        for name, points_px, colour, mode in step.curves:
            u, v = np.round(np.reshape(points_px, (-1, 2)), 1).T.tolist()
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


def event_windows(events, counts, camera: Camera, outline_px) -> list[Step]:
    """Histograms of the last N of some events (M,) EVENT, for each N; ``outline_px(t_us)`` gives the ring's
    true outline (M, 2) at a time."""
    steps = []
    for count in counts:
        some = events[-count:]
        image = histogram(some["x"], some["y"], camera.size_px) / max(1, 8 * count / PAPER.events_per_window)
        first, last = (outline_px(some["t_us"][k]) for k in (0, -1))
        moved_px = np.linalg.norm(last - first, axis=-1).mean()
        lasts_ms = (some["t_us"][-1] - some["t_us"][0]) * 1e-3
        said = f"{lasts_ms:.1f} ms, in which the ring moves {moved_px:.1f} px"
        rings = (
            ("ring at the first event", first, "rival", "lines"),
            ("ring at the last", last, "truth", "lines"),
        )
        steps.append(Step(f"{count:,}", said, image, rings))
    return steps


def ransac_steps(
    mask, points_px, draws: int, rng: np.random.Generator, settings: Settings = OURS
) -> list[Step]:
    """RANSAC draw by draw: five points, the conic through them, what lies on it; at last the answer of
    `ellipse.fit_ransac`, whose draws are others."""
    x, centre, scale = normalise(points_px)
    steps, best = [], 0
    for k in range(draws):
        five = rng.choice(len(x), 5, replace=False)
        theta = five_point_conics(x, five[None])  # none where they do not determine one
        found, real = ellipse_from_conic(matrix(theta))
        on, contour, said = np.zeros(len(x), bool), np.empty((0, 2)), "no ellipse passes through these"
        if real.any():
            on = np.abs(sampson_distance(theta, x))[0] * scale < settings.ransac_tolerance_px
            contour = to_pixels(found, centre, scale).points(180)[0]
            said = f"{on.sum()} of {len(x)} points lie on it"
        best = max(best, on.sum())
        steps.append(
            _draw(f"{k + 1}", f"{said}; best so far {best}", mask, points_px, on, points_px[five], contour)
        )
    answer, inliers = ellipse.fit_ransac(points_px, rng, settings)
    contour = np.empty((0, 2)) if answer is None else answer.points(180)
    said = f"after {settings.ransac_hypotheses} draws and refits: {inliers.sum()} of {len(x)} points"
    return [*steps, _draw("all", said, mask, points_px, inliers, np.empty((0, 2)), contour)]


def _draw(label, title, mask, points_px, on, five_px, contour) -> Step:
    return Step(label, title, 0.4 * np.clip(mask, 0, 1), (
        ("points", points_px[~on], "event", "markers"), ("on the conic", points_px[on], "truth", "markers"),
        ("conic", contour, "ours", "lines"), ("the five drawn", five_px, "rival", "markers"),
    ))  # fmt: skip


def thresholds(mask, levels, truth: Ellipse, rng: np.random.Generator) -> list[Step]:
    """What a mask (H, W) gives at each threshold: its skeleton, and the ellipse or none."""
    steps = []
    for level in levels:
        points = ellipse.skeleton_points(mask, level)
        answer, inliers = ellipse.fit_ransac(points, rng)
        contour = np.empty((0, 2)) if answer is None else answer.points(180)
        off = "no ellipse" if answer is None else (
            f"centre off by {np.linalg.norm(answer.centre_px - truth.centre_px):.2f} px, "
            f"{100 * ellipse.arc_coverage(answer, points[inliers]):.0f} % of the contour seen")  # fmt: skip
        curves = (
            ("skeleton", points, "event", "markers"),
            ("ellipse", contour, "ours", "lines"),
            ("truth", truth.points(180), "truth", "lines"),
        )
        above = ellipse.binarised(mask, level).astype(float)
        steps.append(Step(f"{level:g}", f"{len(points)} skeleton points; {off}", above, curves))
    return steps


def two_circles(radius_m: float, camera: Camera, tilts_deg, distances_m):
    """Plotly figure with sliders for tilt and distance: a circle, the other one that projects to the same
    ellipse, and the one that the paper's formula makes of it; and their three ellipses in the image."""
    from plotly.subplots import make_subplots

    fig = make_subplots(1, 2, specs=[[{"type": "scene"}, {"type": "xy"}]], column_widths=[0.5, 0.5])
    drawn = {(t, z): list(_three_circles(t, z, radius_m, camera)) for t in tilts_deg for z in distances_m}
    start = tilts_deg[len(tilts_deg) // 2], distances_m[len(distances_m) // 2]
    for z in distances_m:
        for k, (name, colour) in enumerate(
            (("the ring", "truth"), ("its twin", "rival"), ("printed", "paper"))
        ):
            circle_m, contour_px, label = drawn[start[0], z][k]
            style = {
                "mode": "lines",
                "line": {"color": COLOUR[colour], "width": 4 - k},
                "visible": z == start[1],
            }
            x, y, depth = circle_m.T
            fig.add_scatter3d(x=x, y=depth, z=-y, name=name, showlegend=False, **style, row=1, col=1)
            u, v = contour_px.T
            fig.add_scatter(x=u, y=v, name=label, **style, row=1, col=2)

    def tilted(t):
        curves = [curve for z in distances_m for curve in drawn[t, z]]
        update = {
            "x": [c for circle_m, px, _ in curves for c in (circle_m[:, 0].tolist(), px[:, 0].tolist())],
            "y": [c for circle_m, px, _ in curves for c in (circle_m[:, 2].tolist(), px[:, 1].tolist())],
            "z": [c for circle_m, _, _ in curves for c in ((-circle_m[:, 1]).tolist(), None)],
            "name": [label for _, _, label in curves for _ in range(2)],
        }
        return {"label": f"{t:g}°", "method": "restyle", "args": [update]}

    def placed(z):
        return {"label": f"{z:g} m", "method": "restyle",
                "args": [{"visible": [other == z for other in distances_m for _ in range(6)]}]}  # fmt: skip

    place = {"x": 0.02, "len": 0.44, "pad": {"t": 45}}
    fig.update_layout(
        height=500, margin={"l": 0, "r": 0, "t": 10, "b": 140}, legend={"x": 0.55, "y": 1.0},
        sliders=[
            {"currentvalue": {"prefix": "tilt "}, "active": tilts_deg.index(start[0]),
             "steps": [tilted(t) for t in tilts_deg], **place},
            {"currentvalue": {"prefix": "distance "}, "active": distances_m.index(start[1]),
             "steps": [placed(z) for z in distances_m], **place, "x": 0.54},
        ],
        scene={"aspectmode": "data", "xaxis_title": "x (m)", "yaxis_title": "depth (m)",
               "zaxis_title": "up (m)", "camera": {"eye": {"x": 2.0, "y": -0.6, "z": 0.7}}},
    )  # fmt: skip
    fig.update_xaxes(title="u (px)", range=[0, camera.width_px])
    fig.update_yaxes(title="v (px)", range=[camera.height_px, 0], scaleanchor="x")
    return fig


def _three_circles(tilt_deg: float, distance_m: float, radius_m: float, camera: Camera):
    """Points in space (N, 3), points in the image (N, 2) and a label, of each circle of `two_circles`."""
    turn = Rotation.from_rotvec([0, np.deg2rad(tilt_deg), 0]) * Rotation.from_rotvec([np.pi, 0, 0])
    truth = Pose(turn.as_matrix(), [0.0, 0.0, distance_m])
    seen = circle_ellipse(truth, radius_m, camera)
    pair, printed = circle.poses(seen, camera, radius_m), circle.paper_poses(seen, camera, radius_m)
    nearest = int(np.argmax(pair.normal @ truth.normal))
    chosen = (truth, "the ring"), (pair[1 - nearest], "its twin"), (printed[nearest], "printed")
    x = np.column_stack([seen.points(), np.ones(360)])
    for T, name in chosen:
        Cx = x @ circle_conic(T, radius_m, camera)
        gap_px = np.abs(np.sum(x * Cx, 1) / (2 * np.linalg.norm(Cx[:, :2], axis=1))).max()
        points_m = T @ circle_points_m(radius_m, 40)[np.r_[:40, 0]]
        yield points_m.round(4), project(points_m, camera).round(1), f"{name}: {gap_px:.2f} px"
