"""Chromium without a window, by its debugging protocol over a pipe: what a page does on a screen and on paper."""

from __future__ import annotations

import base64
import itertools
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
    "--disable-extensions", "--disable-background-networking", "--no-first-run", "--remote-debugging-pipe",
)  # fmt: skip
_AS_3_AND_4 = """
import fcntl, os, sys
reading, writing = (fcntl.fcntl(int(n), fcntl.F_DUPFD, 10) for n in sys.argv[1:3])
os.dup2(reading, 3)
os.dup2(writing, 4)
os.execv(sys.argv[3], sys.argv[3:])
"""  # the numbers of files that the protocol expects


class Browser:
    """One tab. `console` gathers what the page has complained about."""

    def __init__(self, writing: int, reading: int) -> None:
        self._out, self._in = os.fdopen(writing, "wb", buffering=0), os.fdopen(reading, "rb")
        self._numbers = itertools.count(1)
        self._session: str | None = None
        self._events: list[dict[str, Any]] = []
        self.console: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Accessibility"):
            self.call(f"{domain}.enable")

    def close(self) -> None:
        self._out.close()
        self._in.close()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._numbers)
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._out.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == number:
                assert "error" not in answer, (method, answer["error"])
                return dict(answer["result"])

    def _next(self) -> dict[str, Any]:
        data = bytearray()
        while (byte := self._in.read(1)) != b"\0":
            assert byte, "the browser has ended"
            data += byte
        message: dict[str, Any] = json.loads(data)
        method, reported = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.console.append(str(reported["exceptionDetails"]))
        elif method == "Log.entryAdded" and reported["entry"]["level"] in ("error", "warning"):
            self.console.append(reported["entry"]["text"])
        elif method == "Runtime.consoleAPICalled" and reported["type"] in ("error", "warning", "assert"):
            self.console.append(str(reported["args"]))
        elif method:
            self._events.append(message)
        return message

    def open(self, page: Path, *, width: int = 1200, height: int = 900, dark: bool = False) -> None:
        """Shows a file on a screen of this width, in points; one narrower than 600 is a phone."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", media="screen", features=[scheme])
        self._events.clear()
        self.call("Page.navigate", url=page.resolve().as_uri())
        while not any(event["method"] == "Page.loadEventFired" for event in self._events):
            self._next()

    def value(self, expression: str) -> Any:
        """What an expression of JavaScript gives in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def picture(self, path: Path, *, whole: bool = True) -> None:
        """A PNG file of the page."""
        answer = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(answer["data"]))

    def picture_of(self, element: str, path: Path) -> None:
        """A PNG file of the first element that a selector names, at one and a half times its size on the screen."""
        box = "(({left, top, width, height}) => [left + scrollX, top + scrollY, width, height])"
        x, y, width, height = self.value(f"{box}(document.querySelector('{element}').getBoundingClientRect())")
        clip = {"x": x, "y": y, "width": width, "height": height, "scale": 1.5}
        answer = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)
        path.write_bytes(base64.b64decode(answer["data"]))

    def printed(self) -> bytes:
        """The page as PDF, as its style sheet wants it printed."""
        answer = self.call("Page.printToPDF", preferCSSPageSize=True, printBackground=True)
        return base64.b64decode(answer["data"])


@contextmanager
def browser(folder: Path, *, trusting: bool = True) -> Iterator[Browser]:
    """A browser with its profile in `folder`, ended afterwards; `trusting`: a page of the disk may read other files."""
    assert CHROMIUM is not None, "chromium is not installed: tools/setup.sh test installs it"
    to_browser, writing = os.pipe()
    reading, from_browser = os.pipe()

    # 3 and 4 are the protocol's own numbers of files.
    process = subprocess.Popen(
        [sys.executable, "-c", _AS_3_AND_4, str(to_browser), str(from_browser), CHROMIUM, *_OPTIONS,
         *(["--allow-file-access-from-files"] if trusting else []), f"--user-data-dir={folder / 'profile'}"],
        pass_fds=(to_browser, from_browser), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env=os.environ | {"HOME": str(folder)},
    )  # fmt: skip
    os.close(to_browser)
    os.close(from_browser)
    try:
        tab = Browser(writing, reading)
        yield tab
        tab.close()
    finally:
        process.kill()
        process.wait()
