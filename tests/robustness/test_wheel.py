"""The installed package, outside the checkout, with nothing but its wheel and its dependencies."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from importlib import metadata
from pathlib import Path

import cv2
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from lmmap import open_recording
from lmmap.shipped import DATA, ROOT

FIVE_LINES = """
import lmmap
recording = lmmap.open_recording({path!r})
estimator = lmmap.Estimator(recording.camera, modality="rgb")
estimate = estimator(recording.frames[0], recording.frames_t_us[0])
print(lmmap.__file__, estimate.status, *estimate.T_cam_port.position_m.round(2))
"""


NO_OTHERS = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {names!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Refuse())
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
    made_of = ["lmmap", "lmmap_readers", "lmmap_lab", "data/weights", "data/paper", "data/photometry.json",
               "pyproject.toml", "README.md", "LICENSE"]  # fmt: skip
    listed = subprocess.run(
        ["git", "-C", ROOT, "ls-files", *made_of], check=True, capture_output=True, text=True
    )
    for name in listed.stdout.splitlines():
        path = target / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes((ROOT / name).read_bytes())
    return target


def run(site: Path, cwd: Path, code: str) -> subprocess.CompletedProcess:
    """Code in an interpreter that knows the wheel and its dependencies, and no checkout."""
    paths = os.pathsep.join([str(site), sysconfig.get_path("purelib")])
    environment = {**os.environ, "PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"}
    base = Path(sys.base_prefix) / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}"
    return subprocess.run([base, "-c", code], cwd=cwd, env=environment, capture_output=True, text=True)


def python(site: Path, cwd: Path, code: str) -> str:
    """What code prints in such an interpreter."""
    done = run(site, cwd, code)
    assert done.returncode == 0, done.stderr
    return done.stdout


def lmmap(site: Path, cwd: Path, *argv) -> subprocess.CompletedProcess:
    """The ``lmmap`` command in such an interpreter."""
    code = f"import sys; from lmmap.cli.main import main; sys.exit(main({[str(a) for a in argv]!r}))"
    return run(site, cwd, code)


def files(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


def test_five_lines_give_a_pose(site, tmp_path):
    printed = python(site, tmp_path, FIVE_LINES.format(path=str(DATA / "mini" / "test-low.aedat4"))).split()
    assert Path(printed[0]).is_relative_to(site) and printed[1] == "ok"
    assert 0.3 < float(printed[-1]) < 1.5


@pytest.mark.parametrize("house, least", [("lmmap", 50), ("lmmap_readers", 10), ("lmmap_lab", 50)])
def test_every_module_is_in_the_wheel(site, house, least):
    modules = {path.relative_to(ROOT) for path in (ROOT / house).rglob("*.py")}
    assert len(modules) > least and modules == {
        path.relative_to(site) for path in (site / house).rglob("*.py")
    }


def test_the_two_packages_share_one_folder_of_data(site):
    assert {path.parent.name for path in site.rglob("data") if path.is_dir()} == {"lmmap"}
    code = "from lmmap_lab.provenance import DATA; print((DATA / 'paper' / 'table1.csv').exists())"
    assert python(site, site, code).strip() == "True"


def test_importing_is_immediate_and_writes_nothing(site, tmp_path):
    before = files(site)
    code = "import time; start = time.perf_counter(); import lmmap; print(time.perf_counter() - start)"
    seconds = min(float(python(site, tmp_path, code)) for _ in range(3))
    assert seconds < 0.5
    assert files(site) == before and not files(tmp_path)


def test_every_public_name_exists(site, tmp_path):
    code = "import lmmap; print(all(getattr(lmmap, name) for name in lmmap.__all__))"
    assert python(site, tmp_path, code).strip() == "True"


def test_the_folder_above_a_clone_does_not_hide_the_package(tmp_path):
    """A clone is a folder named lmmap, an empty package to Python unless it finds another on its path."""
    texts = [(ROOT / place).read_text() for place in ("Makefile", "binder/postBuild", "README.md")]
    installs = [re.findall(r"pip install ([^`\n]*?) -e \.", text.replace("\\\n", " ")) for text in texts]
    silent = {"--quiet", "--disable-pip-version-check"}
    (options,) = {" ".join(word for word in one.split() if word not in silent) for (one,) in installs}
    clone, target = _copy(tmp_path / "lmmap"), tmp_path / "site"
    install = [sys.executable, "-m", "pip", "install", "-q", *options.split(), "--target", target]
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


@pytest.fixture(scope="module")
def thin(site, tmp_path_factory):
    """The wheel without the laboratory, where its own dependencies are and no other package."""
    folder = tmp_path_factory.mktemp("thin") / "site"
    shutil.copytree(site, folder, ignore=shutil.ignore_patterns("lmmap_lab"))
    needed = {"lmmap"} | _closure(metadata.PathDistribution(next(folder.glob("lmmap-*.dist-info"))).requires)
    refused = _refuse_others(folder, needed)
    assert {"joblib", "matplotlib", "IPython"} <= refused and not {"numpy", "torch", "pandas"} & refused
    return folder


def _closure(requirements: list[str]) -> set[str]:
    """Names of the packages that are needed, and of those that they need."""
    needed, waiting = set(), [Requirement(text) for text in requirements]
    while waiting:
        requirement = waiting.pop()
        name = canonicalize_name(requirement.name)
        applies = not requirement.marker or requirement.marker.evaluate({"extra": ""})
        if applies and name not in needed:
            needed.add(name)
            waiting += map(Requirement, metadata.requires(name) or ())
    return needed


def test_the_thin_part_alone_gives_a_pose(thin, tmp_path):
    mini = DATA / "mini" / "test-low.aedat4"
    printed = python(thin, tmp_path, FIVE_LINES.format(path=str(mini))).split()
    assert Path(printed[0]).is_relative_to(thin) and printed[1] == "ok"
    done = lmmap(thin, tmp_path, "estimate", mini, "--modality", "rgb", "--rate", "5", "-o", "poses.csv")
    assert done.returncode == 0 and not done.stderr and " ok" in done.stdout
    assert (tmp_path / "poses.csv").read_text().count(",ok,") > 3


OF_A_POSE = [
    "numpy",
    "scipy",
    "numba",
    "opencv-python-headless",
    "scikit-image",
    "torch",
    "safetensors",
    "pillow",
]
POSE = """
import sys, cv2, lmmap
image = cv2.imread({path!r})[..., ::-1]
estimator = lmmap.Estimator(lmmap.Camera.davis346(), modality="rgb")
print(estimator(image, 0).status, "lmmap_readers" in sys.modules)
"""


def test_the_pose_of_an_image_needs_eight_packages(site, tmp_path):
    """And the readers beside lmmap are not asked."""
    folder, picture = tmp_path / "site", tmp_path / "p.png"
    shutil.copytree(site, folder, ignore=shutil.ignore_patterns("lmmap_lab"))
    _refuse_others(folder, {"lmmap"} | _closure(OF_A_POSE))
    cv2.imwrite(str(picture), open_recording(DATA / "mini" / "test-low.aedat4").frames[0][..., ::-1])
    assert python(folder, tmp_path, POSE.format(path=str(picture))).split() == ["ok", "False"]


def _refuse_others(folder: Path, needed: set[str]) -> set[str]:
    """Make packages other than those needed look as if they were not installed; their modules' names."""
    owners = metadata.packages_distributions().items()
    refused = {name for name, owned in owners if needed.isdisjoint(map(canonicalize_name, owned))}
    (folder / "sitecustomize.py").write_text(NO_OTHERS.format(names=refused))
    return refused


def test_without_the_laboratory_its_commands_say_what_to_install(thin, site, tmp_path):
    shown = lmmap(thin, tmp_path, "--help")
    assert shown.returncode == 0 and re.search(
        r"^  simulate +needs pip install 'lmmap\[lab\]'$", shown.stdout, re.M
    )
    done = lmmap(thin, tmp_path, "simulate", "--sequence", "test-low", "-o", "demo.aedat4")
    line = "lmmap: simulate: needs lmmap_lab, which is not installed; pip install 'lmmap[lab]'\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", line)


def test_without_its_packages_a_command_of_the_laboratory_says_what_to_install(site, thin, tmp_path):
    """As ``pip install lmmap`` leaves it: the module is there, joblib is not."""
    whole = tmp_path / "site"
    shutil.copytree(site, whole)
    shutil.copy(thin / "sitecustomize.py", whole)
    assert "record sequences of the bench" in lmmap(whole, tmp_path, "--help").stdout
    done = lmmap(whole, tmp_path, "simulate", "--sequence", "test-low", "-o", "demo.aedat4")
    line = "lmmap: simulate: needs joblib, which is not installed; pip install 'lmmap[lab]'\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", line)
