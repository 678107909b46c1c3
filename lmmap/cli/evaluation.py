"""``lmmap evaluate``: errors and detection rates of one recording, as the paper's table has them."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pandas as pd

from lmmap_lab.studies import pose_errors

from ..pipeline import run
from ..recordings.pose_files import read_truth
from ..recordings.stream import Stream
from ..tracking.fusion import fuse
from ..types import Estimate, InputError, Port
from .inputs import find_rig, make_estimator, open_input
from .progress import Bar

SINGLE = pose_errors.MODALITIES  # each camera alone


def evaluate(a) -> None:
    """Print the errors of each camera and of both."""
    stream = _with_truth(a, open_input(a))
    estimates, port = _estimates(a, stream)
    tables = _error_tables(a, stream, estimates, port)
    if a.json:
        print(json.dumps({m: _as_json(table) for m, table in tables.items()}, indent=1))
    else:
        _print_tables(tables)


def _with_truth(a, stream: Stream) -> Stream:
    """The stream with the truth that is named, or that lies beside it, or that its arm's motion gives."""
    if a.truth:
        stream = replace(stream, truth=read_truth(a.truth))
    elif stream.truth is None and (rig := find_rig(a.recording)):
        stream = replace(stream, truth=rig.truth(a.recording))
    if stream.truth is None:
        name = f"{a.recording.stem}.truth.csv"
        also = "; or from its arm, with lmmap calibrate" if a.recording.suffix == ".bag" else ""
        raise InputError(f"{a.recording}: no ground truth beside it; name it by --truth, or as {name}{also}")
    return stream


def _estimates(a, stream: Stream) -> tuple[dict[str, list[Estimate]], Port]:
    """Estimates of each modality that is evaluated, and the port that they are of."""
    if a.as_printed and a.modality == "fused":
        raise InputError("--as-printed: the paper fuses nothing; give --modality rgb or event")
    estimates = {}
    for modality in [a.modality] if a.modality in SINGLE else SINGLE:
        estimator = make_estimator(a, stream.camera, modality)
        estimates[modality], poses = [], 0
        with Bar(stream, modality) as bar:
            for e in run.estimate(stream, estimator, a.rate):
                estimates[modality].append(e)
                poses += e.T_cam_port is not None
                bar.show(e.t_us, len(estimates[modality]), poses)
    if all(estimates.values()) and a.modality not in SINGLE and not a.as_printed:
        estimates["fused"] = list(fuse(run.merge_by_time(estimates), estimator.port.yaw_period_rad, a.rate))
    return estimates, estimator.port


def _error_tables(a, stream: Stream, estimates: dict, port: Port) -> dict[str, pd.DataFrame]:
    """Errors (`pose_errors.errors`) of the modalities with data that the truth covers."""
    tables = {}
    for modality in [a.modality] if a.modality else estimates:
        table = pose_errors.errors(stream, estimates.get(modality, []), port)
        if len(table):
            tables[modality] = table
        elif a.modality:
            raise InputError(f"{a.recording}: holds no {modality} data that its truth covers; try the other")
    if not tables:
        raise InputError(f"{a.recording}: holds no data that its truth covers; check the truth's times")
    if missing := [m for m in estimates if m not in tables]:
        warnings.warn(f"{a.recording}: holds no {' and no '.join(missing)} data that its truth covers",
                      stacklevel=2)  # fmt: skip
    return tables


def _as_json(table: pd.DataFrame) -> dict:
    """The report, and the paper's table by ``filter/metric/variant/statistic``; None for what is unknown."""
    keys = ["outlier_filter", "metric", "variant", "statistic"]
    rows = pose_errors.summary(table).set_index(keys)["value"].replace({np.nan: None})
    report = {k: None if np.isnan(v) else v for k, v in pose_errors.report(table).items()}
    return report | {"table": {"/".join(k): v for k, v in rows.items()}}


def _print_tables(tables: dict[str, pd.DataFrame]) -> None:
    reports = {m: pose_errors.report(table) for m, table in tables.items()}
    summaries = {m: pose_errors.summary(table) for m, table in tables.items()}
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
        cells = "".join(f"{'-':>10}" if np.isnan(v) else f"{v:10.{digits}f}" for v in values)
        print(f"{name.replace('_', ' '):{width}}{cells}")
