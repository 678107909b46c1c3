"""Attack every command with damaged and hostile files, and count what it answers.

    python benchmarks/attack_recordings.py [CASES] [SEED]

A case is a command on a file: a sound one with a structured mutation of its format, or a directed attack on
one promise of it.  Each runs in a process of its own, forked from one that has imported everything, under
limits of memory and time.  A sound answer is exit 0 or 1, at most two lines on stderr, no traceback, no
signal, at most 1 GB above the idle process and at most 10 s of the processor.  Prints a table of commands
and formats, and each violation; ends with 1 if there is one.
"""

from __future__ import annotations

import argparse
import bz2
import collections
import hashlib
import json
import os
import resource
import select
import signal
import struct
import sys
import tempfile
import time
import zlib
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import cv2
import h5py
import numpy as np

from lmmap.cli import main as command
from lmmap.pipeline.weights import FILTERS, weight_path
from lmmap.recordings.formats import WRITERS, write_recording
from lmmap.recordings.pose_files import write_trajectory
from lmmap.types import EVENT, Camera, Port, Pose, Recording, Trajectory

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
MOST_BYTES, HARD_BYTES, MOST_S, WALL_S = 2**30, 3 * 2**30, 10.0, 90.0
NUMBERS = (0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**64 - 1)
TOKENS = (
    "",
    "nan",
    "inf",
    "-1",
    "1e300",
    "9.9e300",
    "1e-300",
    "9" * 400,
    "9223372036854775808",
    "true",
    "null",
    "[]",
    "{}",
    '"text"',
    "346.5",
    "\x00",
    "é",
    "1 2 3 4 5 6 7 8 9",
    "&a [*a]",
    "-9223372036854775808",
)


class Case(NamedTuple):
    """A command's name, the format that it is attacked with, what is done to it, and its arguments."""

    command: str
    format: str
    attack: str
    argv: list[str]


class Answer(NamedTuple):
    """Exit code (negative: a signal), lines on stderr, memory above the idle process, processor time."""

    code: int
    err: str
    bytes: int
    seconds: float

    @property
    def violation(self) -> str:
        """What is wrong with the answer, or nothing."""
        if self.code not in (0, 1):
            return f"ended by {self.code}: " + "".join(self.err.strip().splitlines()[-1:])
        if "Traceback" in self.err:
            return "traceback: " + self.err.strip().splitlines()[-1]
        if len(self.err.splitlines()) > 2:
            return f"{len(self.err.splitlines())} lines"
        if self.bytes > MOST_BYTES:
            return f"{self.bytes / 2**20:.0f} MB"
        return f"{self.seconds:.1f} s" if self.seconds > MOST_S else ""


def answer(argv: list[str]) -> Answer:
    """Run ``lmmap`` in a forked process under limits."""
    sys.stdout.flush()
    with tempfile.TemporaryFile() as err:
        idle = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        child = os.fork()
        if not child:
            code = 99
            try:
                os.setsid()
                silent = os.open(os.devnull, os.O_RDWR)
                for stream, target in ((0, silent), (1, silent), (2, err.fileno())):
                    os.dup2(target, stream)
                size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
                resource.setrlimit(resource.RLIMIT_AS, (size + HARD_BYTES, size + HARD_BYTES))
                resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
                code = command.main(argv)
            except SystemExit as stop:
                code = stop.code if isinstance(stop.code, int) else 1
            except BaseException:
                import traceback

                traceback.print_exc()
            finally:
                sys.stderr.flush()
                os._exit(code)
        ended = os.pidfd_open(child)
        poll = select.poll()
        poll.register(ended, select.POLLIN)
        if not poll.poll(WALL_S * 1000):
            os.killpg(child, signal.SIGKILL)
        os.close(ended)
        _, status, used = os.wait4(child, 0)
        err.seek(0)
        text = err.read().decode(errors="replace")
    bytes_above = max(0, used.ru_maxrss * 1024 - idle)
    return Answer(os.waitstatus_to_exitcode(status), text, bytes_above, used.ru_utime + used.ru_stime)


