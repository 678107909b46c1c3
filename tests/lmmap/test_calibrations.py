"""Calibrations of other programs: the right camera, or a line that says what is not understood."""

import json
import warnings

import dv_processing as dv
import numpy as np
import pytest

from lmmap.calibrations import COLMAP, LENSES
from lmmap.types import Camera, InputError

K = "[226.5, 0., 173.25, 0., 227.5, 133.75, 0., 0., 1.]"
OPENCV = """%YAML:1.0
---
image_width: 346
image_height: 260
{lens}
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: {matrix}
distortion_coefficients: !!opencv-matrix
   rows: {count}
   cols: 1
   dt: d
   data: {coefficients}
"""
FOUR = (-0.042, 0.021, -0.013, 0.004)
PINHOLE = (346, 260, 226.5, 227.5, 173.25, 133.75)


def opencv(lens="", matrix=K, coefficients=FOUR):
    return OPENCV.format(lens=lens, matrix=matrix, count=len(coefficients), coefficients=list(coefficients))


def read(tmp_path, text, name="c.yaml", **options) -> Camera:
    (tmp_path / name).write_text(text if isinstance(text, str) else json.dumps(text))
    return Camera.load(tmp_path / name, **options)


def refused(tmp_path, text, name="c.yaml", **options) -> str:
    with pytest.raises(InputError) as caught:
        read(tmp_path, text, name, **options)
    assert name in str(caught.value) and "\n" not in str(caught.value)
    return str(caught.value)


# --- lenses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("coefficients", [FOUR, (0.1, -0.02, 0.003, -0.0004)])
@pytest.mark.parametrize("lens, model", [("", "radtan"), ("fisheye_model: 0", "radtan"),
                                         ("fisheye_model: 1", "equidistant"),
                                         ("fisheye_model: true", "equidistant"),
                                         ("distortion_model: fisheye", "equidistant")])  # fmt: skip
def test_opencv_s_fisheye_is_one(tmp_path, lens, model, coefficients):
    camera = read(tmp_path, opencv(lens, coefficients=coefficients))
    assert camera == Camera(*PINHOLE, coefficients, model)


@pytest.mark.parametrize(
    "line",
    ["fisheye_model: 2", "lens_model: fisheye", "model_type: MEI", "xi: 1.2", "projection: stereographic",
     "distortion_type: fov", "units: mm", "distortion_coefficents: [0.1, 0, 0, 0]", "k1: 0.1",
     "omnidir_model: 1", "distortion_model: thin_prism", "mirror_parameters: {xi: 1}"],
)  # fmt: skip
def test_what_names_a_lens_and_is_unknown_is_an_error(tmp_path, line):
    assert line.split(":")[0] in refused(tmp_path, opencv(line))


@pytest.mark.parametrize(
    "line", ["camera_name: davis", "units: px", "camera_model: pinhole", "flags: 0",
             "avg_reprojection_error: 0.2",
             "projection_matrix: {rows: 3, cols: 4, data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]}"],
)  # fmt: skip
def test_what_names_none_is_passed_over(tmp_path, line):
    assert read(tmp_path, opencv(line)) == Camera(*PINHOLE, FOUR)


def test_lenses_that_contradict_each_other(tmp_path):
    assert "two lenses" in refused(tmp_path, opencv("fisheye_model: 1\ndistortion_model: plumb_bob"))
    assert "4 distortion coefficients, expected none" in refused(tmp_path, opencv("distortion_model: none"))
    eight = (*FOUR, 0.1, 0.2, 0.3, 0.4)
    assert "8 distortion coefficients" in refused(tmp_path, opencv(coefficients=eight))
    assert read(tmp_path, opencv(coefficients=(*FOUR, 0.1, 0, 0, 0))).distortion == (*FOUR, 0.1)


def test_every_lens_of_the_table_is_one_of_ours():
    known = {lens for values in LENSES.values() for lens in values.values()}
    assert known == {"radtan", "equidistant", "none", None}


