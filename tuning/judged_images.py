"""The images on which poses are counted and confidences tuned, with their masks, made once and kept.

The sequences are short, some on the bench and some in another laboratory (`validation_world`), whose
materials no network has seen.  The sets named tuning tune `calibrate_confidence`; others are held out.  The
first sets are small, and were looked at often.  So a larger one of the other laboratory judges each version
of the default networks once, and changes nothing.  The further tuning sets were added when looks turned out
to err together, which the small ones had not shown.  High light has most of the sequences, for most wrong
poses are there.  Ports unlike their CAD and slow ones, of which a sensor sees mostly its own noise, are there
so that the confidence knows them.  Images, masks and true poses are kept in data/derived/wrong, so that a
change of the geometry is judged in a minute; remove that folder after a change of the bench or the weights.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import joblib
import numpy as np
import torch
import validation_world as world
from tqdm import tqdm

from lmmap.estimation.images import timed_images
from lmmap.geometry.port import in_view
from lmmap.pipeline.network import TurnedToo
from lmmap.pipeline.weights import load_networks
from lmmap.settings import OURS
from lmmap.types import Camera, Port, Pose, Recording
from lmmap_lab.bench import laboratory, sequences, varied
from lmmap_lab.provenance import DERIVED_DATA

LIGHTS = ("low", "medium", "high")  # of `realistic-N`, by N modulo 3
PLACES = {  # number of the first sequence, and how many of each light
    "bench, tuning": (2001, {"low": 5, "medium": 8, "high": 25}),
    "bench, held out": (2301, {"low": 4, "medium": 5, "high": 13}),
    "other laboratory, tuning": (2501, {"low": 5, "medium": 5, "high": 12}),
    "other laboratory, held out": (2601, {"low": 4, "medium": 4, "high": 8}),
    "other laboratory, judged once": (3001, {"low": 20, "medium": 20, "high": 40}),
    "bench, further tuning": (4001, {"low": 15, "medium": 45, "high": 60}),
    "other laboratory, further tuning": (4501, {"low": 15, "medium": 45, "high": 65}),
    "varied ports, tuning": (5001, {"low": 4, "medium": 8, "high": 18}),
    "slow, tuning": (201, {"low": 4, "medium": 4, "high": 4}),
    "slow, held out": (231, {"low": 3, "medium": 3, "high": 3}),
}
SLOW = "speed-1.5"  # a port that moves by 1.5 mm/s
SECONDS = {"low": 0.6, "medium": 0.8, "high": 0.4}  # length of a recording
SLOW_SECONDS = 2.0  # of a slow port's, whose events are few
EACH = 2  # most images of each camera from it
KINDS = ("rgb", "event", "event wider")  # the last: the second look at each of the second
FOLDER = DERIVED_DATA / "wrong"
CAMERA, PORT = Camera.davis346(), Port.lm_map()


def of_light(light: str, first: int, count: int, kind: str = "realistic") -> list[str]:
    """Names of the first sequences of a light from a number on."""
    numbers = range(first, first + 3 * count)
    return [f"{kind}-{n}" for n in numbers if n % 3 == LIGHTS.index(light)]


SETS = {  # light by name of sequence
    place: {
        name: light
        for light, count in counts.items()
        for name in of_light(light, first, count, SLOW if place.startswith("slow") else "realistic")
    }
    for place, (first, counts) in PLACES.items()
}
EXACT = [place for place in SETS if not place.startswith("varied ports")]  # the port is its CAD
SEQUENCES = [name for names in SETS.values() for name in names]
LIGHT = {name: light for names in SETS.values() for name, light in names.items()}
ELSEWHERE = {name for place, names in SETS.items() if place.startswith("other") for name in names}
LATER = ("judged once", "further tuning", "varied ports", "slow")  # sets of the default networks alone
WEIGHTS = {place: (OURS.weights,) if any(part in place for part in LATER) else ("low", OURS.weights)
           for place in SETS}  # fmt: skip
CELLS = [(place, m, w) for place in SETS for m in ("rgb", "event") for w in WEIGHTS[place]]


class Look(NamedTuple):
    """An image, its masks (2, H, W) of ring and markers, the mean masks of it and its half turn, and the true
    pose."""

    image: np.ndarray
    masks: np.ndarray
    turned: np.ndarray
    truth: Pose


class Case(NamedTuple):
    """One image, and for events the second look at it."""

    set: str
    name: str
    light: str
    modality: str
    weights: str
    looks: list[Look]


def recorded(name: str) -> Recording:
    """A short recording; in the other laboratory its worlds take turns."""
    seconds = SLOW_SECONDS if name.startswith(SLOW) else SECONDS[LIGHT[name]]
    if name not in ELSEWHERE:
        port = varied.draw_port(laboratory.sequence(name)) if name in SETS["varied ports, tuning"] else None
        return sequences.simulate(name, seconds, setup=sequences.Setup(frame_hz=5), port=port)
    gap_m, sensor = world.of_turn(name)
    return sequences.simulate(name, seconds, sensor=sensor, setup=world.other_setup(gap_m))


def looks(recording: Recording, modality: str) -> dict[str, tuple[list, list]]:
    """Images with the ring in view and their true poses, evenly over the recording, by kind."""
    span_us, pairs = recording.truth.t_us, []
    for shot in timed_images(recording, modality):
        if modality == "event" and not shot.wider:
            continue
        both = [(shot.t_us, shot.image), *([shot.wider] if shot.wider else [])]
        truths = [recording.truth.at(np.clip([t], span_us[0], span_us[-1]))[0] for t, _ in both]
        if in_view(truths[0], PORT, CAMERA):
            pairs.append([(image, T) for (_, image), T in zip(both, truths, strict=True)])
    pairs = [pairs[i] for i in np.unique(np.linspace(0, len(pairs) - 1, min(EACH, len(pairs))).astype(int))]
    kinds = [kind for kind in KINDS if kind.startswith(modality)]
    return {kind: tuple(map(list, zip(*(f[k] for f in pairs), strict=True))) if pairs else ([], [])
            for k, kind in enumerate(kinds)}  # fmt: skip


def make(cells=None) -> None:
    """All images, and the masks of those sets that ``cells`` name (default: `CELLS`), one recording a process
    in memory."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    absent = [name for name in SEQUENCES if not path_of(name).exists()]
    _in_parallel(lambda name: _save(path_of(name), _arrays(recorded(name))), absent, "images")
    sets = {(place, weights) for place, _, weights in cells or CELLS}
    jobs = [(name, weights) for place, weights in sorted(sets) for name in SETS[place]]
    _in_parallel(lambda job: _save_masks(*job), [job for job in jobs if not path_of(*job).exists()], "masks")


