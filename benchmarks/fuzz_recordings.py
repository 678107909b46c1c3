"""Damage small recordings of every format at random and count what opening them gives.

Run ``python benchmarks/fuzz_recordings.py [FILES_PER_FORMAT]``: each worker process opens damaged files; one
that dies or takes over 20 s counts as a fault, as does any exception but `InputError`.
"""

import collections
import multiprocessing as mp
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

from lmmap.recordings.formats import open_recording
from lmmap.types import EVENT, Camera, InputError, Recording
from lmmap_lab.bench.writers import WRITERS, write_recording

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


def small(rng) -> Recording:
    e = np.zeros(500, EVENT)
    e["t_us"], e["x"], e["y"] = np.sort(rng.integers(0, 10**5, 500)), rng.integers(0, 64, 500), 5
    return Recording("r", CAMERA, e, rng.integers(0, 256, (2, 48, 64, 3), np.uint8), np.array([0, 40_000]))


def damaged(whole: bytes, rng) -> bytes:
    if rng.random() < 0.5:
        return whole[: rng.integers(len(whole))]
    content = np.frombuffer(whole, np.uint8).copy()
    at = rng.integers(len(whole) if rng.random() < 0.5 else 2000, size=rng.integers(1, 8)) % len(whole)
    content[at] ^= rng.integers(1, 256, len(at), np.uint8)
    return content.tobytes()


def opened(path: Path) -> str:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            open_recording(path, CAMERA)
    except InputError as error:
        return "error" if "\n" not in str(error) else "FAULT: more than one line"
    except Exception as error:
        return f"FAULT: {type(error).__name__}: {error}"
    return "read"


def main(count: int) -> None:
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        for suffix in (*WRITERS, ".txt"):
            path = Path(folder) / f"r{suffix}"
            if suffix == ".txt":
                path.write_text("".join(f"{i / 1e3:.6f} {i % 64} {i % 48} {i % 2}\n" for i in range(1, 200)))
            else:
                write_recording(small(rng), path)
            whole, tally = path.read_bytes(), collections.Counter()
            pool = mp.Pool(1)
            for k in range(count):
                path.write_bytes(damaged(whole, rng))
                try:
                    tally[pool.apply_async(opened, (path,)).get(20)] += 1
                except mp.TimeoutError:  # the worker hangs, or died
                    tally[f"FAULT: no answer to file {k}"] += 1
                    pool.terminate()
                    pool = mp.Pool(1)
            pool.terminate()
            print(suffix, dict(tally), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)