# --- matrices -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "matrix, said",
    [
        ("[226.5, 0, 0, 0, 227.5, 0, 173.25, 133.75, 1]", "transposed"),
        ("[226.5, 4.5, 173.25, 0, 227.5, 133.75, 0, 0, 1]", "no skew, got 4.5"),
        ("[226.5, 0, 173.25, 2.5, 227.5, 133.75, 0, 0, 1]", "no skew, got 2.5"),
        ("[453, 0, 346.5, 0, 455, 267.5, 0, 0, 2]", "last row"),
        ("[226.5, 0, 173.25, 0, 227.5, 133.75, 0, 0, 0]", "last row"),
        ("[226.5, 0, 173.25, 0, 227.5, 133.75]", "expected 9 numbers, got 6"),
        ("[0.6546, 0, 0.5007, 0, 0.875, 0.5144, 0, 0, 1]", "fx_px: expected a number from 1"),
    ],
)
def test_matrices_that_are_none(tmp_path, matrix, said):
    assert said in refused(tmp_path, opencv(matrix=matrix))
    spelled = {"img_size": {"width": 346, "height": 260}, "K": json.loads(matrix), "D": [], "type": "PINHOLE"}
    assert said in refused(tmp_path, spelled, "c.json")


@pytest.mark.parametrize(
    "matrix, said",
    [
        ("[226.5, 0, 0, 0, 227.5, 0, 0, 0, 1]", "centre"),
        ("[113.2, 0, 86, 0, 113.7, 66.5, 0, 0, 1]", "centre"),  # of images half as large
        ("[226.5, 0, 346, 0, 227.5, 133.75, 0, 0, 1]", "centre"),
        ("[226.5, 0, 173.25, 0, 113.7, 133.75, 0, 0, 1]", "focal lengths differ"),
        ("[6, 0, 173.25, 0, 6, 133.75, 0, 0, 1]", "focal length is 6 px"),  # in mm
    ],
)
def test_what_is_odd_is_noted(tmp_path, matrix, said):
    with pytest.warns(UserWarning, match=f"c.yaml: its {said}.*check"):
        read(tmp_path, opencv(matrix=matrix))


# --- programs -------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["RADIAL_TANGENTIAL", "EQUIDISTANT", "NONE"])
def test_dv_processing_s_own_file(tmp_path, model):
    """Oracle: iniVation's library writes it."""
    one = dv.kinematics.Transformationf(0, np.eye(4, dtype=np.float32))
    numbers = [] if model == "NONE" else [0.125, -0.25, 0.0625, 0.03125]
    lens = getattr(dv.camera.DistortionModel, model)
    written = dv.camera.calibrations.CameraCalibration(
        "DAVIS346_1", "left", True, (346, 260), (173.25, 133.75), (226.5, 227.5), numbers, lens, one, None
    )
    calibration = dv.camera.CalibrationSet()
    calibration.addCameraCalibration(written)
    calibration.writeToFile(str(tmp_path / "dv.json"))
    ours = "equidistant" if model == "EQUIDISTANT" else "radtan"
    assert Camera.load(tmp_path / "dv.json") == Camera(*PINHOLE, tuple(numbers), ours)


