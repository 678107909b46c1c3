"""Debian's Chromium without a screen, spoken to in the DevTools protocol over one websocket."""

from __future__ import annotations

import itertools
import json
import shutil
import subprocess
from collections import defaultdict
from contextlib import contextmanager, suppress
from time import monotonic, sleep

import websocket

PROGRAM = shutil.which("chromium")
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-extensions",
         "--disable-dev-shm-usage", "--remote-debugging-port=0", "--remote-allow-origins=*")  # fmt: skip


LEFT = ("navigated", "context", "Promise was collected")  # parts of Chromium's words for a page that left


class PageLeft(RuntimeError):
    """The page went to another address before it answered."""


class Page:
    """A tab: what it has asked of the network, what it has complained of, and what it answers."""

    def __init__(self, connection):
        self._connection, self._number = connection, itertools.count(1)
        self._session, self._events = None, defaultdict(list)
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.send(f"{domain}.enable")

    def send(self, method: str, **parameters) -> dict:
        """Result of one command; events that come before it are kept."""
        message = {"id": next(self._number), "method": method, "params": parameters}
        self._connection.send(json.dumps(message | ({"sessionId": self._session} if self._session else {})))
        while (answer := self._receive()).get("id") != message["id"]:
            pass
        if "error" in answer:
            said = answer["error"]["message"]
            left = any(part in said for part in LEFT)
            raise (PageLeft if left else RuntimeError)(f"{method}: {said}")
        return answer["result"]

    def _receive(self) -> dict:
        answer = json.loads(self._connection.recv())
        if "method" in answer and answer.get("sessionId") == self._session:
            self._events[answer["method"]].append(answer["params"])
        return answer

    def open(self, address: str, seconds: float = 60) -> None:
        """Load a page, or that to which it leads at once, until its scripts and its mathematics are done."""
        self._events.clear()
        self.send("Page.navigate", url=address)
        until = monotonic() + seconds
        while not self._events["Page.loadEventFired"]:
            if monotonic() > until:
                raise TimeoutError(f"{address}: not loaded after {seconds:g} s")
            self._receive()
        ready = "window.MathJax?.startup?.promise?.then(() => document.fonts.ready)"
        self.wait_for(f"Promise.resolve({ready}).then(() => document.readyState == 'complete')", seconds)

    def ask(self, expression: str):
        """Value of a JavaScript expression, awaited if it is a promise."""
        answer = self.send("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"]["exception"]["description"])
        return answer["result"].get("value")

    def wait_for(self, expression: str, seconds: float = 20):
        """The expression's value once it is true, on this page or on that to which it leads."""
        until = monotonic() + seconds
        while True:
            with suppress(PageLeft):
                if value := self.ask(expression):
                    return value
            if monotonic() > until:
                raise TimeoutError(f"still not so after {seconds:g} s: {expression}")
            sleep(0.1)

    def show_as(self, width_px: int, height_px: int = 900, theme: str = "light") -> None:
        """A window of this size, on a system with this colour scheme."""
        self.send("Emulation.setDeviceMetricsOverride", width=width_px, height=height_px,
                  deviceScaleFactor=1, mobile=width_px < 600)  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": theme}
        self.send("Emulation.setEmulatedMedia", features=[scheme])

    def click(self, x: float, y: float) -> None:
        for kind in ("mousePressed", "mouseReleased"):
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def requests(self) -> set[str]:
        """Addresses asked for since `open`, less those that are data."""
        addresses = {event["request"]["url"] for event in self._events["Network.requestWillBeSent"]}
        return {address for address in addresses if not address.startswith(("data:", "blob:"))}

    def complaints(self) -> list[str]:
        """Errors of the console since `open`, and exceptions that nobody caught."""
        said = [event["entry"]["text"] for event in self._events["Log.entryAdded"]
                if event["entry"]["level"]  == "error"]  # fmt: skip
        said += [str([part.get("value", part.get("description")) for part in event["args"]])
                 for event in self._events["Runtime.consoleAPICalled"]
                 if event["type"] in ("error", "assert")]  # fmt: skip
        return said + [e["exceptionDetails"]["text"] for e in self._events["Runtime.exceptionThrown"]]


@contextmanager
def chromium(profile):
    """A `Page` of a browser with its own empty profile folder, which ends with the block."""
    with subprocess.Popen([PROGRAM, *FLAGS, f"--user-data-dir={profile}"], text=True,
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:  # fmt: skip
        try:
            said = []
            for line in process.stderr:
                said.append(line)
                if "DevTools listening on" in line:
                    break
            else:
                raise RuntimeError("chromium ended at once:\n" + "".join(said))
            connection = websocket.create_connection(line.split()[-1], timeout=60)
            page = Page(connection)
            yield page
            with suppress(Exception):
                connection.close()
        finally:
            process.terminate()
            process.stderr.close()
