"""A video holds every picture once, also one that was interrupted, which takes no older one's place."""

import cv2
import numpy as np
import pytest

from lmmap.drawing import video

PICTURES = [np.full((48, 64, 3), 12 * k, np.uint8) for k in range(13)]


def levels(path):
    film = cv2.VideoCapture(str(path))
    return [frame.mean() for _ in range(20) if (frame := film.read()[1]) is not None]


def write(path, pictures, stop=None):
    with video.Video(path) as film:
        for picture in pictures:
            film.add(picture, 12.5)
        if stop:
            raise stop


@pytest.mark.parametrize("suffix", [".mp4", ".avi"])
def test_a_video_has_every_picture_once_at_its_rate(tmp_path, suffix):
    path = tmp_path / f"o{suffix}"
    write(path, PICTURES)
    np.testing.assert_allclose(levels(path), [picture.mean() for picture in PICTURES], atol=5)
    assert cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FPS) == 12.5
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupted_video_ends_after_its_last_picture_or_leaves_the_older_one(tmp_path):
    path = tmp_path / "o.mp4"
    for count in (3, 6):
        with pytest.raises(KeyboardInterrupt):
            write(path, PICTURES[:count], KeyboardInterrupt)
        np.testing.assert_allclose(levels(path), [picture.mean() for picture in PICTURES[:3]], atol=5)
        assert list(tmp_path.iterdir()) == [path]


def test_a_video_that_lacks_pictures_is_an_error(tmp_path, monkeypatch):
    """As on a full disk, where OpenCV is silent."""
    with pytest.raises(Exception, match=r"o\.mp4: cannot write"), video.Video(tmp_path / "o.mp4") as film:
        film.add(PICTURES[0], 12.5)
        film._pictures += 1
    assert not (tmp_path / "o.mp4").exists()
