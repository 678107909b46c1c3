"""Laws of the fusing filter: means, order, symmetry, silence, gates, and what its covariance promises."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from strategies import PORT, pose, seeds

from lmmap.geometry.rotations import rotation_between_rad, rotation_z
from lmmap.settings import OURS, MotionSettings
from lmmap.tracking import gate
from lmmap.tracking.fusion import Fusion, fuse
from lmmap.types import Estimate, Pose, Status

PERIOD = PORT.yaw_period_rad
STILL = MotionSettings(
    acceleration_m=1e-9, acceleration_rad=1e-9, correlation_s=0, speed_m_s=1e-9, rate_rad_s=1e-9
)
PATIENT = MotionSettings(lost_s=1.0)
T0 = pose((200, 110), 0.6, 0.4, 0.7, 0.3)
LOOSE = np.diag([2e-3, 2e-3, 4e-3, 0.02, 0.02, 0.01]) ** 2


def moved(T, step) -> Pose:
    return Pose(Rotation.from_rotvec(step[3:]).as_matrix() @ T.rotation, T.position_m + step[:3])


def seen(t_us, T=T0, S=LOOSE, confidence=0.95, **more) -> Estimate:
    return Estimate(t_us, Status.OK, T, covariance=S, confidence=confidence, **more)


def drawn(rng, scale=1.0):
    """A covariance of plausible size with correlations."""
    A = rng.standard_normal((6, 6)) * np.sqrt(LOOSE.diagonal())[:, None]
    return scale * (A @ A.T / 6 + 0.1 * LOOSE)


def noisy(rng, T, S, t_us):
    return seen(t_us, moved(T, np.linalg.cholesky(S) @ rng.standard_normal(6)), S)


def step_between(a: Pose, b: Pose) -> np.ndarray:
    turn = Rotation.from_matrix(b.rotation @ a.rotation.T).as_rotvec()
    return np.concatenate([b.position_m - a.position_m, turn])


@settings(max_examples=25)
@given(seeds(), st.integers(2, 6))
def test_a_still_port_gives_the_information_weighted_mean(seed, count):
    rng = np.random.default_rng(seed)
    steps = [1e-3 * np.sqrt(LOOSE.diagonal()) * rng.standard_normal(6) for _ in range(count)]
    spreads = [drawn(rng) for _ in range(count)]
    filter_ = Fusion(PERIOD, STILL)
    for k, (step, S) in enumerate(zip(steps, spreads, strict=True)):
        filter_.add({("rgb", "event")[k % 2]: seen(1000 * k, moved(T0, step), S)})
    weights = [np.linalg.inv(S) for S in spreads]
    covariance = np.linalg.inv(sum(weights))
    mean = covariance @ sum(w @ s for w, s in zip(weights, steps, strict=True))
    answer = filter_.at(1000 * count)
    scale = np.sqrt(covariance.diagonal())
    np.testing.assert_allclose(step_between(T0, answer.T_cam_port) / scale, mean / scale, atol=1e-5)
    np.testing.assert_allclose(answer.covariance / np.outer(scale, scale),
                               covariance / np.outer(scale, scale), atol=1e-5)  # fmt: skip


@pytest.mark.parametrize("correlation_s", [0.03, 0.2, 1.0])
def test_alike_errors_are_worth_what_their_correlation_leaves(correlation_s):
    """n errors with correlation rho^|i - j| have the information 1' C^-1 1 about their mean."""
    filter_, count, dt_s = Fusion(PERIOD, replace(STILL, correlation_s=correlation_s)), 7, 0.1
    for k in range(count):
        filter_.add({"rgb": seen(int(1e6 * k * dt_s))})
    lags = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    worth = np.linalg.inv(np.exp(-lags * dt_s / correlation_s)).sum()
    np.testing.assert_allclose(filter_.state.covariance[:6, :6] * worth, LOOSE, rtol=1e-6, atol=1e-12)


