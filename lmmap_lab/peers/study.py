"""Does mixing pay?  The pipeline and its peers on the same images, side by side."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch.utils.flop_counter import FlopCounterMode

from lmmap.estimation.images import images
from lmmap.evaluation.error_table import METRICS, errors
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.printed import PrintedEstimator
from lmmap.pipeline.weights import FILTERS, load_network, weight_path
from lmmap.settings import OURS, PerCamera
from lmmap.types import Camera, Estimate, Port, Recording

from ..studies.bootstrap import interval
from ..studies.claims_of_mixing import GEOMETRY, OURSELVES, PRINTED
from ..studies.reliability import confidences, joined
from ..studies.right_and_wrong import right_and_wrong
from ..training.dataset import spread
from . import geometry
from .train import PEERS, load, weights_path

PIPELINE_SET = "low"  # the shipped networks that learned from the same images as the peers
KINDS = ("right", "wrong", "none")
SHARES = tuple(f"{kind}_percent" for kind in KINDS)
MOST_WRONG_PERCENT = 1.0  # of the tuning images, where a peer's limit on its confidence lies
DRAWS = 2000  # of the sequences, for an interval
ROUNDS = 20  # of timed images
Answer = Callable[[np.ndarray, int], Estimate]
Found = dict[str, tuple[list, list, list]]  # three tables of each recording, by method


def estimators(modality: str, weights: Path, limits: dict[str, float] | None = None,
               camera: Camera | None = None, port: Port | None = None) -> dict[str, Answer]:  # fmt: skip
    """Geometry alone, the pipeline, the paper's procedure, and the peers that ``weights`` has networks of.

    Parameters
    ----------
    weights
        A folder of networks that `train` saved.  If the pipeline's are not there, those of `PIPELINE_SET`
        are used.
    limits
        Least confidence of a peer's reported pose, by its name; default: 0.  The pipeline keeps its own
        limit, and the paper's procedure uses no confidence.
    """
    limits = limits or {}
    least = PerCamera(*[limits.get(GEOMETRY, 0.0)] * 2)
    made: dict[str, Answer] = {
        GEOMETRY: geometry.estimator(modality, camera, port, settings=replace(OURS, min_confidence=least))
    }
    networks = tuple(load_network(path, modality, "float32") for path in filter_paths(weights, modality))
    made[OURSELVES] = Estimator(camera, port, modality, networks)
    made[PRINTED] = PrintedEstimator(camera, port, modality, networks)
    paths = {peer: weights_path(weights, peer, modality) for peer in PEERS}
    return made | {
        peer: load(path, camera, port, limits.get(peer, 0.0)) for peer, path in paths.items() if path.exists()
    }


def filter_paths(weights: Path, modality: str) -> list[Path]:
    """Files of the pipeline's networks in the folder ``weights``, or of `PIPELINE_SET` if it holds none."""
    own = [weights_path(weights, name, modality) for name in FILTERS]
    if any(path.exists() for path in own):
        return own
    return [weight_path(name, modality, PIPELINE_SET) for name in FILTERS]


def own_limit(tables: Sequence[pd.DataFrame], known: Sequence[pd.DataFrame],
              most_percent: float = MOST_WRONG_PERCENT) -> float:  # fmt: skip
    """The least confidence from which on at most this share of the images has a wrong pose.

    Parameters
    ----------
    tables, known
        `error_table.errors` and `reliability.confidences` of sequences.
    """
    shown = joined(tables, known).query("in_view")
    poses = shown[shown.right.notna()].sort_values("confidence", ascending=False, kind="stable")
    wrong_percent = 100 * (poses.right == 0).cumsum() / len(shown)
    allowed = poses.confidence[wrong_percent <= most_percent]
    return float(allowed.iloc[-1]) if len(allowed) else 1.0


