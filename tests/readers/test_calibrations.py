"""Calibrations of other programs: the right camera, or a line that says what is not understood."""

import json
import re
import warnings

import dv_processing as dv
import numpy as np
import pytest

from lmmap.types import Camera, InputError
from lmmap_readers.calibrations import COLMAP
from lmmap_readers.camera_fields import LENSES

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
    for name in ("cam7", "two\nlines"):
        with pytest.raises(InputError, match=re.escape(f"no camera {name!r} among cam0, cam1")):
            Camera.load(f"{tmp_path}/two.yaml:{name}")
    with pytest.raises(InputError, match="no such file"):
        Camera.load(f"{tmp_path}/three.yaml:cam1")
    with pytest.raises(InputError, match="expected FILE:NAME, got no name"):
        Camera.load(f"{tmp_path}/two.yaml:")


def test_a_camera_that_is_not_taken_may_have_any_lens(tmp_path):
    text = MIXED.replace("camera_model: pinhole", "camera_model: omni", 1)
    assert read(tmp_path, text, size_px=(346, 260)).fx_px == 328.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert "'omni' is none of pinhole" in refused(tmp_path, text)


# --- what is not dropped ---------------------------------------------------------------------------


@pytest.mark.parametrize("lens, model", [("", "radtan"), ("<fisheye_model>1</fisheye_model>", "equidistant")])
def test_opencv_s_xml_is_its_yaml(tmp_path, lens, model):
    matrix = "<rows>{}</rows><cols>{}</cols><dt>d</dt><data>{}</data>"
    text = f"""<?xml version="1.0"?>
<opencv_storage><calibration_time>"Fri Nov 27"</calibration_time><image_width>346</image_width>
<image_height>260</image_height><!-- flags -->{lens}
<camera_matrix type_id="opencv-matrix">{matrix.format(3, 3, K.strip("[]").replace(",", " "))}</camera_matrix>
<distortion_coefficients type_id="opencv-matrix">{matrix.format(4, 1, " ".join(map(str, FOUR)))}
</distortion_coefficients></opencv_storage>"""
    assert read(tmp_path, text, "camera.xml") == Camera(*PINHOLE, FOUR, model)
    assert "not XML" in refused(tmp_path, text[:-20], "camera.xml")


@pytest.mark.parametrize(
    "line, said",
    [
        ("D: [null, 0, 0, 0, 0]", "distortion: expected a number, got None"),
        ("D: [0, 0, 0, 0, 0, null]", "6 distortion coefficients"),
        ("D: [false, 0, 0, 0, 0]", "distortion: expected a number, got False"),
        ("D:", "d: expected a list of numbers, got None"),
        ("D: {rows: 1, cols: 5, data: [0.1, 0.2, 0, 0]}", "expected 5 numbers, got 4"),
        ("D: [0.1, 0, 0, 0]\ndistortion_coefficients: [0.2, 0, 0, 0]", "differ"),
        ("D: []\ncrop: [10, 10]", "unknown crop"),
        ("D: []\nroi: {x_offset: half}", "roi and binning: expected whole numbers"),
    ],
)
def test_what_is_stated_is_not_dropped(tmp_path, line, said):
    text = f"width: 346\nheight: 260\ndistortion_model: plumb_bob\nK: {K}\n{line}\n"
    assert said in refused(tmp_path, text)


@pytest.mark.parametrize("line", ["D: []", "D: [0, 0, 0, 0, 0]", "D: {rows: 0, cols: 0, data: }", "D: ''"])
def test_no_distortion_is_none(tmp_path, line):
    text = f"width: 346\nheight: 260\ndistortion_model: plumb_bob\nK: {K}\n{line}\n"
    assert read(tmp_path, text) == Camera(*PINHOLE)


def test_a_value_that_is_stated_twice(tmp_path):
    Camera(*PINHOLE).save(tmp_path / "c.json")
    text = (tmp_path / "c.json").read_text().replace("{", '{"fx_px": 400.0,', 1)
    assert "fx_px is stated twice" in refused(tmp_path, text, "c.json")
    kalibr = "cam0: {intrinsics: [226, 227, 173, 133], resolution: [346, 260]}\n"
    for name, text, said in (
        ("c.yaml", opencv("image_width: 640"), "image_width"),
        ("c.yaml", opencv("imageWidth: 640"), "imagewidth"),
        ("c.yaml", opencv("D: {rows: 1, cols: 0, rows: 2}"), "rows"),
        ("k.yaml", 2 * kalibr, "cam0"),
        ("cameras.txt", 2 * FILES["cameras.txt"], "7"),
    ):
        assert f"({said} is stated twice)" in refused(tmp_path, text, name)


def test_a_camera_info_as_a_file_may_be_of_a_region(tmp_path):
    """As `rostopic echo` prints it; (346.5 + 0.5) / 2 - 0.5 is 173."""
    k = K.replace("173.25", "346.5").replace("133.75", "259.5")
    text = (
        f"width: 692\nheight: 520\nbinning_x: 2\nbinning_y: 2\ndistortion_model: plumb_bob\nD: []\nK: {k}\n"
    )
    with pytest.warns(
        UserWarning, match=r"of its region of interest at \(0, 0\), 346 x 260 px, 2 x 2 pixels"
    ):
        camera = read(tmp_path, text)
    assert camera == Camera(346, 260, 113.25, 113.75, 173.0, 129.5)


@pytest.mark.parametrize("name", ["c.json", "c.yaml", "c.yml", "camera"])
def test_what_we_write_we_read_under_any_name(tmp_path, name):
    camera = Camera(*PINHOLE, (1e-05, 0.0, 0.0, -0.1), "equidistant")
    camera.save(tmp_path / name)
    assert Camera.load(tmp_path / name) == camera


def test_what_we_would_not_read_we_do_not_write(tmp_path):
    with pytest.raises(InputError, match=r"c\.json: not written, .*\(distortion: expected a number"):
        Camera(*PINHOLE, (0.1, -7645.0, 0.0, 0.0)).save(tmp_path / "c.json")
    assert not (tmp_path / "c.json").exists()
