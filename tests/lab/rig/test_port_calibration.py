"""A port measured from images: exact edges give its dimensions exactly, noisy ones as well as promised, and a
recording of a higher plate gives that height."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from strategies import facing_pose

from lmmap.cli import main
from lmmap.errors import InputError
from lmmap.geometry.conics import circle_conic
from lmmap.geometry.projection import project
from lmmap.geometry.rotations import rotation_angle_rad
from lmmap.pipeline.estimator import Estimator
from lmmap.types import Pose
from lmmap_lab.bench import sequences
from lmmap_lab.bench.writers import WRITERS
from lmmap_lab.provenance import DATA
from lmmap_lab.rig import port_calibration, port_views
from lmmap_lab.rig.port_calibration import adjust
from lmmap_lab.rig.port_outline import (
    OF_RING,
    RING_POINTS,
    dimensions_m,
    outline,
    windows_share,
    with_dimensions,
)


def batch(poses) -> Pose:
    return Pose(np.stack([T.rotation for T in poses]), np.stack([T.position_m for T in poses]))


def views(rng, count=24, tilt_deg=45.0, depths_m=(0.4, 0.9), aside=0.1) -> Pose:
    """Poses of all azimuths, tilts up to the given one, distances between the given ones, and as far aside
    as given, in units of the distance."""
    tilt_rad = np.deg2rad(tilt_deg) * np.sqrt(rng.uniform(0, 1, count))
    depth_m = np.exp(rng.uniform(*np.log(depths_m), count))
    angles = rng.uniform(-np.pi, np.pi, (2, count))
    xy = rng.uniform(-aside, aside, (2, count))
    return batch([facing_pose(t, a, yaw, [x * z, y * z, z])
                  for t, a, yaw, x, y, z in zip(tilt_rad, *angles, *xy, depth_m, strict=True)])  # fmt: skip


def disturbed(T, rng) -> Pose:
    """Poses some millimetres and a degree beside these."""
    turns = [facing_pose(*rng.normal(0, 0.01, 3), np.zeros(3)).rotation for _ in range(len(T))]
    facing = np.diag([1.0, -1.0, -1.0])
    return Pose(np.stack(turns) @ facing @ T.rotation, T.position_m + rng.normal(0, 0.003, (len(T), 3)))


class ExactEdges:
    """Gaps to the edges that a port has in a camera's images, ``error_px`` (N, K) beyond them."""

    def __init__(self, T, port, camera, error_px=0.0):
        self.error_px = error_px
        radii_m = port.ring_outer_radius_m, port.ring_inner_radius_m
        self.conics = np.stack([circle_conic(T, radius_m, camera) for radius_m in radii_m], 1)
        corners = project(T[:, None, None] @ port.marker_corners_m(), camera)  # (N, S, 4, 2)
        self.corner, self.side = (
            v.reshape(len(T), -1, 1, 2) for v in (corners, np.roll(corners, -1, 2) - corners)
        )

    def __call__(self, at, normal):
        p, d = (np.concatenate([v, np.full_like(v[..., :1], last)], -1) for v, last in ((at, 1), (normal, 0)))
        p, d = (v[:, OF_RING].reshape(len(v), 2, RING_POINTS, 3) for v in (p, d))
        C = self.conics[:, :, None]
        a, b, c = (np.einsum("nrki,nrkij,nrkj->nrk", u, np.broadcast_to(C, (*u.shape, 3)), v)
                   for u, v in ((d, d), (d, p), (p, p)))  # fmt: skip
        nearer = -c / (b + np.sign(b) * np.sqrt(b * b - a * c))  # (p + u d)' C (p + u d) = 0
        start, n = (v[:, OF_RING.stop :].reshape(*self.side.shape[:2], -1, 2) for v in (at, normal))
        across = self.side[..., ::-1] * [1, -1]
        on_side = np.sum((self.corner - start) * across, -1) / np.sum(n * across, -1)
        return np.concatenate([nearer.reshape(len(at), -1), on_side.reshape(len(at), -1)], 1) + self.error_px


OTHER = np.array([1.2, 1.08, 0.95, 1.1, 1.2])  # a port's dimensions in units of the standard port's


