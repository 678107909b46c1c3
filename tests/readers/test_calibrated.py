"""Calibrations inside recordings, and recordings of several cameras."""

import re
import warnings

import dv_processing as dv
import h5py
import library_files
import numpy as np
import pytest
import test_rosbag2 as ros2
from rosbags.rosbag1 import Writer

from lmmap.recordings.formats import open_recording, open_stream
from lmmap.types import EVENT, Camera, InputError, Recording

CAMERA = Camera(346, 260, 226.5, 226.25, 173.5, 133.75, (-0.05, 0.01, 0.001, 0.002, 0.0))
FISHEYE = Camera(346, 260, 201.5, 202.25, 170.5, 130.75, (0.05, 0.01, 0.001, 0.002), "equidistant")
T0 = 1_600_000_000_000_000


def info(store, camera, capital, **changes):
    """A message of sensor_msgs/CameraInfo, as the library makes it; of a size, a model or without numbers."""
    name = {"radtan": "plumb_bob"}.get(camera.distortion_model, camera.distortion_model)
    numbers = {"d": np.array(camera.distortion), "k": camera.K.ravel(), "r": np.eye(3).ravel(),
               "p": np.array([300.0, 0, 173, 0, 0, 301, 130, 0, 0, 0, 1, 0])}  # fmt: skip
    numbers = {(n.upper() if capital else n): v for n, v in numbers.items()}
    changes = {(n.upper() if capital and len(n) == 1 else n): v for n, v in changes.items()}
    roi = store.types["sensor_msgs/msg/RegionOfInterest"](*changes.pop("roi", (0, 0, 0, 0)), False)
    return {"height": camera.height_px, "width": camera.width_px, "distortion_model": name, "binning_x": 0,
            "binning_y": 0, "roi": roi} | numbers | changes  # fmt: skip


def bag1(path, infos, image="/dvs/image_raw"):
    store, kind = library_files.STORE, "sensor_msgs/msg/CameraInfo"
    header = store.types["std_msgs/msg/Header"](seq=0, stamp=library_files._time(T0), frame_id="")
    frame = dict(encoding="mono8", is_bigendian=0, step=346, data=np.full(260 * 346, 9, np.uint8))
    with Writer(path) as bag:
        for topic, kind, fields in (
            *(
                (topic, "sensor_msgs/msg/CameraInfo", info(store, c, True, **more))
                for topic, c, more in infos
            ),
            (image, "sensor_msgs/msg/Image", dict(height=260, width=346) | frame),
        ):
            same = (c for c in bag.connections if c.topic == topic)
            connection = next(same, None) or bag.add_connection(topic, kind, typestore=store)
            message = store.types[kind](header=header, **fields)
            bag.write(connection, T0 * 1000, store.serialize_ros1(message, kind))
    return path


def bag2(path, infos, image="/dvs/image_raw"):
    kind = ros2.KINDS["sensor_msgs/msg/CameraInfo"]
    messages = [(topic, kind(header=ros2.header(T0), **info(ros2.STORE, c, False, **more)), T0)
                for topic, c, more in infos]  # fmt: skip
    return ros2.bag(path, [*messages, (image, ros2.image(np.full((260, 346, 3), 9, np.uint8), T0), T0)])


@pytest.fixture(params=["ros1", "ros2"])
def bag(request, tmp_path):
    return lambda *infos, **more: (bag1 if request.param == "ros1" else bag2)(
        tmp_path / ("r.bag" if request.param == "ros1" else "r"), infos, **more
    )


@pytest.mark.parametrize("camera", [CAMERA, FISHEYE])
def test_camera_info_is_used_and_said(bag, camera):
    path = bag(("/dvs/camera_info", camera, {}))
    with pytest.warns(UserWarning, match=r"taking its own calibration /dvs/camera_info$"):
        assert open_recording(path).camera == camera


def test_a_camera_that_is_given_wins(bag):
    path = bag(("/dvs/camera_info", CAMERA, {}))
    assert open_recording(path, FISHEYE).camera == FISHEYE


def test_topic_and_size_choose_among_camera_infos(bag):
    other = Camera(640, 480, 500.0, 500.0, 320.0, 240.0)
    path = bag(
        ("/a/camera_info", other, {}), ("/b/camera_info", FISHEYE, {}), ("/dvs/camera_info", CAMERA, {})
    )
    with pytest.warns(UserWarning, match=r"taking its own calibration /dvs/camera_info$"):
        assert open_recording(path).camera == CAMERA


