"""Before and after of places, by hand."""

import pandas as pd
import pytest

from lmmap_lab.studies import places


def images():
    """Two places in low light; the networks of the second were not taken."""
    rows = [("scene-61002:20", "before", k < 2, k == 2) for k in range(4)]
    rows += [("scene-61002:20", "after", k < 3, False) for k in range(4)]
    rows += [("scene-61005:20", "before", True, False) for _ in range(4)]
    table = pd.DataFrame(rows, columns=["learned_on", "when", "right", "wrong"]).assign(modality="event")
    return table.assign(judged_on=table.learned_on)


def elsewhere():
    """The same, with the first place's networks judged on two other recordings as well."""
    first = images()[:8]
    return pd.concat(
        [images(), first.assign(judged_on="scene-61004:20"), first.assign(judged_on="scene-61003:20")]
    )


@pytest.mark.parametrize(
    "place, light",
    [
        ("scene-61002:20", "low"),
        ("realistic-4:5", "medium"),
        ("varied-3003:20", "high"),
        ("varied-3001:2", "medium"),
    ],
)
def test_a_place_has_the_light_of_its_sequence(place, light):
    assert places.light_of(place) == light


def test_networks_that_were_not_taken_leave_all_as_it_was():
    right = places.by_recording(images())["right"].droplevel(["light", "judged_on", "modality"])
    assert right.loc["scene-61002:20"].to_dict() == {"before": 50, "after": 75}
    assert right.loc["scene-61005:20"].to_dict() == {"before": 100, "after": 100}


def test_what_other_recordings_judge_is_apart():
    pd.testing.assert_frame_equal(places.own(elsewhere()), images())
    table = places.carried(elsewhere(), "event")
    assert table.index.tolist() == [("low", "high"), ("low", "medium")]
    assert table["right"].loc[("low", "high")].to_dict() == {"before": 2, "after": 3}
    assert table["wrong"].loc[("low", "medium")].to_dict() == {"before": 1, "after": 0}
    assert (table["images"] == 4).all(axis=None)


def test_means_are_over_recordings_within_their_intervals():
    cells = places.means(images()).set_index("when")
    assert cells.right_percent.to_dict() == {"before": 75, "after": 87.5}
    assert cells.wrong_percent.to_dict() == {"before": 12.5, "after": 0}
    assert (cells.recordings == 2).all() and (cells.images == 8).all()
    assert (cells.right_low <= cells.right_percent).all()
    assert (cells.right_percent <= cells.right_high).all()


def test_means_of_a_camera_are_over_the_recordings_of_all_lights():
    both = pd.concat([images(), images().replace({"scene-61005:20": "scene-61004:20"})])
    cells = places.means(both, ["modality"]).set_index(["modality", "when"])
    assert cells.recordings.tolist() == [3, 3] and cells.images.tolist() == [16, 16]
    assert cells.right_percent["event", "after"] == pytest.approx((75 + 100 + 100) / 3)


def test_what_loses_most_is_the_largest_fall():
    assert places.most_lost(images()) == 0
    turned = images().replace({"before": "after", "after": "before"})[:8]
    assert places.most_lost(turned) == 25


def test_a_confidence_is_judged_by_the_poses_that_are_reported():
    seen = images().assign(status="ok", confidence=0.85)
    seen.loc[[3, 7], "status"] = "unsure"  # neither right nor wrong
    seen.loc[2, "confidence"] = 0.97  # of the wrong one
    before, after = (places.reported(seen, when)["event"] for when in places.WHEN)
    assert before.poses.tolist() == [6, 1] and before.right.tolist() == [1, 0]
    assert after.poses.tolist() == [7] and after.right.tolist() == [1]


def test_what_was_learned_from_more_seconds_is_apart():
    first = images()[:8]
    table = places.by_seconds(pd.concat([
        images().assign(weights="high", seconds=20.0), first[:4].assign(weights="high", seconds=0.0),
        first[:4].assign(weights="low", seconds=0.0)]))  # fmt: skip
    right = table.set_index(["weights", "seconds"]).right_percent
    assert right.to_dict() == {("high", 0): 50, ("high", 20): 87.5, ("low", 0): 50}
    assert table.images.tolist() == [4, 8, 4]
