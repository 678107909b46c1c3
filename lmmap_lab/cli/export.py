"""``lmmap export``: networks in ONNX, and everything else that is needed to run them elsewhere."""

from __future__ import annotations

import hashlib
import json
import os
from argparse import Namespace
from dataclasses import asdict, replace
from pathlib import Path

from lmmap.disk import is_there
from lmmap.files import atomic, check_folder_of
from lmmap.pipeline.joint_network import join
from lmmap.pipeline.network import CHANNELS, RECEPTIVE_RADIUS_PX, STRIDE_PX
from lmmap.pipeline.weights import BEFORE, FILTERS, before, load_filter, network_paths, own_limit
from lmmap.settings import OURS
from lmmap.types import InputError, Port

from ..adaptation.folder import MADE_OF, check_whole
from ..training.onnx_graph import BOTH, filter_model, onnx_package

DOCUMENT = "lmmap.json"
JOINED = (
    "lmmap.pipeline.looks:second_opinion: run the steps with the networks of 'before'. Without a "
    "pose, or with one less confident than sure_confidence, run them with those of 'learned' as well. "
    "Without a first pose, the second counts if its confidence reaches min_confidence of this entry. If "
    "the two agree (right_position_m, right_normal_rad, right_rotation_rad), the confidence rises "
    "(look_independence). If not, a second pose below min_confidence of the settings is ignored; "
    "otherwise the more confident pose counts with a lowered confidence, if this reaches the "
    "min_confidence of that pose's networks"
)
STEPS = {  # in their order, of one image; tests compare them with an estimator's
    "lmmap.pipeline.histograms:histogram": "events only: count the last N of them in each pixel; N is "
    "events_per_window for 346 x 260 px, and in proportion to the number of pixels for other sensors",
    "lmmap.pipeline.rescale:resample": "bring the image to trained_focal_px, unless it is within focal_slack "
    "of it or would be enlarged by more than enlargement",
    "lmmap.pipeline.masks:look": "the ring's network, or that of both masks, on the whole image",
    "lmmap.pipeline.ring:find_ring": "binarise the mask at mask_threshold, thin it, fit an ellipse and "
    "measure its contour to a fraction of a pixel, free of lens distortion",
    "lmmap.pipeline.circle:candidates": "the two poses of a circle of ring_radius_m that is seen as this "
    "ellipse",
    "lmmap.pipeline.masks:markers_box_px": "where the markers can be at these poses",
    "lmmap.pipeline.crops:mask_about": "the markers' network, unless the first gave both masks, on a crop "
    "around that box that begins at multiples of stride_px and reaches beyond the box by receptive_radius_px",
    "lmmap.pipeline.yaw:fast_yaw": "the yaw and the normal that masks and image edges support most",
    "lmmap.pipeline.refine:refine": "the pose refined on masks and edges, and its covariance",
    "lmmap.pipeline.judge:judge": "its confidence; do not use a pose below min_confidence",
}


def export(a: Namespace) -> None:
    """Write a set's networks and `DOCUMENT` into a new folder, all or nothing."""
    onnx_package()
    check_folder_of(a.output)
    if is_there(a.output):
        raise InputError(f"{a.output}: exists; give the name of a folder to make")
    models = _models(a.weights)
    with atomic(a.output) as folder:
        folder.mkdir()
        for name, (content, _) in models.items():
            (folder / name).write_bytes(content)
        text = json.dumps(_document(a.weights, models), indent=1)
        (folder / DOCUMENT).write_text(text + "\n")
    print(f"{a.output}: {', '.join(models)}, {DOCUMENT}")


def _models(weights: str) -> dict[str, tuple[bytes, dict]]:
    """``(content, facts)`` of each network by its file's name, of the cameras that the weights are for."""
    if os.path.lexists(Path(weights) / MADE_OF):
        check_whole(Path(weights))
    models = {}
    for modality in _cameras(weights):
        folders = {"": weights} | ({f"{BEFORE}-": first} if (first := before(weights, modality)) else {})
        for start, folder in folders.items():
            filters = [load_filter(path, modality) for path in network_paths(folder, modality)]
            joint = join(filters, modality)
            nets = {BOTH: joint} if joint else dict(zip(FILTERS, filters, strict=True))
            facts = {"mask_threshold": OURS.mask_threshold, "trained_focal_px": OURS.trained_focal_px,
                     "weights": Path(weights).name}  # fmt: skip
            for name, net in nets.items():
                model = filter_model(net, name, modality, facts)
                told = {p.key: p.value for p in model.metadata_props}
                models[f"{start}{name}-{modality}.onnx"] = model.SerializeToString(deterministic=True), told
    return models


def _cameras(weights: str) -> list[str]:
    """The cameras of which the weights hold a network or a card, or else all."""
    there = [m for m in CHANNELS for path in network_paths(weights, m)
             if os.path.exists(path) or os.path.exists(path.with_suffix(".json"))]  # fmt: skip
    return list(dict.fromkeys(there)) or list(CHANNELS)


def _document(weights: str, models: dict) -> dict:
    """What else an integrator needs: lengths in metres, angles in radians."""
    networks = {
        name: {"image": told["image"], "mask": told["mask"], "sha256": hashlib.sha256(content).hexdigest()}
        for name, (content, told) in models.items()
    }
    limits, second = {}, {}
    for m in _cameras(weights):
        first, own = before(weights, m), max(OURS.min_confidence[m], own_limit(weights, m))
        limits[m] = max(OURS.min_confidence[m], own_limit(first, m)) if first else own
        if first:
            names = [name for name in models if name.endswith(f"-{m}.onnx")]
            old = [name for name in names if name.startswith(f"{BEFORE}-")]
            learned = [name for name in names if name not in old]
            second[m] = {BEFORE: old, "learned": learned, "min_confidence": own, "joined": JOINED}
    settings = replace(
        OURS, weights=Path(weights).name, min_confidence=replace(OURS.min_confidence, **limits)
    )
    return {
        "networks": networks, "stride_px": STRIDE_PX,
        "receptive_radius_px": RECEPTIVE_RADIUS_PX, "port": asdict(Port.lm_map()),
        "settings": asdict(settings),
        "steps": [{"function": function, "does": text} for function, text in STEPS.items()],
    } | ({"second_opinion": second} if second else {})  # fmt: skip