def test_where_they_leave_a_choice_it_is_said(bag):
    path = bag(("/b/camera_info", FISHEYE, {}), ("/c/camera_info", CAMERA, {}))
    with pytest.warns(UserWarning, match=r"own calibration /b/camera_info, not /c/camera_info$"):
        assert open_recording(path).camera == FISHEYE


def test_rectified_images_have_the_projection_s_lens(bag):
    path = bag(("/dvs/camera_info", CAMERA, {}), image="/dvs/image_rect_color")
    with pytest.warns(UserWarning, match="own calibration"):
        camera = open_recording(path).camera
    assert camera == Camera(346, 260, 300.0, 301.0, 173.0, 130.0)


@pytest.mark.parametrize("change", [{"roi": (0, 0, 130, 346)}, {"k": 2 * CAMERA.K.ravel()}])
def test_a_camera_info_that_changes_is_not_used(bag, change):
    """Neither its first value nor its last is taken without a word."""
    messages = [("/dvs/camera_info", CAMERA, {}), ("/dvs/camera_info", CAMERA, change)]
    with pytest.warns(UserWarning, match=r"/dvs/camera_info is not used \(it changes 0\.000 s after .*: cut"):
        assert open_recording(bag(*messages)).camera == Camera.davis346()


def test_a_camera_info_that_repeats_itself_is_used_beside_one_that_changes(bag):
    other = [("/b/camera_info", CAMERA, {"k": k * CAMERA.K.ravel()}) for k in (1, 2)]
    with pytest.warns(UserWarning, match=r"taking its own calibration /dvs/camera_info$"):
        assert open_recording(bag(*other, *2 * [("/dvs/camera_info", FISHEYE, {})])).camera == FISHEYE


@pytest.mark.parametrize("of", ["no numbers", "another size", "a lens that is unknown"])
def test_a_camera_info_that_cannot_be_used(bag, of):
    wrong = {"no numbers": (CAMERA, {"k": np.zeros(9)}),
             "another size": (Camera(64, 48, 60.0, 60.0, 31.5, 23.5), {}),
             "a lens that is unknown": (CAMERA, {"distortion_model": "magic"})}  # fmt: skip
    camera, more = wrong[of]
    path = bag(("/dvs/camera_info", camera, more))
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        assert open_recording(path).camera == Camera.davis346()
    said = [str(n.message) for n in notes]
    reason = {"no numbers": "was not calibrated", "another size": "it is for 64 x 48 px, not 346 x 260",
              "a lens that is unknown": "'magic' is none of"}[of]  # fmt: skip
    assert len(said) == 1 and said[0].endswith("taking the nominal DAVIS 346")
    assert "its own calibration /dvs/camera_info is not used" in said[0] and reason in said[0]


WHOLE = Camera(692, 520, 648.0, 646.0, 345.0, 260.0, CAMERA.distortion)  # and images of 346 x 260 px of it


@pytest.mark.parametrize(
    "more, f, centre, said",
    [
        ({"roi": (100, 50, 260, 346)}, 1, (245.0, 210.0), r"at \(100, 50\), 346 x 260 px"),
        ({"roi": (100, 50, 260, 346), "width": 346, "height": 260}, 1, (245.0, 210.0), r"at \(100, 50\)"),
        ({"binning_x": 2, "binning_y": 2}, 2, (172.25, 129.75), "2 x 2 pixels binned to one$"),
        ({"binning_x": 2, "binning_y": 2, "roi": (0, 0, 520, 692)}, 2, (172.25, 129.75), "2 x 2 pixels"),
    ],
)
def test_images_of_a_region_of_the_sensor(bag, more, f, centre, said):
    """The numbers are the whole sensor's; a pixel of n has its centre between them."""
    with pytest.warns(
        UserWarning, match=f"own calibration /dvs/camera_info, of its region of interest .*{said}"
    ):
        camera = open_recording(bag(("/dvs/camera_info", WHOLE, more))).camera
    assert camera == Camera(346, 260, 648.0 / f, 646.0 / f, *centre, CAMERA.distortion)


