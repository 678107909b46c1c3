"""Differences of the tracker from its estimator, counted by hand."""

import pandas as pd
import pytest
from lab.studies.test_tracks import table

from lmmap_lab.provenance import DATA
from lmmap_lab.studies.track_gains import gains, of_full_test


def test_differences_are_counted_image_by_image():
    gained = gains(table("rrwnnrrrNR"), table("rrrrwrrwNR"))
    assert gained["right_points"] == pytest.approx(100 / 8)
    assert gained["wrong_points"] == pytest.approx(100 / 8)


def test_an_image_counts_that_shows_the_ring_to_both():
    assert gains(table("rrNr"), table("rrwN"))["wrong_points"] == 0


def test_a_change_of_every_image_is_no_chance_and_none_is_zero():
    sure, none = gains(table("n" * 60), table("r" * 60)), gains(table("rwn" * 20), table("rwn" * 20))
    assert [sure[f"right_{k}"] for k in ("points", "low", "high")] == [100] * 3
    assert set(none.values()) == {0.0}


def test_tables_of_other_images_are_refused():
    with pytest.raises(ValueError, match="expected 3 images, got 2"):
        gains(table("rrr"), table("rr"))


def test_in_the_full_test_they_are_those_of_the_rates():
    rates = (
        pd.read_csv(DATA / "results" / "tracks-paper.csv")
        .set_index(["light", "camera", "estimates"])
        .sort_index()
    )
    for row in of_full_test().itertuples():
        sides = rates.loc[row.light, row.camera]
        for what in ("right", "wrong"):
            told = sides.loc["tracked"] - sides.loc["frame by frame"]
            assert getattr(row, f"{what}_points") == pytest.approx(told[f"{what}_percent"], abs=0.06)
