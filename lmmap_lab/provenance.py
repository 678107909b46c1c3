"""Where data and results lie, what made a result, and whether it is out of date."""

from __future__ import annotations

import ast
import hashlib
import json
import os
import platform
import subprocess
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.files import InputError, write_text
from lmmap.shipped import CHECKOUT, DATA, ROOT
from lmmap.types import Port

# whatever the laboratory computes goes into results or is compared with them: processors shall round alike
os.environ.setdefault("LMMAP_PRECISION", "float32")
HOUSES = ("lmmap", "lmmap_lab")
DERIVED_DATA = DATA / "derived" if CHECKOUT else Path("lmmap-derived")  # of a wheel: in the user's folder
# what a chapter's output depends on besides its own cells; of results the tables and pictures, not archives
PAGE_SOURCES = ("lmmap/**/*.py", "lmmap_lab/**/*.py", "data/weights/*", "data/mini/*", "data/paper/*",
            "data/*.json", "data/results/**/*.[cjt]*", "data/derived/{profile}/*.[cj]s*",
            "data/derived/recordings/*/told.txt", "book/_static/*.js", "environment.txt")  # fmt: skip
MODULE_SOURCES = ("lmmap/**/*.py", "lmmap_lab/**/*.py", "data/weights/*", "environment.txt")
PACKAGES = ("numpy", "scipy", "torch", "opencv-python-headless", "scikit-image", "numba", "dv-processing")


def profile() -> str:
    """The profile whose results the book shows: that of ``make reproduce``, by default ``quick``."""
    return os.environ.get("PROFILE", "quick")


def made_results() -> Path:
    """The folder of the profile's results; `InputError` before ``make reproduce`` has made them."""
    folder = DERIVED_DATA / profile()
    if not (folder / "summary.csv").exists():
        command = "make reproduce" + ("" if profile() == "quick" else f" PROFILE={profile()}")
        raise InputError(
            f"{folder}: no results yet; run '{command}' in the checkout, then this chapter again"
        )
    return folder


@cache
def source_files(*modules: str) -> tuple[str, ...]:
    """Source files of modules (``"lmmap.estimation.estimates"``) and of all that they import, relative to the
    checkout."""
    waiting, files = [ROOT.joinpath(*name.split(".")).with_suffix(".py") for name in modules], set()
    while waiting:
        path = waiting.pop()
        if path not in files:
            files.add(path)
            imports = [n for n in ast.walk(ast.parse(path.read_bytes())) if isinstance(n, ast.ImportFrom)]
            waiting += [file for n in imports for file in _imported_files(path, n)]
    return tuple(sorted(str(path.relative_to(ROOT)) for path in files))


def _imported_files(path: Path, statement: ast.ImportFrom) -> list[Path]:
    """Files of our packages that an import names: a module, or modules or words of a folder."""
    names = (statement.module or "").split(".")
    if not statement.level and names[0] not in HOUSES:
        return []
    folder = (path.parents[statement.level - 1] if statement.level else ROOT).joinpath(*names)
    named = [folder / f"{alias.name}.py" for alias in statement.names]
    words = [] if all(file.exists() for file in named) else [folder / "__init__.py"]
    return [file for file in (folder.with_suffix(".py"), *named, *words) if file.exists()]


def fingerprint(*extra: str, patterns=MODULE_SOURCES) -> str:
    """Hash of what a result depends on; by default the module, the weights and the environment's pins.

    Raises
    ------
    ValueError
        For a pattern without a file: such a hash would not notice a change.
    """
    digest = hashlib.sha256(repr(extra).encode())
    for pattern in patterns:
        if not (paths := sorted(ROOT.glob(pattern))):
            raise ValueError(f"patterns: expected files in {ROOT}, got none for {pattern!r}")
        for path in paths:
            digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def page_fingerprint(root: Path = ROOT) -> str:
    """Hash of the profile, and of names and contents of all that the book's pages are made of."""
    digest = hashlib.sha256(profile().encode())
    patterns = [pattern.format(profile=profile()) for pattern in PAGE_SOURCES]
    for path in sorted(p for pattern in patterns for p in root.glob(pattern) if p.is_file()):
        digest.update(f"{path.relative_to(root)}\0".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def commit() -> str:
    """The commit of the checkout, with '+' when tracked files other than results differ from it; 'unknown'
    without git."""
    git = ["git", "-C", str(ROOT)]
    try:
        head = subprocess.run(
            [*git, "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True, check=True
        )
        made_of = ["--", ".", ":!data/results"]
        clean = subprocess.run([*git, "diff", "--quiet", "HEAD", *made_of], check=False).returncode == 0
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return head.stdout.strip() + ("" if clean else "+")


def port_mark() -> str:
    """Hash of the lengths of the port that the laboratory has."""
    lengths = {k: v for k, v in vars(Port.lm_map()).items() if k.endswith("_m")}
    return hashlib.sha256(json.dumps(lengths, sort_keys=True).encode()).hexdigest()[:12]


def provenance(**facts) -> dict:
    """What made a result: the given facts, commit, networks' precision, port, machine, versions of packages.

    It is the same for two runs of one commit on one machine.
    """
    return {**facts, "commit": commit(), "precision": os.environ["LMMAP_PRECISION"],
            "port": port_mark(), "python": platform.python_version(), "machine": platform.machine(),
            **{name: version(name) for name in PACKAGES}}  # fmt: skip


def save_json(path: Path, values: dict, **facts) -> Path:
    """Write ``values`` with their provenance, whole or not at all."""
    document = {"values": values, "provenance": provenance(**facts)}
    return write_text(path, json.dumps(document, indent=1, sort_keys=True, default=_json_value) + "\n")


def load_json(path: Path) -> dict:
    """The values of a file that `save_json` wrote."""
    return json.loads(Path(path).read_text())["values"]


def save_table(path: Path, table: pd.DataFrame, **facts) -> Path:
    """Write a CSV, and its provenance as JSON beside it."""
    write_text(
        path.with_suffix(".provenance.json"), json.dumps(provenance(**facts), indent=1, sort_keys=True) + "\n"
    )
    return write_text(path, table.to_csv(index=False, float_format="%.6g"))


def load_table(path: Path) -> pd.DataFrame:
    return pd.read_csv(path)


def _json_value(value):
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
