"""Reading speed of this checkout beside that of another one, format by format.

    python benchmarks/compare_readers.py OTHER_CHECKOUT [EVENTS] [ROUNDS]

The same files are read by both in turns, each in a process of its own, and what counts is the least time of
the processor over all rounds: other programs disturb it less than time on the wall.  Prints a line a format
and the ratio; ends with 1 if any is more than 5 % slower here.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
from bench_recordings import synthetic

from lmmap.recordings.formats import open_recording
from lmmap.types import Recording
from lmmap_lab.bench.writers import WRITERS, write_recording
from lmmap_lab.provenance import DATA, ROOT

MOST = 1.05
WORKER = """
import json, sys, time
from lmmap import Camera
try:
    from lmmap.recordings.formats import open_recording
except ImportError:
    from lmmap.recordings import open_recording
for line in sys.stdin:
    start = time.process_time()
    recording = open_recording(line.strip(), Camera.davis346())
    seconds = time.process_time() - start
    print(json.dumps([seconds, len(recording.events), len(recording.frames)]), flush=True)
"""


class Reader:
    """A process that imports one checkout and reads what it is told to."""

    def __init__(self, checkout: Path):
        self._process = subprocess.Popen(
            [sys.executable, "-c", WORKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=checkout,
            env={"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"},
        )

    def read(self, path: Path) -> tuple[float, int, int]:
        """Seconds of the processor, events and frames."""
        print(path, file=self._process.stdin, flush=True)
        return tuple(json.loads(self._process.stdout.readline()))


def write_files(folder: Path, count: int) -> list[Path]:
    """Random events and twenty frames in each format that both read; the frames are real, as noise does not
    compress."""
    r, frames = synthetic(count), open_recording(DATA / "mini" / "test-low.aedat4").frames[:20]
    times_us = r.events["t_us"][:: len(r.events) // len(frames)][: len(frames)].copy()
    r = Recording(r.name, r.camera, r.events, frames, times_us)
    paths = [folder / f"r{suffix}" for suffix in WRITERS if suffix != ".hdf5"]
    for path in paths:
        write_recording(r, path)
    text = folder / "r.txt"
    rows = (f"{t} {x} {y} {int(p)}\n" for t, x, y, p in r.events[: count // 4].tolist())
    text.write_text("".join(rows))
    pictures = folder / "pictures"
    pictures.mkdir()
    for k, frame in enumerate(frames):
        cv2.imwrite(str(pictures / f"{k}.png"), frame)
    (pictures / "images.txt").write_text("".join(f"{k}.5 {k}.png\n" for k in range(len(frames))))
    return [*paths, text, pictures]


def main(other: Path, count: int, rounds: int) -> bool:
    """Print the table; whether no format got slower."""
    readers = {"there": Reader(other), "here": Reader(ROOT)}
    good = True
    with tempfile.TemporaryDirectory() as folder:
        print(f"{'format':12}{'there ms':>10}{'here ms':>10}{'ratio':>8}")
        for path in write_files(Path(folder), count):
            answers = {name: [reader.read(path)] for name, reader in readers.items()}
            for k in range(rounds):
                for name in sorted(readers, reverse=bool(k % 2)):
                    answers[name].append(readers[name].read(path))
            if len({answer[1:] for each in answers.values() for answer in each}) > 1:
                raise SystemExit(f"{path.name}: the two do not read the same")
            least = {name: min(answer[0] for answer in each) for name, each in answers.items()}
            ratio = least["here"] / least["there"]
            good &= ratio <= MOST
            there_ms, here_ms = (1e3 * least[name] for name in ("there", "here"))
            print(f"{path.suffix or 'folder':12}{there_ms:10.1f}{here_ms:10.1f}{ratio:8.3f}", flush=True)
    return good


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    numbers = [int(a) for a in sys.argv[2:4]]
    sys.exit(not main(Path(sys.argv[1]).resolve(), *numbers, *(2_000_000, 15)[len(numbers) :]))
