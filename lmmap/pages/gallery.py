"""Pictures of single answers, found by what was wrong with them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from ..pipeline.run import shots
from ..recordings.formats import open_recording, read_estimates
from ..studies.metrics import position_error_m
from ..types import Estimate, Port, Recording
from . import drawings
from .tables import ANSWERS, CAMERAS

TILE_IN, COLUMNS, DPI = 1.5, 5, 110


def worst(folder: Path, labels: dict[str, tuple[str, str]], count: int = 10) -> pd.DataFrame:
    """The largest position errors among images with the ring in view.

    Parameters
    ----------
    folder : with ``errors-LABEL.csv``
    labels : ``(sequence, modality)`` by label

    Returns
    -------
    DataFrame
        ``sequence, modality, label, t_us`` and the columns of `accuracy.errors`, worst first.
    """
    return _in_view(folder, labels).dropna(subset="position_error_m").nlargest(count, "position_error_m")


def missed(folder: Path, labels: dict[str, tuple[str, str]], count: int = 10) -> pd.DataFrame:
    """Images with the ring in view and no pose, drawn at random, so that what is drawn of all sequences is
    drawn of its own too; otherwise as `worst`."""
    every = _in_view(folder, labels)
    every = every[every.position_error_m.isna()]
    lots = pd.util.hash_pandas_object(every[["label", "t_us"]], index=False)
    return every.loc[lots.nsmallest(count).index].sort_index()


def false_poses(folder: Path, labels: dict[str, tuple[str, str]]) -> pd.DataFrame:
    """Every pose in sequences that show no port: ``sequence, modality, label, t_us``."""
    rows = [
        {"sequence": name, "modality": modality, "label": label, "t_us": e.t_us}
        for label, (name, modality) in labels.items()
        for e in read_estimates(folder / f"estimates-{label}.csv")
        if e.T_cam_port is not None
    ]
    return pd.DataFrame(rows, columns=["sequence", "modality", "label", "t_us"])


def save_tiles(recording: Recording, folder: Path, labels: dict[str, tuple[str, str]],
         rate_hz: float) -> list[Path]:  # fmt: skip
    """Small pictures of what one sequence may give to `save_sheets`, as files of ``folder``.

    Parameters
    ----------
    labels
        As `worst`, of the sequence; where it shows no port, its false poses are drawn.
    rate_hz
        Of the estimates.
    """
    kinds = (worst, missed) if recording.truth is not None else (false_poses,)
    rows = pd.concat([kind(folder, labels) for kind in kinds])
    files = []
    with plt.rc_context():
        drawings.use_style()
        for (label, t_us), paint in _paintings(rows, folder, rate_hz, {recording.name: recording}):
            fig, ax = plt.subplots(figsize=(TILE_IN, TILE_IN))
            paint(ax)
            files.append(_tile(folder, label, t_us))
            fig.savefig(files[-1], dpi=DPI, facecolor="white", pil_kwargs={"quality": 85})
            plt.close(fig)
    return files


def save_sheets(folder: Path, target: Path, labels: dict[str, tuple[str, str]], empty: dict) -> None:
    """Pictures of the worst, of missed and of false answers as JPEG into ``target``, from what `save_tiles`
    has drawn of each sequence; false ones are those with the labels ``empty``."""
    for name, rows in (
        ("worst", worst(folder, labels)),
        ("missed", missed(folder, labels)),
        ("false", false_poses(folder, empty)),
    ):
        path = target / f"{name}.jpg"
        path.unlink(missing_ok=True)
        tiles = [plt.imread(_tile(folder, r.label, r.t_us)) for r in rows.itertuples()]
        if tiles:
            tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % COLUMNS)
            lines = [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
            plt.imsave(path, np.vstack(lines), pil_kwargs={"quality": 90})


def _tile(folder: Path, label: str, t_us: int) -> Path:
    return folder / f"picture-{label}-{t_us}.jpg"


def _in_view(folder: Path, labels) -> pd.DataFrame:
    tables = [
        pd.read_csv(folder / f"errors-{label}.csv").assign(sequence=name, modality=modality, label=label)
        for label, (name, modality) in labels.items()
    ]
    return pd.concat(tables, ignore_index=True).query("in_view")


def draw(rows: pd.DataFrame, folder: Path, rate_hz: float, columns: int = COLUMNS):
    """The images of ``rows`` (``sequence, modality, label, t_us``) with estimate and truth, and under each
    what it is; estimates were made at ``rate_hz``."""
    height = -(-len(rows) // columns)
    size = (TILE_IN * columns, TILE_IN * height)
    fig, axes = plt.subplots(height, columns, figsize=size, squeeze=False)
    for ax in axes.ravel():
        ax.set_axis_off()
    at = {key: ax for key, ax in zip(zip(rows.label, rows.t_us, strict=True), axes.ravel(), strict=False)}
    for key, paint in _paintings(rows, folder, rate_hz, {}):
        paint(at[key])
    return fig


def _paintings(rows: pd.DataFrame, folder: Path, rate_hz: float, recordings: dict) -> Iterator[tuple]:
    """``((label, t_us), function that draws it on axes)``; recordings not given are in ``folder``."""
    for (name, modality, label), some in rows.groupby(["sequence", "modality", "label"]):
        recording = recordings.get(name) or open_recording(folder / f"{name}.h5")
        answers = {e.t_us: e for e in read_estimates(folder / f"estimates-{label}.csv")}
        wanted = set(some.t_us)
        every = shots(recording, modality, rate_hz=rate_hz)
        looks = (look for shot in every for look in ((shot.t_us, shot.image), shot.wider) if look)
        where = f"{name.removeprefix('test-').replace('-', ' ')}, {CAMERAS[modality]}"
        for t_us, image in looks:
            if t_us in wanted:
                yield (label, t_us), partial(_paint, image, answers[t_us], recording, where)


def _paint(image, answer: Estimate, recording: Recording, where: str, ax) -> None:
    truth = None if recording.truth is None else recording.truth.at(np.array([answer.t_us]))[0]
    drawings.draw_estimate(ax, image, answer, Port.lm_map(), recording.camera, truth)
    if answer.T_cam_port is None and answer.ellipse is not None:
        drawings.draw_ellipse(ax, answer.ellipse)
    said = ANSWERS[str(answer.status)]
    if answer.T_cam_port is not None and truth is not None:
        said = f"{1e3 * position_error_m(answer.T_cam_port, truth):.1f} mm"
    ax.set_axis_off()
    ax.set_title(f"{where}\n{answer.t_us * 1e-6:.1f} s: {said}", fontsize=8)
