"""The ladder on drawn masks: its ends are the two estimators, and the rungs between change one thing each."""

import numpy as np
import pytest
from strategies import CAMERA, PORT, pose

from lmmap import Estimator, PrintedEstimator
from lmmap.estimation.images import TimedImage
from lmmap.evaluation.pose_errors import normal_error_rad
from lmmap.geometry.port import ideal_masks
from lmmap.pipeline.crops import crop_bounds
from lmmap.pipeline.weights import load_networks
from lmmap.types import EVENT, Pose, Recording, Status, Trajectory
from lmmap_lab.studies import ladder

T = pose((190, 120), 0.5, np.deg2rad(35), 0.6, 0.4)
IMAGE = np.zeros((260, 346, 3), np.uint8)


class Drawn:
    """A network that draws what it should find, and counts how often it is asked."""

    def __init__(self, mask):
        self.mask, self.calls = mask, 0

    def __call__(self, image):
        self.calls += 1
        return self.mask


@pytest.fixture(scope="module")
def climbed():
    ring, markers = (Drawn(mask) for mask in ideal_masks(T, PORT, CAMERA))
    ours, rungs = ladder.Ladder(Estimator(CAMERA, PORT, weights=(ring, markers)))(TimedImage(7, IMAGE))
    return ring, ours, rungs


def same_pose(a: Pose, b: Pose) -> bool:
    return np.array_equal(a.rotation, b.rotation) and np.array_equal(a.position_m, b.position_m)


def test_the_ends_of_the_ladder_are_the_two_estimators(climbed):
    _, ours, rungs = climbed
    masks = tuple(lambda _, mask=mask: mask for mask in ideal_masks(T, PORT, CAMERA))
    alone = Estimator(CAMERA, PORT, weights=masks)(IMAGE, 7)
    printed = PrintedEstimator(CAMERA, PORT, weights=masks)(IMAGE, 7)
    assert list(rungs) == list(ladder.MEASURED)
    assert same_pose(ours.T_cam_port, alone.T_cam_port)
    assert same_pose(rungs["ring and markers"].T_cam_port, alone.T_cam_port)
    assert same_pose(rungs["fine yaw"].T_cam_port, alone.printed)
    assert same_pose(rungs["as printed"].T_cam_port, printed.T_cam_port)


def test_the_ring_filter_looks_once_and_the_exact_circle_takes_the_bias_away(climbed):
    ring, _, rungs = climbed
    assert ring.calls == 1
    error_deg = {name: np.rad2deg(float(normal_error_rad(e.T_cam_port, T))) for name, e in rungs.items()}
    for name in ("as printed", "robust ellipse", "sub-pixel contour", "fine yaw"):
        assert error_deg[name] > 2
    assert error_deg["exact circle"] < 0.5 and error_deg["ring and markers"] < 0.5


def test_a_mask_without_a_ring_has_its_status_on_every_rung():
    ours, rungs = ladder.Ladder(Estimator(CAMERA, PORT, weights=(Drawn(0 * IMAGE[..., 0]),) * 2))(
        TimedImage(7, IMAGE)
    )
    assert {e.status for e in (ours, *rungs.values())} == {Status.NO_RING}


def test_a_remembered_mask_belongs_to_its_image():
    network = Drawn(np.zeros((2, 2)))
    remembered = ladder.Remembered(network, images=1)
    first, second = np.zeros(1), np.ones(1)
    for image, calls in ((first, 1), (first.copy(), 1), (second, 2), (first, 3)):
        remembered(image)
        assert network.calls == calls


def test_a_network_that_remembers_is_asked_for_the_same_crops():
    """Its stride and reach are known, so reflectors are not sought in the whole image."""
    network = load_networks("low", "rgb")[1]
    box = (100, 90), (180, 160), CAMERA.size_px
    bounds = crop_bounds(*box, network)
    assert crop_bounds(*box, ladder.Remembered(network)) == bounds != crop_bounds(*box, Drawn(None))


def test_cells_of_every_rung_by_hand(climbed):
    """Right on the upper rungs; printed normals, here by more than 5 deg, are wrong."""
    _, _, rungs = climbed
    t_us = np.array([0, 10**6])
    truth = Trajectory(t_us, Pose(np.stack([T.rotation] * 2), np.stack([T.position_m] * 2)))
    frames = np.zeros((0, 260, 346, 3), np.uint8)
    recording = Recording("r", CAMERA, np.empty(0, EVENT), frames, np.zeros(0, np.int64), truth)
    table = ladder.errors(recording, [rungs] * 4, PORT)
    assert list(table) == ladder.COLUMNS and len(table) == 4 * len(ladder.MEASURED)
    top = table[table.rung == "ring and markers"]
    cells = ladder.summary([table], [top], [top.assign(position_error_m=0.03)], draws=20, seed=0)
    assert set(cells.rung) == set(ladder.RUNGS) and cells.groupby("rung").size().nunique() == 1
    wrong = cells[(cells.metric == "wrong_percent") & (cells.outlier_filter == "without")]
    printed_deg = table[table.rung == "as printed"].normal_error_deg.iloc[0]
    expected = {"as printed": 100.0 * (printed_deg > 5), "confident": 0.0, "fused": 100.0}
    for rung, percent in expected.items():
        assert wrong.set_index("rung").value[rung] == percent
    assert (cells.low <= cells.value + 1e-12).all() and (cells.value <= cells.high + 1e-12).all()
