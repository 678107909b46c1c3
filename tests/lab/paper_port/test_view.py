"""The page of ``lmmap live --view``, in Chromium; and what it advises."""

import contextlib
import http.client
import json
import urllib.parse

import browser
import cv2
import drawn
import numpy as np
import pytest
from strategies import CAMERA, PORT

from lmmap.geometry.conics import circle_ellipse
from lmmap.types import Estimate, Status
from lmmap_lab.paper_port.view import View, advice

T = drawn.START
ELLIPSE = circle_ellipse(T, PORT.ring_radius_m, CAMERA)
FOUND = Estimate(0, Status.OK, T, ellipse=ELLIPSE, confidence=0.97)


@pytest.fixture
def view():
    with View(CAMERA, PORT) as shown:
        yield shown


def ask(view, path, size=None):
    """Status and content, or its first bytes, of a path on the view's server."""
    connection = http.client.HTTPConnection("127.0.0.1", view._server.server_port, timeout=10)
    with contextlib.closing(connection):
        connection.request("GET", path)
        with connection.getresponse() as answer:
            return answer.status, answer.read(size)


def test_only_who_knows_the_address_sees_anything(view):
    assert view._server.server_address[0] == "127.0.0.1"
    path = urllib.parse.urlsplit(view.address).path
    assert len(path) > 20 and b"lmmap live" in ask(view, path)[1]
    for other in ("/", "/state", "/images", f"{path[:-2]}/", path[:-1], f"{path}../state"):
        assert ask(view, other)[0] == 404
    with View(CAMERA, PORT) as another:
        assert path not in another.address


def test_the_state_is_a_line_of_json_and_the_images_are_jpegs(view, rng):
    view.show(drawn.frame(T, rng), FOUND, {"status": "ok", "confidence": 0.97})
    path = urllib.parse.urlsplit(view.address).path
    state = ask(view, f"{path}state")[1]
    assert state.count(b"\n") == 0 and json.loads(state)["confidence"] == 0.97
    assert json.loads(state)["images_per_s"] > 0 and json.loads(state)["advice"] == ""
    head, jpeg = ask(view, f"{path}images", 20_000)[1].split(b"\r\n\r\n", 1)
    assert head.startswith(b"--image\r\n") and int(head.split(b"Content-Length: ")[1]) > 20_000
    jpeg += b"\xff\xd9"  # the rest is not waited for
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR_RGB)
    assert picture.shape[1] == 2 * CAMERA.width_px
    orange = np.abs(picture.astype(int) - (213, 94, 0)).sum(-1) < 100  # the outline
    assert orange.sum() > 100


@pytest.mark.skipif(browser.PROGRAM is None, reason="needs Chromium")
@pytest.mark.filterwarnings("ignore:live. ")
def test_in_chromium(rng, tmp_path):
    with browser.chromium(tmp_path / "profile") as page:
        with View(CAMERA, PORT) as view:
            page.open(view.address)
            view.show(drawn.frame(T, rng), FOUND, {"status": "ok", "position_m": [0.1, 0.2, 0.6]})
            assert page.wait_for("document.getElementById('view').naturalWidth") == 2 * CAMERA.width_px
            assert page.wait_for("document.getElementById('state').textContent.includes('\"ok\"')")
            view.show(np.zeros((260, 346, 3), np.uint8), Estimate(1, Status.NO_RING), {"status": "no_ring"})
            assert page.wait_for("document.getElementById('state').textContent.includes('add light')")
            assert all(address.startswith("http://127.0.0.1:") for address in page.requests())
            assert not page.complaints()
        assert page.wait_for("document.getElementById('state').textContent.includes('has ended')")


def test_advice(rng):
    sharp = drawn.frame(T, rng)
    assert advice(sharp) == ""
    assert "add light" in advice((0.2 * sharp).astype(np.uint8))
    assert "lower the exposure" in advice(np.clip(sharp.astype(int) * 40, 0, 255).astype(np.uint8))
    assert "blurred" in advice(cv2.GaussianBlur(sharp, (0, 0), 7))
    assert "blurred" in advice(cv2.blur(sharp, (25, 1)))
