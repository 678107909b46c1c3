"""Poses as ROS messages, in a ROS 1 bag or an MCAP file of ROS 2, for viewers such as RViz and Foxglove."""

from __future__ import annotations

import os
import re
import sys
from contextlib import ExitStack

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lmmap.files import atomic, check_output, lock, temporary
from lmmap.types import Estimate, InputError, Status

TOPICS = {"/port_pose": "geometry_msgs/msg/PoseWithCovarianceStamped", "/tf": "tf2_msgs/msg/TFMessage"}
STORES = {".bag": get_typestore(Stores.ROS1_NOETIC), ".mcap": get_typestore(Stores.ROS2_HUMBLE)}
STORES[".bag"].register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TOPICS["/tf"]))
END_US = 2**31 * 10**6  # of ROS's times


class PoseBag:
    """Reported poses as messages, in a file whose name ends in ``.bag`` (ROS 1) or ``.mcap`` (ROS 2).

    Use it in a ``with`` block in place of a `Journal`.  For each estimate that is ``ok``, ``/port_pose`` gets
    the pose with its covariance and ``/tf`` the transform, at the estimate's time.  A bag ends in an index,
    so the file gets its name only when the block ends; after an error, only if there was no older one.

    Parameters
    ----------
    frame_id, child_frame_id
        Names of the camera's frame (in ROS's terms an optical frame) and of the port's.

    Raises
    ------
    InputError
        If the file cannot be written, tf2 refuses a name, or ROS cannot represent a time.
    """

    def __init__(self, path, frame_id: str = "camera", child_frame_id: str = "port"):
        names = frame_id, child_frame_id
        fit = all(re.fullmatch(r"[^/\s]\S*", name) and name.isprintable() for name in names)
        if frame_id == child_frame_id or not fit:
            raise InputError(f"--frame-id {frame_id!a}, --child-frame-id {child_frame_id!a}: give two names "
                             "that differ, of letters, without spaces and without / in front")  # fmt: skip
        self.path = self.kept_in = check_output(path, overwrite=True)
        self.statuses: list[str] = []
        self._names, self._kind, self._held = names, self.path.suffix.lower(), ExitStack()
        self._bag = None

    def has(self, *times_us: int) -> bool:
        """Whether an estimate is there from an earlier run: never, because bags are always written anew."""
        return False

    def add(self, estimate: Estimate) -> None:
        """Write an estimate's messages, if it is ``ok``."""
        self.statuses.append(str(estimate.status))
        try:
            if self._bag is None:
                self._open()
            if estimate.status == Status.OK:
                self._write(estimate)
        except OSError:
            self._held.__exit__(*sys.exc_info())  # removes what was written, and raises an InputError
            raise

    def _open(self) -> None:
        part = self._held.enter_context(atomic(self.path, keep=True))
        if self._kind == ".bag":
            self._bag = rosbag1.Writer(part)
        else:  # rosbags makes a folder of this name, and the file in it
            above, name = self._held.enter_context(temporary(part)), self.path.stem  # which the file repeats
            above.mkdir()
            self._bag = rosbag2.Writer(above / name, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
            self._held.callback(os.replace, above / name / f"{name}.mcap", part)
        self._bag.open()
        self._held.callback(self._bag.close)
        store = STORES[self._kind]
        self._topics = [
            self._bag.add_connection(topic, kind, typestore=store) for topic, kind in TOPICS.items()
        ]

    def _write(self, e: Estimate) -> None:
        if not 0 <= e.t_us < END_US:
            raise InputError(
                f"{self.path}: a time of {e.t_us} us, but ROS has 0 to 2^31 s; name the output .csv"
            )
        store = STORES[self._kind]
        serialize = store.serialize_ros1 if self._kind == ".bag" else store.serialize_cdr
        for topic, message in zip(self._topics, messages(e, store.types, *self._names), strict=True):
            self._bag.write(topic, 1000 * int(e.t_us), serialize(message, topic.msgtype))

    def __enter__(self):
        self._held.enter_context(lock(self.path))
        return self

    def __exit__(self, *error):
        self._held.__exit__(*error)


def messages(e: Estimate, types: dict, frame_id: str, child_frame_id: str) -> tuple:
    """Convert an estimate with a pose to the messages of `TOPICS`, using the ``types`` of ROS 1 or 2.

    ROS wants the covariance of x, y, z and of rotations about the fixed axes X, Y, Z of the header's frame,
    the camera's: to first order, in which rotations commute, that is `Estimate.covariance`.
    """

    def make(name: str, *values):
        return types[f"geometry_msgs/msg/{name}"](*values)

    Header, Time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    number = {"seq": 0} if "seq" in Header.__annotations__ else {}  # in ROS 1
    stamp = Time(int(e.t_us) // 10**6, int(e.t_us) % 10**6 * 1000)
    header = Header(stamp=stamp, frame_id=frame_id, **number)
    place_m, turn = (
        e.T_cam_port.position_m.tolist(),
        make("Quaternion", *e.T_cam_port.quaternion_xyzw.tolist()),
    )
    covariance = np.zeros(36) if e.covariance is None else np.ravel(e.covariance)
    pose = make("PoseWithCovariance", make("Pose", make("Point", *place_m), turn), covariance)
    transform = make("Transform", make("Vector3", *place_m), turn)
    stamped = make("TransformStamped", header, child_frame_id, transform)
    return make("PoseWithCovarianceStamped", header, pose), types[TOPICS["/tf"]]([stamped])