@settings(max_examples=30)
@given(seeds(), st.lists(st.integers(-4, 4), min_size=6, max_size=6))
def test_thirds_of_a_turn_make_no_difference(seed, turns):
    rng = np.random.default_rng(seed)
    plain = [noisy(rng, T0, LOOSE, 100_000 * k) for k in range(6)]
    turned = [
        replace(e, T_cam_port=Pose(e.T_cam_port.rotation @ rotation_z(k * PERIOD), e.T_cam_port.position_m))
        for e, k in zip(plain, turns, strict=True)
    ]
    pairs = zip(*(fuse([("rgb", e) for e in track], PERIOD) for track in (plain, turned)), strict=True)
    for a, b in pairs:
        assert rotation_between_rad(a.T_cam_port.rotation, b.T_cam_port.rotation, PERIOD) < 1e-9
        np.testing.assert_allclose(a.T_cam_port.position_m, b.T_cam_port.position_m, atol=1e-12)
        np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-12)


@settings(max_examples=30)
@given(seeds())
def test_the_order_of_estimates_of_one_time_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    both = [{c: noisy(rng, T0, drawn(rng), 100_000 * k) for c in ("rgb", "event", "third")} for k in range(5)]
    forward, backward = Fusion(PERIOD, PATIENT), Fusion(PERIOD, PATIENT)
    for estimates in both:
        forward.add(estimates)
        backward.add(dict(reversed(estimates.items())))
        a, b = (f.at(500_000) for f in (forward, backward))
        np.testing.assert_allclose(a.T_cam_port.position_m, b.T_cam_port.position_m, atol=1e-12)
        np.testing.assert_allclose(a.T_cam_port.rotation, b.T_cam_port.rotation, atol=1e-12)
        np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-12)


def test_a_silent_camera_leaves_the_other_alone():
    rng = np.random.default_rng(3)
    alone = [("rgb", noisy(rng, T0, LOOSE, 100_000 * k)) for k in range(8)]
    silent = [("event", Estimate(100_000 * k + 50_000, Status.NO_RING)) for k in range(8)]
    merged = sorted(alone + silent, key=lambda pair: pair[1].t_us)
    with_silent = [e for e in fuse(merged, PERIOD) if e.t_us % 100_000 == 0]
    for a, b in zip(fuse(alone, PERIOD), with_silent, strict=True):
        np.testing.assert_allclose(a.T_cam_port.rotation, b.T_cam_port.rotation, atol=1e-9)
        np.testing.assert_allclose(a.T_cam_port.position_m, b.T_cam_port.position_m, atol=1e-9)
        np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-9)


@settings(max_examples=20)
@given(seeds(), st.floats(1e-4, 1e4))
def test_the_covariance_stays_one(seed, scale):
    rng = np.random.default_rng(seed)
    filter_, t_us = Fusion(PERIOD), 0
    for _ in range(40):
        t_us += int(rng.integers(1, 200_000))
        S = drawn(rng, scale)
        filter_.add({rng.choice(["rgb", "event"]): noisy(rng, T0, S, t_us)})
        P = filter_.state.covariance
        assert np.array_equal(P, P.T)
        spread = np.sqrt(P.diagonal())
        assert np.linalg.eigvalsh(P / np.outer(spread, spread)).min() > 0


def test_a_grossly_wrong_estimate_is_not_taken():
    wrong = moved(T0, np.array([0.1, 0, 0, 0, 0, 0]))
    filter_ = Fusion(PERIOD)
    for k in range(5):
        filter_.add({"rgb": seen(100_000 * k)})
    before = filter_.at(500_000)
    filter_.add({"event": seen(500_000, wrong)})
    after = filter_.at(500_000)
    np.testing.assert_allclose(after.T_cam_port.position_m, before.T_cam_port.position_m, atol=1e-12)
    assert "event" not in filter_.seen_us


def ring_only(t_us):
    return Estimate(t_us, Status.NO_MARKERS, ring=T0, covariance=LOOSE)


def test_what_fits_is_what_would_be_taken():
    filter_ = Fusion(PERIOD)
    assert not filter_.fits(seen(0))
    filter_.add({"rgb": seen(0)})
    far = moved(T0, np.array([0.1, 0, 0, 0, 0, 0]))
    unsure = Estimate(1000, Status.UNSURE, doubtful=T0, covariance=LOOSE)
    assert filter_.fits(seen(1000)) and filter_.fits(seen(1000, far, rival=T0))
    assert not any(map(filter_.fits, (seen(1000, far), unsure, ring_only(1000), seen(10**7))))


