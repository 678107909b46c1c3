"""Pictures come out of a PDF and of a folder as they went in."""

import numpy as np
import pytest
from PIL import Image

from lmmap.types import InputError
from lmmap_lab.studies.pdf import pictures


@pytest.fixture
def images():
    v, u = np.mgrid[:120, :150]
    image = np.uint8(np.stack([u, v, 250 - u], -1))
    return [image[:, :130], image]


def test_a_folders_pictures_come_in_the_order_of_their_names(images, tmp_path):
    for name, image in zip(("b.png", "a.png"), images, strict=True):
        Image.fromarray(image).save(tmp_path / name)
    (tmp_path / "notes.txt").write_text("not a picture")
    by_name = dict(pictures(tmp_path))
    assert list(by_name) == ["a", "b"]
    np.testing.assert_array_equal(by_name["b"], images[0])


def test_pictures_of_a_pdf_are_named_by_page(images, tmp_path):
    pages = [Image.fromarray(image) for image in images]
    pages[0].save(tmp_path / "two.pdf", save_all=True, append_images=pages[1:])
    by_name = dict(pictures(tmp_path / "two.pdf"))
    assert list(by_name) == ["page1-1", "page2-1"]
    for original, image in zip(images, by_name.values(), strict=True):
        assert image.shape == original.shape
        assert abs(image.astype(float) - original).mean() < 2  # pillow writes JPEG


@pytest.mark.parametrize(
    "name, content, problem",
    [
        ("a.pdf", b"not a PDF", "not a PDF"),
        ("a.pdf", b"%PDF-1.4\n1 0 obj\n<<", "not a PDF"),
        ("a.txt", b"", "neither a folder nor a .pdf"),
    ],
)
def test_what_holds_no_pictures_is_one_line(name, content, problem, tmp_path):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=problem) as error:
        list(pictures(path))
    assert "\n" not in str(error.value)


def test_small_pictures_are_no_pictures(tmp_path):
    Image.new("RGB", (20, 20)).save(tmp_path / "logo.pdf")
    with pytest.raises(InputError, match="no picture of 100 px"):
        list(pictures(tmp_path / "logo.pdf"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no picture"):
        list(pictures(tmp_path / "empty"))
