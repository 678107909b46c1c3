"""The thin package's tests, run alone, cannot import the laboratory; see `make test-lmmap`."""

import sys
from importlib.abc import MetaPathFinder
from pathlib import Path

import pytest

HERE = Path(__file__).parent


class NoLaboratory(MetaPathFinder):
    """Makes ``lmmap_lab`` look as where it is not installed."""

    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "lmmap_lab":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def pytest_configure(config):
    named = [(config.invocation_params.dir / arg.split("::")[0]).resolve() for arg in config.args]
    if all(path.is_relative_to(HERE) for path in named):
        sys.meta_path.insert(0, NoLaboratory())


@pytest.fixture(scope="module", autouse=True)
def own_precision():
    """The networks' own, also where a test of the laboratory, which sets another one, ran before."""
    with pytest.MonkeyPatch.context() as patched:
        patched.delenv("LMMAP_PRECISION", raising=False)
        yield
