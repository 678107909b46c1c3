"""Every public name, every argument: what is misuse is a ValueError that names it, or an `InputError`.

The names come from ``lmmap.__all__`` and the arguments from the signatures.  A new argument needs one good
value in `GOOD`, and is attacked like the others.
"""

import ast
import importlib
import inspect
from dataclasses import asdict, fields, is_dataclass, replace
from enum import Enum
from functools import cache, partial
from itertools import islice
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from strategies import PORT, pose

import lmmap
from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import ideal_masks
from lmmap.types import EVENT, InputError

CAMERA = lmmap.Camera(80, 60, 324.0, 324.0, 39.5, 29.5)
T = pose((40, 30), 1.2, 0.5, 0.8, camera=CAMERA)
RING, MASKS = circle_ellipse(T, PORT.ring_radius_m, CAMERA), ideal_masks(T, PORT, CAMERA)
TWO = lmmap.Pose(np.stack([T.rotation] * 2), np.stack([T.position_m] * 2))
FRAME = np.zeros((60, 80, 3), np.uint8)
OK = lmmap.Estimate(0, lmmap.Status.OK, T, covariance=1e-6 * np.eye(6), confidence=0.9)
EVENTS = np.zeros(4, EVENT)
RECORDING = lmmap.Recording("r", CAMERA, EVENTS, FRAME[None], np.array([0]))


@cache
def estimator() -> lmmap.Estimator:
    return lmmap.Estimator(CAMERA, PORT, "rgb", (lambda _: MASKS[0], lambda _: MASKS[1]))


GOOD = {
    "T_cam_circle": T, "T_cam_port": T, "after_us": None, "angle_rad": 0.3, "camera": CAMERA,
    "centre_px": [40.0, 30.0], "confidence": 0.9, "count": 3, "covariance": np.eye(6), "ellipse": RING,
    "estimate": OK, "estimates": [OK], "events": EVENTS, "focal_px": 300.0, "frames": FRAME[None],
    "frames_t_us": [0], "image": FRAME, "least": 0.5, "major": np.eye(3)[:2], "modality": "rgb",
    "name": "r", "p": np.ones(3), "path": "f.json", "v": np.ones(3),
    "points_px": RING.points(20), "port": PORT, "poses": TWO, "position_m": T.position_m, "radius_m": 0.08,
    "rate_hz": None, "recording": RECORDING, "rng": np.random.default_rng(0), "rotation": T.rotation,
    "semi_axes_px": [9.0, 8.0], "settings": lmmap.OURS, "size_px": (80, 60), "status": lmmap.Status.OK,
    "t_us": 0, "timed": [("rgb", OK)], "value": "ok", "weights": (lambda _: MASKS[0], lambda _: MASKS[1]),
    "x": [0, 1], "y": [0, 1], "yaw_period_rad": 2.0,
}  # fmt: skip
NETWORKS = {"camera": CAMERA, "weights": GOOD["weights"]}
OWN = {
    "Camera": asdict(CAMERA), "Estimator": NETWORKS, "Port": asdict(PORT), "PrintedEstimator": NETWORKS,
    "Tracker": {"estimators": lambda: [estimator()], "events": True}, "Trajectory": {"t_us": [0, 10]},
    "Trajectory.at": {"t_us": 5}, "estimate": {"estimator": estimator}, "windows_before": {"t_us": [0]},
}  # fmt: skip
INNER = {"on_grid", "in_camera", "to_grid", "together"}  # of the estimators' own parts
BAD = [
    None, 5, -1, 0, 2.5, float("nan"), float("inf"), 10**400, True, "a", b"a", [], {}, (), object(), len,
    [None], ["a"], np.zeros((2, 4)), np.eye(3), np.zeros(0), np.full(3, np.nan), np.array(["a"]),
    [[1], [1, 2]], Path("absent"), CAMERA, PORT, T, OK, RING, lmmap.OURS, lmmap.PAPER, (1, 2),
    {"rgb": 1}, lmmap.Camera, 1j, slice(2),
]  # fmt: skip


