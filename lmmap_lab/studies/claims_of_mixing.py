"""What the paper says of mixing learning and geometry, beside what a reader would build instead.

Each rule was settled before the first of these results was looked at.
"""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from lmmap.settings import MODALITIES

from ..provenance import DATA, load_table
from .table1 import LIGHTS
from .verdicts import row, short, verdict

PLACES, COST, CURVES, PICTURES = (
    DATA / "results" / "peers" / f"{name}.csv" for name in ("places", "cost", "curves", "pictures")
)
OURSELVES, PRINTED, GEOMETRY = "pipeline", "as printed", "geometry"  # methods of these tables
WORDS = {GEOMETRY: "geometry alone", "pnp": "points with PnP", "crop": "learned pose"}
ELSEWHERE = "second scene", "varied laboratories"
FEW_IMAGES = 100
AS_WELL_POINTS = 5.0  # of the right poses, in percent of the images
KEPT, MOST_WRONG_PERCENT = 0.9, 1.0  # of the test's right poses, and of the images


def claims_of_mixing() -> Iterator[dict]:
    """Rows of `verdicts.row`, from the committed study of the peers."""
    places = load_table(PLACES)
    yield _satellite_agnostic(places)
    yield _data_efficient(load_table(CURVES))
    yield _lightweight(places, load_table(COST))


def of_test(places: pd.DataFrame) -> pd.DataFrame:
    """Right, wrong and none, in percent of the images, and median errors: means over the three lights of the
    test by ``method, modality``."""
    lights = places[places.place.isin([f"{light} light" for light in LIGHTS])]
    return lights.groupby(["method", "modality"], sort=False).mean(numeric_only=True)


def _satellite_agnostic(places):
    """Whether networks that never saw a satellite find the port on it as well as on those of the test."""
    right = of_test(places).right_percent
    elsewhere = places[places.place.isin(ELSEWHERE)].set_index(["method", "modality", "place"])
    judged = {}
    for estimator, method in (("as_printed", PRINTED), ("ours", OURSELVES)):
        cells = [
            (elsewhere.loc[method, m, place], right[method, m]) for m in MODALITIES for place in ELSEWHERE
        ]
        holds = [cell.right_percent >= KEPT * test and cell.wrong_percent <= MOST_WRONG_PERCENT
                 for cell, test in cells]  # fmt: skip
        text = " | ".join(
            f"{short(test)} % right, elsewhere {short(min(a.right_percent, b.right_percent))} %, "
            f"wrong {short(max(a.wrong_percent, b.wrong_percent))} %"
            for (a, test), (b, _) in (cells[:2], cells[2:])
        )
        judged[estimator] = text, verdict(holds)
    return row(
        "satellite_agnostic",
        "in words",
        judged,
        f"in a second scene and in varied laboratories, which no network saw, at least {100 * KEPT:.0f} % of "
        f"the share of right poses on the test, and at most {MOST_WRONG_PERCENT:g} % wrong poses; partly: in "
        "one of them, or with one camera",
    )


def _data_efficient(curves):
    """Whether the pipeline is ahead where there are few labelled images."""
    few = curves[(curves.images_learned == FEW_IMAGES) & (curves.place == "test")]
    few = few.groupby(["method", "modality"])[["right_percent", "right_low", "right_high"]].mean()
    texts, ahead = [], []
    for m in MODALITIES:
        ours, peers = few.loc[OURSELVES, m], few.xs(m, level="modality").drop(OURSELVES)
        texts.append(f"{ours.right_percent:.0f} % right, the best peer {peers.right_percent.max():.0f} %")
        ahead.append(ours.right_low > peers.right_high.max())
    return row(
        "data_efficient",
        "in words",
        {"ours": (" | ".join(texts), verdict(ahead))},
        f"having learned from {FEW_IMAGES} labelled images, the pipeline has more right poses on the test "
        "than a network that learns a pose, or points for PnP, and the 95 % intervals do not overlap; "
        "partly: with one camera",
    )


def _lightweight(places, cost):
    """Whether nothing that does as well is lighter."""
    right, cost = of_test(places).right_percent, cost.set_index(["method", "modality"])
    judged = {}
    for estimator, method in (("as_printed", PRINTED), ("ours", OURSELVES)):
        texts, lightest = [], []
        for m in MODALITIES:
            own, peers = cost.loc[method, m], cost.xs(m, level="modality").drop([OURSELVES, PRINTED])
            lighter = [p for p in peers.index
                       if right[p, m] >= right[method, m] - AS_WELL_POINTS
                       and peers.parameters[p] < own.parameters and peers.gflop[p] < own.gflop]  # fmt: skip
            lightest.append(not lighter)
            named = ", ".join(WORDS.get(p, p) for p in lighter) or "none"
            texts.append(f"{right[method, m]:.0f} % right; as good and lighter: {named}")
        judged[estimator] = " | ".join(texts), verdict(lightest)
    return row(
        "lightweight",
        "in words",
        judged,
        f"no peer within {AS_WELL_POINTS:g} percentage points of its right poses on the test has fewer "
        "parameters and fewer operations; partly: with one camera",
    )
