"""One recording in every format that is read: the same poses to the last digit, the same health."""

import json

import cv2
import drawn
import foreign_files
import h5py
import numpy as np
import pytest
import test_prophesee as prophesee
import test_rosbag2 as ros2
from library_files import write_recording
from rosbags.rosbag2 import StoragePlugin

from lmmap.cli import main
from lmmap.recordings import formats
from lmmap.recordings.images import IMAGE_SUFFIXES

DRAWN, R = drawn.file(9), drawn.recording(9)
RATE_HZ = "2.7"  # one histogram, of events about number 250 000, where one chunk ends and the next begins


def library(path, r):
    write_recording(r, path)


def aedat(path, r):
    library(path.with_suffix(".aedat4"), r)
    path.with_suffix(".aedat4").rename(path)


def text(path, r):
    path.write_text("".join(f"{t} {x} {y} {int(p)}\n" for t, x, y, p in r.events.tolist()))


def csv(path, r):
    rows = (f"{t}000,{x},{y},{int(p)}\n" for t, x, y, p in r.events.tolist())
    path.write_text("t_ns,x@346,y@260,polarity\n" + "".join(rows))


def npy(path, r):
    rows = np.zeros(len(r.events), [("timestamp", "<i8"), ("x", "<u2"), ("y", "<u2"), ("polarity", "i1")])
    for name, field in (("timestamp", "t_us"), ("x", "x"), ("y", "y"), ("polarity", "p")):
        rows[name] = r.events[field]
    np.save(path, rows)


def raw(encoder):
    return lambda path, r: path.write_bytes(
        encoder(r.events).replace(b"height=720;width=1280", b"height=260;width=346")
    )


def dat(path, r):
    content = prophesee.dat(r.events)
    path.write_bytes(content.replace(b"Width 1280", b"Width 346").replace(b"Height 720", b"Height 260"))


def es(path, r):
    path.write_bytes(foreign_files.es(r.events, r.camera.size_px))