@pytest.mark.parametrize("factors, growth, share", [
    ([1, 1, 1, 1, 1], 1, 1), ([2, 1.2, 1.2, 1.2, 2], 1.2, 1), ([1, 1, 1.2, 1, 1], 1, 0.9)])  # fmt: skip
def test_windows_grow_with_the_plate_and_give_way_to_the_markers(port, factors, growth, share):
    other = with_dimensions(port, factors * dimensions_m(port))
    assert np.allclose(dimensions_m(other), factors * dimensions_m(port))
    grown = growth * np.array([port.window_radius_m, *port.window_size_m])
    assert np.allclose([other.window_radius_m, *other.window_size_m], grown * [1, share, share])
    assert windows_share(other, port) == pytest.approx(share)


def test_dimensions_that_no_port_has_are_an_error(port):
    with pytest.raises(ValueError, match="radius of the ring"):
        with_dimensions(port, [1, 1, 1, 1, 20] * dimensions_m(port))


@pytest.mark.parametrize("focal", [False, True])
def test_exact_edges_give_the_port_to_a_micrometre(port, camera, rng, focal):
    T, other = views(rng), with_dimensions(port, OTHER * dimensions_m(port))
    assumed = replace(camera, fx_px=0.94 * camera.fx_px, fy_px=0.94 * camera.fy_px) if focal else camera
    fit = adjust(disturbed(T, rng), ExactEdges(T, other, camera), port, assumed, focal)
    assert fit.settled and fit.kept.all()
    np.testing.assert_allclose(dimensions_m(fit.port), dimensions_m(other), atol=1e-6)
    assert np.isclose(fit.focal_ratio, 1 / 0.94 if focal else 1, atol=1e-6)
    assert np.max(rotation_angle_rad(np.swapaxes(T.rotation, 1, 2) @ fit.T_cam_port.rotation)) < 1e-5
    np.testing.assert_allclose(fit.T_cam_port.position_m, T.position_m, atol=1e-5)


def test_derivatives_are_those_of_the_gaps(port, camera, rng):
    """What closes a gap to exact edges is the change that made it, to first order."""
    T, shared, h = views(rng, 4), np.append(dimensions_m(port), np.zeros(8)), 1e-6
    edges = ExactEdges(T, port, camera)
    _, J_pose, J_shared = port_calibration.linearise(T, shared, edges, port, camera)
    for k in (0, 1, 2, 3, 4, 9, 10, 11, 12):
        gap_px, _, _ = port_calibration.linearise(T, shared + h * np.eye(13)[k], edges, port, camera)
        np.testing.assert_allclose(-gap_px / h, J_shared[..., k], atol=2e-3 * np.abs(J_shared[..., k]).max())
    for k in range(6):
        moved = port_calibration._moved(T, np.tile(h * np.eye(6)[k], (4, 1)))
        gap_px, _, _ = port_calibration.linearise(moved, shared, edges, port, camera)
        np.testing.assert_allclose(-gap_px / h, J_pose[..., k], atol=2e-3 * np.abs(J_pose[..., k]).max())


def test_a_distorted_camera_has_its_edges_where_its_lens_puts_them(port, camera, rng):
    """Of points on the distorted outline itself the gap is zero, and no step is made."""
    lens = replace(camera, distortion=(-0.3, 0.1, 0.001, -0.001))
    T = views(rng, 14)
    fit = adjust(T, lambda at, normal: np.zeros(at.shape[:2]), port, lens)
    np.testing.assert_allclose(dimensions_m(fit.port), dimensions_m(port), atol=1e-12)


def test_masks_that_are_wider_on_all_sides_change_no_height(port, camera, rng):
    T, other = views(rng), with_dimensions(port, OTHER * dimensions_m(port))
    fit = adjust(disturbed(T, rng), ExactEdges(T, other, camera, 0.3), port, camera)
    np.testing.assert_allclose(fit.offset_px, 0.3, atol=0.01)
    np.testing.assert_allclose(dimensions_m(fit.port)[:2], dimensions_m(other)[:2], atol=2e-5)
    np.testing.assert_allclose(dimensions_m(fit.port)[2:], dimensions_m(other)[2:], atol=1e-4)


