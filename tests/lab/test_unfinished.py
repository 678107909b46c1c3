"""Folders of unfinished work: ours are begun anew and go, others are left alone."""

import os

import pytest

from lmmap.types import InputError
from lmmap_lab.unfinished import MARK, begin_folder, check_own, remove_folder


def names(folder):
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize("kind", ["folder", "link", "file", "pipe"])
def test_what_is_not_ours_is_neither_used_nor_removed(tmp_path, kind):
    path, mine = tmp_path / "o.parts", tmp_path / "mine"
    mine.mkdir()
    (mine / MARK).write_text("{}")
    makers = {"folder": path.mkdir, "link": lambda: path.symlink_to(mine), "file": path.touch}
    makers.get(kind, lambda: os.mkfifo(path))()
    before = path.lstat()
    for refuses in (check_own, lambda path: begin_folder(path, "{}")):
        with pytest.raises(InputError, match="is not ours to replace"):
            refuses(path)
    assert path.lstat() == before and names(mine) == {MARK}


def test_an_own_folder_is_begun_anew_and_goes(tmp_path):
    path = tmp_path / "o.parts"
    for mark in ("a", "b"):
        begin_folder(path, mark)
        assert names(path) == {MARK} and (path / MARK).read_text() == mark
        (path / "part").touch()
    remove_folder(path)
    remove_folder(path)
    assert not names(tmp_path)
