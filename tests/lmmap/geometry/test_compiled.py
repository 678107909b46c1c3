"""Compiled functions are the same with a cache and without."""

import tempfile

import numba
import pytest
from numba.core import caching
from numba.core.errors import TypingError

from lmmap.geometry.compiled import njit


def double(x):
    return 2 * x


@pytest.mark.parametrize("cached", [True, False])
def test_where_no_cache_may_be_written_it_is_compiled_without(tmp_path, monkeypatch, cached):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    if not cached:
        monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
        with pytest.raises(RuntimeError, match="cannot cache"):
            numba.njit(cache=True)(double)
    else:
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert njit()(double)(21) == 42
    assert any(tmp_path.rglob("*.nbi")) == cached


def test_where_the_disk_is_full_it_is_compiled_without(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(caching.IndexDataCacheFile, "_open_for_write", refuse)
    with pytest.raises(OSError, match="No space"):
        numba.njit(cache=True)(double)(21)
    assert njit()(double)(21) == 42


def test_other_errors_pass():
    with pytest.raises(TypingError):
        njit()(lambda x: x.no_such_attribute)(1.0)
