"""Figures: one style, colours by meaning, and the few drawings that chapters share."""

from __future__ import annotations

import cycler
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from . import circle
from .core import Camera, Ellipse, Estimate, Port, Pose, Recording
from .geometry import circle_conic, circle_ellipse, circle_points_m, project
from .pipeline import Estimator, images

# colours that colour-blind readers tell apart (after Okabe & Ito), readable on light and dark
COLOUR = {"rgb": "#0072B2", "event": "#D55E00", "truth": "#009E73", "paper": "#CC79A7", "ours": "#56B4E9",
          "rival": "#E69F00", "ink": "#8A8A8A"}  # fmt: skip

LINES = ("rgb", "event", "truth", "paper", "rival")


def use_style() -> None:
    """Transparent figures with grey ink, so that light and dark pages can both carry them."""
    ink = COLOUR["ink"]
    matplotlib.rcParams.update({
        "figure.facecolor": "none", "axes.facecolor": "none", "savefig.facecolor": "none",
        "savefig.transparent": True, "figure.dpi": 110, "figure.constrained_layout.use": True,
        "figure.figsize": (7.0, 3.2), "font.size": 9, "text.color": ink, "axes.labelcolor": ink,
        "axes.edgecolor": ink, "axes.titlecolor": ink, "xtick.color": ink, "ytick.color": ink,
        "axes.grid": True, "grid.alpha": 0.25, "grid.color": ink, "axes.spines.top": False,
        "axes.spines.right": False, "legend.frameon": False, "image.cmap": "gray", "svg.hashsalt": "lmmap",
        "axes.prop_cycle": cycler.cycler(color=[COLOUR[k] for k in LINES]),
    })  # fmt: skip


def interactive(fig, div_id: str):
    """A plotly figure as a page element that needs no network: plotly.js comes with the book."""
    from IPython.display import HTML

    fig.update_layout(template="none", paper_bgcolor="rgba(0,0,0,0)", plot_bgcolor="rgba(0,0,0,0)",
                      font_color=COLOUR["ink"])  # fmt: skip
    return HTML(fig.to_html(include_plotlyjs=False, full_html=False, div_id=div_id))


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


def show_image(ax, image, title: str = "") -> None:
    """An RGB frame, a mask or a histogram (its counts saturate at the 99.5th percentile)."""
    if image.ndim == 2 and image.dtype != bool:
        image = np.minimum(image / max(np.percentile(image, 99.5), 1e-9), 1)
    ax.imshow(image, vmin=0, vmax=1, interpolation="nearest")
    ax.set_title(title)
    ax.set_axis_off()


def strip(images, titles, width: float = 7.0):
    """A row of images under their titles."""
    aspect = images[0].shape[0] / images[0].shape[1]
    fig, axes = plt.subplots(1, len(images), figsize=(width, width / len(images) * aspect + 0.35))
    for ax, image, title in zip(np.atleast_1d(axes), images, titles, strict=True):
        show_image(ax, image, title)
    return fig, np.atleast_1d(axes)


def draw_port(
    ax, T_cam_port: Pose, port: Port, camera: Camera, colour: str = COLOUR["truth"], **style
) -> None:
    """The CAD's ring and markers at a pose, on an image."""
    rings = [circle_points_m(r, 90) for r in (port.ring_inner_radius_m, port.ring_outer_radius_m)]
    for points in (*rings, *port.marker_corners_m()):
        u, v = project(T_cam_port @ np.vstack([points, points[:1]]), camera).T
        ax.plot(u, v, color=colour, lw=style.get("lw", 1.0))


def draw_ellipse(ax, ellipse: Ellipse, colour: str = COLOUR["ours"], **style) -> None:
    u, v = ellipse.points(180).T
    ax.plot(np.append(u, u[0]), np.append(v, v[0]), color=colour, **{"lw": 1.0, **style})


def draw_estimate(
    ax, image, estimate: Estimate, port: Port, camera: Camera, truth: Pose | None = None
) -> None:
    """An image with the estimate (and the truth) drawn on it."""
    show_image(ax, image, str(estimate.status))
    if truth is not None:
        draw_port(ax, truth, port, camera, COLOUR["truth"])
    if estimate.T_cam_port is not None:
        draw_port(ax, estimate.T_cam_port, port, camera, COLOUR["event"])
    ax.set_xlim(-0.5, camera.width_px - 0.5)
    ax.set_ylim(camera.height_px - 0.5, -0.5)


def draw_pipeline(recording: Recording, modalities=("rgb", "event")):
    """Image, ring mask with its ellipse, marker mask and pose, a row per modality; and the estimates."""
    fig, axes = plt.subplots(len(modalities), 4, figsize=(10, 2.05 * len(modalities)), squeeze=False)
    answers = []
    for row, modality in zip(axes, modalities, strict=True):
        estimator = Estimator(recording.camera, modality=modality)
        t_us, image = list(images(recording, modality))[-3]
        answers.append(answer := estimator(image, t_us))
        title = "RGB frame" if modality == "rgb" else f"{image.sum():,} events"
        show_image(row[0], image, title)
        show_image(row[1], estimator.ring_filter(image), "ring filter, ellipse")
        if answer.ellipse is not None:
            draw_ellipse(row[1], answer.ellipse, COLOUR["event"])
            markers = estimator.find_reflectors(image, estimator.candidates(answer.ellipse))
            show_image(row[2], markers, "reflector filter")
        draw_estimate(row[3], image, answer, estimator.port, recording.camera)
        row[3].set_title("pose")
    return fig, answers


