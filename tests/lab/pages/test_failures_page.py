"""The poses found in images, with what of them is reported."""

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
from lmmap_lab.pages import failures_page, gallery
from lmmap_lab.provenance import DATA

LABELS = {"mini-rgb": ("mini", "rgb")}


def found(folder, min_confidence: float):
    """Poses found by one look, where the estimator has this limit."""
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    write_recording(recording, folder / "mini.h5")
    limit = PerCamera(min_confidence, min_confidence)
    settings = replace(settings_for(recording.camera), min_confidence=limit, turned_look=False)
    estimator = Estimator(recording.camera, modality="rgb", settings=settings)
    write_estimates(list(estimate(recording, estimator, 5)), folder / "estimates-mini-rgb.csv")
    return failures_page.found_poses(folder, LABELS)


def test_the_pose_found_is_the_same_whatever_is_reported(tmp_path):
    free, strict = (found(tmp_path, limit) for limit in (0.0, 1.1))  # no probability is that high
    assert len(free) >= 4 and set(free.status) == {Status.OK} and set(strict.status) == {Status.UNSURE}
    np.testing.assert_allclose(strict.position_error_m, free.position_error_m, atol=1e-6)
    assert all(e.T_cam_port is not None for e in strict.answer)

    fig = gallery.draw(strict.head(2), tmp_path, 5, columns=2)
    assert all("mm" in ax.get_title() for ax in fig.axes)  # the pose found, though none is reported


def test_shares_are_of_all_images_by_hand():
    poses = pd.DataFrame({"position_error_m": [0.001, 0.2, 0.3, np.nan], "wrong": [False, True, True, False],
                          "sequence": "a", "modality": "rgb"})  # fmt: skip
    table = failures_page.share_table(poses, np.array([True, True, False, False]), {"a": "a scene"})
    shares = table.loc[("a scene", "frames")]
    assert shares["every pose"].tolist() == [25, 50] and shares["confident poses"].tolist() == [25, 25]
    assert shares["", "images"] == 4


def test_seen_rings_and_right_poses_are_counted_by_cell():
    seen = pd.DataFrame({"modality": ["rgb", "event"], "light": "high", "images": [10, 8], "seen": [8, 5],
                         "right": [6, 5]})  # fmt: skip
    table = failures_page.seen_table(seen)
    assert table.loc[("frames", "high light"), "right of seen (%)"] == 75
    assert table.loc[("events", "high light"), "right of seen (%)"] == 100
    below = seen[seen.right < 0.9 * seen.seen]
    assert failures_page.cells_in_words(below) == "frames in high light"
    three = pd.DataFrame({"modality": ["rgb", "event", "event"], "light": ["low", "low", "high"]})
    assert failures_page.cells_in_words(three) == "frames in low light, events in low and high light"
    four = pd.DataFrame({"modality": ["rgb"] * 3 + ["event"], "light": ["low", "medium", "high", "high"]})
    assert failures_page.cells_in_words(four) == "frames in every light, events in high light"


def test_a_limit_is_a_dot_on_its_curve_and_a_bar_of_a_hundred_percent():
    frames = pd.DataFrame({"limit": [0.0, 0.5, 0.9], "right_percent": [95.0, 94.0, 80.0],
                           "wrong_percent": [4.0, 2.0, 0.0], "modality": "rgb"})  # fmt: skip
    limits = pd.concat([frames, frames.assign(modality="event", right_percent=50.0)])
    left, bars = failures_page.draw_limit(limits, 0.5).axes
    curve, at, _, events_at = left.lines
    assert np.array_equal(curve.get_xydata(), [(4, 95), (2, 94), (0, 80)])
    assert np.array_equal(at.get_xydata(), [(2, 94)]) and np.array_equal(events_at.get_xydata(), [(2, 50)])
    assert [bar.get_width() for bar in bars.patches] == [94, 4, 2, 50, 48, 2]  # right, none, wrong
    assert bars.patches[2].get_x() == 98 and "right 94.0, none 4.0, wrong 2.0" in bars.texts[0].get_text()
    steps = failures_page.limit_steps(limits)
    assert [step.label for step in steps] == ["0", "0.5", "0.9"]
    assert steps[2].title == "frames: 80.0 % right, 0.0 % wrong; events: 50.0 % right, 0.0 % wrong"
    assert not np.array_equal(steps[0].image, steps[1].image)
