"""Tables as pages show them: in words and units, no wider than a page, and with the same bytes each time."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from .results import DATA

STATISTICS = ("median", "in_fov", "rmse", "all")
WORDS = {  # what a table calls a metric and its statistic
    ("position_error_m", "median"): "position (mm)",
    ("normal_error_deg", "median"): "normal (°)",
    ("rotation_error_deg", "median"): "rotation (°)",
    ("detection_rate_percent", "in_fov"): "found, ring in view (%)",
    ("position_error_m", "rmse"): "position, RMSE (mm)",
    ("normal_error_deg", "rmse"): "normal, RMSE (°)",
    ("rotation_error_deg", "rmse"): "rotation, RMSE (°)",
    ("detection_rate_percent", "all"): "found, all images (%)",
}
ESTIMATORS = {
    "published": "paper",
    "printed": "printed",
    "ours": "ours",
    "certain": "certain",
    "fused": "fused",
}
LIGHTS = {"low": "low light", "medium": "medium light", "high": "high light"}
CAMERAS = {"rgb": "frames", "event": "events", "fused": "fused"}
ANSWERS = {"ok": "a pose", "no_ring": "no ring", "no_ellipse": "no ellipse", "no_markers": "no markers"}


def of_accuracy(compared: pd.DataFrame, statistics: Sequence[str] = STATISTICS,
                estimators: Mapping[str, str] = ESTIMATORS) -> pd.DataFrame:  # fmt: skip
    """Rows of `accuracy.compare` in words: a row per metric and estimator (titles by column), a column per
    light and camera, positions in mm; a value, and in brackets its 95 % interval where it has one."""
    metrics = [words for (_, statistic), words in WORDS.items() if statistic in statistics]
    scale, parts = np.where(compared.metric == "position_error_m", 1e3, 1.0), []
    named = compared.assign(
        of=[WORDS.get(key) for key in zip(compared.metric, compared.statistic, strict=True)],
        light=compared.light.map(LIGHTS), camera=compared.modality.map(CAMERAS),
    )  # fmt: skip
    for column, estimator in estimators.items():
        ends = [named.get(column + end, named.published * np.nan) * scale for end in ("", "_low", "_high")]
        text = [_with_interval(*values) for values in zip(*ends, strict=True)]
        parts.append(named.assign(estimator=estimator, text=text))
    wide = pd.concat(parts).pivot(index=["of", "estimator"], columns=["light", "camera"], values="text")
    rows, columns = product(metrics, estimators.values()), product(LIGHTS.values(), ("frames", "events"))
    wide = wide.reindex(index=list(rows), columns=list(columns))
    return wide.rename_axis(index=(None, None), columns=(None, None))


def _with_interval(value: float, low: float, high: float) -> str:
    if not np.isfinite(value):
        return "none"
    ends = [_digits(end) for end in (low, high) if np.isfinite(end)]
    return _digits(value) + (f" ({' to '.join(ends)})" if len(set(ends)) == 2 else "")


def _digits(value: float) -> str:
    """Three of them, and none behind the point from a hundred on."""
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def of_seeds(table: pd.DataFrame) -> pd.DataFrame:
    """Cells of `accuracy.summary` by ``seed``, ``light`` and ``modality`` in words: a row per metric and
    training, a column per light and camera, a value and in brackets its 95 % interval."""
    shown = table[(table.variant == "exact") & table.statistic.isin(["median", "in_fov"])]
    scale = np.where(shown.metric == "position_error_m", 1e3, 1.0)
    ends = (shown[column] * scale for column in ("value", "low", "high"))
    named = shown.assign(
        of=[WORDS[key] for key in zip(shown.metric, shown.statistic, strict=True)],
        training=[f"seed {seed}" for seed in shown.seed],
        light=shown.light.map(LIGHTS), camera=shown.modality.map(CAMERAS),
        text=[_with_interval(*values) for values in zip(*ends, strict=True)],
    )  # fmt: skip
    wide = named.pivot(index=["of", "training"], columns=["light", "camera"], values="text")
    wide = wide.reindex(columns=list(product(LIGHTS.values(), ("frames", "events"))))
    words = [word for word in WORDS.values() if word in set(named.of)]
    return wide.reindex(words, level=0).rename_axis(index=(None, None), columns=(None, None))


def of_hard_cases(counts: pd.DataFrame, cases: Mapping[str, str]):
    """Success in percent, styled: of ``counts`` by sequence and modality, for the titles of ``cases``."""
    paper = pd.read_csv(DATA / "paper" / "other_results.csv").query("where == 'hard cases'")
    rows = []
    for (name, modality), c in counts[counts.index.isin(cases, level=0)].iterrows():
        published = paper[(paper.condition == cases[name]) & paper.quantity.str.endswith(modality)].value
        rows.append({
            "case": cases[name], "camera": CAMERAS[modality],
            "ellipse, paper (%)": float(published.item()) if len(published) else np.nan,
            "ellipse, ours (%)": 100 * c.ellipses / c.images if modality != "fused" else np.nan,
            "pose, ours (%)": 100 * c.poses / c.images, "our images": c.images,
        })  # fmt: skip
    table = pd.DataFrame(rows).set_index(["case", "camera"]).rename_axis(index=(None, None))
    return table.style.format(precision=1, na_rep="–")


def of_filters(table: pd.DataFrame):
    """`quality.medians` by light, styled: a row per filter, a column per light of overlap and skeleton."""
    named = table.rename(columns={"iou": "IoU", "skeleton_px": "skeleton (px)", "domain_gap": "domain gap"})
    rows = ["domain gap", "filter", "modality"]
    wide = named.pivot_table(["IoU", "skeleton (px)"], rows, "light", sort=False)
    return wide.style.format(precision=2, na_rep="none")


def small_intervals(table: pd.DataFrame):
    """A table of texts, styled: what each has in brackets in small letters under it."""
    return table.style.format(lambda text: text.replace(" (", "<br><small>").replace(")", "</small>"))


def of_claims(claims: pd.DataFrame):
    """`claims.claims`, styled: reasons in small letters under the claims, numbers one over the other."""
    why = claims.why.str.replace(r"`(.+?)`", r"<code>\1</code>", regex=True)
    told = claims.assign(
        claim=claims.claim + "<br><small>" + why + "</small>",
        ours=claims.ours.str.replace("; ours ", "<br>ours "),
    )
    return of_sentences(told.drop(columns="why"))


def of_sentences(table: pd.DataFrame):
    """A table without index, styled, whose cells may take several lines."""
    return table.style.hide().set_table_attributes('class="sentences"')


def html(styled) -> str:
    """A styled table in HTML, its identifier made from its content, where pandas would draw a random one."""
    content = styled.to_html(table_uuid="table")
    return styled.to_html(table_uuid=hashlib.sha256(content.encode()).hexdigest()[:8])


def text(styled) -> str:
    """A styled table's values in letters of one width, for paper."""
    return styled.data.to_string(index=not any(styled.hide_index_))
