"""A small sound file of each format and kind, which the attack suite damages."""

from __future__ import annotations

from pathlib import Path

import cv2
import foreign_files
import h5py
import numpy as np
from library_files import WRITERS, write_recording
from rosbags.rosbag2 import StoragePlugin

from lmmap.pipeline.weights import FILTERS, weight_path
from lmmap.recordings.pose_files import write_trajectory
from lmmap.types import EVENT, Camera, Port, Pose, Recording, Trajectory

CAMERA = Camera(64, 48, 324.0, 324.0, 31.5, 23.5)


def recording(rng) -> Recording:
    """Two seconds of 64 x 48 px, with a truth on a helix: an odometry's track is compared with that."""
    e = np.zeros(4000, EVENT)
    e["t_us"] = np.sort(rng.integers(0, 2_000_000, len(e))) + 10**9
    e["x"], e["y"] = rng.integers(0, 64, len(e)), rng.integers(0, 48, len(e))
    e["p"] = rng.random(len(e)) < 0.5
    frames_us = 10**9 + 500_000 * np.arange(4)
    phase = np.linspace(0, 4 * np.pi, 81)
    helix_m = np.stack([0.1 * np.cos(phase), 0.1 * np.sin(phase), 0.5 + 0.01 * phase], -1)
    facing = np.tile(np.diag([1.0, -1, -1]), (len(phase), 1, 1))
    track = Trajectory(10**9 + 25_000 * np.arange(len(phase)), Pose(facing, helix_m))
    return Recording("r", CAMERA, e, rng.integers(0, 256, (4, 48, 64, 3), np.uint8), frames_us, track)


def sound_files(folder: Path, rng, r: Recording | None = None) -> dict[str, Path]:
    """A recording, by default at random, as a file or folder of each format, and what is read besides."""
    r, files = r or recording(rng), {}
    for suffix in (s for s in WRITERS if s != ".hdf5"):
        write_recording(r, folder / f"r{suffix}")
        files[suffix] = folder / f"r{suffix}"
    files |= _foreign_files(folder, r)
    pictures = files["folder"] = folder / "pictures"
    pictures.mkdir()
    for k, (_, frame) in enumerate(r.timed_frames()):
        cv2.imwrite(str(pictures / f"{k}.png"), frame)
    (pictures / "images.txt").write_text("".join(f"{k}.5 {k}.png\n" for k in range(4)))
    files["numbered"] = folder / "numbered"
    files["numbered"].mkdir()
    for picture in pictures.glob("*.png"):
        (files["numbered"] / picture.name).write_bytes(picture.read_bytes())
    video = cv2.VideoWriter(str(folder / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 20, r.camera.size_px)
    for _, frame in r.timed_frames():
        video.write(frame)
    video.release()
    files[".avi"] = folder / "v.avi"
    files[".png"] = folder / "one.png"
    cv2.imwrite(str(files[".png"]), r.frames[0])
    r.camera.save(folder / "camera.json")
    Port.lm_map().save(folder / "port.json")
    write_trajectory(r.truth, folder / "truth.csv")
    write_trajectory(r.truth, folder / "truth.tum", "tum")
    width_px, height_px = r.camera.size_px
    (folder / "camera.yaml").write_text(
        f"image_width: {width_px}\nimage_height: {height_px}\n"
        "camera_matrix: {rows: 3, cols: 3, data: [60, 0, 31.5, 0, 60, "
        "23.5, 0, 0, 1]}\ndistortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: "
        "[0.1, -0.2, 0.001, 0.002, 0.03]}\n"
    )
    (folder / "camchain.yaml").write_text(
        "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]\n"
        "  distortion_model: radtan\n  intrinsics: [60.0, 61.0, 31.5, 23.5]\n"
        f"  resolution: [{width_px}, {height_px}]\n"
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


def _foreign_files(folder: Path, r: Recording) -> dict[str, Path]:
    """The recording in each format that the package reads and does not write."""
    files = {suffix: folder / f"f{suffix}" for suffix in (".txt", ".csv", ".npy", ".raw", ".dat", ".es")}
    rows = r.events.tolist()
    files[".txt"].write_text("".join(f"{t / 1e6:.6f} {x} {y} {int(p)}\n" for t, x, y, p in rows))
    files[".csv"].write_text("t_us,x,y,p\n" + "".join(f"{t},{x},{y},{int(p)}\n" for t, x, y, p in rows))
    np.save(files[".npy"], r.events)
    files[".raw"].write_bytes(foreign_files.evt3(r.events, r.camera.size_px))
    files[".dat"].write_bytes(foreign_files.dat(r.events, r.camera.size_px))
    files[".es"].write_bytes(foreign_files.es(r.events, r.camera.size_px))
    files["CD.h5"] = folder / "CD.h5"
    with h5py.File(files["CD.h5"], "w") as file:
        columns = [r.events[name] for name in ("x", "y", "p", "t_us")]
        kinds = [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")]
        file["CD/events"] = np.rec.fromarrays(columns, dtype=kinds)
        file.attrs["geometry"] = "{}x{}".format(*r.camera.size_px)
    messages = [
        (
            "/events",
            foreign_files.array(r.events[i : i + 500], size_px=r.camera.size_px),
            int(r.events["t_us"][i]),
        )
        for i in range(0, len(rows), 500)
    ]
    messages += [("/image", foreign_files.image(frame, t_us), t_us) for t_us, frame in r.timed_frames()]
    for name, storage in (("ros2", StoragePlugin.MCAP), ("ros2-db3", StoragePlugin.SQLITE3)):
        files[name] = foreign_files.bag(folder / name, messages, storage)
        (single,) = (path for path in files[name].iterdir() if path.suffix in (".mcap", ".db3"))
        files[single.suffix] = folder / f"f{single.suffix}"
        files[single.suffix].write_bytes(single.read_bytes())
    return files