def test_the_rival_stands_in_where_it_fits():
    """The other normal of the ring, 30 deg away, chosen wrongly once: its rival is taken instead."""
    wrong = moved(T0, np.array([0, 0, 0, np.deg2rad(30), 0, 0]))
    filter_ = Fusion(PERIOD)
    for k in range(5):
        filter_.add({"rgb": seen(100_000 * k)})
    filter_.add({"event": seen(500_000, wrong, rival=T0)})
    assert filter_.seen_us["event"] == 500_000
    assert rotation_between_rad(filter_.at(500_000).T_cam_port.rotation, T0.rotation, PERIOD) < 1e-6


@pytest.mark.parametrize("confidence", [0.7, 0.97])
def test_the_likelier_of_a_track_and_of_a_pose_whose_rival_fits_it_stays(confidence):
    """Track and pose name different normals: p_k = o_k / (1 + o + o'), with the odds of both."""
    other = moved(T0, np.array([0, 0, 0, np.deg2rad(30), 0, 0]))
    filter_ = Fusion(PERIOD)
    filter_.add({"rgb": seen(0, confidence=0.9)})
    filter_.add({"rgb": seen(1000, other, confidence=confidence, rival=T0)})
    odds = [0.9 / 0.1, confidence / (1 - confidence)]
    assert filter_.belief == pytest.approx(max(odds) / (1 + sum(odds)))
    assert step_between(filter_.at(1000).T_cam_port, T0 if confidence < 0.9 else other) == pytest.approx(0)


def test_a_rivals_covariance_is_turned_with_its_normal():
    rng = np.random.default_rng(1)
    S, other = drawn(rng), pose((200, 110), 0.6, 0.4, 2.1)
    turned = gate.rotate_covariance(S, T0.normal, other.normal)
    np.testing.assert_allclose(np.linalg.eigvalsh(turned[3:, 3:]), np.linalg.eigvalsh(S[3:, 3:]))
    about = [T.normal @ C[3:, 3:] @ T.normal for T, C in ((T0, S), (other, turned))]
    assert about[0] == pytest.approx(about[1])


def test_lost_after_silence_and_begun_anew_elsewhere():
    far, lost_us = moved(T0, np.array([0.2, 0.1, 0.1, 0, 0.5, 0])), round(1e6 * OURS.motion.lost_s)
    filter_ = Fusion(PERIOD)
    filter_.add({"rgb": seen(0)})
    assert filter_.at(lost_us).status == Status.OK
    later = filter_.at(lost_us + 1)
    assert (later.status, later.T_cam_port) == (Status.NO_RING, None)
    late_us = lost_us + 50_000
    filter_.add({"rgb": Estimate(late_us, Status.NO_ELLIPSE), "event": Estimate(late_us, Status.NO_RING)})
    assert filter_.at(late_us).status == Status.NO_ELLIPSE
    filter_.add({"event": seen(late_us + 1, far)})
    np.testing.assert_allclose(filter_.at(late_us + 1).T_cam_port.position_m, far.position_m)


def test_waiting_loosens_what_is_known():
    filter_ = Fusion(PERIOD, PATIENT)
    filter_.add({"rgb": seen(0)})
    volumes = [np.linalg.slogdet(filter_.at(t).covariance)[1] for t in (0, 100_000, 300_000)]
    assert np.all(np.diff(volumes) > 0)


def test_true_poses_lie_where_the_covariance_says():
    """A port that does what the filter assumes, seen by two cameras: the state's error is chi-square."""
    rng, motion, dt = np.random.default_rng(5), MotionSettings(correlation_s=0), 0.05
    inside = []
    for _ in range(60):
        spread = np.repeat([motion.speed_m_s, motion.rate_rad_s], 3)
        rate = spread * rng.standard_normal(6)
        T, filter_ = T0, Fusion(PERIOD, motion)
        density = np.repeat([motion.acceleration_m, motion.acceleration_rad], 3)
        for k in range(20):
            filter_.add({("rgb", "event")[k % 2]: noisy(rng, T, LOOSE, int(1e6 * dt * k))})
            error = step_between(filter_.state.T_cam_port, T)
            P = filter_.state.covariance[:6, :6]
            inside.append(error @ np.linalg.solve(P, error) < chi2.ppf(0.95, 6))
            for _ in range(10):
                rate = rate + density * np.sqrt(dt / 10) * rng.standard_normal(6)
                T = moved(T, rate * dt / 10)
    assert 0.92 < np.mean(inside) < 0.98


