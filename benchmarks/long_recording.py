"""Twenty minutes of recording, read and binned: memory and rate, from AEDAT4 and from a bag.

    python benchmarks/long_recording.py FOLDER [SEED_RECORDING]

Writes about 12 GB into FOLDER (some minutes, AEDAT4 mostly: its library takes one event at a time) and
removes them.  The recording is the seed repeated with its time shifted, two thirds of its events, 5 frames
per second.  Each reading runs in a process of its own, whose peak of resident memory is what is reported.
"""

import json
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from lmmap.recordings.formats import open_recording
from lmmap_lab.bench.writers import WRITERS
from lmmap_lab.provenance import DATA

SECONDS = 1200.0
LIMIT_GB, LEAST_MEV_S = 1.5, 10.0


class Tiled:
    """A short recording again and again, as `Recording` is: what the writers need of it."""

    def __init__(self, recording, seconds: float):
        self.name, self.camera, self.truth = recording.name, recording.camera, None
        self._events, self._frames = (
            recording.events[np.arange(len(recording.events)) % 3 > 0],
            recording.frames[::4],
        )
        self._t_us = recording.frames_t_us[::4]
        self._period_us = int(recording.events["t_us"][-1] - recording.events["t_us"][0]) + 1
        self.times = round(seconds * 1e6 / self._period_us)
        self.events = SimpleNamespace(nbytes=self.times * self._events.nbytes)
        self.frames = SimpleNamespace(nbytes=self.times * self._frames.nbytes)

    def chunks(self):
        for k in range(self.times):
            e = self._events.copy()
            e["t_us"] += k * self._period_us
            yield e

    def timed_frames(self):
        for k in range(self.times):
            yield from zip((self._t_us + k * self._period_us).tolist(), self._frames, strict=True)


READ = """
import json, os, resource, sys, time
from lmmap.pipeline.histograms import histogram, windows_of
from lmmap.recordings.formats import open_stream
start = time.perf_counter()
stream = open_stream(sys.argv[1])
sums = [int(histogram(w["x"], w["y"], stream.camera.size_px).sum()) for w in windows_of(stream.chunks())]
seconds = time.perf_counter() - start
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
cpu = sum(os.times()[:2])
print(json.dumps(dict(events=sum(sums), seconds=seconds, cpu_s=cpu, peak_gb=peak * 1024 / 1e9)))
"""
MAIN = """
import json, resource, sys, time
from lmmap.cli import main as cli
start = time.perf_counter()
code = cli.main(sys.argv[1:])
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps(dict(code=code, seconds=time.perf_counter() - start, peak_gb=peak * 1024 / 1e9)))
"""


def child(code: str, *argv) -> dict:
    run = subprocess.run([sys.executable, "-c", code, *map(str, argv)], capture_output=True, text=True)
    if run.returncode:
        raise SystemExit(run.stderr)
    return json.loads(run.stdout.splitlines()[-1])


def main(folder: Path, seed: Path) -> None:
    tiled = Tiled(open_recording(seed), SECONDS)
    tiled.camera.save(folder / "long.camera.json")
    for suffix in (".bag", ".aedat4"):
        path = folder / f"long{suffix}"
        start = time.perf_counter()
        WRITERS[suffix](tiled, path)
        print(
            f"{path.name}: {path.stat().st_size / 1e9:.1f} GB in {time.perf_counter() - start:.0f} s",
            flush=True,
        )
        measured = child(READ, path)
        rate = measured["events"] / measured["seconds"] / 1e6
        print(f"  read, binned: {measured['events'] / 1e6:.0f} M events, {rate:.1f} Mev/s "
              f"({measured['events'] / measured['cpu_s'] / 1e6:.1f} a second of processor), "
              f"peak {measured['peak_gb']:.2f} GB", flush=True)  # fmt: skip
        peaks_and_rates = [(measured["peak_gb"], rate)]
        poses = folder / "long.csv"
        for argv in (
            ("info", path, "--json"),
            ("estimate", path, "--modality", "event", "--rate", "0.1", "-o", poses),
        ):
            run = child(MAIN, *argv)
            print(f"  lmmap {argv[0]}: {run['seconds']:.0f} s, peak {run['peak_gb']:.2f} GB", flush=True)
            peaks_and_rates.append((run["peak_gb"], np.inf))
        poses.unlink()
        path.unlink()
        good = all(peak < LIMIT_GB and rate >= LEAST_MEV_S for peak, rate in peaks_and_rates)
        print(f"  under {LIMIT_GB} GB and over {LEAST_MEV_S:g} Mev/s: {'yes' if good else 'NO'}", flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else DATA / "mini" / "test-low.aedat4")
