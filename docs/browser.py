"""A headless Chromium that is told what to do over a pipe: opens a page, runs script in it, takes pictures."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from base64 import b64decode
from pathlib import Path
from types import TracebackType
from typing import Any, Self

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = ("--headless", "--no-sandbox", "--hide-scrollbars", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
# gives the two pipes the numbers that the browser looks at, and becomes the browser
LAUNCH = """import fcntl, os, sys
pipes = [fcntl.fcntl(int(pipe), fcntl.F_DUPFD_CLOEXEC, 10) for pipe in sys.argv[1:3]]
for number, pipe in zip((3, 4), pipes):
    os.dup2(pipe, number)
os.execv(sys.argv[3], sys.argv[3:])"""
ERRORS = ("Runtime.exceptionThrown", "Log.entryAdded")


class Browser:
    """One page of a browser, driven by the DevTools protocol: `with Browser() as page: page.open(path)`.

    Messages are JSON that ends in a zero byte; the browser reads them from its file descriptor 3 and writes to 4.
    """

    def __init__(self, *flags: str) -> None:
        if CHROMIUM is None:
            raise RuntimeError("no Chromium on this machine; install one, as `apt install chromium` does")
        self.errors: list[str] = []  # what the console of the page said of errors
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        asked = [CHROMIUM, *FLAGS, *flags, f"--user-data-dir={self._profile.name}", "--remote-debugging-pipe"]
        read, self._to = os.pipe()
        self._from, write = os.pipe()
        launch = [sys.executable, "-c", LAUNCH, str(read), str(write), *asked, "about:blank"]
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(launch, pass_fds=(read, write), stdout=quiet, stderr=quiet)
        os.close(read)
        os.close(write)
        self._buffer, self._sent, self._session = b"", 0, ""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Page"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.call("Browser.close")
        self._process.wait(timeout=20)
        os.close(self._to)
        os.close(self._from)
        self._profile.cleanup()

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Ask for something and return the answer. Raises RuntimeError for one that the browser refuses."""
        self._sent += 1
        message: dict[str, Any] = {"id": self._sent, "method": method, "params": params}
        if self._session and not method.startswith(("Browser.", "Target.")):
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while (answer := self._receive()).get("id") != self._sent:
            self._note(answer)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return dict(answer["result"])

    def _receive(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            more = os.read(self._from, 1 << 20)
            if not more:
                raise RuntimeError("the browser has ended")
            self._buffer += more
        message, self._buffer = self._buffer.split(b"\0", 1)
        return dict(json.loads(message))

    def _note(self, event: dict[str, Any]) -> None:
        params = event.get("params", {})
        called = event.get("method") == "Runtime.consoleAPICalled" and params.get("type") == "error"
        logged = event.get("method") == "Log.entryAdded" and params["entry"]["level"] != "error"
        if called or (event.get("method") in ERRORS and not logged):
            self.errors.append(json.dumps(params))

    def run(self, script: str) -> Any:
        """Return the value of an expression in the page, of a promise what it gives."""
        found = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise RuntimeError(json.dumps(found["exceptionDetails"]))
        return found["result"].get("value")

    def open(self, path: Path, until: str = "document.readyState === 'complete'", seconds: float = 60.0) -> None:
        """Open a file and wait until an expression is true in it. Raises TimeoutError when it does not become so."""
        self.call("Page.navigate", url=path.resolve().as_uri())
        self.wait(until, seconds)

    def wait(self, until: str, seconds: float = 20.0) -> None:
        """Wait until an expression is true in the page. Raises TimeoutError when it does not become so."""
        end = time.monotonic() + seconds
        while not self.run(f"Boolean({until})"):
            if time.monotonic() > end:
                raise TimeoutError(f"not within {seconds:g} s: {until}")
            time.sleep(0.05)

    def look(self, width: int, height: int, *, dark: bool = False, scale: float = 1.0) -> None:
        """Set the size of the window in CSS pixels, the scheme of colours and the pixels to each of those."""
        size = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def picture(self, clip: tuple[float, float, float, float] | None = None, quality: int | None = None) -> bytes:
        """Return the window, or x, y, width and height of the page, as PNG; with a quality as JPEG."""
        asked: dict[str, Any] = {"format": "png"} if quality is None else {"format": "jpeg", "quality": quality}
        if clip is not None:
            area = dict(zip(("x", "y", "width", "height"), clip, strict=True))
            asked |= {"clip": {**area, "scale": 1}, "captureBeyondViewport": True}
        return b64decode(self.call("Page.captureScreenshot", **asked)["data"])
