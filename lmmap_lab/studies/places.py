"""What networks gain that learn a place by themselves: right and wrong poses before and after, of recordings
that `benchmarks/adapt_places.py` judged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from lmmap.settings import MODALITIES

from ..bench import laboratory, varied
from .bootstrap import interval
from .reliability import reliability

COUNTED = ("right", "wrong")
WHEN = ("before", "after")
KEY = ["learned_on", "judged_on", "modality"]


def light_of(place: str) -> str:
    """The light of ``NAME:SECONDS``, where a name is the bench's, a varied laboratory's or ``scene-N``."""
    name = place.partition(":")[0].replace("scene-", "realistic-")
    if name.startswith("varied-"):
        return varied.light_of(int(name.split("-")[1]))
    return laboratory.sequence(name).light


def with_both(images: pd.DataFrame) -> pd.DataFrame:
    """A row an image ``before`` and ``after``, and its ``light``; networks not taken change nothing."""
    taken = images[images.when == "after"].set_index(KEY).index.unique()
    kept = images[~images.set_index(KEY).index.isin(taken)].assign(when="after")
    both = pd.concat([images, kept], ignore_index=True)
    return both.assign(
        light=both.judged_on.map({place: light_of(place) for place in both.judged_on.unique()})
    )


def by_recording(images: pd.DataFrame) -> pd.DataFrame:
    """Percent of right and wrong poses by light, recordings and camera (rows), before and after (columns)."""
    groups = with_both(images).groupby(["light", *KEY, "when"])
    counts = groups[list(COUNTED)].mean().mul(100).assign(images=groups.size())
    return counts.unstack("when")[[*COUNTED, "images"]]


def means(images: pd.DataFrame, by: Sequence[str] = ("light", "modality"), draws: int = 2000,
          seed: int = 0) -> pd.DataFrame:  # fmt: skip
    """Means over recordings of `by_recording`, by light and camera, with 95 % intervals over recordings.

    Returns
    -------
    DataFrame
        The columns of ``by``, ``when, recordings, images`` and, for ``right`` and ``wrong``, ``NAME_percent``
        and its ends ``NAME_low, NAME_high``.
    """
    table, rng, rows = by_recording(images), np.random.default_rng(seed), []
    for key, cell in table.groupby(list(by), sort=False):
        drawn = rng.integers(0, len(cell), (draws, len(cell)))
        for when in WHEN:
            row = dict(zip(by, key, strict=True)) | {"when": when, "recordings": len(cell)}
            row["images"] = int(cell["images", when].sum())
            for what in COUNTED:
                values = cell[what, when].to_numpy()
                low, high = interval(values[drawn].mean(1))
                row |= {f"{what}_percent": values.mean(), f"{what}_low": low, f"{what}_high": high}
            rows.append(row)
    return pd.DataFrame(rows)


def by_seconds(images: pd.DataFrame) -> pd.DataFrame:
    """Percent of right and wrong poses by light, camera, networks and the seconds that they learned from."""
    parts = []
    for (weights, seconds), learned in images.groupby(["weights", "seconds"]):
        groups = with_both(learned).query("when == 'after'").groupby(["light", "modality"])
        shares = groups[list(COUNTED)].mean().mul(100).add_suffix("_percent")
        parts.append(shares.assign(images=groups.size(), weights=weights, seconds=seconds))
    return pd.concat(parts).reset_index()


def own(images: pd.DataFrame) -> pd.DataFrame:
    """Images of the recordings that taught."""
    return images[images.learned_on == images.judged_on]


def carried(images: pd.DataFrame, modality: str) -> pd.DataFrame:
    """What networks gain on other recordings of the place that taught them.

    Returns
    -------
    DataFrame
        By ``taught`` and ``judged``, the lights of the two recordings, and for each of `WHEN` the
        ``images`` and how many of them are ``right`` and ``wrong``.
    """
    both = with_both(images[(images.learned_on != images.judged_on) & (images.modality == modality)])
    both = both.assign(taught=both.learned_on.map(light_of), judged=both.light)
    groups = both.groupby(["taught", "judged", "when"])
    return groups[list(COUNTED)].sum().assign(images=groups.size()).unstack("when")


def most_lost(images: pd.DataFrame) -> float:
    """By how many points the recording that loses most has less right poses after than before."""
    right = by_recording(images)["right"]
    return float((right.before - right.after).max())


def reported(images: pd.DataFrame, when: str) -> dict[str, pd.DataFrame]:
    """`reliability.reliability` of the poses that each camera reports before or after, by its modality."""
    told = with_both(images).query("when == @when and status == 'ok'")
    of = dict(list(told.groupby("modality")))
    return {m: reliability(of[m].confidence, of[m].right) for m in MODALITIES if m in of}
