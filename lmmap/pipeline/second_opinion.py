"""Networks that have learned a place, asked only where those from before find no sure pose."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np

from ..settings import Settings
from ..types import Camera, Estimate, InputError, Port, checked
from . import agreement
from .estimator import Estimator
from .image_estimator import Weights
from .masks import Expected
from .weights import DOMAIN_GAPS, load_card, network_paths

BEFORE = "before"  # folder of the networks from before, in one of networks that have learned


class SecondOpinion(Estimator):
    """Pose of the port in one image, called as `Estimator` is: by the networks from before, and where these
    are not sure also by those that have learned.  A sure pose cannot be lost by learning.

    Parameters
    ----------
    camera, port, modality, settings, precision
        As `Estimator`.
    weights
        Folder of ``lmmap adapt`` whose networks of this modality have learned.
    """

    learned: Estimator | None = None  # the single looks of which an estimate is made have none

    @checked
    def __init__(self, camera: Camera | str | Path | None, port: Port | None, modality: str,
                 weights: str | Path, settings: Settings | None = None, precision: str = "auto"):  # fmt: skip
        super().__init__(camera, port, modality, Path(weights) / BEFORE, settings, precision)
        self.learned = Estimator(camera, port, modality, weights, settings, precision)

    def __call__(self, image: np.ndarray, t_us: int = 0, near: Expected | None = None) -> Estimate:
        """As `Estimator`."""
        first = super().__call__(image, t_us, near)
        if self.learned is None or not agreement.needs_more_events(first, self.settings):
            return first
        return self._joined(first, self.learned(image, t_us, near))

    def _joined(self, first: Estimate, second: Estimate) -> Estimate:
        """The first pose, confirmed or doubted by the second; the second pose where there is none, or where
        it contradicts a less sure one, if the second networks' own limit allows it.  What an estimator would
        not report contradicts nothing."""
        if first.T_cam_port is None:
            return first if second.T_cam_port is None else second
        agree = second.found is not None and agreement.alike(
            first.found, second.found, self.port, self.settings
        )
        if not agree and second.confidence < self.settings.min_confidence[self.modality]:
            return first
        both = self.together([first, second])
        if agree or both.found is first.found:
            return both
        return both.judged(both.confidence, self.learned.settings.min_confidence[self.modality])


def estimator_of(camera: Camera | str | Path | None, port: Port | None, modality: str, weights: Weights,
                 settings: Settings | None = None) -> Estimator:  # fmt: skip
    """A `SecondOpinion` of a folder whose networks of this modality have learned, of other weights an
    `Estimator`."""
    kind = SecondOpinion if before(weights, modality) else Estimator
    return kind(camera, port, modality, weights, settings)


def weight_hashes(weights: str | Path, modality: str) -> dict[str, str]:
    """What the weight files that `estimator_of` reads hold, by their names in their folder."""
    files = {path.name: path for path in network_paths(weights, modality)}
    if folder := before(weights, modality):
        files |= {f"{BEFORE}/{path.name}": path for path in network_paths(folder, modality)}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest()[:16] for name, path in files.items()}


def before(weights: Weights, modality: str) -> Path | None:
    """The folder of the networks from before that those of this modality keep, if they have learned.

    Raises `InputError` where the cards of this modality say that they have, and the folder has none.
    """
    if not isinstance(weights, str | Path) or weights in DOMAIN_GAPS:
        return None
    folder = Path(weights) / BEFORE
    if any(os.path.exists(path) for path in network_paths(folder, modality)):
        return folder
    for path in network_paths(weights, modality):
        if os.path.exists(path.with_suffix(".json")) and load_card(path).get("adapted"):
            raise InputError(f"{folder}: no networks from before, on which {path.name} relies; restore them")
    return None