def test_wrong_images_and_edges_do_no_harm(port, camera, rng):
    """A tenth of the edges are anywhere, and two images show another yaw than their start."""
    T, other = views(rng, 30), with_dimensions(port, OTHER * dimensions_m(port))
    count = len(outline(port).points_m)
    error_px = np.where(rng.random((30, count)) < 0.1, rng.uniform(-6, 6, (30, count)), 0)
    start = disturbed(T, rng)
    turned = start[:2] @ Pose(facing_pose(np.pi, 0, np.deg2rad(25), np.zeros(3)).rotation, np.zeros(3))
    start = batch([turned[0], turned[1], *(start[i] for i in range(2, 30))])
    exact = ExactEdges(T, other, camera, error_px)

    def seen(at, normal):
        gap_px = exact(at, normal)
        return np.where(np.abs(gap_px) < 8, gap_px, np.nan)

    fit = adjust(start, seen, port, camera)
    assert not fit.kept[:2].any() and fit.kept[2:].all()
    np.testing.assert_allclose(dimensions_m(fit.port), dimensions_m(other), atol=2e-5)


def test_standard_deviations_are_those_of_repetitions(port, camera, rng):
    """Errors of single edges, of all edges of an image alike, and of all a recording's masks alike."""
    T, known_m, errors_m, sigmas_m = views(rng, 24), dimensions_m(port), [], []
    kinds = (np.arange(len(outline(port).points_m)) >= OF_RING.stop).astype(int)
    log_distance = np.log(np.linalg.norm(T.position_m, axis=1))
    log_distance -= np.median(log_distance)
    for _ in range(40):
        offset_px = rng.normal(0, port_calibration.OFFSET_PX, 2)
        growth_px = rng.normal(0, port_calibration.GROWTH_PX, 2)
        error_px = rng.normal(0, 0.3, (24, len(kinds))) + rng.normal(0, 0.15, (24, 2))[:, kinds]
        error_px += (offset_px + growth_px * log_distance[:, None])[:, kinds]
        fit = adjust(T, ExactEdges(T, port, camera, error_px), port, camera)
        errors_m.append(dimensions_m(fit.port) - known_m)
        sigmas_m.append(fit.sigma_m)
    scatter_m = np.sqrt(np.mean(np.square(errors_m), 0))
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(sigmas_m), 0)), scatter_m, rtol=0.3)


def test_what_the_views_do_not_determine_is_said(port, camera, rng):
    def lines(T):
        error_px = rng.normal(0, 0.3, (len(T), len(outline(port).points_m)))
        return port_views.undetermined(adjust(T, ExactEdges(T, port, camera, error_px), port, camera))

    assert not lines(views(rng))
    head_on = lines(views(rng, tilt_deg=1.0, depths_m=(0.6, 0.62), aside=0.01))
    assert any(line.startswith("the views do not determine the plate's height") for line in head_on)
    assert all("\n" not in line for line in head_on)


def test_chosen_views_are_unlike(rng):
    usual, odd = views(rng, 60, 3.0, (0.6, 0.61)), views(rng, 3, 60.0, (0.4, 1.0))
    T = batch([*(usual[i] for i in range(60)), *(odd[i] for i in range(3))])
    assert set(port_views.spread(T, 4)) > {60, 61, 62}
    assert list(port_views.spread(T, 100)) == list(range(63))


def test_a_half_height_is_found_below_a_pixel():
    """A straight soft edge at u = 20.3; beyond the image there is none."""
    mask = np.clip((20.3 - np.arange(40.0)) / 4 + 0.5, 0, 1).astype(np.float32) * np.ones((30, 1), np.float32)
    at, right = np.array([[18.0, 9.0], [23.0, 15.5], [38.0, 9.0], [8.0, 9.0]]), np.tile([1.0, 0.0], (4, 1))
    np.testing.assert_allclose(
        port_views.half_height_px(mask, at, right), [2.3, -2.7, np.nan, np.nan], atol=0.05
    )


@pytest.fixture(scope="module")
def higher(tmp_path_factory):
    """A recording of a port whose plate is a fifth higher: 20 frames of varied views; and the port."""
    port = sequences.Port.lm_map()
    higher = replace(port, plate_height_m=1.2 * port.plate_height_m)
    with pytest.MonkeyPatch.context() as patch:  # no events
        patch.setattr(sequences, "render_times_us", lambda *_: np.zeros(1, np.int64))
        setup = sequences.Setup(frame_hz=0.5)
        recording = sequences.simulate("realistic-50004", 40.0, setup=setup, port=higher)
    path = tmp_path_factory.mktemp("port") / "own.aedat4"
    WRITERS[".aedat4"](recording, path)
    return recording, path, higher