# --- sound files ----------------------------------------------------------------------------------


def recording(rng) -> Recording:
    """Two seconds of 64 x 48 px, with a truth."""
    e = np.zeros(4000, EVENT)
    e["t_us"] = np.sort(rng.integers(0, 2_000_000, len(e))) + 10**9
    e["x"], e["y"] = rng.integers(0, 64, len(e)), rng.integers(0, 48, len(e))
    e["p"] = rng.random(len(e)) < 0.5
    frames_us = 10**9 + 500_000 * np.arange(4)
    track = Trajectory(
        10**9 + 10**6 * np.arange(3),
        Pose(np.tile(np.diag([1.0, -1, -1]), (3, 1, 1)), np.tile([0, 0, 0.5], (3, 1))),
    )
    return Recording("r", CAMERA, e, rng.integers(0, 256, (4, 48, 64, 3), np.uint8), frames_us, track)


def sound_files(folder: Path, rng) -> dict[str, Path]:
    """A file (or folder) of each format that is attacked."""
    r = recording(rng)
    files = {}
    for suffix in (s for s in WRITERS if s != ".hdf5"):
        write_recording(r, folder / f"r{suffix}")
        files[suffix] = folder / f"r{suffix}"
    lines = (f"{t / 1e6:.6f} {x} {y} {int(p)}\n" for t, x, y, p in r.events.tolist())
    files[".txt"] = folder / "e.txt"
    files[".txt"].write_text("".join(lines))
    pictures = files["folder"] = folder / "pictures"
    pictures.mkdir()
    for k, (_, frame) in enumerate(r.timed_frames()):
        cv2.imwrite(str(pictures / f"{k}.png"), frame)
    (pictures / "images.txt").write_text("".join(f"{k}.5 {k}.png\n" for k in range(4)))
    video = cv2.VideoWriter(str(folder / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 20, (64, 48))
    for _, frame in r.timed_frames():
        video.write(frame)
    video.release()
    files[".avi"] = folder / "v.avi"
    CAMERA.save(folder / "camera.json")
    Port.lm_map().save(folder / "port.json")
    write_trajectory(r.truth, folder / "truth.csv")
    write_trajectory(r.truth, folder / "truth.tum", "tum")
    (folder / "camera.yaml").write_text(
        "image_width: 64\nimage_height: 48\ncamera_matrix: {rows: 3, cols: 3, data: [60, 0, 31.5, 0, 60, "
        "23.5, 0, 0, 1]}\ndistortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: "
        "[0.1, -0.2, 0.001, 0.002, 0.03]}\n"
    )
    (folder / "camchain.yaml").write_text(
        "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]\n"
        "  distortion_model: radtan\n  intrinsics: [60.0, 61.0, 31.5, 23.5]\n  resolution: [64, 48]\n"
    )
    names = ("camera.json", "camera.yaml", "camchain.yaml", "port.json", "truth.csv", "truth.tum")
    files |= {name: folder / name for name in names}
    weights = folder / "weights"
    weights.mkdir()
    for name in FILTERS:
        for shipped in (weight_path(name, "event"), weight_path(name, "event").with_suffix(".json")):
            (weights / shipped.name).write_bytes(shipped.read_bytes())
    files["weights"] = weights / weight_path("ring", "event").name
    files["card"] = files["weights"].with_suffix(".json")
    return files


# --- mutations ------------------------------------------------------------------------------------


def mutated(whole: bytes, rng, text: bool) -> tuple[str, bytes]:
    """The name of a mutation, and what it makes of a file."""
    if text and rng.random() < 0.75:
        return _mutated_text(whole.decode(errors="replace"), rng)
    kind = ("cut", "bits", "number", "zeros", "repeat", "swap")[rng.integers(6)]
    at = int(rng.integers(len(whole))) if rng.random() < 0.5 else int(rng.integers(min(len(whole), 2000)))
    content = bytearray(whole)
    if kind == "cut":
        del content[at:]
    elif kind == "bits":
        for k in rng.integers(len(whole), size=rng.integers(1, 8)):
            content[k] ^= 1 << int(rng.integers(8))
    elif kind == "number":
        form = ("<H", "<I", "<Q")[rng.integers(3)]
        number = struct.pack(form, NUMBERS[rng.integers(len(NUMBERS))] % 2 ** (8 * struct.calcsize(form)))
        content[at : at + len(number)] = number
    elif kind == "zeros":
        size = int(rng.integers(1, 4000))
        content[at : at + size] = bytes(size)
    elif kind == "repeat":
        content[at:at] = content[at : at + int(rng.integers(1, 5000))]
    else:
        other, size = int(rng.integers(len(whole))), int(rng.integers(1, 500))
        content[at : at + size], content[other : other + size] = (
            content[other : other + size],
            content[at : at + size],
        )
    return kind, bytes(content)


def _mutated_text(whole: str, rng) -> tuple[str, bytes]:
    """A token, a line or the nesting of a text changed."""
    lines = whole.splitlines(keepends=True) or [""]
    k = int(rng.integers(len(lines)))
    kind = ("token", "token", "token", "lost line", "line twice", "nested")[rng.integers(6)]
    if kind == "token":
        separators = ", :[]{}\n"
        places = [
            i
            for i, c in enumerate(lines[k])
            if c not in separators and (i == 0 or lines[k][i - 1] in separators)
        ]
        start = places[rng.integers(len(places))] if places else 0
        stop = next((i for i in range(start, len(lines[k])) if lines[k][i] in separators), len(lines[k]))
        lines[k] = lines[k][:start] + TOKENS[rng.integers(len(TOKENS))] + lines[k][stop:]
    elif kind == "lost line":
        del lines[k]
    elif kind == "line twice":
        lines.insert(k, lines[k])
    else:
        depth = int(rng.choice([30, 1000, 50_000]))
        lines[k] = lines[k].rstrip("\n") + "[" * depth + "]" * depth + "\n"
    return kind, "".join(lines).encode(errors="surrogateescape")


# --- directed attacks -----------------------------------------------------------------------------


def directed_files(folder: Path) -> dict[str, Path]:
    """Files that each break one promise of their format."""
    files = {}

    def add(name: str, content: bytes) -> None:
        files[name] = folder / name
        files[name].write_bytes(content)

    for suffix in (".aedat4", ".bag", ".h5", ".txt", ".avi"):
        files[f"fifo{suffix}"] = folder / f"fifo{suffix}"
        os.mkfifo(files[f"fifo{suffix}"])
        files[f"zero{suffix}"] = folder / f"zero{suffix}"
        files[f"zero{suffix}"].symlink_to("/dev/zero")
        files[f"sparse{suffix}"] = folder / f"sparse{suffix}"
        with files[f"sparse{suffix}"].open("wb") as file:
            file.truncate(2**33)
    with (folder / "line.txt").open("wb") as file:  # one line, whose end never comes
        file.write(b"1.0 1 1 1 ")
        file.truncate(2**32)
    files["line.txt"] = folder / "line.txt"
    for name, t_us in (("gap", 3_600_000_000), ("epoch", 1_700_000_000_000_000), ("end", 2**62)):
        add(
            f"{name}.txt",
            b"".join(b"%d %d 5 1\n" % (k * 50 + (t_us if k > 9000 else 0), k % 64) for k in range(18_000)),
        )
    add("int64.txt", b"9223372036854775807 1 1 1\n" * 50)
    add("seconds.txt", b"9.9e300 1 1 1\n" * 50)
    _directed_hdf5(files, folder)
    _directed_bags(files, folder)
    row = b"\x00" + bytes(2**16 * 3)
    pixels = zlib.compressobj(9)
    body = b"".join(pixels.compress(row) for _ in range(2**12)) + pixels.flush()
    for name, height in (("gigapixel", 2**14), ("cut", 2**12)):
        pictures = files[f"{name} folder"] = folder / name
        pictures.mkdir()
        (pictures / "0.png").write_bytes(_png(2**16, height, body))
        (pictures / "timestamps.txt").write_text("1.0\n")
    for name, time_text in (("huge", "9.9e300"), ("int", "9" * 30), ("nan", "nan."), ("negative", "-1.5")):
        pictures = files[f"{name} times"] = folder / f"times-{name}"
        pictures.mkdir()
        cv2.imwrite(str(pictures / "0.png"), np.zeros((48, 64, 3), np.uint8))
        (pictures / "timestamps.txt").write_text(f"{time_text}\n")
    return files


def _png(width: int, height: int, body: bytes) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def _directed_hdf5(files: dict, folder: Path) -> None:
    def columns(file, count, **layout):
        for name, dtype in (("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")):
            file.create_dataset(f"events/{name}", (count,), dtype, **layout)

    for name, count, layout in (
        ("never", 10**8, {"chunks": (10**6,)}),
        ("never-large", 10**12, {"chunks": (10**6,)}),
        ("never-contiguous", 10**9, {}),
        ("large-chunks", 2**31, {"chunks": (2**29,)}),
    ):
        files[f"{name}.h5"] = folder / f"{name}.h5"
        with h5py.File(files[f"{name}.h5"], "w") as file:
            columns(file, count, **layout)
    files["bomb.h5"] = folder / "bomb.h5"
    with h5py.File(files["bomb.h5"], "w") as file:
        columns(file, 10**6, chunks=(10**6,), compression="gzip")
        inflate = zlib.compressobj(9)
        bomb = b"".join(inflate.compress(bytes(2**24)) for _ in range(128)) + inflate.flush()
        for name in "txyp":
            file[f"events/{name}"].id.write_direct_chunk((0,), bomb)
    files["external.h5"] = folder / "external.h5"
    with h5py.File(files["external.h5"], "w") as file:
        columns(file, 10, external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])
    files["filter.h5"] = folder / "filter.h5"
    with h5py.File(files["filter.h5"], "w") as file:
        import hdf5plugin

        columns(file, 1000, chunks=(1000,), **hdf5plugin.Bitshuffle())
        for name in "txyp":
            file[f"events/{name}"][:] = 0
            file[f"events/{name}"].id.write_direct_chunk((0,), os.urandom(200))
    files["frames.h5"] = folder / "frames.h5"
    with h5py.File(files["frames.h5"], "w") as file:
        columns(file, 10)
        file.create_dataset("frames", (10**6, 48, 64, 3), "u1", chunks=(1, 48, 64, 3), compression="gzip")
        file["frames_t_us"] = np.arange(10**6)


