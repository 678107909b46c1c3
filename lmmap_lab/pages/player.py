"""The book's video of both cameras at once: images, masks, poses and errors of the short profile's sequences.

``python -m lmmap_lab.pages.player`` writes ``book/_static/player.mp4`` after ``make reproduce``.
FFmpeg makes it smaller: ``ffmpeg -i player.mp4 -c:v libvpx-vp9 -crf 36 -b:v 0 small.mp4``.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.font_manager import findfont
from PIL import Image, ImageDraw, ImageFont

from lmmap.drawing.overlay import draw
from lmmap.drawing.video import Video
from lmmap.estimation.images import timed_images
from lmmap.evaluation.pose_errors import position_error_m
from lmmap.pipeline.estimator import Estimator
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import read_estimates
from lmmap.settings import PAPER
from lmmap.types import InputError, Recording

from ..provenance import DERIVED_DATA, ROOT
from . import drawings
from .tables import CAMERAS, LIGHTS

SEQUENCES = {"test-medium": LIGHTS["medium"], "test-high": LIGHTS["high"], "test-low": LIGHTS["low"],
             "hard-reflect": "full reflect"}  # fmt: skip  # a bright image first
WIDE_PX, TALL_PX, PLOT_PX = 270, 203, 166  # of a camera's image, and of the plot below
TEXT_PX = 16  # of letters, 10.5 on a phone
LIMITS_MM = (0.1, 300)
STEP = 2  # of the images, so that the file stays small
VIDEO = ROOT / "book" / "_static" / "player.mp4"
SAID = "frames and histograms with masks and poses, and both cameras' errors over time"


def tiles(recording: Recording, modality: str, folder: Path) -> Iterator[tuple[int, np.ndarray, float]]:
    """Yield time, a picture of image, masks and pose, and the position's error (mm, NaN without a pose)."""
    estimator = Estimator(recording.camera, modality=modality)
    answers = {e.t_us: e for e in read_estimates(folder / f"estimates-{recording.name}-{modality}.csv")}
    for timed in timed_images(recording, modality, rate_hz=PAPER.rate_hz):
        answer = next((answers[t] for t in sorted(timed.times_us) if t in answers), None)
        if answer is None:
            continue
        picture = draw(timed.image, answer, recording.camera, estimator.port)[:-28]  # less its line of text
        masks = [estimator.ring_network(timed.image), np.zeros(timed.image.shape[:2], np.float32)]
        error_mm = np.nan
        if answer.T_cam_port is not None:
            masks[1] = estimator.reflector_network(timed.image)
            truth = recording.truth.at(np.array([answer.t_us]))[0]
            error_mm = 1e3 * float(position_error_m(answer.T_cam_port, truth))
        yield timed.t_us, tile(picture, masks, modality, error_mm), error_mm


def tile(picture: np.ndarray, masks: list[np.ndarray], modality: str, error_mm: float) -> np.ndarray:
    """A camera's image over its two masks (H, W) in [0, 1], with the camera's name and the error."""
    half = WIDE_PX // 2, TALL_PX // 2
    ink = 255 * np.hstack([1 - cv2.resize(mask, half, interpolation=cv2.INTER_AREA) for mask in masks])
    below = np.repeat(ink.astype(np.uint8)[..., None], 3, -1)
    large = cv2.resize(picture, (WIDE_PX, TALL_PX), interpolation=cv2.INTER_AREA)
    shown = Image.fromarray(np.vstack([large, below]))
    pen, font = ImageDraw.Draw(shown), ImageFont.truetype(findfont("DejaVu Sans"), TEXT_PX)
    said = "no pose" if np.isnan(error_mm) else f"{error_mm:.1f} mm"
    pen.rectangle((0, 0, WIDE_PX, TEXT_PX + 6), drawings.COLOUR[modality])
    pen.text((6, 2), CAMERAS[modality], "white", font)
    pen.text((WIDE_PX - 6, 2), said, "white", font, anchor="ra")
    for x, name in zip((0, half[0]), ("ring", "markers"), strict=True):
        pen.text((x + 6, TALL_PX + 2), name, drawings.COLOUR["ink"], font)
    return np.asarray(shown)


