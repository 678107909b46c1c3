"""The former and the present answers to the same images."""

from dataclasses import replace

import numpy as np
import pandas as pd

from lmmap.estimation.estimates import estimate
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import settings_for
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import write_estimates
from lmmap.settings import PerCamera
from lmmap.types import Status
from lmmap_lab.bench.writers import write_recording
from lmmap_lab.pages import failures_page
from lmmap_lab.provenance import DATA

LABELS = {"mini-rgb": ("mini", "rgb")}


def answered(folder, min_confidence: float):
    """Both answers by one look, where the present estimator has this limit."""
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    write_recording(recording, folder / "mini.h5")
    settings = replace(
        settings_for(recording.camera),
        min_confidence=PerCamera(min_confidence, min_confidence),
        turned_look=False,
    )
    estimator = Estimator(recording.camera, modality="rgb", settings=settings)
    write_estimates(list(estimate(recording, estimator, 5)), folder / "estimates-mini-rgb.csv")
    return failures_page.both_answers(folder, LABELS)


def test_without_a_limit_the_former_and_the_present_answers_are_the_same(tmp_path):
    answers = answered(tmp_path, 0.0)
    assert len(answers) >= 4 and answers.position_error_m.notna().all()
    np.testing.assert_array_equal(answers.former_position_error_m, answers.position_error_m)


def test_what_the_limit_refuses_the_former_estimator_reports(tmp_path):
    free = answered(tmp_path, 0.0)
    strict = answered(tmp_path, 1.1)  # no probability is that high
    assert set(strict.status) == {Status.UNSURE} and strict.position_error_m.isna().all()
    np.testing.assert_allclose(strict.former_position_error_m, free.position_error_m, atol=1e-6)

    shares = failures_page.share_table(strict, {"mini": "a second"})
    assert shares.loc[("a second", "frames"), ("former", "right (%)")] == 100
    assert shares.loc[("a second", "frames"), ("present", "no pose (%)")] == 100

    fig = failures_page.draw_answers(strict.head(2), tmp_path, 5)
    titles = [ax.get_title() for ax in fig.axes]
    assert len(titles) == 4 and sum("former: " in title for title in titles) == 2
    assert sum("now: unsure" in title for title in titles) == 2


def test_seen_rings_and_right_poses_are_counted_by_cell():
    seen = pd.DataFrame({"modality": ["rgb", "event"], "light": "high", "images": [10, 8], "seen": [8, 5],
                         "right": [6, 5]})  # fmt: skip
    table = failures_page.seen_table(seen)
    assert table.loc[("frames", "high light"), "right of seen (%)"] == 75
    assert table.loc[("events", "high light"), "right of seen (%)"] == 100
    below = seen[seen.right < 0.9 * seen.seen]
    assert failures_page.cells_in_words(below) == "frames in high light"


def test_each_limit_is_a_dot_and_only_some_have_labels():
    limits = pd.DataFrame({"limit": [0.0, 0.5, 0.9], "right_percent": [95.0, 94.0, 80.0],
                           "wrong_percent": [4.0, 2.0, 0.0], "light": "high", "modality": "rgb"})  # fmt: skip
    other = limits.assign(light="low", right_percent=99.0)
    (ax,) = failures_page.draw_limits(pd.concat([limits, other]), "high", (0.0, 0.9)).axes
    line, events = ax.lines
    assert not len(events.get_xdata())
    assert np.array_equal(line.get_xydata(), [(4, 95), (2, 94), (0, 80)])
    assert [(text.get_text(), text.xy) for text in ax.texts] == [("0", (4, 95)), ("0.9", (0, 80))]
