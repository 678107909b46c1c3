"""``lmmap pictures`` draws what it finds, and says so."""

import numpy as np
from PIL import Image

from lmmap.cli.choices import SETS
from lmmap.cli.main import main
from lmmap.recordings.formats import open_recording
from lmmap.shipped import DATA


def test_a_folder_of_pictures_is_drawn_and_told(tmp_path, capsys):
    frame = open_recording(DATA / "mini" / "test-low.aedat4").frames[0]
    photos, drawn = tmp_path / "photos", tmp_path / "new" / "drawn"
    photos.mkdir()
    Image.fromarray(frame[70:190, 100:240]).save(photos / "port.png")
    command = ["pictures", str(photos), "-o", str(drawn), "--modality", "rgb"]
    in_the_way = [*command[:3], str(photos / "port.png"), *command[4:]]
    assert main(in_the_way) == 1 and "cannot write" in capsys.readouterr().err
    assert main(command) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[2] for line in lines[1:]] == list(SETS)
    picture = np.asarray(Image.open(drawn / "port-rgb.png"))
    assert picture.shape[1] > 2 * picture.shape[0] and picture.ndim == 3
    assert main(command) == 1 and "--overwrite" in capsys.readouterr().err