def plot_errors(errors: dict[str, np.ndarray], bounds_s, end_s: float) -> np.ndarray:
    """Picture of both cameras' errors over the whole video, (H, W, 3) u8; a column of it is a time."""
    fig = plt.figure(figsize=(2 * WIDE_PX / 100, PLOT_PX / 100), dpi=100, layout="none")
    ax, points = fig.add_axes((0, 0, 1, 1)), 0.72 * TEXT_PX
    for modality, (t_s, error_mm) in errors.items():
        ax.semilogy(t_s, error_mm, ".", ms=4, color=drawings.COLOUR[modality])
    for start_s, name in bounds_s:
        ax.axvline(start_s, color="#999999", lw=0.8)
        ax.text(start_s + 0.15, 0.7 * LIMITS_MM[1], name.replace(" ", "\n"), fontsize=points, va="top")
    for level_mm in (1, 10):
        ax.axhline(level_mm, color="#dddddd", lw=0.6, zorder=0)
        ax.text(end_s, level_mm, f"{level_mm} mm", fontsize=points, ha="right", va="center",
                bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 1})  # fmt: skip
    ax.set(xlim=(0, end_s), ylim=LIMITS_MM)
    fig.canvas.draw()
    picture = np.asarray(fig.canvas.buffer_rgba())[..., :3].copy()
    plt.close(fig)
    return picture


def write(path: Path, folder: Path, sequences=SEQUENCES) -> None:
    """Write the video of the sequences of a study's ``folder``, at the rate of the estimates."""
    moments, errors, bounds_s, start_s = [], {m: [] for m in ("rgb", "event")}, [], 0.0
    for name, title in sequences.items():
        recording = open_recording(folder / f"{name}.h5")
        seen = {m: list(tiles(recording, m, folder)) for m in errors}
        bounds_s.append((start_s, title))
        for m, shots in seen.items():
            errors[m] += [(start_s + 1e-6 * t_us, error_mm) for t_us, _, error_mm in shots]
        event_t_us = np.array([t_us for t_us, _, _ in seen["event"]])
        for t_us, frame, _ in seen["rgb"]:
            last = max(np.searchsorted(event_t_us, t_us, side="right") - 1, 0)
            moments.append((start_s + 1e-6 * t_us, frame, seen["event"][last][1]))
        start_s += len(seen["rgb"]) / PAPER.rate_hz
    plot = plot_errors({m: np.array(rows).T for m, rows in errors.items()}, bounds_s, start_s)
    with Video(path) as video:
        for t_s, frame, histogram in moments[::STEP]:
            below = plot.copy()
            x = min(int(t_s / start_s * 2 * WIDE_PX), 2 * WIDE_PX - 2)
            below[:, x : x + 2] = (0, 0, 0)
            video.add(np.vstack([np.hstack([frame, histogram]), below]), PAPER.rate_hz / STEP)


class Player:
    """The video as the output of a notebook's cell, its controls below it; in print its middle picture."""

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        html = ('<div class="player"><video controls loop playsinline preload="metadata" '
                f'aria-label="{SAID}" src="../_static/{VIDEO.name}"></video></div>')  # fmt: skip
        return {"text/html": html, "image/png": base64.b64encode(self.still()).decode()}

    def still(self) -> bytes:
        """The middle picture, PNG."""
        video = cv2.VideoCapture(str(VIDEO), cv2.CAP_FFMPEG)
        video.set(cv2.CAP_PROP_POS_FRAMES, video.get(cv2.CAP_PROP_FRAME_COUNT) // 2)
        read, picture = video.read()
        if not read:
            raise InputError(f"{VIDEO}: cannot read it; make it by python -m lmmap_lab.pages.player")
        return cv2.imencode(".png", picture)[1].tobytes()


if __name__ == "__main__":
    write(VIDEO, DERIVED_DATA / "quick")
