"""Variations: what each changes and, above all, what it must not."""

import numpy as np
import pytest

from lmmap_lab.training import augment

SHAPE = (48, 56)


@pytest.fixture
def frame(rng):
    return rng.uniform(20, 200, (*SHAPE, 3)).astype(np.float32)


@pytest.fixture
def counts(rng):
    return rng.poisson(1.5, SHAPE).astype(np.float32)


@pytest.fixture
def mask():
    v, u = np.indices(SHAPE)
    return np.abs(np.hypot(v - 24, u - 28) - 14) < 2


FRAMES = {
    "expose": augment.expose, "tint": augment.tint, "blur": augment.blur, "compress": augment.compress,
    "noise": augment.noise, "hot_pixels": lambda f, rng: augment.hot_pixels(f, rng, 255.0),
}  # fmt: skip


@pytest.mark.parametrize("name", FRAMES)
def test_frames_stay_frames_and_the_input_stays_as_it_was(frame, rng, name):
    before = frame.copy()
    for _ in range(20):
        out = FRAMES[name](frame, rng)
        assert out.shape == frame.shape
        assert out.min() >= 0
        assert out.max() <= 255
        assert np.isfinite(out).all()
    assert np.array_equal(frame, before)


@pytest.mark.parametrize("vary", [augment.robust_frame, augment.robust_histogram])
def test_a_variation_is_a_function_of_its_generator(frame, counts, mask, vary):
    image = frame if vary is augment.robust_frame else counts
    runs = [vary(image, mask, image[::-1], np.random.default_rng(s)) for s in (3, 3, 4)]
    assert np.array_equal(runs[0][0], runs[1][0])
    assert not np.array_equal(runs[0][0], runs[2][0])


def test_flips_move_image_and_mask_alike(mask, rng):
    for _ in range(16):
        image, turned = augment.flip([mask.astype(float), mask], rng)
        assert np.array_equal(image > 0, turned)


def test_exposure_and_tint_keep_black_black_and_tint_keeps_edges(rng):
    black = np.zeros((*SHAPE, 3), np.float32)
    assert not augment.expose(black, rng).any()
    assert not augment.tint(black, rng).any()
    white = augment.tint(np.full((*SHAPE, 3), 100, np.float32), rng)
    inside = white[(white > 0).all(-1) & (white < 255).all(-1)]
    assert np.abs(np.diff(white, axis=1)).max() < 0.2 * inside.max()  # slow: no false edges


def test_blur_keeps_the_light(frame, rng):
    for _ in range(10):
        assert augment.blur(frame, rng).mean() == pytest.approx(frame.mean(), rel=0.02)


def test_clutter_hides_and_its_mask_follows(frame, mask, rng):
    other = np.zeros_like(frame)
    for _ in range(20):
        image, left = augment.clutter(frame, mask, other, rng)
        hidden = (image == 0).all(-1)
        assert not (left & hidden).any()
        assert np.array_equal(left, mask & ~hidden)
        assert np.array_equal(image[~hidden], frame[~hidden])


def test_seams_darken_the_ring_only_and_nothing_without_a_ring(frame, mask, rng):
    out = augment.seams(frame, mask, rng)
    changed = (out != frame).any(-1)
    assert changed.any()
    assert not (changed & ~mask).any()
    assert (out <= frame).all()
    assert np.array_equal(augment.seams(frame, np.zeros(SHAPE, bool), rng), frame)


def test_thinning_loses_events_and_noise_adds_them(counts, rng):
    thinned = augment.thin(counts, rng)
    assert (thinned <= counts).all()
    assert 0.5 * counts.sum() < thinned.sum() < counts.sum()
    assert (augment.noise_events(counts, rng) >= counts).all()


def test_hot_pixels_are_few_and_bright(counts, rng):
    out = augment.hot_pixels(counts, rng, 30.0, share=0.05)
    changed = out != counts
    assert changed.mean() < 0.1
    assert (out[changed] >= 15).all()
