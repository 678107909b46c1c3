"""``lmmap pictures``: the port in pictures of unknown lenses, from a PDF or a folder."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

import cv2
import numpy as np

from lmmap.cli.choices import MODALITIES
from lmmap.drawing.overlay import draw
from lmmap.files import atomic, check_output, writes
from lmmap.pipeline.weights import SETS, load_networks
from lmmap.settings import OURS
from lmmap.types import Port

from ..studies.any_lens import best_look, looks, markers_px
from ..studies.pdf import pictures as read_pictures

HEADER = (
    f"{'picture':26} {'camera':6} {'filters':8} {'look (px)':>9}  {'status':10} {'contrast':>8} "
    f"{'confidence':>10}  ring's centre and semi-axes (px)"
)


def pictures(a: Namespace) -> None:
    """Draw what each set of filters finds in each picture, and print a line for each."""
    with writes(a.output):
        a.output.mkdir(parents=True, exist_ok=True)
    modalities = [a.modality] if a.modality else MODALITIES
    networks = {m: {gap: load_networks(gap, m) for gap in SETS} for m in modalities}
    port = Port.load(a.port) if a.port else Port.lm_map()
    settings = replace(OURS, local_search=True)  # pictures from anywhere are cluttered
    print(HEADER)
    for name, picture in read_pictures(a.source):
        for modality, sets in networks.items():
            path = a.output / f"{name}-{modality}.png"
            check_output(path, [a.source], overwrite=a.overwrite)
            panels = []
            for gap, pair in sets.items():
                look = best_look([*looks(picture, modality, pair, settings, port)])
                panels.append(_panel(look, port, picture.shape[0]))
                print(_line(name, modality, gap, look, picture.shape[1::-1]), flush=True)
            with atomic(path) as part:
                part.write_bytes(cv2.imencode(".png", np.hstack(panels)[..., ::-1])[1])


def _panel(look, port: Port, height_px: int) -> np.ndarray:
    """A look with its mask, ellipse, axes and markers, as high as the picture and a caption need."""
    panel = draw(look.image, look.estimate, look.camera, port, look.ring_mask)
    scale = panel.shape[1] / look.camera.width_px
    pose = look.estimate.T_cam_port or look.estimate.doubtful
    if pose is not None:
        corners = (markers_px(pose, port, look.camera) + 0.5) * scale - 0.5
        cv2.polylines(panel, np.round(corners).astype(np.int32), True, (230, 159, 0), 1, cv2.LINE_AA)
    width_px = round(panel.shape[1] * height_px / panel.shape[0])
    return cv2.resize(panel, (width_px, height_px), interpolation=cv2.INTER_AREA)


def _line(name: str, modality: str, gap: str, look, size_px) -> str:
    e, ellipse = look.estimate, look.ellipse_in(size_px)
    if ellipse is None:
        return f"{name:26} {modality:6} {gap:8} {'':9}  {e.status}"
    start = f"{name:26} {modality:6} {gap:8} {look.camera.width_px:9}  {e.status:10}"
    (u, v), (a, b) = ellipse.centre_px, ellipse.semi_axes_px
    return f"{start} {look.contrast:8.2f} {e.confidence:10.2f}  ({u:.1f}, {v:.1f})  {a:.1f}  {b:.1f}"
