"""``lmmap live --view``: a page on this computer that shows the newest image with its estimate."""

from __future__ import annotations

import json
import secrets
import sys
import threading
import time
import warnings
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np

from lmmap.drawing.overlay import draw
from lmmap.types import Camera, Estimate, Port, Status

PAGE = b"""<!doctype html><html lang="en"><meta charset="utf-8"><title>lmmap live</title>
<link rel="icon" href="data:,">
<style>body{background:#111;color:#eee;font:1.1rem/1.6 system-ui;margin:1rem}img{max-width:100%}</style>
<img id="view" alt="newest image with the port's outline and axes"><pre id="state">waiting</pre>
<script>
const view = document.getElementById("view"), state = document.getElementById("state");
addEventListener("load", () => { view.src = "images"; });
const tell = () => fetch("state").then(r => r.text()).then(
  text => { state.textContent = text.replace(/, "/g, ',\\n "'); setTimeout(tell, 200); },
  () => { state.textContent += "\\nlmmap live has ended"; });
tell();
</script></html>"""
REPEAT_S = 0.3  # Chromium shows an image when the next one comes


class View:
    """Serves a stream of JPEGs and a line of JSON to this computer alone, under an address that cannot be
    guessed; use it in ``with``."""

    def __init__(self, camera: Camera, port: Port):
        self._camera, self._port, self._count, self._began_s = camera, port, 0, time.monotonic()
        self._jpeg, self._state, self._over = None, "{}", False
        self._new, path = threading.Condition(), f"/{secrets.token_urlsafe(16)}/"
        pages = {path: self._send_page, f"{path}state": self._send_state, f"{path}images": self._send_images}

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                send = pages.get(self.path)
                send(self) if send else self.send_error(404)

            def log_message(self, *_):
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self.address = f"http://127.0.0.1:{self._server.server_port}{path}"

    def show(self, image: np.ndarray, estimate: Estimate, facts: dict) -> None:
        """Show an image (H, W, 3) u8 or (H, W) with its estimate, and what else is known of it, to everyone
        who looks."""
        hint = advice(image) if image.ndim == 3 and estimate.status != Status.OK else ""
        if hint:
            warnings.warn(f"live: {hint}", stacklevel=2)
        self._count += 1
        rate = self._count / (time.monotonic() - self._began_s)
        picture = draw(image, estimate, self._camera, self._port)[..., ::-1]
        jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes()
        with self._new:
            self._jpeg = jpeg
            self._state = json.dumps(facts | {"images_per_s": round(rate, 1), "advice": hint})
            self._new.notify_all()

    def __enter__(self) -> View:
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        print(f"lmmap: look at {self.address}", file=sys.stderr, flush=True)
        return self

    def __exit__(self, *_) -> None:
        with self._new:
            self._over = True
            self._new.notify_all()
        self._server.shutdown()
        self._server.server_close()

    def _send_page(self, request) -> None:
        _send(request, "text/html", PAGE)

    def _send_state(self, request) -> None:
        _send(request, "application/json", self._state.encode())

    def _send_images(self, request) -> None:
        _head(request, "multipart/x-mixed-replace; boundary=image")
        parts, jpeg = [b"--image\r\n"], None
        while not self._over:
            try:
                request.wfile.write(b"".join(parts))
            except OSError:  # the page was closed
                return
            with self._new:
                if self._jpeg in (jpeg, None):
                    self._new.wait(REPEAT_S)
                jpeg = self._jpeg
            head = f"Content-Type: image/jpeg\r\nContent-Length: {len(jpeg or b'')}\r\n\r\n"
            parts = [head.encode(), jpeg, b"\r\n--image\r\n"] if jpeg else []


def _send(request, kind: str, content: bytes) -> None:
    _head(request, kind)
    request.wfile.write(content)


def _head(request, kind: str) -> None:
    request.send_response(200)
    request.send_header("Content-Type", kind)
    request.send_header("Cache-Control", "no-store")
    request.end_headers()


def advice(frame: np.ndarray) -> str:
    """What to change about a frame (H, W, 3) u8 that is too bright, too dark or blurred; empty if nothing.

    Across an edge of contrast c that is blurred with a standard deviation of s px, a pixel differs from the
    next by at most 0.4 c / s; frames are called blurred where their strongest edges, in either direction,
    stay below a twelfth, for s = 5 px.
    """
    grey = frame[..., 1]
    low, high = np.percentile(grey[::4, ::4], [0.5, 99.5])
    if np.mean(grey[::4, ::4] > 250) > 0.2:
        return "a fifth of the image is white: lower the exposure, or turn away from the window"
    if high < 60:
        return "the image is dark: add light, or raise the exposure"
    pairs = ((grey[1:], grey[:-1]), (grey[:, 1:], grey[:, :-1]))
    steepest = min(np.percentile(cv2.absdiff(*pair)[::2, ::2], 99.9) for pair in pairs)
    if steepest < (high - low) / 12:
        return "the image is blurred: hold still, add light, or switch the autofocus off"
    return ""