def draw_cumulative(ax, values, label: str, colour: str, **style) -> None:
    """Share of values below each value."""
    values = np.sort(np.asarray(values)[np.isfinite(values)])
    ax.plot(
        values, 100 * (np.arange(len(values)) + 1) / max(len(values), 1), color=colour, label=label, **style
    )


METHOD_COLOUR = {"ORB-SLAM3 event": "#E69F00", "ORB-SLAM3 rgb": "#56B4E9", "lmmap event": COLOUR["event"],
                 "lmmap rgb": COLOUR["rgb"], "SVO event": "#CC79A7", "SVO rgb": "#009E73"}  # fmt: skip


def draw_boxes(ax, groups: dict[str, list[np.ndarray]], ticks: list[str]) -> None:
    """Box plots side by side over shared ticks: ``groups[method][k]`` are the values at tick k.

    Boxes hold the middle half, whiskers reach to the last value within one and a half box lengths.
    """
    width = 0.8 / max(len(groups), 1)
    for row, (name, values) in enumerate(groups.items()):
        ink = {"color": METHOD_COLOUR[name]}
        some = [(k + (row - (len(groups) - 1) / 2) * width, v) for k, v in enumerate(values) if len(v)]
        if some:
            ax.boxplot([v for _, v in some], positions=[at for at, _ in some], widths=0.8 * width,
                       whiskerprops=ink, capprops=ink, medianprops=ink, showfliers=False,
                       manage_ticks=False, patch_artist=True,
                       boxprops={"facecolor": ink["color"] + "60", "edgecolor": ink["color"]})  # fmt: skip
        ax.plot([], [], color=ink["color"], linewidth=6, alpha=0.6, label=name)
    ax.set_xticks(range(len(ticks)), ticks)
    ax.set_xlim(-0.6, len(ticks) - 0.4)


def draw_tracked(ax, times_s: dict[str, list[np.ndarray]], gap_s: float = 0.3) -> None:
    """A thin line per run, drawn where it has poses: ``times_s[method][run]``."""
    rows, at = [], 0
    for name, runs in times_s.items():
        rows.append(at + (len(runs) - 1) / 2)
        for t_s in runs:
            breaks = np.flatnonzero(np.diff(t_s) > gap_s) + 1
            for part in np.split(t_s, breaks):
                if len(part):
                    ax.plot(part[[0, -1]], [at, at], color=METHOD_COLOUR[name], solid_capstyle="butt")
            at += 1
        at += 2
    ax.set_yticks(rows, list(times_s))
    ax.invert_yaxis()
    ax.grid(axis="y", visible=False)


def draw_architecture(ax, net, size_px) -> None:
    """The layers of a `FilterNet` as boxes, as tall as their maps and as wide as their channels say;
    sizes are those of a pass through the net itself."""
    shapes = _shapes(net, size_px)
    x, tops = 0.0, []
    for name, (channels, height, width) in shapes:
        w, h = 0.25 + 0.25 * np.log2(max(channels, 1)) / 2, 4.0 * height / shapes[0][1][1]
        colour = COLOUR["rgb"] if name.startswith("down") else COLOUR["event"]
        colour = colour if name != "input" else COLOUR["ink"]
        ax.add_patch(plt.Rectangle((x, -h / 2), w, h, facecolor=colour, alpha=0.6, edgecolor=COLOUR["ink"]))
        ax.text(x + w / 2, -2.35, f"{channels}\n{width} x {height}", ha="center", va="top", fontsize=7)
        tops.append((x + w / 2, h / 2))
        x += w + 0.75
    for (a, b), level in zip(((1, 5), (2, 4)), (2.9, 2.45), strict=True):  # the skips
        (xa, ya), (xb, yb) = tops[a], tops[b]
        ax.plot([xa, xa, xb, xb], [ya, level, level, yb], color=COLOUR["truth"], lw=1.2)
    ax.set(xlim=(-0.3, x), ylim=(-3.2, 3.2))
    ax.set_axis_off()


def _shapes(net, size_px) -> list[tuple[str, tuple]]:
    """(name, (channels, height, width)) of the input and of what each stage gives on."""
    import torch

    found = []
    layers = [
        *((f"down {i}", m) for i, m in enumerate(net.down)),
        *((f"up {i}", m) for i, m in enumerate(net.up[:2])),
    ]
    hooks = [m.register_forward_hook(lambda m, i, o, n=n: found.append((n, o.shape[1:]))) for n, m in layers]
    width, height = size_px
    channels = net.down[0].in_channels
    with torch.inference_mode():
        last = net(torch.zeros(1, channels, height, width))
    for hook in hooks:
        hook.remove()
    pooled = [(n, (s[0], s[1] // 2, s[2] // 2) if n.startswith("down") else tuple(s)) for n, s in found]
    return [("input", (channels, height, width)), *pooled, ("up 2", tuple(last.shape[1:]))]


def mask_errors(found, truth) -> np.ndarray:
    """A picture (H, W, 3) of boolean masks: right green, too much orange, missed blue."""
    picture = np.zeros((*truth.shape, 3))
    for where, name in ((found & truth, "truth"), (found & ~truth, "event"), (~found & truth, "ours")):
        picture[where] = matplotlib.colors.to_rgb(COLOUR[name])
    return picture
