"""Worst and missed answers are found, and drawn where their images are."""

import numpy as np
import pandas as pd

from lmmap import gallery
from lmmap.core import Estimate, Status
from lmmap.pipeline import images, shots
from lmmap.recordings import open_recording, read_estimates, write_estimates, write_npz
from lmmap.results import DATA

LABELS = {"mini-rgb": ("mini", "rgb"), "mini-event": ("mini", "event")}


def folder_of(tmp_path):
    """A recording, made-up errors and statuses at its images' times."""
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    write_npz(recording, tmp_path / "mini.npz")
    for k, (label, (_, modality)) in enumerate(LABELS.items()):
        times = [t_us for t_us, _ in images(recording, modality, rate_hz=5)]
        truth = recording.truth.at(np.array(times))
        found = [
            Estimate(t, Status.OK, truth[i]) if i % 2 else Estimate(t, Status.NO_RING)
            for i, t in enumerate(times)
        ]
        write_estimates(found, tmp_path / f"estimates-{label}.csv")
        error = [0.001 * i + 0.1 * k if i % 2 else np.nan for i in range(len(times))]
        table = pd.DataFrame({"t_us": times, "status": "ok", "in_view": True, "position_error_m": error})
        table.loc[1, "in_view"] = False
        table.to_csv(tmp_path / f"errors-{label}.csv", index=False)
    return tmp_path


def test_worst_come_first_and_misses_are_spread(tmp_path):
    folder = folder_of(tmp_path)
    worst, missed = gallery.worst(folder, LABELS, 3), gallery.missed(folder, LABELS, 2)
    assert worst.position_error_m.is_monotonic_decreasing and len(worst) == 3
    assert worst.modality.iloc[0] == "event" and worst.in_view.all()
    assert missed.position_error_m.isna().all() and missed.label.tolist() == ["mini-rgb", "mini-event"]
    assert gallery.missed(folder, LABELS, 100).label.value_counts().min() > 1

    rows = pd.concat([worst, missed])
    fig = gallery.draw(rows, folder, 5.0, columns=3)
    titles = [ax.get_title() for ax in fig.axes if ax.images]
    assert len(titles) == 5 and sum("no ring" in title for title in titles) == 2
    assert len(read_estimates(folder / "estimates-mini-rgb.csv")) > 5


def test_a_second_look_is_drawn_as_it_was_seen(tmp_path):
    folder = folder_of(tmp_path)
    shot = [s for s in shots(open_recording(folder / "mini.npz"), "event", rate_hz=5) if s.wider][-1]
    t_us, image = shot.wider
    write_estimates([Estimate(t_us, Status.NO_RING)], folder / "estimates-mini-event.csv")
    rows = pd.DataFrame([{"sequence": "mini", "modality": "event", "label": "mini-event", "t_us": t_us}])
    (ax,) = (ax for ax in gallery.draw(rows, folder, 5.0).axes if ax.images)
    shown = np.asarray(ax.images[0].get_array())
    assert shown.shape[:2] == image.shape
    assert np.count_nonzero(shown) == np.count_nonzero(image) > np.count_nonzero(shot.image)


def test_false_poses_are_all_poses_where_there_is_no_port(tmp_path):
    folder = folder_of(tmp_path)
    false = gallery.false_poses(folder, ["mini"])
    poses = sum(
        e.T_cam_port is not None for m in LABELS for e in read_estimates(folder / f"estimates-{m}.csv")
    )
    assert len(false) == poses > 0 and set(false.label) == set(LABELS)


def test_pictures_are_published_only_of_what_there_is(tmp_path):
    folder, target = folder_of(tmp_path), tmp_path / "out"
    target.mkdir()
    (target / "missed.jpg").write_text("of an earlier run")
    full = pd.read_csv(folder / "errors-mini-rgb.csv").assign(position_error_m=0.001)
    for label in LABELS:
        full.to_csv(folder / f"errors-{label}.csv", index=False)
    gallery.publish(folder, target, {"mini-rgb": LABELS["mini-rgb"]}, 5.0, [], 5.0)
    assert [path.name for path in target.iterdir()] == ["worst.jpg"]
    gallery.publish(folder, target, {"mini-rgb": LABELS["mini-rgb"]}, 5.0, ["mini"], 5.0)
    assert sorted(path.name for path in target.iterdir()) == ["false.jpg", "worst.jpg"]
