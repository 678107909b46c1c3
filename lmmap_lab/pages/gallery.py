"""Pictures of single images with their estimates: the worst errors, missed ports, false poses."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.estimation.images import timed_images
from lmmap.evaluation.pose_errors import position_error_m, rotation_error_rad
from lmmap.geometry.conics import circle_ellipse
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import read_estimates
from lmmap.types import Estimate, Port, Recording

from . import drawings
from .tables import ANSWERS, CAMERAS

TILE_IN, COLUMNS, DPI = 1.5, 5, 110
MARGIN = 1.7  # of a picture around the port, in semi-major axes of the ring


def worst(folder: Path, labels: dict[str, tuple[str, str]], count: int = 10) -> pd.DataFrame:
    """The largest position errors among images with the ring in view.

    Parameters
    ----------
    folder : with ``errors-LABEL.csv``
    labels : ``(sequence, modality)`` by label

    Returns
    -------
    DataFrame
        ``sequence, modality, label, t_us`` and the columns of `error_table.errors`, worst first.
    """
    return _in_view(folder, labels).dropna(subset="position_error_m").nlargest(count, "position_error_m")


def missed_images(folder: Path, labels: dict[str, tuple[str, str]], count: int = 10) -> pd.DataFrame:
    """Images with the ring in view and no pose, drawn by lot; arguments and result as in `worst`.

    The lot of an image is a hash of its label and time.  So an image that is drawn among all sequences is
    also drawn among those of its own sequence.
    """
    rows = _in_view(folder, labels)
    rows = rows[rows.position_error_m.isna()]
    lots = pd.util.hash_pandas_object(rows[["label", "t_us"]], index=False)
    return rows.loc[lots.nsmallest(count).index].sort_index()


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
    """Draw the images of one sequence that `save_sheets` may show, as small files in ``folder``.

    Parameters
    ----------
    labels
        As in `worst`, of this sequence.  Of a sequence without a port the false poses are drawn.
    rate_hz
        The estimates' rate.
    """
    kinds = (worst, missed_images) if recording.truth is not None else (false_poses,)
    rows = pd.concat([kind(folder, labels) for kind in kinds])
    files = []
    with plt.rc_context():
        drawings.use_style()
        for (label, t_us), paint in paintings(rows, folder, rate_hz, {recording.name: recording}):
            fig, ax = plt.subplots(figsize=(TILE_IN, TILE_IN))
            paint(ax)
            files.append(_tile(folder, label, t_us))
            fig.savefig(files[-1], dpi=DPI, facecolor="white", pil_kwargs={"quality": 85})
            plt.close(fig)
    return files


def save_sheets(folder: Path, target: Path, labels: dict[str, tuple[str, str]], empty: dict) -> None:
    """Write sheets of the worst, the missed and the false answers as JPEG into ``target``.

    The sheets are put together from the files that `save_tiles` has drawn of each sequence.

    Parameters
    ----------
    labels : of the test's sequences, as in `worst`
    empty : of the sequences without a port
    """
    for name, rows in (
        ("worst", worst(folder, labels)),
        ("missed", missed_images(folder, labels)),
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
    """Figure of the images of ``rows`` with estimate and truth, each with a title that says what it is.

    Parameters
    ----------
    rows : ``sequence, modality, label, t_us``, and ``answer`` where an estimate is not the folder's
    folder : has the recordings and their estimates
    rate_hz : the estimates' rate
    """
    height = -(-len(rows) // columns)
    size = (TILE_IN * columns, TILE_IN * height)
    fig, axes = plt.subplots(height, columns, figsize=size, squeeze=False)
    for ax in axes.ravel():
        ax.set_axis_off()
    drawn = zip(rows.itertuples(), axes.ravel(), strict=False)
    at = {(row.label, row.t_us): (ax, getattr(row, "answer", None)) for row, ax in drawn}
    for key, paint in paintings(rows, folder, rate_hz, {}):
        ax, answer = at[key]
        paint(ax, answer=answer)
    return fig


def paintings(rows: pd.DataFrame, folder: Path, rate_hz: float, recordings: dict) -> Iterator[tuple]:
    """Yield ``(label, t_us)`` and a function that draws this image on axes.

    The function takes the axes and, as a keyword, another ``answer`` than that in ``folder``.  Recordings
    that ``recordings`` does not hold are read from ``folder``.
    """
    for (name, modality, label), images in rows.groupby(["sequence", "modality", "label"]):
        recording = recordings.get(name) or open_recording(folder / f"{name}.h5")
        answers = {e.t_us: e for e in read_estimates(folder / f"estimates-{label}.csv")}
        wanted = set(images.t_us)
        every = timed_images(recording, modality, rate_hz=rate_hz)
        looks = (look for shot in every for look in ((shot.t_us, shot.image), shot.wider) if look)
        where = f"{name.removeprefix('test-').replace('-', ' ')}, {CAMERAS[modality]}"
        for t_us, image in looks:
            if t_us in wanted:
                yield (label, t_us), partial(_paint, image, answers[t_us], recording, where)


def _paint(image, known: Estimate, recording: Recording, where: str, ax, answer=None) -> None:
    answer, port, camera = answer or known, Port.lm_map(), recording.camera
    truth = None if recording.truth is None else recording.truth.at(np.array([known.t_us]))[0]
    drawings.draw_estimate(ax, image, answer, port, camera, truth)
    if answer.T_cam_port is None and answer.ellipse is not None:
        drawings.draw_ellipse(ax, answer.ellipse, drawings.COLOUR["paper"])  # far from the truth's green
    ring = answer.ellipse if truth is None else circle_ellipse(truth, port.ring_radius_m, camera)
    if ring is not None:  # millimetres could not be seen in a whole image
        drawings.look_at(ax, ring, MARGIN)
    result = ANSWERS[str(answer.status)]
    if answer.T_cam_port is not None and truth is not None:
        turn_deg = np.rad2deg(rotation_error_rad(answer.T_cam_port, truth, port.yaw_period_rad))
        result = f"{1e3 * position_error_m(answer.T_cam_port, truth):.0f} mm, {turn_deg:.0f}°"
    ax.set_axis_off()
    ax.set_title(f"{where}\n{answer.t_us * 1e-6:.1f} s: {result}", fontsize=8)
