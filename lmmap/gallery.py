"""Pictures of single answers, found by what was wrong with them."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from . import figures
from .accuracy import MODALITIES
from .core import Port
from .metrics import position_error_m
from .pipeline import shots
from .recordings import open_recording, read_estimates
from .tables import ANSWERS, CAMERAS


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
    """Images with the ring in view and no pose, spread evenly over all of them; otherwise as `worst`."""
    every = _in_view(folder, labels)
    every = every[every.position_error_m.isna()]
    return every.iloc[np.unique(np.linspace(0, len(every) - 1, min(count, len(every))).astype(int))]


def false_poses(folder: Path, sequences) -> pd.DataFrame:
    """Every pose in ``sequences``, which show no port: ``sequence, modality, label, t_us``."""
    rows = [
        {"sequence": name, "modality": modality, "label": f"{name}-{modality}", "t_us": e.t_us}
        for name in sequences
        for modality in MODALITIES
        for e in read_estimates(folder / f"estimates-{name}-{modality}.csv")
        if e.T_cam_port is not None
    ]
    return pd.DataFrame(rows, columns=["sequence", "modality", "label", "t_us"])


def publish(folder: Path, target: Path, labels: dict[str, tuple[str, str]], rate_hz: float, empty,
            empty_hz: float) -> None:  # fmt: skip
    """Pictures of the worst, of missed and of false answers as JPEG into ``target``, for who has not the
    recordings; false ones are those in the sequences ``empty``."""
    for name, rows, hz in (
        ("worst", worst(folder, labels), rate_hz),
        ("missed", missed(folder, labels), rate_hz),
        ("false", false_poses(folder, empty), empty_hz),
    ):
        path = target / f"{name}.jpg"
        path.unlink(missing_ok=True)
        if len(rows):
            with plt.rc_context():
                figures.use_style()
                fig = draw(rows, folder, hz)
                fig.savefig(path, dpi=110, facecolor="white")
            plt.close(fig)


def _in_view(folder: Path, labels) -> pd.DataFrame:
    tables = [
        pd.read_csv(folder / f"errors-{label}.csv").assign(sequence=name, modality=modality, label=label)
        for label, (name, modality) in labels.items()
    ]
    return pd.concat(tables, ignore_index=True).query("in_view")


def draw(rows: pd.DataFrame, folder: Path, rate_hz: float, columns: int = 5):
    """The images of ``rows`` (``sequence, modality, label, t_us``) with estimate and truth, and under each
    what it is; estimates were made at ``rate_hz``."""
    height = -(-len(rows) // columns)
    fig, axes = plt.subplots(height, columns, figsize=(1.5 * columns, 1.5 * height), squeeze=False)
    for ax in axes.ravel():
        ax.set_axis_off()
    at = {key: ax for key, ax in zip(zip(rows.label, rows.t_us, strict=True), axes.ravel(), strict=False)}
    for (name, modality, label), some in rows.groupby(["sequence", "modality", "label"]):
        recording = open_recording(folder / f"{name}.npz")
        answers = {e.t_us: e for e in read_estimates(folder / f"estimates-{label}.csv")}
        wanted = set(some.t_us)
        every = shots(recording, modality, rate_hz=rate_hz)
        looks = (look for shot in every for look in ((shot.t_us, shot.image), shot.wider) if look)
        for t_us, image in looks:
            if t_us not in wanted:
                continue
            ax, answer = at[label, t_us], answers[t_us]
            truth = None if recording.truth is None else recording.truth.at(np.array([t_us]))[0]
            figures.draw_estimate(ax, image, answer, Port.lm_map(), recording.camera, truth)
            if answer.T_cam_port is None and answer.ellipse is not None:
                figures.draw_ellipse(ax, answer.ellipse)
            said = ANSWERS[str(answer.status)]
            if answer.T_cam_port is not None and truth is not None:
                said = f"{1e3 * position_error_m(answer.T_cam_port, truth):.1f} mm"
            where = name.removeprefix("test-").replace("-", " ")
            ax.set_title(f"{where}, {CAMERAS[modality]}\n{t_us * 1e-6:.1f} s: {said}", fontsize=8)
    return fig