def prophesee_hdf5(path, r):
    rows = np.zeros(len(r.events), [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    for name, field in (("t", "t_us"), ("x", "x"), ("y", "y"), ("p", "p")):
        rows[name] = r.events[field]
    with h5py.File(path, "w") as file:
        file["CD/events"], file.attrs["geometry"] = rows, "346x260"


def packets(storage):
    def write(path, r):
        """Packets of 5000 events, by turns in the two encodings whose times are the clock's."""
        messages = []
        for i in range(0, len(r.events), 5000):
            part = r.events[i : i + 5000]
            base_us = int(part["t_us"][0])
            name = ("mono", "libcaer_cmp")[i // 5000 % 2]
            packed = getattr(ros2, name)(part, base_us)
            message = ros2.packet(name, packed, base_us, base_us * 1000, height=260, width=346)
            messages.append(("/events", message, base_us))
        for t_us, frame in r.timed_frames():
            message = ros2.KINDS["sensor_msgs/msg/Image"](
                header=ros2.header(t_us), height=260, width=346, encoding="rgb8", is_bigendian=0,
                step=3 * 346, data=frame.ravel(),
            )  # fmt: skip
            messages.append(("/image", message, t_us))
        folder = path if path.suffix == "" else path.with_suffix("")
        ros2.bag(folder, sorted(messages, key=lambda m: m[2]), storage)
        if path != folder:
            (file,) = [p for p in folder.iterdir() if p.suffix == path.suffix]
            file.rename(path)

    return write


def folder(path, r):
    path.mkdir()
    for k, frame in enumerate(r.frames):
        cv2.imwrite(str(path / f"{k:03d}.png"), frame[..., ::-1])
    (path / "timestamps.txt").write_text("".join(f"{t}\n" for t in r.frames_t_us))


EVENTS = {
    "e.aedat4": library, "e.aedat": aedat, "e.bag": library, "e.h5": library, "e.hdf5": prophesee_hdf5,
    "e.txt": text,
    "e.csv": csv, "e.npy": npy, "evt2.raw": raw(prophesee.evt2), "evt21.raw": raw(prophesee.evt21),
    "evt3.raw": raw(prophesee.evt3), "e.dat": dat, "e.es": es, "e.mcap": packets(StoragePlugin.MCAP),
    "e.db3": packets(StoragePlugin.SQLITE3), "bag2": packets(StoragePlugin.SQLITE3),
}  # fmt: skip
FRAMES = {name: EVENTS[name] for name in ("e.aedat4", "e.bag", "e.h5", "e.mcap", "e.db3", "bag2")}
FRAMES["pictures"] = folder
LOSSY = {*IMAGE_SUFFIXES, ".mp4", ".avi", ".mkv", ".mov"}  # one image, or changed ones: tested elsewhere


def test_every_format_is_here():
    here = {"." + name.partition(".")[2] if "." in name else "folder" for name in (*EVENTS, *FRAMES)}
    assert here | LOSSY == set(formats.suffixes())


@pytest.fixture(scope="module")
def poses(tmp_path_factory):
    """Bytes of the poses of a recording's images."""

    def run(path, modality):
        output = tmp_path_factory.mktemp("poses") / "poses.csv"
        camera = tmp_path_factory.mktemp("camera") / "camera.json"
        R.camera.save(camera)
        argv = ["estimate", str(path), "--modality", modality, "--camera", str(camera), "--rate", RATE_HZ]
        assert main.main([*argv, "-o", str(output)]) == 0
        return output.read_bytes()

    return run


@pytest.fixture(scope="module")
def reference(poses):
    return {modality: poses(DRAWN, modality) for modality in ("rgb", "event")}


@pytest.mark.parametrize("name", EVENTS | FRAMES)
def test_every_format_gives_the_same_poses(tmp_path, poses, reference, name, capsys):
    path = tmp_path / name
    (EVENTS | FRAMES)[name](path, R)
    R.camera.save(tmp_path / "c.json")
    capsys.readouterr()
    assert main.main(["info", str(path), "--camera", str(tmp_path / "c.json"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["backward_steps"] == facts["out_of_range"] == 0
    for modality, known, count in (("event", EVENTS, facts["events"]), ("rgb", FRAMES, facts["frames"])):
        if name in known:
            assert count == len(R.events if modality == "event" else R.frames)
            assert reference[modality].count(b",ok,") > 0
            assert poses(path, modality) == reference[modality]


def test_poses_are_drawn_afterwards(tmp_path, capsys):
    """On the frames and on the histograms that they were made of, and on no others."""
    for modality in ("rgb", "event"):
        output, video = tmp_path / f"{modality}.csv", tmp_path / f"{modality}.mp4"
        images = ["--modality", modality, "--rate", RATE_HZ]
        assert main.main(["estimate", str(DRAWN), *images, "-o", str(output)]) == 0
        assert main.main(["draw", str(DRAWN), str(output), *images, "-o", str(video)]) == 0
        count = len(output.read_text().splitlines()) - 1
        assert capsys.readouterr().out.splitlines()[-1].startswith(f"{video}: {count} images, ")
        film = cv2.VideoCapture(str(video))
        assert sum(film.read()[0] for _ in range(count + 3)) == count
    wrong = ["--modality", "rgb", "-o", str(tmp_path / "n.mp4")]
    assert main.main(["draw", str(DRAWN), str(output), *wrong]) == 1
    err = capsys.readouterr().err
    assert "give the --modality, --rate and --events" in err and not (tmp_path / "n.mp4").exists()


def test_an_interrupted_drawing_keeps_what_was_drawn(tmp_path, capsys, monkeypatch):
    """Ctrl-C ends the video after its last picture; the command again, with --overwrite, draws it whole."""
    poses, video = tmp_path / "poses.csv", tmp_path / "o.mp4"
    images = ["--modality", "rgb", "--rate", "10"]
    assert main.main(["estimate", str(DRAWN), *images, "-o", str(poses)]) == 0
    command = ["draw", str(DRAWN), str(poses), *images, "-o", str(video)]

    def stop(self, estimate):
        self.images += 1
        if self.images == 3:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("lmmap.cli.drawing.Bar.add", stop)
        assert main.main(command) == 130
    assert cv2.VideoCapture(str(video)).get(cv2.CAP_PROP_FRAME_COUNT) == 3
    assert main.main(command) == 1 and "--overwrite" in capsys.readouterr().err
    assert main.main([*command, "--overwrite"]) == 0
    count = len(poses.read_text().splitlines()) - 1
    assert cv2.VideoCapture(str(video)).get(cv2.CAP_PROP_FRAME_COUNT) == count > 3
    assert [p.name for p in tmp_path.iterdir() if "o.mp4" in p.name] == ["o.mp4"]