def networks_of(estimator: Answer) -> list[torch.nn.Module]:
    """The networks that answer."""
    own = [getattr(estimator, name, None) for name in ("net", "ring_network", "reflector_network")]
    nets = [getattr(net, "_net", net) for net in own]
    return [net for net in nets if isinstance(net, torch.nn.Module)]


def cost(makes: dict[str, Answer], image: np.ndarray) -> pd.DataFrame:
    """A row a method: ``parameters`` of its networks, ``gflop`` that they take for an image by torch's own
    count, and median milliseconds on one thread and on two, the methods in turns (``ms_1``, ``ms_2``)."""
    rows, threads = {name: {} for name in makes}, torch.get_num_threads()
    for name, estimator in makes.items():
        with FlopCounterMode(display=False) as counter:
            estimator(image, 0)  # which also compiles
        rows[name]["parameters"] = sum(p.numel() for net in networks_of(estimator) for p in net.parameters())
        rows[name]["gflop"] = counter.get_total_flops() / 1e9
    for count in (1, 2):
        torch.set_num_threads(count)
        spent_s = {name: [] for name in makes}
        for _ in range(ROUNDS):
            for name, estimator in makes.items():
                start_s = time.perf_counter()
                estimator(image, 0)
                spent_s[name].append(time.perf_counter() - start_s)
        for name, each in spent_s.items():
            rows[name][f"ms_{count}"] = 1e3 * float(np.median(each))
    torch.set_num_threads(threads)
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("method").reset_index()


def answered(recordings: Iterable[Recording], modality: str, makes: dict[str, Answer],
             most: int | None = None, port: Port | None = None) -> Found:  # fmt: skip
    """By method, tables of the same images of recordings with truth, of each at most ``most``, evenly spread:
    `error_table.errors` of the poses reported, `reliability.confidences`, and errors of every pose, the
    doubtful ones too."""
    port, found = port or Port.lm_map(), {name: ([], [], []) for name in makes}
    for recording in recordings:
        shots = list(images(recording, modality))
        shots = [shots[i] for i in spread(len(shots), most or len(shots))]
        for name, estimator in makes.items():
            answers = [estimator(image, t_us) for t_us, image in shots]
            found[name][0].append(errors(recording, answers, port))
            found[name][1].append(confidences(recording, answers, port))
            every = [replace(answer, T_cam_port=answer.found) for answer in answers]
            found[name][2].append(errors(recording, every, port))
    return found


def side_by_side(found: Found) -> pd.DataFrame:
    """A row a method: right, wrong and none in percent of the images with the ring in view, with 95 %
    intervals over sequences (``_low``, ``_high``); the same if every pose were reported (``every_``); and the
    median errors of every pose."""
    rows = []
    for name, (tables, _, every) in found.items():
        of_every = {f"every_{what}": share for what, share in shares(every).items() if what.startswith(KINDS)}
        rows.append({"method": name, **shares(tables), **of_every,
                     **pd.concat(every)[list(METRICS)].median()})  # fmt: skip
    return pd.DataFrame(rows)


def shares(tables: list[pd.DataFrame]) -> dict[str, float]:
    """`right_and_wrong` of sequences, with intervals by the bootstrap over them."""
    ours = right_and_wrong(tables).query("estimator == 'ours'").iloc[0]
    seen = [table for table in tables if table.in_view.any()]
    each = pd.concat([right_and_wrong([table]).iloc[:1] for table in seen])
    drawn = np.random.default_rng(0).integers(0, len(each), (DRAWS, len(each)))
    values, weights = each[list(SHARES)].to_numpy()[drawn], each.images.to_numpy()[drawn]
    means = (values * weights[..., None]).sum(1) / weights.sum(1)[:, None]
    found = {"images": int(ours.images), "sequences": len(each)}
    for name, draws in zip(SHARES, means.T, strict=True):
        found[name] = ours[name]
        found[name.replace("percent", "low")], found[name.replace("percent", "high")] = interval(draws)
    return found
