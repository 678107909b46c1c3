"""Shared by all tests: how many examples a law is tried on, a camera, a port, random numbers."""

import numpy as np
import pytest
from hypothesis import settings

from lmmap.cli import main
from lmmap.types import Camera, Port

settings.register_profile("lmmap", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("lmmap")


@pytest.fixture
def camera():
    return Camera.davis346()


@pytest.fixture
def port():
    return Port.lm_map()


@pytest.fixture
def rng():
    return np.random.default_rng(20)


@pytest.fixture
def lmmap(capsys):
    """Run a command; its exit code and what it printed."""

    def run(*argv):
        code = main.main([str(a) for a in argv])
        out, err = capsys.readouterr()
        return code, out, err

    return run
