"""Figures and tables of the chapter that asks whether mixing learning and geometry pays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import matplotlib.pyplot as plt
import pandas as pd

from lmmap.settings import MODALITIES
from lmmap.types import Camera, Estimate, Port

from ..studies.claims_of_mixing import GEOMETRY, OURSELVES, PRINTED, of_test
from .drawings import COLOUR, draw_estimate, draw_intervals, plain_log
from .tables import CAMERAS

METHODS = {GEOMETRY: "geometry alone", "pnp": "points, then PnP", "crop": "learned pose",
           PRINTED: "mixed, as printed", OURSELVES: "mixed, ours"}  # fmt: skip
COLOURS = {GEOMETRY: "rival", "pnp": "event", "crop": "fused", PRINTED: "ink", OURSELVES: "ours"}
APART = 0.13  # of the methods at one place
CURVES = "test", "second scene"
KINDS = "right", "wrong"


def draw_places(places: pd.DataFrame):
    """Right (above) and wrong poses by place, with intervals over sequences, a column for each camera."""
    names = list(places.place.unique())
    fig, axes = plt.subplots(2, 2, figsize=(7.6, 5.2), sharex=True, sharey="row")
    for column, modality in zip(axes.T, MODALITIES, strict=True):
        for ax, what in zip(column, KINDS, strict=True):
            for k, (method, rows) in enumerate(_by_method(places[places.modality == modality])):
                x = [names.index(place) + (k - 2) * APART for place in rows.place]
                ends = (rows[f"{what}_{end}"] for end in ("percent", "low", "high"))
                draw_intervals(ax, x, *ends, COLOUR[COLOURS[method]], METHODS[method])
            ax.grid(axis="x", visible=False)
        column[0].set(title=CAMERAS[modality], ylim=(-3, 103))
        column[1].set_xticks(range(len(names)), names, rotation=40, ha="right", fontsize=8)
    axes[0, 0].set_ylabel("right poses (%)")
    axes[1, 0].set_ylabel("wrong poses (%)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, fontsize=8, ncols=3, loc="outside lower center")
    return fig


def draw_curves(curves: pd.DataFrame, places: pd.DataFrame):
    """Right poses over the number of labelled images, on the test (above) and the second scene, a column for
    each camera; geometry alone, of ``places``, needs none."""
    fig, axes = plt.subplots(2, 2, figsize=(7.6, 5.2), sharex=True, sharey=True)
    for column, modality in zip(axes.T, MODALITIES, strict=True):
        alone = {"test": of_test(places).right_percent[GEOMETRY, modality]}
        of_camera = places[(places.method == GEOMETRY) & (places.modality == modality)]
        alone |= of_camera.set_index("place").right_percent.to_dict()
        for ax, place in zip(column, CURVES, strict=True):
            ax.axhline(alone[place], ls="--", color=COLOUR[COLOURS[GEOMETRY]], label=METHODS[GEOMETRY])
            own = curves[(curves.modality == modality) & (curves.place == place)]
            for method, rows in _by_method(own):
                means, colour = rows.groupby("images_learned").right_percent.mean(), COLOUR[COLOURS[method]]
                ax.plot(means.index, means, "-", color=colour)
                ends = (rows[f"right_{end}"] for end in ("percent", "low", "high"))
                draw_intervals(ax, rows.images_learned, *ends, colour, METHODS[method])
            ax.set(xscale="log", ylim=(-3, 103))
            plain_log(ax.xaxis, (1, 3))
        column[0].set_title(CAMERAS[modality])
        column[1].set_xlabel("labelled images")
    for ax, place in zip(axes[:, 0], CURVES, strict=True):
        ax.set_ylabel(f"right poses (%), {place}")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, fontsize=8, ncols=4, loc="outside lower center")
    return fig


def test_table(places: pd.DataFrame) -> pd.DataFrame:
    """Means over the three lights of the test: a row a camera and method."""
    means = of_test(places)
    means = means.assign(position_mm=1e3 * means.position_error_m)
    words = {"right_percent": "right (%)", "wrong_percent": "wrong (%)",
             "every_right_percent": "right, no limit (%)", "every_wrong_percent": "wrong, no limit (%)",
             "position_mm": "position (mm)", "normal_error_deg": "normal (°)"}  # fmt: skip
    return _in_words(means[list(words)].rename(columns=words)).map("{:.1f}".format)


def elsewhere_table(places: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Right / wrong poses in percent at places with these names, with each method's limit on its confidence
    and without: a row a camera and method."""
    rows, columns = places.set_index(["place", "method", "modality"]).sort_index(), {}
    for name in names:
        for words, stem in (("", ""), (", no limit", "every_")):
            right, wrong = (rows.loc[name, f"{stem}{what}_percent"].map("{:.0f}".format) for what in KINDS)
            columns[name + words] = right + " / " + wrong
    return _in_words(pd.DataFrame(columns))


def cost_table(cost: pd.DataFrame) -> pd.DataFrame:
    """What each method costs: a row a camera and method."""
    rows = cost.set_index(["method", "modality"])
    forms = {"parameters": ("parameters", "{:,.0f}"), "gflop": ("GFLOP", "{:.2f}"),
             "ms_1": ("one core (ms)", "{:.0f}"), "ms_2": ("two cores (ms)", "{:.0f}"),
             "step_ms": ("training step (ms)", "{:.0f}")}  # fmt: skip
    texts = pd.DataFrame({title: rows[name].map(form.format) for name, (title, form) in forms.items()})
    return _in_words(texts)


def draw_answers(image, answers: dict[str, Estimate], truth, camera: Camera, port: Port):
    """One image with each method's pose (orange), reported or doubtful, and the true one (green)."""
    fig, axes = plt.subplots(2, -(-len(answers) // 2), figsize=(7.6, 4.4), squeeze=False)
    for ax in axes.flat[len(answers) :]:
        ax.set_axis_off()
    for ax, (method, answer) in zip(axes.flat, answers.items(), strict=False):
        draw_estimate(ax, image, replace(answer, T_cam_port=answer.found), port, camera, truth)
        ax.set_title(f"{METHODS[method]}: {answer.status}", fontsize=8)
    return fig


def _by_method(rows: pd.DataFrame):
    return [(method, rows[rows.method == method]) for method in METHODS if (rows.method == method).any()]


def _in_words(table: pd.DataFrame) -> pd.DataFrame:
    """Rows by method and camera, the cameras one below the other, in words."""
    rows = [(m, method) for m in MODALITIES for method in METHODS if (method, m) in table.index]
    table = table.swaplevel().loc[rows]
    return table.rename(index=CAMERAS, level=0).rename(index=METHODS, level=1).rename_axis([None, None])
