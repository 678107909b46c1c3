"""The book's table of formats is what the commands do with a small file of each.

    python tests/lab/book/test_format_table.py

writes data/results/formats.csv anew.
"""

import contextlib
import io
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import cv2
import drawn
import pandas as pd
import pytest
import test_calibrated as within
import test_every_format as every
from test_two_cameras import rpg

from lmmap.cli import main
from lmmap.recordings.formats import formats, open_recording, open_stream
from lmmap.recordings.pose_files import write_trajectory
from lmmap.shipped import DATA
from lmmap.types import InputError

TABLE = DATA / "results" / "formats.csv"
MEANS = {True: "yes", False: "no"}


def picture(path, r):
    cv2.imwrite(str(path), r.frames[0][..., ::-1])


def video(path, r):
    codec = {".mp4": "mp4v", ".mov": "mp4v"}.get(path.suffix, "MJPG")
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), 20, r.camera.size_px)
    for frame in r.frames:
        writer.write(frame[..., ::-1])
    writer.release()


FILES = {  # a file of each of `formats`, and what it is estimated from
    "e.aedat4": (every.library, "event"), "e.bag": (every.library, "event"),
    "bag": (every.EVENTS["bag2"], "event"),
    "e.raw": (every.EVENTS["evt3.raw"], "event"), "e.dat": (every.dat, "event"),
    "e.hdf5": (every.prophesee_hdf5, "event"), "e.es": (every.es, "event"),
    "e.txt": (every.text, "event"), "e.csv": (every.csv, "event"),
    "e.npy": (every.npy, "event"), "pictures": (every.folder, "rgb"), "p.png": (picture, "rgb"),
    "v.mp4": (video, "rgb"),
}  # fmt: skip


OF_BOTH = {"e.hdf5": ("e.h5", every.library), "pictures": ("pictures", rpg)}  # with frames and events
INFO = [("/dvs/camera_info", within.FISHEYE, {})]
CALIBRATED = {  # a file of a format that can hold its calibration
    "e.bag": lambda path: within.bag1(path, INFO), "bag": lambda path: within.bag2(path, INFO),
    "e.hdf5": lambda path: within.m3ed(path, within.FISHEYE),
}  # fmt: skip


def units(path: Path, camera: Path) -> str:
    """What settles the unit of a file's times."""
    for option, value in (("time_unit", "us"), ("fps", 20.0)):
        with contextlib.suppress(InputError):
            open_stream(path, camera, **{option: value})
            return f"--{option.replace('_', '-')}"
    return "stated"


def calibrations(name: str, place: Path) -> str:
    """Where a calibration is found that is not named."""
    if name not in CALIBRATED:
        open_stream(place / name)  # the one beside it
        return "beside it"
    inside = place / "far" / "away" / f"calibrated{Path(name).suffix}"
    inside.parent.mkdir(parents=True)
    CALIBRATED[name](inside)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return "in it, or beside it" if open_stream(inside).camera == within.FISHEYE else "not in it"


def works(*arguments) -> tuple[int, str]:
    """The exit code of a command and what it wrote to the error stream."""
    with contextlib.redirect_stderr(io.StringIO()) as err, contextlib.redirect_stdout(io.StringIO()):
        return main.main([str(a) for a in arguments]), err.getvalue()


def spoil(path: Path) -> None:
    """The first half of a file, or of the largest one of a folder, without its first 64 bytes."""
    if path.is_dir():
        path = max((p for p in path.iterdir() if p.suffix != ".yaml"), key=lambda p: p.stat().st_size)
    content = path.read_bytes()
    path.write_bytes(bytes(64) + content[64 : len(content) // 2])


def clocks(name: str, place: Path, camera: Path) -> str:
    """Whether the clocks of both cameras are compared: frames an hour late must not be fused."""
    r, (ending, write) = drawn.recording(3), OF_BOTH.get(name, (name, FILES[name][0]))
    path = place / f"late-{ending}"
    write(path, replace(r, frames_t_us=r.frames_t_us + 3_600_000_000))
    read = open_recording(path, camera)
    if not (len(read.events) and len(read.frames)):
        return "of one camera"
    code, err = works("estimate", path, "--camera", camera, "--modality", "fused", "-o", place / "late.csv")
    return "compared" if code == 1 and "do not overlap, so their clocks differ" in err else "no"


def tried(name: str, place: Path) -> dict[str, str]:
    """What each command does with a file."""
    write, modality = FILES[name]
    r, path, camera, truth = drawn.recording(3), place / name, place / "camera.json", place / "truth.csv"
    write(path, r)
    r.camera.save(camera)
    write_trajectory(r.truth, truth)
    used = path, "--camera", camera
    try:
        read = open_recording(path, camera)
        done = {"read": len(read.events) + len(read.frames) > 0}
    except Exception:  # whatever it is, the table says it
        done = {"read": False}
    done["units"] = units(path, camera)
    r.camera.save(path.with_suffix(".camera.json"))
    done["calibrations"] = calibrations(name, place)
    done["info"] = works("info", *used)[0] == 0
    done["estimate"] = works("estimate", *used, "--modality", modality, "-o", place / "o.csv")[0] == 0
    done["evaluate"] = works("evaluate", *used, "--modality", modality, "--truth", truth)[0] == 0
    spoil(path)
    code, err = works("estimate", *used, "--modality", modality, "-o", place / "p.csv")
    lines = [line for line in err.splitlines() if line.startswith("lmmap: ") and path.name in line]
    done["bad input is one line"] = code == 1 and len(lines) == 1
    facts = {k: MEANS.get(v, v) for k, v in done.items()} | {"clocks": clocks(name, place, camera)}
    return {"name": name, "images": modality} | facts


def row(k: int, place: Path) -> dict[str, str]:
    name = list(FILES)[k]
    ending = Path(name).suffix or {"bag": ".mcap", "pictures": "folder"}[name]
    what, suffixes = next((what, ends) for what, ends in formats().items() if ending in ends)
    return {"format": what, "name ends in": " ".join(suffixes)} | tried(name, place)


@pytest.mark.parametrize("k", range(len(FILES)), ids=FILES)
def test_the_table_says_what_the_commands_do(tmp_path, k):
    table = pd.read_csv(TABLE, dtype=str)
    assert len(table) == len(formats()) == len(FILES)
    made = row(k, tmp_path)
    assert made == table.iloc[k].to_dict()
    assert "no" not in made.values()


if __name__ == "__main__":
    rows = []
    for k in range(len(FILES)):
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row(k, Path(folder)))
    pd.DataFrame(rows).to_csv(TABLE, index=False)
    print(pd.DataFrame(rows).to_string())