def test_a_higher_plate_is_measured_and_gives_poses_as_good_as_the_true_port(higher, port, capsys):
    recording, path, true = higher
    output = path.with_name("port.json")
    assert main.main(["calibrate", str(path), "--port", "-o", str(output), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["dimensions"]
    measured = sequences.Port.load(output)
    assert measured.plate_height_m == rows["plate's height, m"]["value"]
    assert abs(measured.plate_height_m / true.plate_height_m - 1) < 0.03
    for value, row in zip(dimensions_m(true), rows.values(), strict=True):
        assert abs(row["value"] - value) < 3 * row["sigma"]
    assert measured.petal_rise_m == port.petal_rise_m and measured.ring_radius_m == port.ring_radius_m

    truth = recording.truth.at(recording.frames_t_us)
    errors = {}
    for name, shape in (("true", true), ("measured", measured)):
        estimator = Estimator(recording.camera, shape)
        poses = [estimator(frame).T_cam_port for frame in recording.frames[::3]]
        assert all(T is not None for T in poses)
        T = batch(poses)
        errors[name] = np.array([
            np.median(np.linalg.norm(T.position_m - truth[::3].position_m, axis=1)),
            np.median(np.arccos(np.clip(np.sum(T.normal * truth[::3].normal, -1), -1, 1))),
        ])  # fmt: skip
    assert np.all(errors["measured"] < 1.2 * errors["true"] + [2e-4, np.deg2rad(0.05)])


def test_a_recording_of_another_port_says_so(higher, tmp_path, capsys):
    """With the standard port, and neither with its own nor where the standard port is what was built."""
    _, path, true = higher
    true.save(own := tmp_path / "own.json")
    mini = DATA / "mini" / "test-low.aedat4"
    slow = [path, "--rate", 0.25]
    calls = slow, [*slow, "--track"], [*slow, "--port", own], [mini, "--rate", 4]
    note, off_px = re.compile(r"note: the markers lie ([\d.]+) px from .*lmmap calibrate --port"), []
    for k, call in enumerate(calls):
        output = ["-o", tmp_path / f"{k}.csv"]
        assert main.main(["estimate", "--modality", "rgb", *map(str, [*call, *output])]) == 0
        off_px.append([float(px) for px in note.findall(capsys.readouterr().err)])
    assert 0.5 < off_px[0][0] < 3 and off_px[1] == off_px[0] and off_px[2:] == [[], []]


def test_bad_input_is_one_line(higher, tmp_path, capsys):
    _, path, _ = higher
    exists = tmp_path / "port.json"
    exists.write_text("{}")
    text = tmp_path / "notes.txt"
    text.write_text("not a recording")
    for arguments, problem in (
        ([path, "--port", "-o", exists], "exists"),
        ([text, "--port", "-o", tmp_path / "new.json"], "notes.txt"),
        ([path, path, "--port"], "one recording"),
        ([path, "--port", "--board", "8x5"], "leave --board out"),
        ([path, "--port", "--rate", "0"], "--rate 0"),
        ([path, "--port", "--rate", "0.05", "-o", tmp_path / "new.json"], "12 are needed"),
        ([path, "--port", "--modality", "event", "-o", tmp_path / "new.json"], "holds no images"),
    ):
        assert main.main(["calibrate", *map(str, arguments)]) == 1
        error = capsys.readouterr().err.strip().splitlines()
        assert sum(line.startswith("lmmap: ") and not line.startswith("lmmap: note") for line in error) == 1
        assert problem in error[-1]
    assert exists.read_text() == "{}" and not (tmp_path / "new.json").exists()


def test_images_without_a_ring_are_counted():
    lost = port_views.Views(Pose(np.zeros((0, 3, 3)), np.zeros((0, 3))), [],
                            port_views.Counter({port_views.Status.NO_RING: 7}))  # fmt: skip
    with pytest.raises(InputError, match=r"^own: no ring found in 7 images"):
        port_views.check(lost, "own")
