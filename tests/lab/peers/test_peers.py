"""The peers: each one's law, and that all learn by the one loop."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from lmmap.evaluation.pose_errors import normal_error_rad, position_error_m, rotation_error_rad
from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import ideal_masks
from lmmap.geometry.projection import project_points
from lmmap.geometry.rotations import rotation_z
from lmmap.settings import OURS
from lmmap.types import EVENT, Camera, Estimate, Port, Pose, Recording, Status, Trajectory
from lmmap_lab.bench.laboratory import sequence, sequence_motion
from lmmap_lab.peers import crops, geometry, points, regression, samples, study, train
from lmmap_lab.training import dataset
from lmmap_lab.training.recipe import Recipe

CAMERA, PORT = Camera.davis346(), Port.lm_map()
BARREL = replace(CAMERA, distortion=(-0.2, 0.05, 0.0, 0.0))
POSES = Pose.stack([sequence_motion(sequence(f"realistic-{n}"), np.array([3.0])) for n in (1, 2, 4, 5)])


def drawn(T_cam_port: Pose) -> np.ndarray:
    """A dark frame with the ring and the markers in white."""
    return drawn_by(CAMERA, T_cam_port)


def drawn_by(camera: Camera, T_cam_port: Pose) -> np.ndarray:
    white = ideal_masks(T_cam_port, PORT, camera).max(0)
    return np.repeat((15 + 185 * white).astype(np.uint8)[..., None], 3, -1)


@pytest.mark.parametrize("detectors", [("contours",), ("templates",), geometry.DETECTORS])
def test_geometry_finds_a_drawn_ring(detectors):
    for pose in POSES[:2]:
        true = circle_ellipse(pose, PORT.ring_radius_m, CAMERA)
        u, v, *axes, _ = geometry.find_ring(drawn(pose), PORT, detectors)
        assert np.allclose((u, v), true.centre_px, atol=1.0)
        assert np.allclose(sorted(axes, reverse=True), true.semi_axes_px, atol=1.5)
    assert geometry.find_ring(np.zeros((260, 346, 3), np.uint8), PORT, detectors) is None


def test_geometry_gives_the_pose_of_a_drawn_port_and_none_of_an_empty_image():
    answer = geometry.estimator("rgb")
    for pose in POSES[1:3]:
        found = answer(drawn(pose)).found
        assert position_error_m(found, pose) < 0.002
        assert normal_error_rad(found, pose) < np.deg2rad(2)
        assert rotation_error_rad(found, pose, PORT.yaw_period_rad) < np.deg2rad(2)
    assert answer(np.zeros((260, 346, 3), np.uint8)).status == Status.NO_RING
    assert geometry.estimator("event")(np.zeros((260, 346), np.uint16)).status == Status.NO_RING


@pytest.mark.parametrize("camera", [CAMERA, BARREL])
def test_pnp_on_exact_points_in_any_order_returns_the_pose(camera, rng):
    for pose in POSES:
        at = project_points(pose, points.points_m(PORT), camera)
        shuffled = np.stack([rng.permutation(of_class) for of_class in at])
        found, confidence = points.solve(shuffled, np.ones(at.shape[:2]), PORT, camera)
        assert position_error_m(found, pose) < 1e-8
        assert rotation_error_rad(found, pose, PORT.yaw_period_rad) < 1e-7
        assert confidence == 1


def test_pnp_survives_lost_and_false_points(rng):
    at, heights = project_points(POSES[0], points.points_m(PORT), CAMERA), np.ones((points.CLASSES, 3))
    at[0, 0], heights[0, 0], at[5, 1] = np.nan, 0, (10, 10)
    found, confidence = points.solve(at, heights, PORT, CAMERA)
    assert position_error_m(found, POSES[0]) < 1e-8
    assert confidence == 1  # of points without noise
    assert points.solve(np.full_like(at, np.nan), 0 * heights, PORT, CAMERA) is None


def test_pnp_states_the_spread_of_its_rotations_and_half_the_height_doubles_its_scale(rng):
    exact = project_points(POSES[0], points.points_m(PORT), CAMERA)
    off_rad, stated_rad = [], []
    for _ in range(100):
        at, ones = exact + rng.normal(0, 0.5, exact.shape), np.ones(exact.shape[:2])
        found, confidence = points.solve(at, ones, PORT, CAMERA)
        off_rad.append(rotation_error_rad(found, POSES[0], PORT.yaw_period_rad))
        stated_rad.append(-OURS.right_normal_rad / np.log1p(-confidence))
        _, less = points.solve(at, ones / 2, PORT, CAMERA)
        assert (1 - less) ** 2 == pytest.approx(1 - confidence)
    assert np.sqrt(np.mean(np.square(stated_rad))) == pytest.approx(
        np.sqrt(np.mean(np.square(off_rad))), rel=0.12
    )


def test_peaks_of_heatmaps_are_their_points():
    at = project_points(POSES[1], points.points_m(PORT), CAMERA)
    found, heights = points.peaks(points.heatmaps(at, (260, 346)), 3)
    for true, seen in zip(at, found, strict=True):
        assert np.linalg.norm(true[:, None] - seen, axis=-1).min(1).max() < 0.05
    assert heights.min() > 0.8


def test_the_network_of_points_sees_the_whole_port():
    image = torch.rand(1, 3, 128, 128, requires_grad=True)
    points.network("rgb", 1 / 4)(image)[0, -1, 32, 32].backward()
    u, v = np.nonzero(image.grad[0].abs().sum(0).numpy())
    assert np.hypot(u - 64, v - 64).max() > 60  # a ring's diameter at 0.6 m


def test_a_pose_is_its_code_and_its_loss_does_not_know_a_third_of_a_turn():
    for pose in POSES:
        code = regression.encode_pose(pose)
        back = regression.decode_pose(code.astype(float))
        assert position_error_m(back, pose) < 1e-6
        assert rotation_error_rad(back, pose, PORT.yaw_period_rad) < 1e-6
        truth, answer = torch.from_numpy(code)[None], torch.zeros(1, regression.ANSWERS)
        for k in range(3):
            turned = Pose(pose.rotation @ rotation_z(k * PORT.yaw_period_rad), pose.position_m)
            answer[0, :9] = torch.from_numpy(regression.encode_pose(turned))
            assert regression.differences(answer, truth).max() < 1e-5
        answer[0, :9] = torch.from_numpy(
            regression.encode_pose(Pose(pose.rotation @ rotation_z(1.0), pose.position_m))
        )
        assert regression.differences(answer, truth)[0, 0] > 1


@pytest.mark.parametrize("mirror", [False, True])
def test_a_rolled_image_shows_the_rolled_pose(mirror):
    for pose in POSES:
        matrix, turned = samples.roll(pose, 0.7, mirror, CAMERA)
        image = samples.warp(drawn(pose), matrix, CAMERA.size_px)
        assert np.linalg.det(turned.rotation) == pytest.approx(1)
        expected = drawn(turned)
        around = project_points(turned, points.points_m(PORT), CAMERA).reshape(-1, 2)
        (left, top), (right, bottom) = np.rint([around.min(0), around.max(0)]).astype(int).clip(0)
        difference = np.abs(image.astype(int) - expected)[top:bottom, left:right]
        assert difference.mean() < 6


def test_a_crop_shows_the_port_as_a_camera_that_looks_at_it(rng):
    (width, height), radius_px = crops.SIZE_PX, crops.RING_PX
    for pose in POSES:
        about_m = pose.position_m + np.array([0.01, -0.01, 0.02])
        seen = crops.in_crop(pose, about_m)
        back = crops.from_crop(seen, about_m)
        assert (
            position_error_m(back, pose) < 1e-12
            and rotation_error_rad(back, pose, PORT.yaw_period_rad) < 1e-7
        )
        focal_px = radius_px * np.linalg.norm(about_m) / crops.RING_M
        looking = Camera(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)
        metres = Pose(seen.rotation, np.linalg.norm(about_m) * seen.position_m)
        difference = np.abs(crops.crop(drawn(pose), about_m, CAMERA) - drawn_by(looking, metres))
        assert difference.mean() < 8
        ring = circle_ellipse(metres, PORT.ring_radius_m, looking)
        assert ring.semi_axes_px[0] == pytest.approx(radius_px, rel=0.15)


@pytest.fixture(scope="module")
def drawn_samples(tmp_path_factory):
    """Ten sequences of two drawn frames, and their names."""
    folder = tmp_path_factory.mktemp("samples")
    names = [f"augmented-{k}" for k in range(10)]
    for k, name in enumerate(names):
        poses = POSES[np.array([k % 4, (k + 1) % 4])]
        frames = np.stack([drawn(pose) for pose in poses])
        matrices = np.concatenate([poses.rotation, poses.position_m[..., None]], -1)
        arrays = {"rgb": frames, "rgb_labels": (frames[..., 0] > 150).astype(np.uint8), "rgb_poses": matrices}
        dataset.write_samples(folder / name, arrays, "drawn")
    return folder, names


@pytest.mark.parametrize("peer", ["pnp", "pose", "crop"])
def test_a_peer_learns_goes_on_where_it_was_and_answers(drawn_samples, tmp_path, monkeypatch, peer):
    folder, names = drawn_samples
    for name in (peer, "pose"):
        monkeypatch.setitem(train.PEERS, name, train.PEERS[name]._replace(network=_small(name)))
    recipe = Recipe("ring", "rgb", steps=10, batch=2, rate=1e-3, warm_up=2)

    def run(where, peer=peer):
        return train.train(peer, recipe, tmp_path / where, folder, names, every=5, report=lambda line: None)

    whole = run("whole")
    curve = train.load_card(whole)["curve"]
    assert curve[-1]["loss"] < curve[0]["loss"]

    original = train.batch

    def killed(*args):
        if args[3] == 7:
            raise KeyboardInterrupt
        return original(*args)

    with monkeypatch.context() as patch:
        patch.setattr(train, "batch", killed)
        with pytest.raises(KeyboardInterrupt):
            run("cut")
    assert run("cut").read_bytes() == whole.read_bytes()

    if peer == "crop":
        run("whole", "pose")  # which says where to look
    answer = train.load(whole)(drawn(POSES[0]), 5)
    assert answer.t_us == 5
    assert 0 <= answer.confidence <= 1


def _small(peer):
    return {
        "pnp": lambda m, width: points.network(m, 1 / 4),
        "pose": lambda m, width: regression.network(m, 1 / 4),
        "crop": lambda m, width: crops.network(m, 1 / 4),
    }[peer]


def test_fewer_images_are_a_part_of_all(drawn_samples):
    folder, names = drawn_samples
    few = [samples.PosedSamples(names, "ring", "rgb", folder, 5, seed) for seed in (0, 0, 1)]
    places = [sample._places for sample in few]
    assert [len(p) for p in places] == [5, 5, 5]
    assert places[0] == places[1] != places[2]


def test_side_by_side(drawn_samples):
    t_us = np.array([0, 50_000])
    truth, frames = Trajectory(t_us, POSES[:2]), np.stack([drawn(pose) for pose in POSES[:2]])
    recording = Recording("drawn", CAMERA, np.zeros(0, EVENT), frames, t_us, truth)
    makes = {
        "geometry": geometry.estimator("rgb"),
        "never": lambda image, t_us=0: Estimate(t_us, Status.NO_RING),
        "doubts": lambda image, t_us=0: Estimate(t_us, Status.UNSURE, doubtful=POSES[t_us // 50_000]),
    }
    found = study.answered([recording], "rgb", makes)
    table = study.side_by_side(found)
    never = table.set_index("method").loc["never"]
    assert never.none_percent == 100 == never.every_none_percent
    doubts = table.set_index("method").loc["doubts"]
    assert doubts.none_percent == 100 == doubts.every_right_percent and doubts.position_error_m == 0
    assert np.allclose(table[list(study.SHARES)].sum(axis=1), 100)
    costs = study.cost(makes, frames[0]).set_index("method")
    assert (costs.parameters == 0).all() and (costs.ms_1 > costs.ms_1["never"]).geometry


def test_a_limit_allows_as_many_wrong_poses_as_it_may():
    t_us = np.arange(10)
    table = pd.DataFrame({"t_us": t_us, "in_view": True})
    known = pd.DataFrame({"t_us": t_us, "confidence": 0.9 - 0.1 * t_us[:10] / 2, "right": 1.0})
    known.loc[[4, 7], "right"] = 0
    known.loc[9, "right"] = np.nan
    for most, least in ((0, 0.75), (10, 0.6), (20, 0.5)):
        assert study.own_limit([table], [known], most) == pytest.approx(least)
    assert study.own_limit([table], [known.assign(right=0.0)], 5) == 1.0


def test_a_lens_that_no_network_saw_gives_the_same_image_to_the_networks():
    longer = replace(CAMERA, fx_px=405.0, fy_px=405.0, distortion=(-0.1, 0.02, 0.0, 0.0))
    seen = []
    answer = train.LearnedEstimator("pnp", points.network("rgb", 1 / 4), "rgb", longer)
    with pytest.MonkeyPatch.context() as patch:
        given = lambda net, image, *rest: seen.append(image)  # noqa: E731
        patch.setitem(train.PEERS, "pnp", train.PEERS["pnp"]._replace(answer=given))
        assert answer(drawn_by(longer, POSES[0])).status == Status.NO_MARKERS
    around = project_points(POSES[0], points.points_m(PORT), CAMERA).reshape(-1, 2)
    (left, top), (right, bottom) = np.rint([around.min(0), around.max(0)]).astype(int)
    assert np.abs(seen[0].astype(int) - drawn(POSES[0]))[top:bottom, left:right].mean() < 6
