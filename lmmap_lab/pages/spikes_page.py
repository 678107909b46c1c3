"""The figures of the chapter on spiking networks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
import torch

from lmmap.pipeline.network import FilterNet
from lmmap.settings import PAPER
from lmmap.types import Recording

from ..studies import spikes
from ..training.spiking import SpikingNet, activations, sliced
from .drawings import COLOUR, draw_intervals
from .tables import with_ends

CROP_PX = 96
STYLES = {  # colour and marker of a network; ordinary ones that take the whole histogram are lines
    "converted, plain": ("paper", "v"), "converted, signed": ("event", "o"),
    "trained, plain": ("rival", "s"), "trained, signed": ("truth", "D"),
    "ordinary": ("rgb", "x"),
}  # fmt: skip
LABELS = {"slices": "slices T", "events": "events so far (thousands)"}
WORDS = {"iou_ring": "overlap of the ring mask", "iou_markers": "overlap of the marker masks",
         "right_percent": "right poses (%)", "wrong_percent": "wrong poses (%)"}  # fmt: skip


def crop_of(recording: Recording, pixel, slices: int) -> tuple[torch.Tensor, tuple[int, int]]:
    """Slices (T, 1, S, S) of a recording's first window around a pixel, and where in them the pixel is."""
    events, (width, height) = recording.events[: PAPER.events_per_window], recording.camera.size_px
    x = sliced(events["y"].astype(int) * width + events["x"], (height, width), slices)
    at = np.rint(pixel).astype(int)
    low = np.clip(at - CROP_PX // 2, 0, [width - CROP_PX, height - CROP_PX])
    crop = x[:, None, low[1] : low[1] + CROP_PX, low[0] : low[0] + CROP_PX]
    return torch.from_numpy(crop.copy()), tuple((at - low).tolist())


class AtPixel(NamedTuple):
    """A pixel's logit after each slice (T,), and what its neurons of the first layer have sent by then, in
    spikes (T, 64); those taken back do not count."""

    logit: np.ndarray
    fired: np.ndarray


@torch.inference_mode()
def spiking_at(net: SpikingNet, x: torch.Tensor, at: tuple[int, int]) -> AtPixel:
    """What a spiking network makes of slices (T, 1, S, S) at a pixel (u, v)."""
    (column, row), thresholds = at, net.ceilings[0][:, 0, 0] / net.slices
    answers = [(z[0, 0, row, column], s[0][0, :, row // 2, column // 2]) for z, s in net.answers(x)]
    logits, sent = (torch.stack(values) for values in zip(*answers, strict=True))
    return AtPixel(logits.numpy(), (sent / thresholds).round().cumsum(0).numpy())


@torch.inference_mode()
def ordinary_at(net: FilterNet, thresholds: torch.Tensor, x: torch.Tensor, at: tuple[int, int]) -> AtPixel:
    """The same of an ordinary network and the whole window (1, 1, S, S)."""
    column, row = at
    passed = activations(net, x)[0][0, :, row // 2, column // 2] / thresholds
    return AtPixel(net(x)[0, 0, row, column].numpy()[None], passed.numpy()[None])


def draw_pixel(axes, of_kinds: dict[str, AtPixel], ordinary: AtPixel) -> None:
    """Spikes of the neuron that is most wrong if it is plain (above) and the pixel's logit (below)."""
    neuron = int(np.argmax(of_kinds["plain"].fired[-1] - ordinary.fired[-1]))
    (top, bottom), dashed = axes, dict(color=COLOUR["rgb"], lw=1.2, ls="--", label="ordinary, in the end")
    for kind, found in of_kinds.items():
        colour = COLOUR[STYLES[f"converted, {kind}"][0]]
        events = 1e-3 * PAPER.events_per_window * np.arange(1, len(found.logit) + 1) / len(found.logit)
        top.step(events, found.fired[:, neuron], where="post", color=colour, label=kind)
        bottom.plot(events, found.logit, color=colour, label=kind)
    top.axhline(ordinary.fired[-1, neuron], **dashed)
    bottom.axhline(ordinary.logit[-1], **dashed)
    top.set(ylabel="spikes so far")
    bottom.set(xlabel="events so far (thousands)", ylabel="logit of the pixel")
    top.legend(fontsize=8, loc="center right")


def draw_curves(axes, outcomes: pd.DataFrame, over: str, networks, measures) -> None:
    """Measures over ``slices`` or ``events``, with intervals; an ordinary network has no slices: a line."""
    for ax, measure in zip(axes, measures, strict=True):
        for k, name in enumerate(networks):
            rows = outcomes[outcomes.network == name].sort_values(over)
            colour, low, high = COLOUR[STYLES[name][0]], rows[f"{measure}_low"], rows[f"{measure}_high"]
            if over == "slices" and name == "ordinary":
                ax.axhline(rows[measure].iloc[0], color=colour, lw=1, ls="--", label=name)
                ax.axhspan(low.iloc[0], high.iloc[0], color=colour, alpha=0.15, lw=0)
                continue
            x = rows[over] * 1.03 ** (k - 1) if over == "slices" else 1e-3 * rows[over] + 0.25 * (k - 1)
            draw_intervals(ax, x, rows[measure], low, high, colour, name)
            ax.plot(x, rows[measure], color=colour, lw=1)
        ax.set(xlabel=LABELS[over], ylabel=WORDS[measure])
        if over == "slices":
            ax.set_xscale("log", base=2)
            ax.set_xticks(spikes.SLICES, [str(n) for n in spikes.SLICES])
            ax.minorticks_off()


def outcome_table(rows: pd.DataFrame) -> pd.DataFrame:
    """Means of groups in words, each with its interval in brackets: a row a network, a column a group."""

    def text(row, measure: str) -> str:
        ends = (row[measure + end] for end in ("", "_low", "_high"))
        return with_ends(*ends, ".2f" if measure.startswith("iou") else ".0f")

    measures = ("iou_ring", "right_percent", "wrong_percent")
    cells = [{"network": row["network"], "of": row["of"], "what": WORDS[m], "text": text(row, m)}
             for _, row in rows.iterrows() for m in measures]  # fmt: skip
    wide = pd.DataFrame(cells).pivot(index=["what", "network"], columns="of", values="text")
    order = [(WORDS[m], n) for m in measures for n in STYLES if (WORDS[m], n) in wide.index]
    return (
        wide.reindex(order)[list(dict.fromkeys(rows["of"]))]
        .rename_axis([None, None])
        .rename_axis(columns=None)
    )


def facts(outcomes: pd.DataFrame, made_by: dict) -> dict[str, float]:
    """The numbers of the chapter's text; right and wrong are percentages of the windows.  ``made_by`` is the
    provenance of the outcomes."""
    every = outcomes[outcomes.group == "all"].set_index(["network", "slices", "events"]).sort_index()
    whole, half, most = spikes.EVENTS[-1], spikes.EVENTS[1], spikes.SLICES[-1]
    rows = {
        "ordinary": ("ordinary", 1, whole), "half_ordinary": ("ordinary", 1, half),
        "half_signed": ("converted, signed", spikes.WATCHED, half),
        "plain": ("converted, plain", most, whole), "signed": ("converted, signed", most, whole),
        "few_signed": ("converted, signed", spikes.TRAINED_SLICES, whole),
        "few_plain": ("converted, plain", spikes.TRAINED_SLICES, whole),
        "trained_plain": ("trained, plain", spikes.TRAINED_SLICES, whole),
        "trained_signed": ("trained, signed", spikes.TRAINED_SLICES, whole),
        "half_trained": ("trained, signed", spikes.TRAINED_SLICES, half),
    }  # fmt: skip
    measures = {"iou": "iou_ring", "right": "right_percent", "wrong": "wrong_percent"}
    known = {name: every.loc[key] for name, key in rows.items() if key in every.index}
    named = {f"{n}_{word}": float(row[m]) for n, row in known.items() for word, m in measures.items()}
    counts = {"windows": int(known["ordinary"].windows), "sequences": int(known["ordinary"].sequences)}
    slices = {"most": most, "watched": spikes.WATCHED, "few": spikes.TRAINED_SLICES, "half": f"{half:,}"}
    training = {fact: made_by["trainings"]["ring-signed"][fact] for fact in ("steps", "batch")}
    return counts | slices | named | training


def cost_facts(costs: pd.DataFrame) -> dict[str, float]:
    """How many times less energy few signed slices take than an ordinary network and than it needs, how many
    times more most of them take than that, and how many times longer a slice takes than its whole image."""
    rows = costs.set_index(["network", "slices"])
    ordinary, signed = rows.loc["ordinary", 1], rows.loc["converted, signed"]
    slower = signed.core_ms / signed.index / ordinary.core_ms
    return {
        "saved": float(ordinary.millijoule / signed.millijoule[spikes.TRAINED_SLICES]),
        "saved_needed": float(ordinary.millijoule_needed / signed.millijoule[spikes.TRAINED_SLICES]),
        "most_times": float(signed.millijoule[spikes.SLICES[-1]] / ordinary.millijoule_needed),
        "slower": float(slower.mean()),
    }


def cost_table(costs: pd.DataFrame) -> pd.DataFrame:
    """What a window's ring mask takes, in words; *needed* leaves out what is multiplied by zero."""
    words = {"network": "network", "slices": "slices", "operations": "operations (10⁹)",
             "operations_needed": "needed (10⁹)", "millijoule": "energy (mJ)",
             "millijoule_needed": "needed (mJ)", "spikes_a_neuron": "spikes per neuron",
             "core_ms": "time (ms)"}  # fmt: skip
    counts = ["operations", "operations_needed"]
    return costs.assign(**(1e-9 * costs[counts]))[list(words)].rename(columns=words)