FILES = {
    "metavision.json": {"image_size": {"width": 346, "height": 260}, "type": "pinhole", "camera_matrix":
                        [226.5, 0, 173.25, 0, 227.5, 133.75, 0, 0, 1], "distortion_coefficients": list(FOUR)},
    "matrix.json": {"image_size": [346, 260], "camera_matrix": {"rows": 3, "cols": 3, "data":
                    [226.5, 0, 173.25, 0, 227.5, 133.75, 0, 0, 1]}, "distortion_coefficients": list(FOUR)},
    "camera.json": {"Nu": 346, "Nv": 260, "ppx": 5.86e-6, "ppy": 5.86e-6, "fx": 0.0175, "fy": 0.0175,
                    "cameraMatrix": [[226.5, 0, 173.25], [0, 227.5, 133.75], [0, 0, 1]],
                    "distCoeffs": list(FOUR)},
    "info.yaml": f"width: 346\nheight: 260\ndistortion_model: plumb_bob\nD: {list(FOUR)}\nK: {K}\n",
    "cameras.txt": "# a comment\n7 OPENCV 346 260 226.5 227.5 173.75 134.25 -0.042 0.021 -0.013 0.004\n",
    "calib.txt": "226.5 227.5 173.25 133.75 -0.042 0.021 -0.013 0.004\n",
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_other_programs_files(tmp_path, name):
    assert read(tmp_path, FILES[name], name, size_px=(346, 260)) == Camera(*PINHOLE, FOUR)


def test_calib_txt_states_no_size(tmp_path):
    assert "states them" in refused(tmp_path, FILES["calib.txt"], "calib.txt")
    assert "fx fy cx cy" in refused(tmp_path, "1 2 3\n", "calib.txt", size_px=(4, 4))


@pytest.mark.parametrize("model", COLMAP)
def test_colmap_s_models(tmp_path, model):
    """COLMAP has the first pixel's corner at 0, we its centre."""
    p = {"f": 300, "fx": 300, "fy": 300, "cx": 173.5, "cy": 130, "k1": 0.1, "k2": 0.02, "p1": 0.003,
         "p2": 4e-4, "k3": 5e-5, "k4": 6e-6}  # fmt: skip
    names = COLMAP[model].split()
    camera = read(tmp_path, f"1 {model} 346 260 {' '.join(str(p[n]) for n in names)}\n", "cameras.txt")
    kinds = ("k1", "k2", "k3", "k4") if "FISHEYE" in model else ("k1", "k2", "p1", "p2")
    lens = tuple(p[n] if n in names else 0.0 for n in kinds)
    assert (camera.cx_px, camera.cy_px, camera.fx_px, camera.fy_px) == (173.0, 129.5, 300.0, 300.0)
    assert camera.distortion == (lens if any(lens) else ())
    assert camera.distortion_model == ("equidistant" if "FISHEYE" in model else "radtan")
    said = refused(tmp_path, f"1 FOV 346 260 {' '.join('1' * 5)}\n", "cameras.txt")
    assert "COLMAP's model 'FOV'" in said


# --- several cameras ------------------------------------------------------------------------------


def kalibr(name, size, f, topic):
    return (f"{name}:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.0, 0.0, 0.0]\n"
            f"  distortion_model: radtan\n  intrinsics: [{f}, {f}, {size[0] / 2}, {size[1] / 2}]\n"
            f"  resolution: {list(size)}\n"
            f"  rostopic: {topic}\n")  # fmt: skip


TWO = kalibr("cam0", (346, 260), 226.0, "/davis/left/image_raw") + kalibr(
    "cam1", (346, 260), 328.0, "/davis/right/image_raw"
)
MIXED = kalibr("cam0", (1440, 1080), 1300.0, "/rgb/image_raw") + kalibr(
    "cam1", (346, 260), 328.0, "/dvs/image_raw"
)


@pytest.mark.parametrize(
    "text, options, f",
    [
        (MIXED, {"size_px": (346, 260)}, 328.0),
        (MIXED, {"size_px": (1440, 1080)}, 1300.0),
        (TWO, {"size_px": (346, 260), "topics": ("/davis/right/events",)}, 328.0),
        (TWO, {"size_px": (346, 260), "topics": ("/davis/left/image_raw",)}, 226.0),
        (TWO, {"topics": ("/davis/right/image_raw",)}, 328.0),
    ],
)
def test_size_and_topic_choose_a_camera(tmp_path, text, options, f):
    assert read(tmp_path, text, **options).fx_px == f


@pytest.mark.parametrize("options", [{}, {"size_px": (346, 260)}, {"topics": ("/dvs/events", "events")}])
def test_where_they_leave_a_choice_it_is_said(tmp_path, options):
    with pytest.warns(UserWarning, match=r"taking cam0, not cam1; name another, as --camera c\.yaml:cam1"):
        assert read(tmp_path, TWO, **options).fx_px == 226.0


def test_a_camera_is_named(tmp_path):
    (tmp_path / "two.yaml").write_text(TWO)
    assert Camera.load(f"{tmp_path}/two.yaml:cam1").fx_px == 328.0
    assert Camera.load(f"{tmp_path}/two.yaml:cam0").fx_px == 226.0
    with pytest.raises(InputError, match="no camera cam7 among cam0, cam1"):
        Camera.load(f"{tmp_path}/two.yaml:cam7")
    with pytest.raises(InputError, match="no such file"):
        Camera.load(f"{tmp_path}/three.yaml:cam1")


def test_a_camera_that_is_not_taken_may_have_any_lens(tmp_path):
    text = MIXED.replace("camera_model: pinhole", "camera_model: omni", 1)
    assert read(tmp_path, text, size_px=(346, 260)).fx_px == 328.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert "'omni' is none of pinhole" in refused(tmp_path, text)
