"""Rigs as files: what goes in comes out, beside the bags that it serves, and what is none is one line."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import line, unreadable

from lmmap.types import Port, Pose
from lmmap_readers.rig import RIG_FILE, Rig, find_rig, scale_port

CAM_ROOT = Pose(Rotation.from_euler("xyz", [80, 3, -7], degrees=True).as_matrix(), [0.3, 0.4, 0.7])
TIP_PORT = Pose(Rotation.from_euler("z", 17, degrees=True).as_matrix(), [0.004, -0.006, 0.11])
RIG = Rig("base_link", "tool0", CAM_ROOT, TIP_PORT, 0.09, 0.016, {"detections": 3})


def test_a_rig_survives_its_file(tmp_path):
    RIG.save(tmp_path / "rig.json")
    again = Rig.load(tmp_path / "rig.json")
    assert (again.root, again.tip, again.delay_s) == ("base_link", "tool0", 0.016)
    assert again.calibration == RIG.calibration and again.port.ring_radius_m == pytest.approx(0.09)
    for name in ("T_cam_root", "T_tip_port"):
        np.testing.assert_allclose(getattr(again, name).rotation, getattr(RIG, name).rotation, atol=1e-15)
        np.testing.assert_allclose(getattr(again, name).position_m, getattr(RIG, name).position_m)


def test_a_rig_serves_the_bags_of_its_folder_and_of_those_in_it(tmp_path):
    (tmp_path / "deep" / "deeper").mkdir(parents=True)
    assert find_rig(tmp_path / "a.bag") is None and find_rig(None) is None
    RIG.save(tmp_path / RIG_FILE)
    assert find_rig(tmp_path / "a.bag").tip == find_rig(tmp_path / "deep" / "a.bag").tip == "tool0"
    assert find_rig(tmp_path / "deep" / "deeper" / "a.bag") is None
    assert find_rig(tmp_path / "a.aedat4") is None


@pytest.mark.parametrize("change", [
    {"root": None}, {"root": ["a"]}, {"tip": "t" * 2000}, {"ring_radius_m": 0}, {"ring_radius_m": 1e300},
    {"ring_radius_m": 10**400}, {"ring_radius_m": True}, {"delay_s": float("nan")}, {"delay_s": 1e300},
    {"delay_s": "1"}, {"T_cam_root": 3}, {"T_cam_root": [[1]]}, {"T_tip_port": [[1e300] * 4] * 4},
    {"T_tip_port": [[10**400] * 4] * 4}, {"T_tip_port": {}},
])  # fmt: skip
def test_rigs_are_checked_field_by_field(tmp_path, change):
    RIG.save(tmp_path / "rig.json")
    values = json.loads((tmp_path / "rig.json").read_text())
    (tmp_path / "rig.json").write_text(json.dumps(values | change))
    assert "rig.json: not a rig" in line(Rig.load, tmp_path / "rig.json")


@pytest.mark.parametrize("text", ["", "[]", "3", "null", '{"root": "a"}', "[" * 100_000])
def test_documents_that_are_no_rigs(tmp_path, text):
    (tmp_path / "rig.json").write_text(text)
    assert "rig.json: not a rig" in line(Rig.load, tmp_path / "rig.json")


def test_what_is_no_file_or_too_large_is_not_read(tmp_path):
    for path, words in unreadable(tmp_path):
        assert words in line(Rig.load, path)


def test_a_port_of_another_size_is_the_same_shape():
    port, large = Port.lm_map(), scale_port(Port.lm_map(), 0.16)
    np.testing.assert_allclose(large.marker_corners_m(), 2 * port.marker_corners_m())
    assert large.symmetry == port.symmetry and large.plate_height_tolerance == port.plate_height_tolerance
    assert scale_port(large, port.ring_radius_m).panel_size_m == pytest.approx(port.panel_size_m)
