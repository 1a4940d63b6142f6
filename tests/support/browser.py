"""A headless browser that shows one page, driven by the Chrome DevTools protocol through pipes.

Chromium reads commands from its file descriptor 3 and answers on 4, as JSON that ends with a zero byte."""

import base64
import contextlib
import json
import os
import select
import shutil
import signal
import time
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")

OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-extensions", "--hide-scrollbars", "--remote-debugging-pipe",
)  # fmt: skip

LONGEST_WAIT = 60.0
"""Seconds after which an answer is given up."""


def browser_path() -> str | None:
    """The path of an installed browser: that in the variable CHROME, or one of NAMES; None without
    one."""
    return os.environ.get("CHROME") or next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """A page in a browser. requests, complaints: what it asked the network for, and its console's errors,
    warnings and exceptions, since the start."""

    def __init__(self, program: str, folder: Path):
        read, self._write = os.pipe()
        self._read, write = os.pipe()
        moves = [(os.POSIX_SPAWN_DUP2, read, 3), (os.POSIX_SPAWN_DUP2, write, 4)]
        # The pipes' own numbers may be 3 or 4, which the moves must not overwrite: they are copied first.
        spare = [os.dup(fd) for fd in (read, write)]
        for fd, copy in zip((read, write), spare, strict=True):
            os.close(fd)
            os.set_inheritable(copy, True)
        while min(spare) <= 4:
            spare = [os.dup(fd) for fd in spare]
        moves = [(os.POSIX_SPAWN_DUP2, spare[0], 3), (os.POSIX_SPAWN_DUP2, spare[1], 4)]
        quiet = (os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0)
        command = [program, *OPTIONS, f"--user-data-dir={folder}", "about:blank"]
        environment = {**os.environ, "DBUS_SESSION_BUS_ADDRESS": "/dev/null"}
        self._process = os.posix_spawn(program, command, environment, file_actions=[quiet, *moves])
        for fd in spare:
            os.close(fd)
        self._rest, self._number, self._session = b"", 0, None
        self.requests, self.complaints = [], []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters):
        """The answer to a command. Raises RuntimeError if that is an error."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        number = self._number
        while True:
            answer = self._next()
            if answer.get("id") == number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]

    def _next(self) -> dict:
        """The next message, and notes what it says about requests and errors."""
        end = time.monotonic() + LONGEST_WAIT
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._read], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                raise TimeoutError("the browser does not answer")
            more = os.read(self._read, 1 << 20)
            if not more:
                raise RuntimeError("the browser has ended")
            self._rest += more
        line, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(line)
        kind, about = message.get("method"), message.get("params", {})
        if kind == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])
        elif kind == "Runtime.exceptionThrown":
            self.complaints.append(about["exceptionDetails"]["exception"].get("description", "exception"))
        elif kind == "Runtime.consoleAPICalled":
            self.complaints.append(str(about["args"]))
        elif kind == "Log.entryAdded":
            self.complaints.append(about["entry"]["text"])
        self._last = kind
        return message

    def open(self, path: Path, width: int = 1200, height: int = 900) -> None:
        """Shows a file in a window of this size."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        self.call("Page.navigate", url=path.as_uri())
        while self._next().get("method") != "Page.loadEventFired":
            pass
        self.settle()

    def value(self, expression: str):
        """The value of an expression of the page, a promise's when it is kept."""
        found = self.call(
            "Runtime.evaluate",
            expression=expression,
            returnByValue=True,
            awaitPromise=True,
            userGesture=True,
        )
        if "exceptionDetails" in found:
            raise RuntimeError(found["exceptionDetails"]["exception"]["description"])
        return found["result"].get("value")

    def settle(self) -> None:
        """Waits until the page has drawn twice."""
        self.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def choose(self, identity: str, value: str, event: str = "change") -> None:
        """Gives a control a value, as a user does, and waits for the drawing."""
        element = f"document.getElementById({json.dumps(identity)})"
        self.value(f"{element}.value = {json.dumps(value)}; {element}.dispatchEvent(new Event('{event}'))")
        self.settle()

    def text(self, identity: str) -> str:
        """The text of an element."""
        return self.value(f"document.getElementById({json.dumps(identity)}).textContent")

    def picture(self, number: int = 0) -> str:
        """The pixels of a canvas as a data URL."""
        return self.value(f"document.getElementById('picture-{number}').toDataURL()")

    def mouse(self, kind: str, x: float, y: float, **more) -> None:
        """Sends an event of the mouse."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def colours(self, scheme: str) -> None:
        """Prefers `light` or `dark` colours."""
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.call("Emulation.setEmulatedMedia", features=features)

    def screenshot(self) -> bytes:
        """The page as PNG."""
        self.settle()
        return base64.b64decode(self.call("Page.captureScreenshot", captureBeyondViewport=True)["data"])

    def close(self) -> None:
        """Ends the browser."""
        session, self._session = self._session, None
        with contextlib.suppress(RuntimeError, OSError, TimeoutError):
            self.call("Browser.close")
        del session
        for _ in range(100):
            if os.waitpid(self._process, os.WNOHANG)[0]:
                break
            time.sleep(0.05)
        else:
            os.kill(self._process, signal.SIGKILL)
            os.waitpid(self._process, 0)
        os.close(self._read)
        os.close(self._write)
