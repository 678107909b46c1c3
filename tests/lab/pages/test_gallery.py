"""Worst and missed answers are found, and drawn where their images are."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.estimation.images import images, timed_images
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import read_estimates, write_estimates
from lmmap.types import Estimate, Status
from lmmap_lab.bench.writers import write_recording
from lmmap_lab.pages import gallery
from lmmap_lab.provenance import DATA

LABELS = {"mini-rgb": ("mini", "rgb"), "mini-event": ("mini", "event")}


def folder_of(tmp_path):
    """A recording, made-up errors and statuses at its images' times."""
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    write_recording(recording, tmp_path / "mini.h5")
    for k, (label, (_, modality)) in enumerate(LABELS.items()):
        times = [t_us for t_us, _ in images(recording, modality, rate_hz=5)]
        truth = recording.truth.at(np.array(times))
        estimates = [
            Estimate(t, Status.OK, truth[i]) if i % 2 else Estimate(t, Status.NO_RING)
            for i, t in enumerate(times)
        ]
        write_estimates(estimates, tmp_path / f"estimates-{label}.csv")
        error = [0.001 * i + 0.1 * k if i % 2 else np.nan for i in range(len(times))]
        table = pd.DataFrame({"t_us": times, "status": "ok", "in_view": True, "position_error_m": error})
        table.loc[1, "in_view"] = False
        table.to_csv(tmp_path / f"errors-{label}.csv", index=False)
    return tmp_path


def test_worst_come_first_and_misses_are_drawn_by_lot(tmp_path):
    folder = folder_of(tmp_path)
    worst, missed = gallery.worst(folder, LABELS, 3), gallery.missed_images(folder, LABELS, 2)
    assert worst.position_error_m.is_monotonic_decreasing and len(worst) == 3
    assert worst.modality.iloc[0] == "event" and worst.in_view.all()
    assert missed.position_error_m.isna().all() and len(missed) == 2
    assert gallery.missed_images(folder, LABELS, 100).label.value_counts().min() > 1

    rows = pd.concat([worst, missed])
    fig = gallery.draw(rows, folder, 5.0, columns=3)
    titles = [ax.get_title() for ax in fig.axes if ax.images]
    assert len(titles) == 5 and sum("no ring" in title for title in titles) == 2
    assert len(read_estimates(folder / "estimates-mini-rgb.csv")) > 5


def test_a_second_look_is_drawn_as_it_was_seen(tmp_path):
    folder = folder_of(tmp_path)
    shot = [s for s in timed_images(open_recording(folder / "mini.h5"), "event", rate_hz=5) if s.wider][-1]
    t_us, image = shot.wider
    write_estimates([Estimate(t_us, Status.NO_RING)], folder / "estimates-mini-event.csv")
    rows = pd.DataFrame([{"sequence": "mini", "modality": "event", "label": "mini-event", "t_us": t_us}])
    (ax,) = (ax for ax in gallery.draw(rows, folder, 5.0).axes if ax.images)
    shown = np.asarray(ax.images[0].get_array())
    assert shown.shape[:2] == image.shape
    assert np.count_nonzero(shown) == np.count_nonzero(image) > np.count_nonzero(shot.image)


def test_false_poses_are_all_poses_where_there_is_no_port(tmp_path):
    folder = folder_of(tmp_path)
    false = gallery.false_poses(folder, LABELS)
    poses = sum(
        e.T_cam_port is not None for m in LABELS for e in read_estimates(folder / f"estimates-{m}.csv")
    )
    assert len(false) == poses > 0 and set(false.label) == set(LABELS)


def test_what_is_missed_in_all_is_missed_in_its_own_sequence(tmp_path):
    """So pictures drawn sequence by sequence hold those of all together."""
    folder = folder_of(tmp_path)
    for kind in (gallery.worst, gallery.missed_images):
        every = kind(folder, LABELS, 2)
        own = pd.concat(kind(folder, {label: of}, 2) for label, of in LABELS.items())
        assert len(every) == 2 < len(own)
        assert len(own.merge(every, on=["label", "t_us"])) == 2


def test_pictures_are_published_only_of_what_there_is(tmp_path):
    folder, target = folder_of(tmp_path), tmp_path / "out"
    target.mkdir()
    (target / "missed.jpg").write_text("of an earlier run")
    full = pd.read_csv(folder / "errors-mini-rgb.csv").assign(position_error_m=0.001)
    for label in LABELS:
        full.to_csv(folder / f"errors-{label}.csv", index=False)
    recording, labels = open_recording(folder / "mini.h5"), {"mini-rgb": LABELS["mini-rgb"]}
    kept = gallery.save_tiles(recording, folder, labels, 5.0)
    kept += gallery.save_tiles(replace(recording, truth=None), folder, LABELS, 5.0)
    (folder / "mini.h5").unlink()
    gallery.save_sheets(folder, target, labels, {})
    assert [path.name for path in target.iterdir()] == ["worst.jpg"]
    gallery.save_sheets(folder, target, labels, LABELS)
    assert sorted(path.name for path in target.iterdir()) == ["false.jpg", "worst.jpg"]
    tile, sheet = plt.imread(kept[0]), plt.imread(target / "worst.jpg")
    lines = -(-min(len(full), 10) // gallery.COLUMNS)
    assert sheet.shape == (lines * tile.shape[0], gallery.COLUMNS * tile.shape[1], 3)
