"""What stays the same from image to image."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import OURS, Settings
from ..types import Camera, Port


@dataclass(frozen=True)
class Setup:
    """The port, the camera in whose pixels masks and geometry are computed, its modality, the settings."""

    port: Port
    camera: Camera
    modality: str
    settings: Settings = OURS
