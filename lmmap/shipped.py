"""Paths of the data shipped with the package: beside it in a checkout, inside it in a wheel."""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
CHECKOUT = (PACKAGE.parent / "pyproject.toml").exists()
ROOT = PACKAGE.parent
DATA = (ROOT if CHECKOUT else PACKAGE) / "data"
