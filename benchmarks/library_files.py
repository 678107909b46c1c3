"""AEDAT4, ROS 1 bags and HDF5 as iniVation's, ROS's and HDF5's own libraries write them.

For tests and for the attack suite, as `foreign_files`: what is read is not what our own writers wrote.
"""

from __future__ import annotations

from pathlib import Path

import dv_processing as dv
import h5py
import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lmmap.recordings.pose_files import write_trajectory
from lmmap.types import Recording

STORE = get_typestore(Stores.ROS1_NOETIC)
STORE.register(
    get_types_from_msg("uint16 x\nuint16 y\ntime ts\nbool polarity\n", "dvs_msgs/msg/Event")
    | get_types_from_msg(
        "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n",
        "dvs_msgs/msg/EventArray",
    )
)
PER_MESSAGE = 10_000  # events


def aedat4(r: Recording, path: Path) -> None:
    """By dv-processing, in the packets that it makes itself."""
    config = dv.io.MonoCameraWriter.Config(r.name, dv.CompressionType.ZSTD)
    config.addEventStream(r.camera.size_px)
    config.addFrameStream(r.camera.size_px)
    writer, store = dv.io.MonoCameraWriter(str(path), config), dv.EventStore()
    for event in r.events.tolist():
        store.push_back(*event)
    if len(r.events):
        writer.writeEvents(store)
    for t_us, frame in r.timed_frames():
        writer.writeFrame(dv.Frame(t_us, np.ascontiguousarray(frame[..., ::-1])))
    del writer  # closes the file


def bag(r: Recording, path: Path) -> None:
    """By rosbags, whose serialiser makes each message."""
    width, height = r.camera.size_px
    event = STORE.types["dvs_msgs/msg/Event"]
    with Writer(path) as file:
        for topic, kind, messages in (
            ("/dvs/events", "dvs_msgs/msg/EventArray", [
                (part[-1][0], dict(events=[event(x, y, _time(t_us), p) for t_us, x, y, p in part]))
                for i in range(0, len(r.events), PER_MESSAGE)
                for part in [r.events[i : i + PER_MESSAGE].tolist()]
            ]),
            ("/dvs/image_raw", "sensor_msgs/msg/Image", [
                (t_us, dict(encoding="rgb8", is_bigendian=0, step=3 * width, data=frame.ravel()))
                for t_us, frame in r.timed_frames()
            ]),
        ):  # fmt: skip
            connection = file.add_connection(topic, kind, typestore=STORE)
            for t_us, fields in messages:
                header = STORE.types["std_msgs/msg/Header"](seq=0, stamp=_time(t_us), frame_id="")
                message = STORE.types[kind](header=header, height=height, width=width, **fields)
                file.write(connection, t_us * 1000, STORE.serialize_ros1(message, kind))


def _time(t_us: int):
    return STORE.types["builtin_interfaces/msg/Time"](sec=t_us // 10**6, nanosec=t_us % 10**6 * 1000)


def hdf5(r: Recording, path: Path) -> None:
    """By h5py, in DSEC's layout with frames added."""
    packed = dict(chunks=True, compression="gzip", shuffle=True, fletcher32=True)
    with h5py.File(path, "w") as file:
        file.attrs["size_px"] = r.camera.size_px
        for name, values in zip("txyp", (r.events[field] for field in r.events.dtype.names), strict=True):
            values = values.astype(np.uint8) if name == "p" else values
            file.create_dataset(f"events/{name}", data=values, maxshape=(None,), **packed)
        file.create_dataset("frames", data=r.frames, maxshape=(None, *r.frames.shape[1:]), **packed)
        file["frames_t_us"] = r.frames_t_us


WRITERS = {".aedat4": aedat4, ".bag": bag, ".h5": hdf5, ".hdf5": hdf5}


def write_recording(recording: Recording, path: Path) -> None:
    """Write in the format that the name ends in, unchecked, and beside it the camera and the truth."""
    WRITERS[path.suffix](recording, path)
    recording.camera.save(path.with_suffix(".camera.json"))
    if recording.truth is not None:
        write_trajectory(recording.truth, path.with_suffix(".truth.csv"))
