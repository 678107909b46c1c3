"""A video in segments: joined, interrupted and resumed it is the unbroken one."""

import cv2
import numpy as np
import pytest

from lmmap.drawing import video
from lmmap.types import InputError

MADE_OF = {"recording": "r", "camera": {"fx": 1.0}}
PICTURES = [np.full((48, 64, 3), 12 * k, np.uint8) for k in range(13)]


@pytest.fixture(autouse=True)
def short_segments(monkeypatch):
    monkeypatch.setattr(video, "SEGMENT", 4)


def frames(path):
    film = cv2.VideoCapture(str(path))
    return [frame for _ in range(20) if (frame := film.read()[1]) is not None]


def write(path, pictures, **options):
    with video.Video(path, **options) as film:
        for picture in pictures[film.kept :]:
            film.add(picture, 12.5)


@pytest.mark.parametrize("suffix", [".mp4", ".avi"])
def test_segments_join_into_every_picture_once(tmp_path, suffix):
    path = tmp_path / f"o{suffix}"
    write(path, PICTURES, made_of=MADE_OF)
    levels = [frame.mean() for frame in frames(path)]
    np.testing.assert_allclose(levels, [picture.mean() for picture in PICTURES], atol=5)
    assert cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FPS) == 12.5
    assert list(tmp_path.iterdir()) == [path]


def test_a_joined_video_has_the_packets_of_its_segments(tmp_path):
    """In their order, and key frames where theirs are: else a browser stops at the first jump."""
    segments = [tmp_path / f"{k:06}-{13:06}.mp4" for k in range(2)]
    for segment in segments:
        with video.Video(segment) as film:
            for picture in PICTURES:
                film.add(picture, 12.5)
    video.join(segments, tmp_path / "o.mp4")
    ours = list(video.packets(tmp_path / "o.mp4"))
    theirs = [packet for segment in segments for packet in video.packets(segment)]
    assert [is_key for _, is_key in ours] == [is_key for _, is_key in theirs]
    assert [packet.tobytes() for packet, _ in ours] == [packet.tobytes() for packet, _ in theirs]
    assert 2 <= sum(is_key for _, is_key in ours) < len(ours)


@pytest.mark.parametrize("cut", [0, 4, 6])
def test_an_interrupted_video_goes_on(tmp_path, cut):
    """After Ctrl-C no picture is drawn twice, and the end is the same, picture by picture."""
    whole, path = tmp_path / "w.mp4", tmp_path / "o.mp4"
    write(whole, PICTURES[:cut], made_of=MADE_OF)
    with pytest.raises(KeyboardInterrupt), video.Video(path, MADE_OF) as film:
        for picture in PICTURES[:cut]:
            film.add(picture, 12.5)
        raise KeyboardInterrupt
    assert not path.exists() and film.folder.is_dir()
    with video.Video(path, MADE_OF, resume=True) as film:
        assert film.kept == cut
        for picture in PICTURES[cut:]:
            film.add(picture, 12.5)
    assert not film.folder.exists()
    levels = [frame.mean() for frame in frames(path)]
    np.testing.assert_allclose(levels, [picture.mean() for picture in PICTURES], atol=5)
    for ours, theirs in zip(frames(path), frames(whole) if cut else [], strict=False):
        np.testing.assert_array_equal(ours, theirs)


def test_a_killed_video_loses_less_than_a_segment(tmp_path):
    """What was begun and is not whole is drawn again."""
    film = video.Video(tmp_path / "o.mp4", MADE_OF).__enter__()
    for picture in PICTURES[:6]:
        film.add(picture, 12.5)
    film._writer.release()  # as the system leaves it
    film._held.close()
    write(tmp_path / "o.mp4", PICTURES, made_of=MADE_OF, resume=True)
    assert len(frames(tmp_path / "o.mp4")) == len(PICTURES)


def test_only_segments_of_the_same_pictures_are_resumed(tmp_path):
    path = tmp_path / "o.mp4"
    with pytest.raises(KeyboardInterrupt), video.Video(path, MADE_OF) as film:
        film.add(PICTURES[0], 12.5)
        raise KeyboardInterrupt
    with pytest.raises(InputError, match=r"o\.mp4\.parts: was made with another camera"):
        write(path, PICTURES, made_of=MADE_OF | {"camera": {"fx": 2.0}}, resume=True)
    assert len(list(film.folder.glob("*.mp4"))) == 1
    with film, pytest.raises(InputError, match=r"o\.mp4: another process writes it"):
        write(path, PICTURES, made_of=MADE_OF, resume=True)


def test_a_folder_that_is_not_ours_is_not_touched(tmp_path):
    folder = tmp_path / "o.mp4.parts"
    folder.mkdir()
    (folder / "000000-000003.mp4").write_text("mine")
    for resume in (False, True):
        with pytest.raises(InputError, match=r"o\.mp4\.parts"):
            write(tmp_path / "o.mp4", PICTURES, made_of=MADE_OF, resume=resume)
    assert (folder / "000000-000003.mp4").read_text() == "mine"
