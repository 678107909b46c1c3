"""``lmmap export``: networks in ONNX, and what else somebody needs who runs them elsewhere."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

from lmmap.files import atomic, check_folder_of
from lmmap.pipeline.network import CHANNELS, RECEPTIVE_RADIUS_PX, STRIDE_PX
from lmmap.pipeline.weights import FILTERS, load_filter, network_paths
from lmmap.settings import OURS
from lmmap.types import InputError, Port

from ..training.onnx_graph import filter_model, onnx_package

DOCUMENT = "lmmap.json"
STEPS = {  # in their order, of one image; tests compare them with an estimator's
    "lmmap.pipeline.histograms:histogram": "events only: count the last N of them in each pixel, N = "
    "events_per_window for 346 x 260 px and as many a pixel for other sensors",
    "lmmap.pipeline.rescale:resample": "bring the image to trained_focal_px, unless it is within focal_slack "
    "of it or would be enlarged by more than enlargement",
    "lmmap.pipeline.masks:look": "the ring's network, on the whole image",
    "lmmap.pipeline.ring:find_ring": "binarise the mask at mask_threshold, thin it, fit an ellipse and "
    "measure its contour below a pixel, free of lens distortion",
    "lmmap.pipeline.circle:candidates": "the two poses of a circle of ring_radius_m that is seen as this "
    "ellipse",
    "lmmap.pipeline.masks:markers_box_px": "where the markers can be at these poses",
    "lmmap.pipeline.crops:mask_about": "the reflectors' network, on a crop around that box that begins at "
    "multiples of stride_px and reaches beyond the box by receptive_radius_px",
    "lmmap.pipeline.yaw:fast_yaw": "the yaw and the normal that masks and image edges support most",
    "lmmap.pipeline.refine:refine": "the pose refined on masks and edges, and its covariance",
    "lmmap.pipeline.judge:judge": "its confidence; below min_confidence a pose is not to be used",
}


def export(a) -> None:
    """Write a set's networks and `DOCUMENT` into a new folder, all or nothing."""
    onnx_package()
    check_folder_of(a.output)
    if a.output.exists():
        raise InputError(f"{a.output}: exists; give the name of a folder to make")
    models = dict(_models(a.weights))
    with atomic(a.output) as folder:
        folder.mkdir()
        for name, (content, _) in models.items():
            (folder / name).write_bytes(content)
        text = json.dumps(_document(a.weights, models), indent=1)
        (folder / DOCUMENT).write_text(text + "\n")
    print(f"{a.output}: {', '.join(models)}, {DOCUMENT}")


def _models(weights: str):
    """``(file's name, (content, facts))`` of each network, of the cameras that the weights are for."""
    cameras = [m for m in CHANNELS if network_paths(weights, m)[0].exists()]
    for modality in cameras or CHANNELS:
        for name, path in zip(FILTERS, network_paths(weights, modality), strict=True):
            facts = {"mask_threshold": OURS.mask_threshold, "trained_focal_px": OURS.trained_focal_px,
                     "weights": Path(weights).name}  # fmt: skip
            model = filter_model(load_filter(path, modality), name, modality, facts)
            told = {p.key: p.value for p in model.metadata_props}
            yield f"{name}-{modality}.onnx", (model.SerializeToString(deterministic=True), told)


def _document(weights: str, models: dict) -> dict:
    """What else an integrator needs: lengths in metres, angles in radians."""
    networks = {
        name: {"image": told["image"], "mask": told["mask"], "sha256": hashlib.sha256(content).hexdigest()}
        for name, (content, told) in models.items()
    }
    return {
        "networks": networks, "stride_px": STRIDE_PX,
        "receptive_radius_px": RECEPTIVE_RADIUS_PX, "port": asdict(Port.lm_map()),
        "settings": asdict(replace(OURS, weights=Path(weights).name)),
        "steps": [{"function": function, "does": text} for function, text in STEPS.items()],
    }  # fmt: skip