def _directed_bags(files: dict, folder: Path) -> None:
    """Bags whose one chunk inflates to two gigabytes, or says that it does."""

    def field(name: bytes, value: bytes) -> bytes:
        return struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value

    def record(fields: bytes, data: bytes) -> bytes:
        return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data

    packer = bz2.BZ2Compressor(9)
    bomb = b"".join(packer.compress(bytes(2**24)) for _ in range(64)) + packer.flush()
    for name, content, size in (("bomb.bag", bomb, 1000), ("promise.bag", bomb, 2**32 - 1)):
        head = field(b"op", b"\x05") + field(b"compression", b"bz2") + field(b"size", struct.pack("<I", size))
        chunk = record(head, content)
        at = 13 + 4096
        index = record(
            field(b"op", b"\x04")
            + field(b"ver", struct.pack("<I", 1))
            + field(b"conn", bytes(4))
            + field(b"count", struct.pack("<I", 1)),
            struct.pack("<III", 1, 0, 0),
        )
        connection = record(
            field(b"op", b"\x07") + field(b"conn", bytes(4)) + field(b"topic", b"/dvs/events"),
            field(b"topic", b"/dvs/events")
            + field(b"type", b"dvs_msgs/EventArray")
            + field(b"md5sum", b"*")
            + field(b"message_definition", b"Header header\n"),
        )
        info = record(
            field(b"op", b"\x06")
            + field(b"ver", struct.pack("<I", 1))
            + field(b"chunk_pos", struct.pack("<Q", at))
            + field(b"start_time", bytes(8))
            + field(b"end_time", bytes(8))
            + field(b"count", struct.pack("<I", 1)),
            struct.pack("<II", 0, 1),
        )
        fields = (
            field(b"op", b"\x03")
            + field(b"index_pos", struct.pack("<Q", at + len(chunk) + len(index)))
            + field(b"conn_count", struct.pack("<I", 1))
            + field(b"chunk_count", struct.pack("<I", 1))
        )
        header = record(fields, b" " * (4096 - 8 - len(fields)))
        files[name] = folder / name
        files[name].write_bytes(b"#ROSBAG V2.0\n" + header + chunk + index + connection + info)


