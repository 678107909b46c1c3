"""Chooses `BetweenSettings`, on sequences that neither train nor test anything.

    python tuning/tune_between.py

The first table is of events at the edges of the true poses: how far outward they lie, and how their scatter
falls with their number.  ``outward_px``, ``sigma_px`` and ``common_px`` are read off it.  The second is of
tracks: how late events are.  At each speed the 95 % region should hold 90 to 99 % of the true poses.  Of the
settings nearest to that, it takes the one with the best logarithmic score, which counts the speeds alike.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.stats import chi2

from lmmap.evaluation.pose_errors import pose_difference
from lmmap.settings import OURS
from lmmap.tracking.edges import EdgeFinder
from lmmap.types import Port
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_table
from lmmap_lab.studies import between_images

SECONDS = {"1.5": 4.0, "30": 2.0, "150": 2.0}
NUMBERS = {"1.5": (102,), "30": range(101, 107), "150": range(101, 107)}  # two of each light
SEQUENCES = [f"speed-{mm_s}-{n}" for mm_s, numbers in NUMBERS.items() for n in numbers]
FOLDER = DERIVED_DATA / "between"
LATE_US = (0, 3500)
INSIDE_PERCENT, SLACK = (90, 99), 1.0  # the goal, and what is as near to it
EVERY_US, HALF_US, LEAST_PX_S = 6000, 1000, 3.0


def residuals(recording, port: Port, gate_px: float) -> pd.DataFrame:
    """Number and summed distance of the events at each piece of an edge at true poses, by polarity."""
    finder, events, rows = EdgeFinder(port, recording.camera), recording.events, []
    last_us = min(events["t_us"][-1], recording.truth.t_us[-1]) - 2 * EVERY_US
    for t_us in range(100_000, int(last_us), EVERY_US):
        T = recording.truth.at(np.array([t_us - 5000, t_us, t_us + 5000]))
        velocity = pose_difference(T[:1], T[2:], port.yaw_period_rad)[0] / 0.01
        moves_px_s = finder.edges.jacobian(T[1], recording.camera) @ velocity
        usable = finder.edges.visible(T[1], port, recording.camera) & (np.abs(moves_px_s) > LEAST_PX_S)
        start, stop = np.searchsorted(events["t_us"], [t_us - HALF_US, t_us + HALF_US])
        count, sum_px = finder(events[start:stop], T[1], usable, gate_px)
        own = (moves_px_s > 0).astype(int)  # the polarity that the motion makes
        pieces = np.arange(len(own))
        rows.append(np.stack([count[own, pieces], sum_px[own, pieces], count[1 - own, pieces]], -1))
    table = pd.DataFrame(np.concatenate(rows), columns=["events", "sum_px", "other"])
    return table[table.events > 0].assign(sequence=recording.name)


def scatter(table: pd.DataFrame) -> pd.DataFrame:
    """By the number of events at a piece: outward distance, variance of their mean, other polarity."""
    groups = table.assign(mean_px=table.sum_px / table.events).groupby(
        [table.sequence.str.split("-").str[1], pd.cut(table.events, [0, 1, 3, 7, 1000])], observed=True
    )
    rows = groups.agg(pieces=("events", "size"), events=("events", "mean"), outward_px=("mean_px", "mean"),
                      variance_px2=("mean_px", "var"), other=("other", "mean"))  # fmt: skip
    return rows.rename_axis(["speed_mm_s", "number"]).reset_index().drop(columns="number")


def judged(cases, late_us: int, port: Port) -> dict:
    """A row of the grid: how tracks with events do on all cases."""
    late_sigma_us = OURS.between.late_sigma_us if late_us else 0.0
    settings = replace(OURS.between, late_us=late_us, late_sigma_us=late_sigma_us)
    followed = [(between_images.follow(r, a, port, settings), r) for r, a in cases]
    table = pd.concat([between_images.errors(f, r, port) for f, r in followed])
    table = table[table.method == between_images.METHODS[-1]]
    table["inside"] = 100 * (table.nees < chi2.ppf(0.95, 6))
    speeds = table.groupby(table.sequence.str.split("-").str[1])
    row = {"late_us": late_us, "score": speeds.score.mean().mean()}
    for mm_s, t in speeds:
        row |= {f"inside_percent_{mm_s}": t.inside.mean(), f"score_{mm_s}": t.score.mean(),
                f"position_mm_{mm_s}": t.position_mm.median(),
                f"rotation_deg_{mm_s}": t.rotation_deg.median()}  # fmt: skip
    return row


def choice(grid: pd.DataFrame) -> pd.Series:
    """Of the settings that are nearest to `INSIDE_PERCENT` at each speed, the best score."""
    inside = grid.filter(like="inside_percent")
    beyond = np.maximum(INSIDE_PERCENT[0] - inside, inside - INSIDE_PERCENT[1]).clip(0).sum(axis=1)
    return grid.loc[grid.score.where(beyond <= beyond.min() + SLACK).idxmax()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=("edges", "grid"), help="one table; default: both")
    parser.add_argument("--jobs", type=int, default=2)
    a, port = parser.parse_args(), Port.lm_map()
    seconds = {name: SECONDS[name.split("-")[1]] for name in SEQUENCES}
    recordings = [between_images.kept_recording(name, s, FOLDER) for name, s in seconds.items()]
    facts = {"command": "python tuning/tune_between.py", "sequences": SEQUENCES, "seconds": SECONDS}
    if a.only != "grid":
        edges = scatter(pd.concat([residuals(r, port, OURS.between.gate_px) for r in recordings]))
        save_table(DATA / "results" / "between" / "edges.csv", edges, **facts)
    if a.only != "edges":
        cases = [(r, between_images.kept_arrivals(r, FOLDER)) for r in recordings]
        tasks = (delayed(judged)(cases, late_us, port) for late_us in LATE_US)
        grid = pd.DataFrame(Parallel(n_jobs=a.jobs, max_nbytes=None)(tasks))
        save_table(DATA / "results" / "between" / "grid.csv", grid, **facts)
        print(grid.round(2).to_string())
        print("chosen:", choice(grid).to_dict())


if __name__ == "__main__":
    main()
