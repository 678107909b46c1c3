"""The claims of mixing, on tables made so that the verdict is known."""

import pandas as pd
import pytest

from lmmap.settings import MODALITIES
from lmmap_lab.studies import claims_of_mixing as mixing
from lmmap_lab.studies.claims_of_mixing import GEOMETRY, OURSELVES, PRINTED
from lmmap_lab.studies.verdicts import FAILS, HOLDS, PARTLY

METHODS = (GEOMETRY, "pnp", "pose", PRINTED, OURSELVES)
LIGHTS = ("low light", "medium light", "high light")


def places(ours=90.0, peers=50.0, elsewhere=1.0, wrong=0.5, modalities=MODALITIES):
    """Shares on the test, and elsewhere a part of them; cameras but ``modalities`` have what holds."""
    rows = []
    for method in METHODS:
        for m in MODALITIES:
            right, changed = ours if method in (OURSELVES, PRINTED) else peers, m in modalities
            rows += [(method, m, light, right + k, 0.0) for k, light in zip((-3, 0, 3), LIGHTS, strict=True)]
            rows += [(method, m, place, (elsewhere if changed else 1) * right, wrong if changed else 0.0)
                     for place in mixing.ELSEWHERE]  # fmt: skip
    return pd.DataFrame(rows, columns=["method", "modality", "place", "right_percent", "wrong_percent"])


def curves(ours=80.0, peers=60.0, half=5.0, modalities=MODALITIES):
    rows = []
    for method in ("pnp", "pose", OURSELVES):
        for m in MODALITIES:
            right = ours if method == OURSELVES else peers if m in modalities else 0.0
            rows.append((method, m, "test", mixing.FEW_IMAGES, right, right - half, right + half))
            rows.append((method, m, "test", 1000, peers, peers, peers))  # which decides nothing
    columns = ["method", "modality", "place", "images_learned", "right_percent", "right_low", "right_high"]
    return pd.DataFrame(rows, columns=columns)


def costs(**parameters):
    rows = [(method, m, parameters.get(method, 1e6), parameters.get(method, 1e6) / 1e6)
            for method in METHODS for m in MODALITIES]  # fmt: skip
    return pd.DataFrame(rows, columns=["method", "modality", "parameters", "gflop"])


@pytest.mark.parametrize("changed, verdict", [
    ({}, HOLDS), ({"elsewhere": 0.92}, HOLDS), ({"elsewhere": 0.88}, FAILS), ({"wrong": 1.2}, FAILS),
    ({"wrong": 1.2, "modalities": ("event",)}, PARTLY),
])  # fmt: skip
def test_satellites_that_no_network_saw_keep_nine_tenths_of_the_right_poses_and_hardly_any_wrong(
    changed, verdict
):
    row = mixing._satellite_agnostic(places(**changed))
    assert row["verdict"] == row["ours_verdict"] == row["as_printed_verdict"] == verdict


@pytest.mark.parametrize("changed, verdict", [
    ({}, HOLDS), ({"half": 12.0}, FAILS), ({"ours": 50.0}, FAILS),
    ({"half": 12.0, "modalities": ("rgb",)}, PARTLY),
])  # fmt: skip
def test_few_images_suffice_if_the_intervals_are_apart(changed, verdict):
    assert mixing._data_efficient(curves(**changed))["verdict"] == verdict


def test_it_is_lightweight_unless_a_peer_as_good_is_lighter():
    assert mixing._lightweight(places(), costs())["verdict"] == HOLDS
    assert mixing._lightweight(places(), costs(pnp=5e5))["verdict"] == HOLDS  # lighter, but not as good
    assert mixing._lightweight(places(peers=86.0), costs(pnp=5e5))["verdict"] == FAILS
    assert mixing._lightweight(places(peers=86.0), costs(pnp=2e6, pose=2e6, geometry=2e6))["verdict"] == HOLDS
    found = mixing._lightweight(places(peers=86.0), costs(geometry=0.0))
    assert found["verdict"] == FAILS and "lighter: geometry alone" in found["ours"]