def test_a_steady_motion_is_learnt():
    rate = np.array([0.03, -0.02, 0.05, 0.1, -0.05, 0.2])
    truth = {t: moved(T0, rate * t * 1e-6) for t in range(0, 2_100_000, 100_000)}
    tight = np.diag([1e-4] * 3 + [1e-3] * 3) ** 2
    answers = list(fuse([("rgb", seen(t, T, tight)) for t, T in truth.items()], PERIOD))
    np.testing.assert_allclose(step_between(answers[-1].T_cam_port, truth[2_000_000]), 0, atol=2e-3)


def test_at_a_rate_the_answers_come_at_its_ticks_from_what_has_come():
    timed = [("rgb", seen(8000 + 50_000 * k)) for k in range(9)]
    ticks = [e.t_us for e in fuse(timed, PERIOD, rate_hz=10)]
    assert ticks == [8000, 108_000, 208_000, 308_000, 408_000]
    assert [e.t_us for e in fuse(timed, PERIOD)] == [e.t_us for _, e in timed]
    assert list(fuse([], PERIOD, rate_hz=10)) == []


def test_misuse_is_named():
    filter_ = Fusion(PERIOD)
    with pytest.raises(ValueError, match="estimates: expected one time"):
        filter_.add({"rgb": seen(0), "event": seen(1)})
    with pytest.raises(ValueError, match="estimates: expected covariances, got none from rgb"):
        list(fuse([("rgb", seen(0, S=None))], PERIOD))
    filter_.add({"rgb": seen(10)})
    with pytest.raises(ValueError, match="t_us: expected 10 or later"):
        filter_.at(5)


@pytest.mark.parametrize("period", [0.0, 1e-9, -1.0, 7.0, np.nan, np.inf, None, "1", [1.0], True])
def test_periods_that_are_none(period):
    with pytest.raises(ValueError, match=r"yaw_period_rad: expected .*, got "):
        list(fuse([], period))


@pytest.mark.parametrize("rate_hz", [0.0, 1e-300, -1.0, 1e300, np.nan, np.inf, "10", [10.0]])
def test_rates_that_are_none(rate_hz):
    with pytest.raises(ValueError, match=r"rate_hz: expected .*, got "):
        list(fuse([], PERIOD, rate_hz))


@pytest.mark.parametrize("t_us", [2**63, 1e300, np.nan, np.inf, None, "0"])
def test_times_that_are_none(t_us):
    with pytest.raises(ValueError, match=r"t_us: expected .*, got "):
        list(fuse([("rgb", seen(t_us))], PERIOD))


@pytest.mark.parametrize(
    "covariance",
    [
        None, np.full((6, 6), np.nan), np.eye(5), -np.eye(6), np.zeros((6, 6)), "text", [1.0] * 6,
        np.eye(6) + 2 * np.eye(6, k=1) + 2 * np.eye(6, k=-1), np.ones((6, 6)),
        np.eye(6) + 0.5 * np.eye(6, k=1),
    ],
)  # fmt: skip
def test_covariances_that_are_none(covariance):
    """Of no shape, not positive, with correlations beyond one, of one and that differ from their mirrors."""
    with pytest.raises(ValueError, match=r"(estimates|covariance): expected .*, got "):
        list(fuse([("rgb", seen(0, S=covariance))], PERIOD))


def test_a_covariance_may_be_lists():
    (as_lists,), (as_array,) = (fuse([("rgb", seen(0, S=S))], PERIOD) for S in (LOOSE.tolist(), LOOSE))
    np.testing.assert_array_equal(as_lists.covariance, as_array.covariance)


@pytest.mark.parametrize("end_us", [7_200_000_000, 1_300_000])
def test_ticks_end_with_the_track_in_a_gap(end_us):
    """Behind it no image is left that one could be said of."""
    estimates = [seen(t_us) for t_us in (0, 10_000, end_us)]
    fused = list(fuse([("rgb", e) for e in estimates], PERIOD, 10.0))
    assert [e.t_us for e in fused] == [0, 100_000, 200_000, end_us]


