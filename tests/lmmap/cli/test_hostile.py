"""Commands lose nothing: outputs that are not theirs stay, inputs never change, and answers are short."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import drawn
import pytest

from lmmap.errors import InputError
from lmmap.files import lock
from lmmap.recordings.journal import Journal
from lmmap.shipped import ROOT
from lmmap.types import Camera

DRAWN = drawn.file(6)
NOTES = "notes that nobody has a copy of\nand a second line"


def digests(folder: Path) -> dict[str, str]:
    """Hashes of the files in a folder, by their names."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}


def estimate(output, *extra, recording=DRAWN):
    return ("estimate", recording, "--modality", "rgb", "--rate", "5", "-o", output, *extra)


@pytest.mark.parametrize("extra", [(), ("--resume",), ("--resume", "--format", "tum")])
def test_a_file_that_is_not_ours_is_not_touched(tmp_path, lmmap, extra):
    path = tmp_path / "poses.csv"
    path.write_text(NOTES)
    code, _, err = lmmap(*estimate(path, *extra))
    assert code == 1 and len(err.splitlines()) == 1 and path.read_text() == NOTES
    assert [p.name for p in tmp_path.iterdir()] == ["poses.csv"]


@pytest.mark.parametrize("flag", ["--overwrite", "--resume"])
def test_no_output_replaces_an_input(tmp_path, lmmap, flag):
    for source in (DRAWN, DRAWN.with_suffix(".camera.json"), DRAWN.with_suffix(".truth.csv")):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    before = digests(tmp_path)
    recording = tmp_path / DRAWN.name
    (tmp_path / "link.csv").symlink_to(recording)
    for output in (
        recording,
        recording.with_suffix(".camera.json"),
        recording.with_suffix(".truth.csv"),
        tmp_path / "link.csv",
    ):
        code, _, err = lmmap(*estimate(output, flag, recording=recording))
        assert code == 1 and "is also read as" in err
    assert {k: v for k, v in digests(tmp_path).items() if k != "link.csv"} == before


def test_an_output_that_exists_needs_a_word(tmp_path, lmmap):
    path = tmp_path / "poses.csv"
    assert lmmap(*estimate(path))[0] == 0
    before = digests(tmp_path)
    code, _, err = lmmap(*estimate(path))
    assert code == 1 and "--overwrite" in err and digests(tmp_path) == before
    assert lmmap(*estimate(path, "--resume"))[0] == 0 and digests(tmp_path) == before
    code, _, err = lmmap(*estimate(path, "--resume", "--flip", "x"))
    assert code == 1 and "another flip" in err and digests(tmp_path) == before
    assert lmmap(*estimate(path, "--overwrite"))[0] == 0 and digests(tmp_path) == before


def test_two_processes_on_one_output(tmp_path):
    path = tmp_path / "poses.csv"
    code = (
        "import sys; from lmmap.errors import InputError; from lmmap.files import lock\n"
        "try:\n    with lock(sys.argv[1]): print('free')\nexcept InputError as error: print(error)"
    )
    with Journal(path):
        held = subprocess.run(
            [sys.executable, "-c", code, path], capture_output=True, text=True, cwd=ROOT
        ).stdout
        with pytest.raises(InputError, match="another process"), lock(path):
            pass
    free = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, cwd=ROOT).stdout
    assert "another process writes" in held and free == "free\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "argv",
    [
        ("info", DRAWN, "--camera", "{}.json"),
        ("info", DRAWN, "--camera", "{}.yaml"),
        ("estimate", DRAWN, "--modality", "rgb", "--port", "{}.json", "-o", "{}.out.csv"),
        ("evaluate", DRAWN, "--truth", "{}.csv"),
        ("draw", DRAWN, "{}.csv", "--modality", "rgb", "-o", "{}.out.webm"),
    ],
    ids=lambda argv: " ".join(str(a) for a in argv[:1] + argv[2:4]),
)
def test_what_never_ends_is_not_read(tmp_path, lmmap, argv):
    """Pipes and devices in the place of every other file that a command reads."""
    for kind in ("pipe", "device"):
        for suffix in (".json", ".yaml", ".csv", ".tum"):
            path = tmp_path / f"{kind}{suffix}"
            os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero")
        code, _, err = lmmap(*(str(a).replace("{}", str(tmp_path / kind)) for a in argv))
        assert code == 1 and len(err.splitlines()) == 1 and "a device or a pipe" in err, err


def test_a_jump_of_hours_at_a_rate_ends_in_seconds(tmp_path, lmmap):
    lines = [f"{50 * k + (7_200_000_000 if k > 9000 else 0)} {k % 64} 5 1\n" for k in range(18_000)]
    (tmp_path / "gap.txt").write_text("".join(lines))
    Camera(64, 48, 324.0, 324.0, 31.5, 23.5).save(tmp_path / "camera.json")
    code, out, err = lmmap(
        "estimate",
        tmp_path / "gap.txt",
        "--camera",
        tmp_path / "camera.json",
        "--modality",
        "event",
        "--events",
        "500",
        "--rate",
        "100",
        "-o",
        tmp_path / "p.csv",
        "--json",
    )
    assert code == 0 and "no events for 7200 s" in err and len(err.splitlines()) == 1
    assert json.loads(out)["images"] < 120