# --- cases ----------------------------------------------------------------------------------------


def commands(path: Path, kind: str, folder: Path, sound: dict[str, Path]) -> dict[str, list[str]]:
    """Every command that reads a file of a kind, by its name."""
    out, recording_path = folder / "out", sound[".h5"]
    fast = ["--rate", "2", "--events", "500"]
    if kind.startswith(("camera", "camchain")):
        return {"info": ["info", str(recording_path), "--camera", str(path)]}
    if kind == "port.json":
        return {
            "estimate": [
                "estimate",
                str(recording_path),
                "--modality",
                "event",
                *fast,
                "--port",
                str(path),
                "-o",
                f"{out}.csv",
                "--overwrite",
            ]
        }
    if kind.startswith("truth"):
        return {
            "evaluate": ["evaluate", str(recording_path), "--truth", str(path), "--modality", "rgb"],
            "score": ["odometry", "score", str(path), "--reference", str(sound["truth.csv"])],
        }
    if kind in ("weights", "card"):
        return {
            "estimate": [
                "estimate",
                str(recording_path),
                "--modality",
                "event",
                *fast,
                "--weights",
                str(path.parent),
                "-o",
                f"{out}.csv",
                "--overwrite",
            ]
        }
    camera = ["--camera", str(sound["camera.json"])]
    every = {
        "info": ["info", str(path), *camera],
        "estimate": [
            "estimate",
            str(path),
            *camera,
            "--modality",
            "event",
            *fast,
            "-o",
            f"{out}.csv",
            "--overwrite",
        ],
        "estimate rgb": [
            "estimate",
            str(path),
            *camera,
            "--modality",
            "rgb",
            "-o",
            f"{out}.tum",
            "--overwrite",
        ],
        "evaluate": ["evaluate", str(path), *camera, *fast, "--truth", str(sound["truth.csv"])],
        "export": ["odometry", "export", str(path), f"{out}-folder", *camera, "--overwrite"],
        "live": ["live", str(path), *camera, "--modality", "event", "--events", "500", "--seconds", "0.5"],
    }
    if kind.endswith("bag"):
        every["calibrate"] = ["calibrate", str(path), *camera, "-o", f"{out}.json", "--overwrite"]
        every["dataset"] = ["dataset", "check", str(path.parent)]
    return every


