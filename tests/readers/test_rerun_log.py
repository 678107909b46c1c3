"""What Rerun is told of estimates, by a stand-in that writes down every call."""

import sys
from pathlib import Path
from types import SimpleNamespace

import drawn
import numpy as np
import pytest
from strategies import facing_pose

from lmmap.cli import main
from lmmap.recordings.pose_files import read_estimates
from lmmap.types import Camera, Ellipse, Estimate, Port, Status
from lmmap_readers import rerun_log

DRAWN = drawn.file(6)
T = facing_pose(0.3, 0.2, 0.1, [0.01, -0.02, 0.6])
SPREAD = np.diag([1e-3, 2e-3, 5e-3, 1e-2, 1e-2, 1e-2]) ** 2
IMAGE = np.zeros((260, 346, 3), np.uint8)


class Recorder:
    """Stands for the package: its archetypes are their names and arguments, its log is a list."""

    def __init__(self):
        self.entries, self.closed = [], 0

    def __getattr__(self, name):
        return lambda *values, **named: SimpleNamespace(name=name, values=values, **named)

    ViewCoordinates = SimpleNamespace(RDF=SimpleNamespace(name="ViewCoordinates"))

    def RecordingStream(self, _):
        return self

    def save(self, path):
        self.path, self.t_us = Path(path), None
        self.path.write_text("log")

    def set_time(self, timeline, duration):
        self.t_us = int(duration / np.timedelta64(1, "us"))

    def log(self, entity, *components, static=False):
        self.entries.append((None if static else self.t_us, entity, components[0]))

    def flush(self):
        pass

    def disconnect(self):
        self.closed += 1

    def of(self, entity):
        """``(t_us, archetype)`` of an entity, in order."""
        return [(t_us, what) for t_us, where, what in self.entries if where == entity]


@pytest.fixture
def rerun(monkeypatch):
    recorder = Recorder()
    monkeypatch.setitem(sys.modules, "rerun", recorder)
    return recorder


def test_each_estimate_is_logged_once_with_its_time_and_pose(tmp_path, rerun, capsys):
    """Of the command: those of its CSV, and nothing else."""
    argv = ["estimate", str(DRAWN), "--modality", "event", "--rate", "20", "-o", str(tmp_path / "p.csv")]
    assert main.main([*argv, "--rerun", str(tmp_path / "p.rrd")]) == 0
    estimates = read_estimates(tmp_path / "p.csv")
    assert len(estimates) > 2 and rerun.closed == 1 and (tmp_path / "p.rrd").read_text() == "log"
    assert [t_us for t_us, _ in rerun.of("status")] == [e.t_us for e in estimates]
    assert [what.values[0] for _, what in rerun.of("status")] == [str(e.status) for e in estimates]
    assert [t_us for t_us, _ in rerun.of("camera/event/ring")] == [e.t_us for e in estimates]
    for e, (t_us, pose) in zip(estimates, rerun.of("camera/port"), strict=True):
        assert t_us == e.t_us
        if e.T_cam_port is None:
            assert pose.name == "Clear"
        else:
            np.testing.assert_allclose(pose.translation, e.T_cam_port.position_m, atol=1e-6)
            np.testing.assert_allclose(pose.mat3x3, e.T_cam_port.rotation, atol=1e-6)
    assert any(pose.name == "Transform3D" for _, pose in rerun.of("camera/port"))
    assert not any("rgb" in entity for _, entity, _ in rerun.entries)


def test_poses_are_logged_afterwards(tmp_path, rerun, capsys):
    argv = ["--modality", "rgb", "--rate", "20"]
    assert main.main(["estimate", str(DRAWN), *argv, "-o", str(tmp_path / "p.csv")]) == 0
    drawn = ["draw", str(DRAWN), str(tmp_path / "p.csv"), *argv, "-o", str(tmp_path / "p.rrd")]
    assert main.main(drawn) == 0
    times_us = [e.t_us for e in read_estimates(tmp_path / "p.csv")]
    assert [t_us for t_us, _ in rerun.of("camera/port")] == times_us
    assert [t_us for t_us, _ in rerun.of("camera/rgb") if _.name == "Image"] == times_us


def test_what_an_estimate_lacks_is_cleared(tmp_path, rerun):
    ring = Ellipse([170, 130], [40, 38], 0.1)
    seen = Estimate(-5, Status.OK, T, ellipse=ring, covariance=SPREAD, confidence=0.9)
    with rerun_log.RerunLog(tmp_path / "p.rrd", Port.lm_map(), Camera.davis346()) as log:
        log.add(IMAGE, seen, np.ones(IMAGE.shape[:2]))
        log.add(None, Estimate(7, Status.PREDICTED, T))
        log.add(IMAGE, Estimate(9, Status.NO_RING))
    kinds = {entity: [(t, what.name) for t, what in rerun.of(entity)] for _, entity, _ in rerun.entries}
    assert kinds["camera/port"] == [(-5, "Transform3D"), (7, "Transform3D"), (9, "Clear")]
    assert kinds["camera/uncertainty"] == [(-5, "Ellipsoids3D"), (7, "Clear"), (9, "Clear")]
    assert kinds["camera/rgb/ellipse"] == [(-5, "LineStrips2D"), (9, "Clear")]
    assert [t for t, _ in kinds["status"]] == [t for t, _ in kinds["confidence"]] == [-5, 7, 9]


def test_the_ellipsoid_is_the_covariances():
    """Its axes turn half axes of two standard deviations back into the covariance."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        root = rng.standard_normal((3, 3))
        half_m, xyzw = rerun_log.ellipsoid(root @ root.T)
        axes = rerun_log.Rotation.from_quat(xyzw).as_matrix()
        np.testing.assert_allclose(axes @ np.diag(half_m / rerun_log.SIGMAS) ** 2 @ axes.T, root @ root.T)


def test_an_error_leaves_the_older_file(tmp_path, rerun):
    path = tmp_path / "p.rrd"
    path.write_text("old")
    with pytest.raises(ValueError), rerun_log.RerunLog(path, Port.lm_map(), Camera.davis346()):
        raise ValueError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("name", "said"), [("p.rrd", "pip install"), ("p.mp4", "name the file for Rerun")])
def test_without_the_package_or_with_another_name_it_is_one_line(tmp_path, monkeypatch, capsys, name, said):
    monkeypatch.setitem(sys.modules, "rerun", None)  # as where it is not installed
    argv = ["estimate", str(DRAWN), "--modality", "rgb", "-o", str(tmp_path / "p.csv")]
    assert main.main([*argv, "--rerun", str(tmp_path / name)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line and list(tmp_path.iterdir()) == []
