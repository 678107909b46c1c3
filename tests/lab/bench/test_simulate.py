"""Sequences on disk: the same from one process or two, resumed, and never half a file."""

import numpy as np
import pytest

from lmmap import open_recording
from lmmap.types import InputError
from lmmap_lab.bench import part_files, sequences, simulate


def test_two_processes_write_what_one_call_returns(tmp_path):
    jobs = [(name, 0.15, tmp_path / f"{name}.h5") for name in ("test-low", "empty-0")]
    done = list(simulate.record_all(jobs, workers=2))
    assert [path for path, *_ in done] == [job[2] for job in jobs]
    for (name, seconds, path), (_, events, frames) in zip(jobs, done, strict=True):
        written, wanted = open_recording(path), sequences.simulate(name, seconds)
        assert np.array_equal(written.events, wanted.events) and len(wanted.events) == events
        assert np.array_equal(written.frames, wanted.frames) and len(wanted.frames) == frames
    assert not list(tmp_path.glob("*.parts"))


def test_what_is_done_survives_a_failed_write(tmp_path, monkeypatch):
    monkeypatch.setattr(sequences, "PART_S", 0.05)
    path = tmp_path / "a.h5"

    def full(recording, path):
        raise InputError(f"{path}: cannot write (No space left on device); choose a folder with room")

    with monkeypatch.context() as patch, pytest.raises(InputError, match="No space left"):
        patch.setattr(simulate, "write_recording", full)
        simulate.record("test-low", 0.15, path)
    assert not path.exists() and list((tmp_path / "a.h5.parts").glob("*.h5"))
    begun = []
    simulate.record("test-low", 0.15, path, begun.append)
    assert path.exists() and begun[0] > 0.05


def test_a_full_disk_is_one_clear_line(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(sequences, "PART_S", 0.05)
    monkeypatch.setattr(part_files.h5py, "File", full)
    with pytest.raises(InputError, match=r"0000\.h5: cannot write \(No space left on device\)"):
        simulate.record("test-low", 0.15, tmp_path / "a.h5")
    assert not (tmp_path / "a.h5").exists()


def test_no_scheduler(tmp_path):
    with pytest.raises(InputError, match="tcp://localhost:1: "):
        list(simulate.record_all([("test-low", 0.1, tmp_path / "a.h5")], scheduler="tcp://localhost:1"))