def test_a_region_that_the_images_do_not_know_moves_nothing(bag):
    path = bag(("/dvs/camera_info", CAMERA, {"roi": (10, 10, 100, 200), "binning_x": 2}))
    with pytest.warns(UserWarning, match=r"own calibration /dvs/camera_info$"):
        assert open_recording(path).camera == CAMERA


def test_the_projection_is_of_the_whole_sensor_too(bag):
    path = bag(("/dvs/camera_info", WHOLE, {"roi": (30, 20, 260, 346)}), image="/dvs/rect/image")
    with pytest.warns(UserWarning, match="region of interest at"):
        assert open_recording(path).camera == Camera(346, 260, 300.0, 301.0, 143.0, 110.0)


# --- HDF5 -----------------------------------------------------------------------------------------


def m3ed(path, camera, group="prophesee/left", **changes):
    t = np.arange(500, dtype=np.int64) * 37
    with h5py.File(path, "w") as file:
        for name, values in zip("txyp", (t, t % 346, t % 260, t % 2), strict=True):
            file[f"{group}/{name}"] = values
        calib = {"resolution": list(camera.size_px), "camera_model": "pinhole",
                 "intrinsics": [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px],
                 "distortion_model": camera.distortion_model, "distortion_coeffs": camera.distortion[:4],
                 "T_to_prophesee_left": np.eye(4)}  # fmt: skip
        for name, value in (calib | changes).items():
            file[f"{group}/calib/{name}"] = value
    return path


@pytest.mark.parametrize("group", ["prophesee/left", "events"])
def test_the_calibration_of_an_hdf5_group(tmp_path, group):
    radtan = Camera(346, 260, 226.5, 226.25, 173.5, 133.75, CAMERA.distortion[:4])
    for camera in (radtan, FISHEYE):
        with pytest.warns(UserWarning, match=f"taking its own calibration {group}/calib$"):
            recording = open_recording(m3ed(tmp_path / "e.h5", camera, group))
        assert recording.camera == camera and len(recording.events) == 500


@pytest.mark.parametrize("places", ["prophesee", "davis"])
def test_of_two_cameras_the_other_one_is_named_and_can_be_chosen(tmp_path, places):
    left, right = f"{places}/left", f"{places}/right"
    with h5py.File(tmp_path / "e.h5", "w") as file:
        for k, group in enumerate((left, right)):
            t = np.arange(20) + k
            if places == "davis":
                file[f"{group}/events"] = np.column_stack([t % 346, t % 260, t * 1e-6, np.ones(20)])
            else:
                for name, values in zip("txyp", (t, t % 346, t % 260, t % 2), strict=True):
                    file[f"{group}/{name}"] = values
    with pytest.warns(UserWarning, match=f"taking {left}, not {right}; choose with --stream"):
        assert open_recording(tmp_path / "e.h5", CAMERA).events["t_us"][0] == 0
    assert open_recording(tmp_path / "e.h5", CAMERA, stream=left).events["t_us"][0] == 0
    assert open_recording(tmp_path / "e.h5", CAMERA, stream=right).events["t_us"][0] == 1
    for name in ("middle", "two\nlines"):
        said = f"no camera {name!r} in it (--stream); it has {left}, {right}"
        with pytest.raises(InputError, match=re.escape(said)):
            open_recording(tmp_path / "e.h5", CAMERA, stream=name)


def test_an_hdf5_calibration_that_is_not_understood(tmp_path):
    path = m3ed(tmp_path / "e.h5", Camera(640, 480, 500.0, 500.0, 320.0, 240.0), distortion_model="fov")
    text = "its own calibration prophesee/left/calib is not used .*'fov' is none of.*; give one with --camera"
    with pytest.raises(InputError, match=text):
        open_recording(path)
    path = m3ed(tmp_path / "e.h5", Camera(640, 480, 500.0, 500.0, 320.0, 240.0), distortion_model=3.0)
    with pytest.raises(InputError, match="'unreadable' is none of"):
        open_recording(path)
    assert open_stream(m3ed(tmp_path / "e.h5", CAMERA, intrinsics=3.0), CAMERA).camera == CAMERA


# --- AEDAT4 of two cameras ------------------------------------------------------------------------


