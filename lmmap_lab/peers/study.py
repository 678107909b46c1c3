"""Does mixing pay?  The pipeline and its peers on the same images, side by side.

    python -m lmmap_lab.peers.study realistic-2401 realistic-2402 --seconds 2 --weights FOLDER -o peers.csv

``FOLDER`` has what `train` saved; a peer without weights there is left out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch.utils.flop_counter import FlopCounterMode

from lmmap.estimation.images import images
from lmmap.evaluation.error_table import METRICS, errors
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import MODALITIES, OURS
from lmmap.types import Estimate, Port, Recording

from ..bench import sequences
from ..provenance import save_table
from ..studies.bootstrap import interval
from ..studies.reliability import confidences
from ..studies.right_and_wrong import by_limit, right_and_wrong
from . import geometry
from .train import PEERS, load, weights_path

OURSELVES, GEOMETRY = "pipeline", "geometry"
SHARES = ("right_percent", "wrong_percent", "none_percent")
DRAWS = 2000  # of the sequences, for an interval
Answer = Callable[[np.ndarray, int], Estimate]


def estimators(modality: str, weights: Path | None, networks: str = OURS.weights) -> dict[str, Answer]:
    """The pipeline with a set of networks, and each peer that needs no weights or has some."""
    made = {OURSELVES: Estimator(modality=modality, weights=networks), GEOMETRY: geometry.estimator(modality)}
    paths = {peer: weights_path(weights, peer, modality) for peer in PEERS} if weights else {}
    return made | {peer: load(path) for peer, path in paths.items() if path.exists()}


def networks_of(estimator: Answer) -> list[torch.nn.Module]:
    """The networks that answer."""
    own = [getattr(estimator, name, None) for name in ("net", "ring_network", "reflector_network")]
    nets = [getattr(net, "_net", net) for net in own]
    return [net for net in nets if isinstance(net, torch.nn.Module)]


def cost(estimator: Answer, image: np.ndarray) -> dict[str, float]:
    """The ``parameters`` of an estimator's networks, and the ``gflop`` that they take for an image, by
    torch's own count."""
    with FlopCounterMode(display=False) as counter:
        estimator(image, 0)
    parameters = sum(p.numel() for net in networks_of(estimator) for p in net.parameters())
    return {"parameters": parameters, "gflop": counter.get_total_flops() / 1e9}


def compare(recordings: Iterable[Recording], modality: str, makes: dict[str, Answer], most: int | None = None,
            report=print) -> tuple[pd.DataFrame, pd.DataFrame]:  # fmt: skip
    """All methods on the same images of recordings with truth.

    Parameters
    ----------
    makes
        The methods by name.
    most
        Images of a recording, evenly spread; default: all.

    Returns
    -------
    A row a method: right, wrong and none in percent of the images with the ring in view, with 95 % intervals
    over sequences (``_low``, ``_high``), median errors of the poses given, milliseconds an image and `cost`;
    and for each the shares by limit on its confidence, `right_and_wrong.by_limit`.
    """
    port, tables, known, spent_s, shown, costs = Port.lm_map(), {}, {}, {}, 0, {}
    for recording in recordings:
        shots = list(images(recording, modality))
        wanted = min(most or len(shots), len(shots))
        shots = [shots[int(i)] for i in np.linspace(0, len(shots) - 1, wanted)]
        shown += len(shots)
        for name, estimator in makes.items():
            if name not in costs:  # which also compiles what the first image needs
                costs[name] = cost(estimator, shots[0][1])
            start_s = time.perf_counter()
            answers = [estimator(image, t_us) for t_us, image in shots]
            spent_s[name] = spent_s.get(name, 0.0) + time.perf_counter() - start_s
            tables.setdefault(name, []).append(errors(recording, answers, port))
            known.setdefault(name, []).append(confidences(recording, answers, port))
        report(f"{recording.name}, {modality}: {len(shots)} images")
    rows = [
        {"modality": modality, "method": name, **_shares(tables[name]),
         **pd.concat(tables[name])[list(METRICS)].median(), "ms": 1e3 * spent_s[name] / shown, **costs[name]}
        for name in makes
    ]  # fmt: skip
    limits = [by_limit(tables[name], known[name]).assign(modality=modality, method=name) for name in makes]
    return pd.DataFrame(rows), pd.concat(limits, ignore_index=True)


def _shares(tables: list[pd.DataFrame]) -> dict[str, float]:
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


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sequences", nargs="+", metavar="NAME", help="of the bench: realistic-2401, ...")
    parser.add_argument("--seconds", type=float, default=2.0, help="of each sequence (default: 2)")
    parser.add_argument("--most", type=int, help="images of a sequence, evenly spread (default: all)")
    parser.add_argument("--modality", choices=MODALITIES, nargs="+", default=MODALITIES)
    parser.add_argument("--networks", default=OURS.weights, help="of the pipeline (default: %(default)s)")
    parser.add_argument("--weights", type=Path, metavar="FOLDER", help="of the peers")
    text = "table to write; the shares by limit go to NAME-limits.csv beside it"
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="CSV", help=text)
    args = parser.parse_args(arguments)
    results = []
    for modality in args.modality:
        recordings = (sequences.simulate(name, args.seconds) for name in args.sequences)
        makes = estimators(modality, args.weights, args.networks)
        results.append(compare(recordings, modality, makes, args.most, partial(print, flush=True)))
    table, limits = (pd.concat(parts, ignore_index=True) for parts in zip(*results, strict=True))
    facts = {"sequences": args.sequences, "seconds": args.seconds, "networks": args.networks,
             "threads": torch.get_num_threads()}  # fmt: skip
    save_table(args.output, table, **facts)
    save_table(args.output.with_name(f"{args.output.stem}-limits.csv"), limits, **facts)
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
