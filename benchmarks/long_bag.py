"""Memory and time for a bag of six gigabytes, the size of the authors', from bag to truth and errors.

    python benchmarks/long_bag.py FOLDER [GIGABYTES]

Writes a stand-in of that size into FOLDER and removes it: the committed recording again and again, with the
arm to and fro.  Each command runs in a process of its own, and its peak of resident memory is reported.
``evaluate`` estimates one image in ten seconds, because reading is what is measured.
"""

import sys
import time
from pathlib import Path

import numpy as np
from long_recording import MAIN, child

from lmmap import open_recording
from lmmap.files import CAMERA, atomic
from lmmap.recordings.rig import RIG_FILE
from lmmap.types import Camera
from lmmap_lab.bench import rosbag_writer
from lmmap_lab.provenance import DATA
from lmmap_lab.rig import authors_bags, standin, tf
from lmmap_lab.rig.ur5e import follow

LIMIT_GB = 2.0


class Mirrored:
    """A short recording played to and fro, with the part of `Recording` that `rosbag_writer.write` needs.

    Backward, frames are in reverse order.  Events keep their order: their rate and size are right, but not
    what they show.
    """

    def __init__(self, recording, periods: int):
        self.camera, self.periods, self._recording = recording.camera, periods, recording
        self.period_us = int(recording.truth.t_us[-1]) + 5000

    def chunks(self):
        for k in range(self.periods):
            e = self._recording.events.copy()
            e["t_us"] += standin.START_US + k * self.period_us
            yield e

    def timed_frames(self):
        for k in range(self.periods):
            times_us, frames = self._recording.frames_t_us, self._recording.frames
            if k % 2:
                times_us, frames = self._recording.truth.t_us[-1] - times_us[::-1], frames[::-1]
            yield from zip((times_us + standin.START_US + k * self.period_us).tolist(), frames, strict=True)

    def arm(self):
        """Times and joints of the arm, to and fro."""
        truth = self._recording.truth
        there = follow(standin.arm_poses(truth.poses))
        back_us = truth.t_us[-1] - truth.t_us[::-1]
        parts = [(back_us, there[::-1]) if k % 2 else (truth.t_us, there) for k in range(self.periods)]
        t_us = [t + standin.START_US + k * self.period_us for k, (t, _) in enumerate(parts)]
        return np.concatenate(t_us), np.concatenate([joints for _, joints in parts])


def main(folder: Path, gigabytes: float) -> None:
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    recording = standin.shift_time(recording, -int(recording.truth.t_us[0]))
    period_gb = (13 * len(recording.events) + recording.frames.nbytes) / 1e9
    long = Mirrored(recording, int(np.ceil(gigabytes / period_gb)))
    path, start = folder / "dark__test.bag", time.perf_counter()
    with atomic(path) as temporary:
        rosbag_writer.write(long, temporary, tf.arm_messages(*long.arm()), calibrated=False)
    standin.write_hand_eye(folder / authors_bags.HAND_EYE)
    standin.RIG.save(folder / RIG_FILE)
    Camera.davis346().save(folder / CAMERA)
    print(
        f"{path.name}: {path.stat().st_size / 1e9:.1f} GB in {time.perf_counter() - start:.0f} s", flush=True
    )
    peaks = []
    for argv in (
        ("dataset", "check", folder),
        ("info", path, "--json"),
        ("evaluate", path, "--modality", "rgb", "--rate", "0.1"),
        ("evaluate", path, "--modality", "event", "--rate", "0.1"),
        ("calibrate", path, "--rate", "0.2", "-o", folder / "again.json"),
        ("calibrate", path, "--rate", "0.2", "-o", folder / "again.json"),  # goes on: only reads
    ):
        run = child(MAIN, *argv)
        peaks.append(run["peak_gb"])
        print(f"  lmmap {argv[0]}: exit {run['code']}, {run['seconds']:.0f} s, peak {run['peak_gb']:.2f} GB",
              flush=True)  # fmt: skip
    path.unlink()
    print(f"  under {LIMIT_GB} GB: {'yes' if max(peaks) < LIMIT_GB else 'NO'}")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 6.0)
