"""Where data and results lie, what made a result, and whether it is out of date."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import warnings
from collections.abc import Callable, Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import llvmlite.binding
import numpy as np
import pandas as pd

from lmmap.errors import InputError
from lmmap.files import write_text
from lmmap.shipped import CHECKOUT, DATA, ROOT
from lmmap.types import Port

from .meaning import meaning

# whatever the laboratory computes goes into results or is compared with them: processors shall round alike
os.environ.setdefault("LMMAP_PRECISION", "float32")
DERIVED_DATA = DATA / "derived" if CHECKOUT else Path("lmmap-derived")  # of a wheel: in the user's folder
# what a chapter's output depends on besides its own cells; of results the tables and pictures, not archives
PAGE_SOURCES = ("lmmap/**/*.py", "lmmap_readers/**/*.py", "lmmap_lab/**/*.py", "data/weights/**/*",
            "data/mini/*", "data/paper/*", "data/peers/*", "data/*.json", "data/results/**/*.[cjt]*",
            "data/derived/{profile}/*.[cj]s*", "data/derived/recordings/*/told.txt", "book/_static/*.js",
            "environment.txt")  # fmt: skip
PINS = "environment.txt"
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


def fingerprint(*facts: str, code: Iterable[Callable | ModuleType] = (), files: Iterable[str] = ()) -> str:
    """Hash of what a result depends on.

    Parameters
    ----------
    facts
        What it was made with: its sequence, a rate.
    code
        Functions, classes and modules that make it; they count by their `meaning`.
    files
        Files by patterns relative to the checkout.  They count by name and content, wherever they lie; of
        `PINS` the `pins` count.

    Raises
    ------
    ValueError
        For a pattern without a file: such a hash would not notice a change.
    """
    digest = hashlib.sha256(repr((facts, meaning(*code))).encode())
    for pattern in files:
        if not (paths := sorted(ROOT.glob(pattern))):
            raise ValueError(f"files: expected some in {ROOT}, got none for {pattern!r}")
        for path in paths:
            digest.update(path.name.encode())
            digest.update(hashlib.sha256(pins() if path == ROOT / PINS else path.read_bytes()).digest())
    return digest.hexdigest()


def pins() -> bytes:
    """The exact versions of `PINS`, in order, without comments and without what only development needs."""
    sections = (ROOT / PINS).read_text().split("\n\n")
    lines = [line for text in sections if not text.startswith("# development") for line in text.splitlines()]
    return "\n".join(sorted(line for line in lines if line and not line.startswith("#"))).encode()


def page_fingerprint(root: Path = ROOT) -> str:
    """Hash of the profile, and of names and contents of all that the book's pages are made of."""
    digest = hashlib.sha256(profile().encode())
    patterns = [pattern.format(profile=profile()) for pattern in PAGE_SOURCES]
    for path in sorted(p for pattern in patterns for p in root.glob(pattern) if p.is_file()):
        digest.update(f"{path.relative_to(root)}\0".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:16]


def commit() -> str:
    """The commit of the checkout, with '+' when other files than results and references are edited or new;
    'unknown' without git."""
    made_of = ["--", ".", ":!data/results", ":!data/reference"]
    git = ["git", "-C", str(ROOT), "status", "--porcelain=v2", "--branch", *made_of]
    try:
        head, *lines = subprocess.run(git, capture_output=True, text=True, check=True).stdout.splitlines()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return head.removeprefix("# branch.oid ")[:12] + ("+" if any(line[0] != "#" for line in lines) else "")


def processor() -> str:
    """The kind of processor for which kernels are compiled here, by its microarchitecture."""
    return llvmlite.binding.get_host_cpu_name()


def port_mark() -> str:
    """Hash of the lengths of the port that the laboratory has."""
    lengths = {k: v for k, v in vars(Port.lm_map()).items() if k.endswith("_m")}
    return hashlib.sha256(json.dumps(lengths, sort_keys=True).encode()).hexdigest()[:12]


def provenance(**facts) -> dict:
    """What made a result: processor, the given facts, commit, networks' precision, port, packages' versions.

    It is the same for two runs of one commit on one machine.
    """
    return {"processor": processor(), **facts, "commit": commit(), "precision": os.environ["LMMAP_PRECISION"],
            "port": port_mark(), "python": platform.python_version(), "machine": platform.machine(),
            **_versions()}  # fmt: skip


@cache
def _versions() -> dict[str, str]:
    return {name: version(name) for name in PACKAGES}


def _provenance_of(path: Path, facts: dict) -> dict:
    """`provenance`, with a warning if a result that is to be committed comes from no commit."""
    made = provenance(**facts)
    own, derived = (folder.resolve() in path.resolve().parents for folder in (DATA, DERIVED_DATA))
    if own and not derived and made["commit"].endswith(("+", "unknown")):
        warnings.warn(f"{path}: made by edited files, which nobody can look up; commit them and make it "
                      "again, for a test refuses it", stacklevel=3)  # fmt: skip
    return made


def save_json(path: Path, values: dict, **facts) -> Path:
    """Write ``values`` with their provenance, whole or not at all."""
    document = {"values": values, "provenance": _provenance_of(path, facts)}
    return write_text(path, json.dumps(document, indent=1, sort_keys=True, default=_json_value) + "\n")


def load_json(path: Path) -> dict:
    """The values of a file that `save_json` wrote."""
    return json.loads(Path(path).read_text())["values"]


def save_table(path: Path, table: pd.DataFrame, **facts) -> Path:
    """Write a CSV, and its provenance as JSON beside it."""
    made = json.dumps(_provenance_of(path, facts), indent=1, sort_keys=True) + "\n"
    write_text(path.with_suffix(".provenance.json"), made)
    return write_text(path, table.to_csv(index=False, float_format="%.6g"))


def facts_of(path: Path) -> dict:
    """What `save_table` wrote beside a table."""
    return json.loads(path.with_suffix(".provenance.json").read_text())


def load_table(path: Path) -> pd.DataFrame:
    return pd.read_csv(path)


def _json_value(value):
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