def cases(count: int, seed: int, folder: Path, directed: bool = True):
    """Yield the directed attacks and then mutated files, up to ``count``; each is written for its case."""
    rng = np.random.default_rng(seed)
    for name in ("sound", "directed", "mutated", "mutated/pictures", "mutated/weights"):
        (folder / name).mkdir()
    sound = sound_files(folder / "sound", rng)
    yielded = 0
    for name, path in (directed_files(folder / "directed") if directed else {}).items():
        kind = path.suffix or "folder"
        for which, argv in commands(path, kind, folder, sound).items():
            if which != "dataset" and yielded < count:
                yielded += 1
                yield Case(which, kind, f"directed: {name}", argv)
    kinds = sorted(sound)
    while yielded < count:
        kind = kinds[rng.integers(len(kinds))]
        path = sound[kind]
        attack, target = _mutate(kind, path, folder / "mutated", sound, rng)
        names = commands(target, kind, folder, sound)
        which = sorted(names)[rng.integers(len(names))]
        yielded += 1
        yield Case(which, kind, attack, names[which])


def _mutate(kind: str, path: Path, folder: Path, sound: dict[str, Path], rng) -> tuple[str, Path]:
    if kind == "folder":
        target = folder / "pictures"
        for source in path.iterdir():
            (target / source.name).write_bytes(source.read_bytes())
        source = sorted(path.iterdir())[rng.integers(5)]
        attack, content = mutated(source.read_bytes(), rng, source.suffix == ".txt")
        (target / source.name).write_bytes(content)
        return f"{attack} in {source.name}", target
    if kind in ("weights", "card"):
        for source in path.parent.iterdir():
            (folder / "weights" / source.name).write_bytes(source.read_bytes())
    attack, content = mutated(path.read_bytes(), rng, kind in (".txt", "card") or "." in kind[1:])
    target = folder / "weights" / path.name if kind in ("weights", "card") else folder / path.name
    target.write_bytes(content)
    return attack, target


