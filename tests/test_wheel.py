"""The installed package, outside the checkout, with nothing but its wheel and its dependencies."""

import os
import re
import shlex
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from lmmap_lab.provenance import DATA, ROOT

FIVE_LINES = """
import lmmap
recording = lmmap.open_recording({path!r})
estimator = lmmap.Estimator(recording.camera, modality="rgb")
estimate = estimator(recording.frames[0], recording.frames_t_us[0])
print(lmmap.__file__, estimate.status, *estimate.T_cam_port.position_m.round(2))
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with the unpacked wheel, built from a copy of the checkout's own files."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    build = ["wheel", "--no-deps", "--no-build-isolation", "-w", folder, _copy(folder / "source")]
    subprocess.run([*command, *build], check=True)
    (wheel,) = folder.glob("lmmap-*.whl")
    subprocess.run([*command, "install", "--no-deps", "--target", folder / "site", wheel], check=True)
    return folder / "site"


def _copy(target: Path) -> Path:
    """The tracked files that a wheel is made of; a build writes beside its sources."""
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "lmmap", "data/weights", "data/paper",
                             "data/photometry.json", "pyproject.toml", "README.md", "LICENSE"],
                            check=True, capture_output=True, text=True).stdout.splitlines()  # fmt: skip
    for name in listed:
        path = target / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes((ROOT / name).read_bytes())
    return target


def python(site: Path, cwd: Path, code: str) -> str:
    """What code prints in an interpreter that knows the wheel and its dependencies, and no checkout."""
    paths = os.pathsep.join([str(site), sysconfig.get_path("purelib")])
    environment = {**os.environ, "PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"}
    base = Path(sys.base_prefix) / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}"
    return subprocess.run([base, "-c", code], cwd=cwd, env=environment, check=True, capture_output=True,
                          text=True).stdout  # fmt: skip


def files(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


def test_five_lines_give_a_pose(site, tmp_path):
    printed = python(site, tmp_path, FIVE_LINES.format(path=str(DATA / "mini" / "test-low.aedat4"))).split()
    assert Path(printed[0]).is_relative_to(site) and printed[1] == "ok"
    assert 0.3 < float(printed[-1]) < 1.5


def test_every_wing_is_in_the_wheel(site):
    wings = {path.parent.name for path in (ROOT / "lmmap").glob("*/__init__.py")}
    assert wings == {path.parent.name for path in (site / "lmmap").glob("*/__init__.py")}


def test_importing_is_immediate_and_writes_nothing(site, tmp_path):
    before = files(site)
    code = "import time; start = time.perf_counter(); import lmmap; print(time.perf_counter() - start)"
    seconds = min(float(python(site, tmp_path, code)) for _ in range(3))
    assert seconds < 0.5
    assert files(site) == before and not files(tmp_path)


def test_every_public_name_exists(site, tmp_path):
    code = "import lmmap; print(all(getattr(lmmap, name) for name in lmmap.__all__))"
    assert python(site, tmp_path, code).strip() == "True"


@pytest.mark.parametrize("place", ["Makefile", "binder/postBuild", "README.md"])
def test_the_folder_above_a_clone_does_not_hide_the_package(tmp_path, place):
    """A clone is a folder named lmmap, an empty package to Python unless it finds another on its path."""
    text = (ROOT / place).read_text().replace("\\\n", " ")
    (options,) = re.findall(r"pip install ([^`\n]*?) -e \.", text)
    clone, target = _copy(tmp_path / "lmmap"), tmp_path / "site"
    install = [sys.executable, "-m", "pip", "install", "-q", *shlex.split(options), "--target", target]
    subprocess.run([*install, "-e", clone], check=True)
    code = f"import site; site.addsitedir({str(target)!r}); import lmmap; print(lmmap.__file__)"
    assert python(target, tmp_path, code).strip() == str(clone / "lmmap" / "__init__.py")


def test_what_needs_a_checkout_says_so(site, tmp_path):
    code = "from lmmap.cli.main import main; print(main(['reproduce']))"
    assert python(site, tmp_path, code).strip() == "1" and not files(tmp_path)


def test_the_wheel_declares_what_it_needs(site):
    (metadata,) = site.glob("lmmap-*.dist-info/METADATA")
    needs = [line for line in metadata.read_text().splitlines() if line.startswith("Requires-Dist")]
    assert any("torch" in line for line in needs) and (site / "lmmap" / "py.typed").exists()
