"""A recording played: nothing comes before its time, all of it comes, the newest image is taken."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lmmap.estimation.images import newest_images
from lmmap.recordings import devices
from lmmap.recordings.stream import Source, Stream
from lmmap.settings import OURS
from lmmap.types import EVENT, Camera

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
START_US = 10**15


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self):
        self.s = 100.0

    def __call__(self) -> float:
        return self.s


def played(clock):
    e = np.zeros(1000, EVENT)
    e["t_us"] = START_US + 1000 * np.arange(1000)
    e["x"] = np.arange(1000) % 64
    frames = [(START_US + 100_000 * k, np.full((48, 64, 3), k, np.uint8)) for k in range(10)]
    source = Source(Path("r"), (64, 48), lambda: iter(np.split(e, [10, 333, 800])), lambda: iter(frames))
    return devices.Played(Stream("r", CAMERA, source), clock), e


def test_events_come_when_they_are_due():
    device, e = played(clock := Clock())
    got = device.pending("event")
    for step_s in (0.0, 0.05, 0.3, 0.0, 0.5, 0.2):
        clock.s += step_s
        got += device.pending("event")
        so_far = np.concatenate(got)
        assert so_far["t_us"].max() <= device.now_us()
        assert len(so_far) == np.sum(e["t_us"] <= device.now_us())
    np.testing.assert_array_equal(np.concatenate(got), e)
    assert not device.running()


@pytest.mark.parametrize("factor", [2.0, 1.0])
def test_the_newest_is_taken_and_the_rest_is_counted(factor):
    device, _ = played(clock := Clock())
    settings = replace(OURS, events_per_window=100, second_look_factor=factor)
    shots = newest_images(device, "event", settings)
    clock_steps = iter([0.15, 0.45, 0.39])
    device.pending("event")
    seen, before_us = [], 0
    for step_s in clock_steps:
        clock.s += step_s
        shot, newest_us, skipped = next(shots)
        assert shot.image.sum() == 100 and newest_us <= device.now_us()
        assert device.now_us() - newest_us < 1000
        if seen and factor > 1:
            wider_us, wider = shot.wider
            assert before_us < wider_us < shot.t_us
            assert wider.sum() == 100 * factor and np.all(wider >= shot.image)
        else:
            assert shot.wider is None  # 150 have come, not yet 200; or no wider one is asked for
        seen.append(skipped)
        before_us = shot.t_us
    assert seen == [0, 3, 2]  # 150, 450 and 390 new events, in windows of 100
    device, _ = played(clock := Clock())
    shots = newest_images(device, "rgb", OURS)
    assert next(shots)[0].image[0, 0, 0] == 0
    clock.s += 0.35
    shot, _, skipped = next(shots)
    assert (shot.image[0, 0, 0], skipped, shot.t_us) == (3, 2, START_US + 300_000)


def test_the_first_of_many_gaps_is_named():
    """One note, however often the clock of a damaged recording jumps."""
    e = np.zeros(6, EVENT)
    e["t_us"] = START_US + 60_000_000 * np.arange(6)
    source = Source(Path("r"), (64, 48), lambda: iter(np.split(e, 6)))
    device = devices.Played(Stream("r", CAMERA, source), Clock())
    with pytest.warns(UserWarning, match="nothing for 60 s") as noted:
        while device.running():
            device.pending("event")
    assert len(noted) == 1