def attack(
    count: int, seed: int, report=print, directed: bool = True
) -> tuple[collections.Counter, list[tuple[Case, Answer]]]:
    """Run so many cases; counts by command, format and exit code, and those whose answer is a violation."""
    tally, violations = collections.Counter(), []
    with suppress(KeyboardInterrupt), tempfile.TemporaryDirectory() as folder:  # what was counted is printed
        for case in cases(count, seed, Path(folder), directed):
            result = answer(case.argv)
            tally[case.command, case.format, result.code if not result.violation else "violation"] += 1
            if result.violation:
                violations.append((case, result))
                report(
                    f"VIOLATION {case.command} {case.format} [{case.attack}]: {result.violation}", flush=True
                )
    return tally, violations


def changed_inputs(folder: Path) -> list[tuple[list[str], str]]:
    """Run every command on sound files; arguments and problem of each bad answer or changed input."""
    inputs = folder / "inputs"
    inputs.mkdir()
    sound = sound_files(inputs, np.random.default_rng(0))
    before, ran, wrong = digests(inputs), set(), []
    for kind, path in sound.items():
        for name, argv in commands(path, kind, folder, sound).items():
            if (name, kind) in ran or (name == "live" and kind != ".h5"):
                continue
            ran.add((name, kind))
            problem = answer(argv).violation or (digests(inputs) != before and "an input changed")
            wrong += [(argv, problem)] if problem else []
    print(*sorted({name for name, _ in ran}))
    return wrong


def digests(folder: Path) -> dict[str, str]:
    """Hashes of all files below a folder, by their names in it."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def print_table(tally: collections.Counter) -> None:
    """Cases, exits and violations of each command and format."""
    print(f"{'command':14}{'format':16}{'cases':>7}{'exit 0':>8}{'exit 1':>8}{'violations':>12}")
    rows = sorted({key[:2] for key in tally})
    for row in rows:
        counts = [tally[*row, code] for code in (0, 1, "violation")]
        print(f"{row[0]:14}{row[1]:16}{sum(counts):7d}{counts[0]:8d}{counts[1]:8d}{counts[2]:12d}")
    totals = [sum(n for key, n in tally.items() if key[2] == code) for code in (0, 1, "violation")]
    print(f"{'all':30}{sum(totals):7d}{totals[0]:8d}{totals[1]:8d}{totals[2]:12d}")


def warm_up() -> None:
    """Import what commands import when they run, so that a forked process need not."""
    import lmmap.cli.authors
    import lmmap.cli.estimation
    import lmmap.cli.evaluation
    import lmmap.cli.recording
    import lmmap.studies.odometry_files  # noqa: F401


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("count", type=int, nargs="?", default=10_000)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--mutations-only", action="store_true", help="without the directed attacks")
    parser.add_argument("--sound-in", type=Path, help="run each command on sound files here instead")
    arguments = parser.parse_args()
    began = time.monotonic()
    warm_up()
    if arguments.sound_in:
        problems = changed_inputs(arguments.sound_in)
        print(*problems, sep="\n", end="", file=sys.stderr)
        sys.exit(bool(problems))
    counts, wrong = attack(arguments.count, arguments.seed, directed=not arguments.mutations_only)
    print_table(counts)
    print(json.dumps({"minutes": round((time.monotonic() - began) / 60, 1), "violations": len(wrong)}))
    sys.exit(bool(wrong))