def _in_parallel(function, arguments: list, what: str) -> None:
    tasks = (joblib.delayed(function)(argument) for argument in arguments)
    done = joblib.Parallel(os.cpu_count(), return_as="generator_unordered")(tasks)
    deque(tqdm(done, what, len(arguments), disable=None), maxlen=0)


def _save_masks(name: str, weights: str) -> None:
    """The masks that both networks make of each image, (N, 2, 2, H, W): of the image, and with its turn."""
    torch.set_num_threads(1)
    masks = {}
    with np.load(path_of(name)) as images:
        for kind in KINDS:
            networks = load_networks(weights, kind.split()[0])
            ways = networks, [TurnedToo(network) for network in networks]
            of_each = [[[f(image) for f in way] for way in ways] for image in images[kind]]
            masks[kind] = np.array(of_each, np.float16)
    _save(path_of(name, weights), masks)


def _arrays(recording: Recording) -> dict[str, np.ndarray]:
    """Images of all kinds, and their true poses."""
    arrays = {}
    for modality in ("rgb", "event"):
        for kind, (images, truths) in looks(recording, modality).items():
            arrays[kind] = np.array(images)
            arrays[f"{kind} rotation"] = np.array([T.rotation for T in truths]).reshape(-1, 3, 3)
            arrays[f"{kind} position_m"] = np.array([T.position_m for T in truths]).reshape(-1, 3)
    return arrays


def _save(path, arrays: dict[str, np.ndarray]) -> None:
    temporary = path.with_suffix(".tmp")
    with temporary.open("wb") as file:
        np.savez(file, **arrays)
    temporary.rename(path)


def path_of(name: str, weights: str = "images"):
    """Where the images of a sequence are kept, or the masks that a set of filters makes of them."""
    return FOLDER / f"{name}-{weights}.npz"


def cases(set_name: str, modality: str, weights: str) -> Iterator[Case]:
    """What `make` has kept of a set."""
    kinds = [kind for kind in KINDS if kind.startswith(modality)]
    for name, light in SETS[set_name].items():
        with np.load(path_of(name)) as data, np.load(path_of(name, weights)) as masks:
            parts = [[data[kind], masks[kind].astype(np.float32), data[f"{kind} rotation"],
                      data[f"{kind} position_m"]] for kind in kinds]  # fmt: skip
        for i in range(len(parts[0][0])):
            views = [Look(p[0][i], *p[1][i], Pose(p[2][i], p[3][i])) for p in parts]
            yield Case(set_name, name, light, modality, weights, views)
