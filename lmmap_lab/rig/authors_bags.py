"""The authors' bags: what their data set holds, what a bag's name says, which bags of a folder are usable.

All of it is from the data set's public description.  The description does not say which lamps its words dark,
normal, light and mixed stand for: `LIGHT_LEVELS` is our reading.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lmmap.recordings.bags import IMAGES
from lmmap.recordings.rosbag import open_bag
from lmmap.types import InputError

from . import tf
from .hand_eye_file import read_hand_eye

HANDLE = "https://hdl.handle.net/2123/33938"
EVENTS, FRAMES, TF, STATES = "/dvs/events", "/dvs/image_raw", "/tf", "/joint_states"
HAND_EYE = "camera-to-robot-calibration_dvs.yaml"
STUDIES = (  # study, bags that it needs, their size
    ("table, test", "dataset_0307_notexture (testing), test_datasets_additional", "over 6 GB a bag"),
    ("table, low domain gap (training)", "dataset_0307, dataset_0307_notexture (training)", "not stated"),
    ("table, high domain gap (training)", "dataset_0307 (its two texture covers)", "not stated"),
    ("hard cases", "hard_cases_benchmark, hard_cases_additional", "not stated"),
    ("false detections", "dataset_0307 (its bag without a port)", "not stated"),
    ("odometry", "a test bag in high light", "over 6 GB a bag"),
    ("ground truth", HAND_EYE, "some hundred bytes"),
    ("misaligned truth, or a formula", "two test bags, and the ground truth's file", "over 6 GB a bag"),
    ("intrinsics", "the raw calibration bags", "not stated"),
)
LIGHT_LEVELS = {"dark": "low", "normal": "medium", "light": "high", "mixed": "mixed"}
LAMPS = re.compile(r"T(\d+)_RA_(\d+)_ES_([01])(?:_(\w+))?", re.I)
ROLE = re.compile(r"(?:.*_)?(dark|light|mixed|normal)__(train|test|hard)", re.I)
EMPTY, CALIBRATION = re.compile(r"no[_-]?port|empty", re.I), re.compile(r"calib|checker|chess", re.I)
EXPECTED = (
    "T1_RA_50_ES_1_NAME.bag, dark|light|mixed|normal__train|test|hard.bag, or a name with noport or calib"
)


@dataclass(frozen=True)
class AuthorsBag:
    """What the name and the folder of one of the authors' bags say.

    ``role`` is train, test, hard, empty or calibration; ``light`` is low, medium, high or mixed;
    ``textured`` says that the satellite has one of the covers for training.
    """

    path: Path
    role: str
    light: str | None = None
    trajectory: int | None = None
    textured: bool = False


def describe_bag(path) -> AuthorsBag:
    """What a bag's name and folder say; raises `InputError` if they say nothing.

    The lamps' numbers decide before the words: any sunlight is high light, earthshine alone is medium light.
    """
    path = Path(path)
    stem, folder = path.stem, path.parent.name
    lamps, named_role = LAMPS.search(stem), ROLE.fullmatch(stem)
    light = LIGHT_LEVELS[named_role[1].lower()] if named_role else None
    trajectory = int(lamps[1]) if lamps else None
    if lamps:
        light = "high" if int(lamps[2]) else ("medium" if lamps[3] == "1" else "low")
    if EMPTY.search(stem):
        role = "empty"
    elif CALIBRATION.search(stem):
        role = "calibration"
    elif named_role:
        role = named_role[2].lower()
    elif lamps:
        words = f"{folder}/{stem}".lower()
        role = next((r for r in ("hard", "test") if r in words), "train")
    else:
        raise InputError(
            f"{path}: its name says neither light nor purpose; name it as the authors did ({EXPECTED})"
        )
    textured = role == "train" and "notexture" not in f"{folder}/{stem}".lower()
    return AuthorsBag(path, role, light, trajectory, textured)


def list_bags(folder) -> list[Path]:
    """All bags below a folder, by name; raises `InputError` if there is none."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give the one with the authors' bags")
    paths = sorted(folder.rglob("*.bag"))
    if not paths:
        packed = len([*folder.rglob("*.tar"), *folder.rglob("*.tar.gz")])
        if packed:
            raise InputError(f"{folder}: holds {packed} archives but no bag; unpack them (tar xf)")
        raise InputError(f"{folder}: holds no bag; see lmmap dataset")
    return paths


def hand_eye_file(folder, deep: bool = True) -> Path | None:
    """The hand-eye calibration of the DAVIS in a folder, or (``deep``) anywhere below it."""
    for pattern in (HAND_EYE, "*camera-to-robot*.y*ml", "*hand*eye*.y*ml"):
        if paths := sorted(Path(folder).rglob(pattern) if deep else Path(folder).glob(pattern)):
            return paths[0]
    return None


def check_bags(folder) -> Iterator[dict]:
    """Yield for each bag, in order, what it is and ``problem``, which is empty if the bag is usable."""
    hand_eye = hand_eye_file(folder)
    for path in list_bags(folder):
        row = {"bag": str(path.relative_to(folder)), "gigabytes": path.stat().st_size / 1e9, "role": "",
               "light": "", "seconds": None, "whole": False, "problem": ""}  # fmt: skip
        try:
            facts = bag_contents(path)
            row |= {"seconds": facts["seconds"], "whole": True}
            bag = describe_bag(path)
            row |= {"role": bag.role, "light": bag.light or ""}
            _require_contents(bag, facts, hand_eye)
        except InputError as error:
            row["problem"] = str(error).removeprefix(f"{path}: ")
        yield row


def bag_contents(path) -> dict:
    """A bag's seconds and its topics' messages, by its index; raises `InputError` if it is cut short."""
    with open_bag(path) as bag:
        topics = {name: (t.msgtype, t.msgcount) for name, t in bag.topics.items()}
        return {"seconds": bag.duration * 1e-9, "topics": topics}


def _require_contents(bag: AuthorsBag, facts: dict, hand_eye: Path | None) -> None:
    """Raise `InputError` if the bag lacks something that its purpose needs."""
    kinds = {kind for kind, count in facts["topics"].values() if count}
    has = {EVENTS: any(k.endswith("/EventArray") for k in kinds), FRAMES: bool(kinds & set(IMAGES))}
    if bag.role == "calibration":
        has.pop(EVENTS)
    if missing := [topic for topic, there in has.items() if not there]:
        topics = ", ".join(sorted(facts["topics"])) or "none"
        raise InputError(f"{bag.path}: no messages of {', '.join(missing)} among its topics ({topics}); "
                         "download it again")  # fmt: skip
    if bag.role not in ("empty", "calibration"):
        ends = read_hand_eye(hand_eye).ends if hand_eye else tf.arm_ends(bag.path)
        tf.arm_motion(bag.path, *ends, tf.GLANCE_S)