@pytest.mark.parametrize("confidence", [0.0, -0.1, 1.1, np.nan])
def test_confidences_that_are_none(confidence):
    with pytest.raises(ValueError, match=r"estimates: expected confidences in \(0, 1\], got .* from rgb"):
        list(fuse([("rgb", seen(0, confidence=confidence))], PERIOD))


ELSEWHERE = moved(T0, np.array([0.1, 0, 0, 0, 0, 0]))


def test_a_contradiction_by_hand():
    """Odds of 9 against 4 leave 9 of 14; 9 : 5 against 4 leave 9 of 34 to the track and 20 to the pose."""
    filter_ = Fusion(PERIOD, PATIENT)
    filter_.add({"rgb": seen(0, confidence=0.9)})
    assert filter_.belief == 0.9
    filter_.add({"event": seen(100_000, ELSEWHERE, confidence=0.8)})
    assert filter_.belief == pytest.approx(9 / 14)
    np.testing.assert_allclose(filter_.at(100_000).T_cam_port.position_m, T0.position_m, atol=1e-9)
    filter_.add({"event": seen(200_000, ELSEWHERE, confidence=0.8)})
    assert filter_.belief == pytest.approx(20 / 34)
    np.testing.assert_allclose(filter_.at(200_000).T_cam_port.position_m, ELSEWHERE.position_m)


@given(st.floats(0.01, 1), st.floats(0.01, 1))
def test_agreement_leaves_the_surer_and_contradiction_doubts_both(first, second):
    agreeing, contradicting = Fusion(PERIOD, PATIENT), Fusion(PERIOD, PATIENT)
    for filter_, T in ((agreeing, T0), (contradicting, ELSEWHERE)):
        filter_.add({"rgb": seen(0, confidence=first)})
        filter_.add({"event": seen(100_000, T, confidence=second)})
    assert agreeing.belief == max(first, second)
    assert contradicting.belief <= max(first, second) + 1e-9
    surer = T0 if first >= second else ELSEWHERE
    np.testing.assert_allclose(contradicting.state.T_cam_port.position_m, surer.position_m, atol=1e-9)


def test_after_a_contradiction_the_fused_pose_is_unsure_until_one_of_two_proves_right():
    rgb = [("rgb", seen(100_000 * k, confidence=0.9)) for k in (0, 1, 3)]
    event = [("event", seen(50_000, confidence=0.9)), ("event", seen(200_000, ELSEWHERE, confidence=0.9))]
    statuses = [e.status for e in fuse(sorted(rgb + event, key=lambda pair: pair[1].t_us), PERIOD)]
    assert statuses == [Status.OK] * 3 + [Status.UNSURE, Status.OK]


def test_cameras_that_contradict_each_other_throughout_have_no_pose():
    """As on the command line: what `fuse` gives is what `lmmap estimate --modality fused` writes."""
    both = [
        (c, seen(50_000 * k, ELSEWHERE if c == "event" else T0)) for k in range(6) for c in ("rgb", "event")
    ]
    with pytest.warns(UserWarning, match="^r: the two cameras' poses contradict each other in"):
        assert {e.status for e in fuse(both, PERIOD, name="r")} == {Status.UNSURE}


def test_a_ring_without_markers_counts_for_nothing():
    """No marker confirms it, and where networks find none it is wrong in most images."""
    alone = list(fuse([("rgb", seen(0))], PERIOD, 10.0))
    rings = [("event", ring_only(t_us)) for t_us in (100_000, 200_000, 300_000)]
    fused = list(fuse([("rgb", seen(0)), *rings], PERIOD, 10.0))
    assert (alone[0].status, fused[0].status) == (Status.OK, Status.OK)
    assert fused[-1].status == Status.NO_MARKERS


def test_what_is_not_known_well_is_no_answer():
    """A position known to 20 mm along each axis is within 20 mm in a fifth of all cases."""
    (e,) = fuse([("rgb", seen(0, S=np.diag([0.02] * 3 + [0.001] * 3) ** 2))], PERIOD)
    assert (e.status, e.T_cam_port) == (Status.UNSURE, None)
    assert e.doubtful is not None and e.confidence == pytest.approx(0.95 * chi2.cdf(1, 3), abs=1e-3)