def call(function, arguments: dict):
    """A function's value for arguments by name; ``*args`` are given one after another."""
    positional, named = [], {}
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind == parameter.VAR_POSITIONAL:
            positional += list(arguments.get(name, ()))
        elif name in arguments:
            named[name] = arguments[name]
    value = function(*positional, **named)
    return list(islice(value, 3)) if inspect.isgenerator(value) else value


def own(label: str) -> dict:
    return {
        name: value() if name in ("estimator", "estimators") else value
        for name, value in OWN.get(label, {}).items()
    }


def good(label: str, function) -> dict:
    """What a call needs."""
    parameters = inspect.signature(function).parameters.values()
    needed = [p.name for p in parameters if p.default is p.empty and p.kind != p.VAR_KEYWORD]
    return {name: (GOOD | own(label))[name] for name in needed if name != "self"} | own(label)


def public() -> dict[str, object]:
    """All that a program may call, by its name: it is made anew for each attack."""
    found = {}
    for name in lmmap.__all__:
        value = getattr(lmmap, name)
        if isinstance(value, ModuleType):
            functions = dict(inspect.getmembers(value, inspect.isfunction))
            here = [n for n, f in functions.items() if f.__module__ == value.__name__ and n[0] != "_"]
            found |= {n: partial(getattr, value, n) for n in here}
        elif is_dataclass(value) and not isinstance(value, type):
            found[name] = partial(settings_of, value)
        elif not isinstance(value, type):
            found[name] = partial(getattr, lmmap, name)
        elif not issubclass(value, Enum | Exception):
            found[name] = partial(getattr, lmmap, name)
            for n, _ in inspect.getmembers(value, callable):
                if (n[0] != "_" and n not in INNER) or n == "__call__":
                    found[f"{name}.{n}"] = partial(method, name, n)
    return found


def settings_of(value):
    def change(**changes):
        return replace(value, **changes)

    named = partial(inspect.Parameter, kind=inspect.Parameter.KEYWORD_ONLY, default=None)
    change.__signature__ = inspect.Signature([named(f.name) for f in fields(value)])
    return change


def method(name: str, n: str):
    kind = getattr(lmmap, name)
    if inspect.ismethod(getattr(kind, n)):
        return getattr(kind, n)
    return getattr(call(kind, good(name, kind)), n)


PUBLIC = public()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that are not finite
@pytest.mark.parametrize("label", sorted(PUBLIC))
def test_misuse_of_any_argument_is_named(label, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    faults = []
    for name in inspect.signature(PUBLIC[label]()).parameters:
        for bad in BAD:
            function = PUBLIC[label]()
            arguments = good(label, function) | {name: bad}
            parameter = inspect.signature(function).parameters[name]
            if parameter.kind == parameter.VAR_KEYWORD:
                continue
            if parameter.kind == parameter.VAR_POSITIONAL:
                arguments[name] = [bad]
            try:
                call(function, arguments)
            except InputError:
                pass
            except ValueError as error:
                if not any(argument in str(error) for argument in inspect.signature(function).parameters):
                    faults.append((name, bad, f"{error!r:.200}"))
            except Exception as error:
                faults.append((name, bad, f"{error!r:.200}"))
    assert not faults, "\n".join(f"{name}={bad!r:.40}: {fault}" for name, bad, fault in faults)


def test_type_checkers_see_the_public_names():
    """At run time each is imported when it is first used, which no type checker follows."""
    stub = ast.parse(Path(lmmap.__file__).with_suffix(".pyi").read_text())
    homes = {alias.asname: node.module for node in stub.body for alias in node.names}
    assert sorted(homes) == lmmap.__all__
    for name, home in homes.items():
        value = getattr(importlib.import_module(f"lmmap.{home}"), name, None)
        assert (value or importlib.import_module(f"lmmap.{home}.{name}")) is getattr(lmmap, name)