@pytest.fixture
def stereo(tmp_path):
    left, right = (dv.io.MonoCameraWriter.Config(name) for name in ("DAVIS_1", "DAVIS_2"))
    for config in (left, right):
        config.addEventStream((346, 260))
    writer = dv.io.StereoCameraWriter(str(tmp_path / "s.aedat4"), left, right)
    for k, write in enumerate((writer.left.writeEvents, writer.right.writeEvents)):
        store = dv.EventStore()
        for t_us in range(1000 + k, 1020 + k, 2):
            store.push_back(t_us, 5, 6, True)
        write(store)
    del writer
    return tmp_path / "s.aedat4"


def test_the_second_camera_is_named_and_can_be_chosen(stereo):
    with pytest.warns(UserWarning, match=r"taking the streams 0 \(DAVIS_1\), not 1 \(DAVIS_2\).*--stream"):
        assert open_recording(stereo, CAMERA).events["t_us"][0] == 1000
    assert open_recording(stereo, CAMERA, stream=0).events["t_us"][0] == 1000
    assert open_recording(stereo, CAMERA, stream=1).events["t_us"][0] == 1001
    with pytest.raises(InputError, match="no events or frames in stream 5, but in 0, 1"):
        open_recording(stereo, CAMERA, stream="5")
    assert open_recording(stereo, CAMERA, stream="1").events["t_us"][0] == 1001


def test_a_calibration_of_both_is_chosen_by_the_camera_s_name(stereo, tmp_path):
    one, calibration = (
        dv.kinematics.Transformationf(0, np.eye(4, dtype=np.float32)),
        dv.camera.CalibrationSet(),
    )
    for k, name in enumerate(("DAVIS_1", "DAVIS_2")):
        calibration.addCameraCalibration(dv.camera.calibrations.CameraCalibration(
            name, "left", not k, (346, 260), (173.25, 133.75), (226.5 + k, 227.5), [],
            dv.camera.DistortionModel.NONE, one, None))  # fmt: skip
    calibration.writeToFile(str(tmp_path / "c.json"))
    assert open_recording(stereo, tmp_path / "c.json", stream=0).camera.fx_px == 226.5
    assert open_recording(stereo, tmp_path / "c.json", stream=1).camera.fx_px == 227.5


def test_events_and_frames_of_one_camera_are_no_two(tmp_path):
    e = np.zeros(10, EVENT)
    e["t_us"] = np.arange(10)
    frames = np.zeros((2, 260, 346, 3), np.uint8)
    library_files.aedat4(Recording("r", CAMERA, e, frames, np.array([0, 5])), tmp_path / "r.aedat4")
    back = open_recording(tmp_path / "r.aedat4", CAMERA)
    assert (len(back.events), len(back.frames)) == (10, 2)


@pytest.mark.parametrize("version", ["1.0", "2.0", "3.1"])
@pytest.mark.parametrize("name", ["old.aedat", "old.aedat4"])
def test_older_aedat_is_named_with_what_converts_it(tmp_path, version, name):
    (tmp_path / name).write_bytes(f"#!AER-DAT{version}\r\n# more\r\n".encode() + bytes(100))
    with pytest.raises(InputError, match=rf"{name}: AEDAT {version}, and only AEDAT4 is read; .*converter"):
        open_recording(tmp_path / name, CAMERA)


@pytest.mark.parametrize("text", ["davis346:6", "davis346:6cm", "EVK4:8", "gen4:12.5um"])
def test_a_lens_without_mm(tmp_path, text):
    with pytest.raises(InputError, match=rf"{text}: a focal length without mm; give .*mm"):
        open_recording(library_file(tmp_path), text)


def test_a_size_that_differs_names_the_calibration(tmp_path):
    Camera(640, 480, 500.0, 500.0, 320.0, 240.0).save(tmp_path / "other.json")
    with pytest.raises(InputError, match=r"346 x 260 px, but \S*other\.json is for 640 x 480 px"):
        open_recording(library_file(tmp_path), tmp_path / "other.json")


def library_file(tmp_path):
    e = np.zeros(10, EVENT)
    e["t_us"] = np.arange(10)
    nothing = np.zeros((0, 260, 346, 3), np.uint8), np.zeros(0, np.int64)
    library_files.hdf5(Recording("r", CAMERA, e, *nothing), tmp_path / "r.h5")
    return tmp_path / "r.h5"
