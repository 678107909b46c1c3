"""What ``lmmap info`` says of a recording, with a calibration and without."""

import json

import drawn
import dv_processing as dv
import numpy as np
import pytest
import test_prophesee as prophesee
from library_files import write_recording
from test_bad_input import write_camera

from lmmap.cli import main
from lmmap.types import Pose
from lmmap_readers.rig import Rig


@pytest.fixture
def info(capsys):
    """Run ``lmmap info`` and give back its facts."""

    def run(path, *extra):
        assert main.main(["info", str(path), *map(str, extra), "--json"]) == 0, capsys.readouterr().err
        return json.loads(capsys.readouterr().out)

    return run


def table(path, columns="t_us,x@320,y@240,p", last=(319, 239)):
    path.write_text(f"{columns}\n1000,4,5,1\n2000,{last[0]},{last[1]},0\n")
    return path


def test_it_needs_no_calibration(info, tmp_path, capsys):
    path = table(tmp_path / "e.csv")
    facts = info(path)
    assert "DVXplorer Lite" in facts["sensor"] and "table" in facts["format"] and facts["focal_px"] is None
    assert (facts["width_px"], facts["height_px"], facts["events"]) == (320, 240, 2)
    assert main.main(["info", str(path)]) == 0
    assert "focal px           no calibration; give one with --camera" in capsys.readouterr().out
    assert main.main(["estimate", str(path), "--modality", "event", "-o", str(tmp_path / "p.csv")]) == 1


def test_a_file_without_a_size_is_as_large_as_its_events_reach(info, tmp_path, capsys):
    facts = info(table(tmp_path / "e.csv", "t_us,x,y,p", (250, 99)))
    assert (facts["width_px"], facts["height_px"], facts["out_of_range"]) == (251, 100, 0)
    absurd = table(tmp_path / "f.csv", "t_us,x,y,p", (32_000, 31_000))
    assert main.main(["info", str(absurd)]) == 1
    err = capsys.readouterr().err
    assert "32001 x 31001 px; give its calibration" in err and len(err.splitlines()) == 1


@pytest.mark.parametrize(("focal_px", "in_range"), [(500, True), (225, False)])
def test_the_lens_is_in_range_or_not(info, tmp_path, focal_px, in_range):
    camera = write_camera(tmp_path, width_px=320, height_px=240, fx_px=focal_px, fy_px=focal_px)
    facts = info(table(tmp_path / "e.csv"), "--camera", camera)
    assert facts["lens_in_range"] is in_range and facts["focal_px"] == focal_px
    near_m, far_m = (min(focal_px, 324) * 0.08 / ring_px for ring_px in (80, 21))
    assert facts["port_known_at_m"] == pytest.approx([near_m, far_m], abs=1e-3)


@pytest.mark.parametrize("exposure_us", [20_000, 0])
def test_the_exposure_of_frames(info, tmp_path, exposure_us):
    config = dv.io.MonoCameraWriter.Config("gray")
    config.addFrameStream((320, 240))
    writer = dv.io.MonoCameraWriter(str(tmp_path / "g.aedat4"), config)
    image = np.zeros((240, 320), np.uint8)
    writer.writeFrame(dv.Frame(1000, exposure_us, 0, 0, image, dv.FrameSource.SENSOR))
    del writer
    facts = info(tmp_path / "g.aedat4")
    assert facts["exposure_ms"] == (20.0 if exposure_us else None) and facts["streams"] == ["FRME"]


def test_topics_encoding_and_what_would_be_estimated(info, tmp_path):
    r = drawn.recording(3)
    write_recording(r, tmp_path / "r.bag")
    facts = info(tmp_path / "r.bag")
    assert any("dvs_msgs/msg/EventArray" in topic for topic in facts["topics"]) and len(facts["topics"]) == 2
    assert facts["would_estimate"] == {"rgb": len(r.frames), "event": len(r.events) // 35_000}
    assert facts["networks"] == "robust"
    (tmp_path / "e.raw").write_bytes(prophesee.evt21(r.events))
    facts = info(tmp_path / "e.raw")
    assert facts["encoding"] == "EVT2.1" and "EVK4" in facts["sensor"]


def test_the_truth_is_where_evaluate_finds_it(info, tmp_path):
    path = tmp_path / "r.bag"
    write_recording(drawn.recording(3), path)
    assert info(path)["truth"]
    path.with_suffix(".truth.csv").unlink()
    assert not info(path)["truth"]
    still = Pose(np.eye(3), [0, 0, 0.5])
    Rig("base", "tool0", still, still, 0.08).save(tmp_path / "rig.json")
    assert info(path)["truth"]
