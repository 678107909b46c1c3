"""Tables as pages show them: in words and units, no wider than a page, and with the same bytes each time."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from ..provenance import DATA

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
    "table1": "paper",
    "printed": "printed",
    "ours": "ours",
    "certain": "certain",
    "fused": "fused",
}
LIGHTS = {"low": "low light", "medium": "medium light", "high": "high light"}
GAPS = {"low-domain-gap": "low domain gap", "high-domain-gap": "high domain gap"}
CAMERAS = {"rgb": "frames", "event": "events", "fused": "fused"}
CELL, INTERVAL = ["metric", "statistic", "light", "modality"], ("value", "low", "high")
FITS = {"iou": "IoU", "skeleton_px": "skeleton (px)", "stray": "astray", "missed": "missed"}
ANSWERS = {"ok": "a pose", "no_ring": "no ring", "no_ellipse": "no ellipse", "no_markers": "no markers"}


def of_accuracy(compared: pd.DataFrame, statistics: Sequence[str] = STATISTICS,
                estimators: Mapping[str, str] = ESTIMATORS) -> pd.DataFrame:  # fmt: skip
    """Rows of `accuracy.compare` in words: a row per metric and estimator (titles by column), a column per
    light and camera, positions in mm; a value, and in brackets its 95 % interval where it has one."""
    nothing, parts = compared.table1 * np.nan, []
    for column, estimator in estimators.items():
        ends = (compared.get(column + end, nothing) for end in ("", "_low", "_high"))
        parts.append(compared[CELL].assign(**dict(zip(INTERVAL, ends, strict=True)), by=estimator))
    return _wide(pd.concat(parts), statistics, list(estimators.values()))


def of_differences(compared: pd.DataFrame):
    """In how many cells of `accuracy.compare` the paper's value lies in our 95 % interval, and in how many of
    the others ours is better or worse, styled: a row per metric, columns by domain gap."""
    more_is_better = compared.metric == "detection_rate_percent"
    inside = compared.table1.between(compared.ours_low, compared.ours_high)
    better = (compared.ours > compared.table1) == more_is_better
    told = compared.assign(
        of=[WORDS[key] for key in zip(compared.metric, compared.statistic, strict=True)],
        ours=np.select([inside, better], ["alike", "better"], "worse"),
    )
    counts = told.groupby(["of", "training", "ours"]).size().unstack(["training", "ours"], fill_value=0)
    columns = list(product(GAPS, ("better", "alike", "worse")))
    counts = counts.reindex(index=list(WORDS.values()), columns=columns, fill_value=0)
    return counts.rename(GAPS, axis=1).rename_axis(index=None, columns=(None, None)).style


def of_found(answers: pd.DataFrame, compared: pd.DataFrame):
    """Percent of the images with the ring in view that have a pose in the paper, a pose of ours, at least an
    ellipse of ours, styled: of `accuracy.compare`, and of `distributions.answers` by what that has."""
    rows = {"table1": "a pose, paper", "ours": "a pose, ours", "ellipse": "an ellipse, ours"}
    cell, cameras = ["training", "light", "modality"], ("rgb", "event")
    counts = answers.assign(ellipse=answers.in_view.where(answers.status.isin(["ok", "no_markers"]), 0))
    counts = counts.groupby(cell)[["ellipse", "in_view"]].sum()
    rates = compared.query("statistic == 'in_fov' and outlier_filter == 'without'").set_index(cell)
    rates = rates.assign(ellipse=100 * counts.ellipse / counts.in_view)[list(rows)].stack().unstack(cell[1:])
    rates = rates.reindex(index=list(product(GAPS, rows)), columns=list(product(LIGHTS, cameras)))
    wide = rates.rename(GAPS | rows).rename(LIGHTS | CAMERAS, axis=1)
    return wide.rename_axis(index=(None, None), columns=(None, None)).style.format(precision=1)


def of_seeds(table: pd.DataFrame) -> pd.DataFrame:
    """Cells of `accuracy.summary` by ``seed``, ``light`` and ``modality`` in words: a row per metric and
    training, a column per light and camera, a value and in brackets its 95 % interval."""
    cells = table[table.variant == "exact"].assign(by="seed " + table.seed.astype(str))
    return _wide(cells, ("median", "in_fov"), list(cells.by.unique()))


def _wide(cells: pd.DataFrame, statistics: Sequence[str], by: Sequence[str]) -> pd.DataFrame:
    """A row per metric and each of ``by``, a column per light and camera."""
    cells = cells[cells.statistic.isin(statistics)]
    scale = np.where(cells.metric == "position_error_m", 1e3, 1.0)
    ends = (cells[name] * scale for name in INTERVAL)
    told = cells.assign(
        of=[WORDS[key] for key in zip(cells.metric, cells.statistic, strict=True)],
        light=cells.light.map(LIGHTS), camera=cells.modality.map(CAMERAS),
        text=[_with_interval(*values) for values in zip(*ends, strict=True)],
    )  # fmt: skip
    wide = told.pivot(index=["of", "by"], columns=["light", "camera"], values="text")
    rows = product([words for (_, of), words in WORDS.items() if of in statistics], by)
    wide = wide.reindex(index=list(rows), columns=list(product(LIGHTS.values(), ("frames", "events"))))
    return wide.rename_axis(index=(None, None), columns=(None, None))


def _with_interval(value: float, low: float, high: float) -> str:
    if not np.isfinite(value):
        return "none"
    ends = [_digits(end) for end in (low, high) if np.isfinite(end)]
    return _digits(value) + (f" ({' to '.join(ends)})" if len(set(ends)) == 2 else "")


def _digits(value: float) -> str:
    """Three of them, and none behind the point from a hundred on."""
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def of_coverage(covered: pd.DataFrame) -> pd.DataFrame:
    """`distributions.coverage` by ``modality`` and ``light``: percent, in brackets its 95 % interval."""
    ends = zip(covered.inside_95_percent, covered.low, covered.high, strict=True)
    told = covered.replace({"modality": CAMERAS, "light": LIGHTS}).assign(
        text=[f"{value:.0f} ({low:.0f} to {high:.0f})" for value, low, high in ends]
    )
    wide = told.pivot(index="modality", columns="light", values="text")
    wide = wide.reindex(index=list(CAMERAS.values()), columns=list(LIGHTS.values()))
    return wide.rename_axis(index=None, columns=None)


def of_sequences(table: pd.DataFrame):
    """`distributions.of_sequence` by ``sequence`` and ``modality`` in words, styled."""
    words = {key: WORDS[key, "median"] for key in ("position_error_m", "normal_error_deg")}
    words |= {"found_percent": WORDS["detection_rate_percent", "in_fov"],
              "inside_95_percent": "inside the 95 % region (%)"}  # fmt: skip
    told = table.assign(position_error_m=1e3 * table.position_error_m, camera=table.modality.map(CAMERAS))
    told = told.sort_values("sequence", kind="stable").set_index(["sequence", "camera"])[list(words)]
    return told.rename(columns=words).rename_axis(index=(None, None)).style.format(precision=2)


def of_fusion(apart: pd.DataFrame) -> pd.DataFrame:
    """`distributions.against_better` by ``light`` in words: a row per light and median error, which camera is
    the better one, and by how much the fused track is above it, in brackets the 95 % interval."""
    rows = []
    for row in apart.itertuples():
        scale = 1e3 if row.metric == "position_error_m" else 1.0
        value, low, high = scale * np.array([row.difference, row.low, row.high])
        said = f"{value:+.2f} ({low:+.2f} to {high:+.2f})"
        rows.append((LIGHTS[row.light], WORDS[row.metric, "median"], CAMERAS[row.better], said))
    columns = ["light", "median error", "better camera", "fused minus better"]
    return pd.DataFrame(rows, columns=columns).set_index(columns[:2])


def of_saturation(shares: pd.DataFrame, paper_percent: np.ndarray):
    """Shares of black and white pixels by ``light``, the paper's (3, 2) beside them, and the rank correlation
    of both together with the error; styled."""
    paper = pd.DataFrame(paper_percent, list(LIGHTS), ["low", "high"])
    ours = shares.set_index("light").loc[list(LIGHTS)]
    columns = {(f"{word} (%)", whose): of[end] for end, word in (("low", "black"), ("high", "white"))
               for whose, of in (("paper", paper), ("ours", ours))}  # fmt: skip
    table = pd.DataFrame({**columns, ("rank correlation", "with the error"): ours.rank_correlation})
    return table.rename(LIGHTS).style.format(precision=1).format("{:.2f}", table.columns[-1:].tolist())


def of_hard_cases(counts: pd.DataFrame, cases: Mapping[str, str]):
    """Success in percent and median errors, styled: of ``counts`` by sequence and modality, for the titles of
    ``cases``."""
    paper = pd.read_csv(DATA / "paper" / "other_results.csv").query("where == 'hard cases'")
    rows = []
    for (name, modality), c in counts[counts.index.isin(cases, level=0)].iterrows():
        reported = paper[(paper.condition == cases[name]) & paper.quantity.str.endswith(modality)].value
        rows.append({
            "case": cases[name], "camera": CAMERAS[modality],
            "ellipse, paper (%)": float(reported.item()) if len(reported) else np.nan,
            "ellipse, ours (%)": 100 * c.ellipses / c.images if modality != "fused" else np.nan,
            "pose, ours (%)": 100 * c.poses / c.images, "our images": c.images,
            "off by (mm)": 1e3 * c.position_error_m, "normal (°)": c.normal_error_deg,
        })  # fmt: skip
    table = pd.DataFrame(rows).set_index(["case", "camera"]).rename_axis(index=(None, None))
    return table.style.format(precision=1, na_rep="–")


def of_filters(table: pd.DataFrame, fits: Sequence[str] = ("iou", "skeleton_px")):
    """`quality.medians` by light, styled: a row per filter, a column per fit and light."""
    named = table.rename(columns={**FITS, "domain_gap": "domain gap"})
    rows = ["domain gap", "filter", "modality"]
    wide = named.pivot_table([FITS[fit] for fit in fits], rows, "light", sort=False)
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
