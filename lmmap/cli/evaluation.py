"""``lmmap evaluate``: errors and detection rates of one recording, as in the paper's table."""

from __future__ import annotations

import json
import warnings
from argparse import Namespace
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pandas as pd

from .. import plugins
from ..estimation.estimates import estimate, merge_by_time
from ..evaluation import cells, error_table
from ..recordings.pose_files import read_truth
from ..recordings.stream import Stream
from ..settings import MODALITIES
from ..tracking.fusion import fuse
from ..types import Estimate, InputError, Port, Trajectory
from .inputs import can_be_fused, find_rig, make_estimator, open_input
from .progress import Bar


def evaluate(a: Namespace) -> None:
    """Print the errors of each camera and of both fused."""
    if a.as_printed and a.modality == "fused":
        raise InputError("--as-printed: the paper fuses nothing; give --modality rgb or event")
    stream = open_input(a)
    stream = replace(stream, truth=_truth(a, stream))
    if check := plugins.reader("truth_clock"):  # before anything is estimated
        check(stream, a.truth or a.recording)
    single = (a.modality,) if a.modality in MODALITIES else MODALITIES
    estimators = {m: make_estimator(a, stream.camera, m) for m in single}
    both = single == MODALITIES and not a.as_printed and can_be_fused(stream, needed=a.modality == "fused")
    port = estimators[single[0]].port
    estimates = {m: _estimates(stream, e, a.rate) for m, e in estimators.items()}
    if both and all(estimates.values()):
        merged = merge_by_time(estimates)
        estimates["fused"] = list(fuse(merged, port.yaw_period_rad, a.rate, name=str(a.recording)))
    tables = _error_tables(a, stream, estimates, port)
    reports = {m: error_table.report(table, len(estimates[m]) - len(table)) for m, table in tables.items()}
    summaries = {m: cells.summary(table) for m, table in tables.items()}
    if a.json:
        print(json.dumps({m: _as_json(reports[m], summaries[m]) for m in tables}, indent=1))
    else:
        _print_tables(reports, summaries)


def _truth(a: Namespace, stream: Stream) -> Trajectory:
    """The truth that is named, or that lies beside the recording, or that the arm of its rig gives."""
    if a.truth:
        return read_truth(a.truth)
    if stream.truth is not None:
        return stream.truth
    if rig := find_rig(a):
        with suppress(plugins.NotInstalled):
            return plugins.first("evaluate", plugins.TRUTHS, a.recording, rig)
    name, also = f"{a.recording.stem}.truth.csv", ""
    if a.recording.suffix == ".bag":
        also = f", or derive it from the arm with lmmap calibrate ({plugins.INSTALL})"
    raise InputError(f"{a.recording}: no ground truth beside it; give --truth, or name the file {name}{also}")


def _estimates(stream: Stream, estimator, rate_hz: float | None) -> list[Estimate]:
    """One camera's estimates."""
    with Bar(stream, estimator.modality) as bar:
        return [bar.add(e) for e in estimate(stream, estimator, rate_hz)]


def _error_tables(a: Namespace, stream: Stream, estimates: dict, port: Port) -> dict[str, pd.DataFrame]:
    """Errors (`error_table.errors`) of the modalities with data that the truth covers."""
    asked, data = ([a.modality], f"{a.modality} data") if a.modality else (list(estimates), "data")
    tables = {m: error_table.errors(stream, estimates.get(m, []), port) for m in asked}
    tables = {m: table for m, table in tables.items() if len(table)}
    if not tables:
        remedy = "try the other modality" if a.modality else "give a truth in the recording's own time"
        raise InputError(f"{a.recording}: holds no {data} that its truth covers; {remedy}")
    seen = max(tables, key=lambda m: tables[m].position_error_m.count())
    other_form = plugins.reader("truth_form")
    if other_form and (form := other_form(estimates[seen], stream.truth, port.yaw_period_rad)):
        warnings.warn(f"{a.truth or a.recording}: {form}", stacklevel=2)
    if missing := [m for m in asked if m not in tables]:
        text = f"{a.recording}: holds no {' and no '.join(missing)} data that its truth covers"
        warnings.warn(text, stacklevel=2)
    return tables


def _as_json(report: dict, summary: pd.DataFrame) -> dict:
    """The report, and the paper's table by ``filter/metric/variant/statistic``; None for what is unknown."""
    values = {"/".join(cell[:4]): value for *cell, value in summary.itertuples(index=False)}
    known = [{k: None if np.isnan(v) else v for k, v in part.items()} for part in (report, values)]
    return known[0] | {"table": known[1]}


def _print_tables(reports: dict[str, dict], summaries: dict[str, pd.DataFrame]) -> None:
    rows = [(name, [report[name] for report in reports.values()]) for name in next(iter(reports.values()))]
    filtered = next(iter(summaries.values())).query("variant == 'exact' and outlier_filter == 'with'")
    for k, row in filtered.iterrows():
        scale, unit = (1e3, "mm") if row.metric.endswith("_m") else (1, row.metric.rsplit("_", 1)[1])
        name = f"with outlier filter: {row.metric.rsplit('_', 1)[0]} {row.statistic} {unit}"
        rows.append((name, [scale * summary.value[k] for summary in summaries.values()]))
    width = max(len(name) for name, _ in rows)
    print(" " * width + "".join(f"{m:>10}" for m in reports))
    for name, values in rows:
        digits = 0 if isinstance(values[0], int) else 2
        numbers = "".join(f"{'-':>10}" if np.isnan(v) else f"{v:10.{digits}f}" for v in values)
        print(f"{name.replace('_', ' '):{width}}{numbers}")
