"""A headless Chromium, driven through its DevTools protocol: for looking at pages and for operating
them.

Only what pictures and tests need: open a page in a size and colour scheme, run a script in it,
press keys, drag the pointer, take a picture, print; with every console error and every request to a
network collected.
"""

from __future__ import annotations

import base64
import ctypes
import io
import json
import math
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from PIL import Image
from websockets.sync.client import ClientConnection, connect

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    # without a graphics card 2D is drawn 20 times faster by the processor itself than by a card it
    # imitates
    *("--disable-accelerated-2d-canvas", "--disable-gpu-rasterization"),
    *("--headless=new", "--no-sandbox", "--hide-scrollbars", "--use-angle=swiftshader"),
    *(
        "--enable-unsafe-swiftshader",
        "--disable-dev-shm-usage",
        "--remote-debugging-port=0",
        "about:blank",
    ),
)
START_SECONDS = 300.0  # a busy machine takes long, and only what fails waits for it
_PIECE = 4000  # pixels: of a picture of a whole page, what is drawn at once
_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)
ANSWER_SECONDS = 300.0  # the same; 3D is drawn in software


def chromium() -> str | None:
    """The browser that is installed, None without one."""
    for name in NAMES:
        path = shutil.which(name)
        if path is not None:
            return path
    return None


def _end_with_parent() -> None:
    """Whatever ends this process, SIGKILL included, ends the browser too."""
    ctypes.CDLL(None).prctl(_PARENT_DEATH_SIGNAL, signal.SIGTERM)


class PageError(Exception):
    """The browser refused something, or a script in the page failed."""


class Browser:
    """A browser process of its own with an empty profile; a context manager that ends it."""

    def __enter__(self) -> Self:
        path = chromium()
        if path is None:
            raise PageError(f"no browser is installed: none of {', '.join(NAMES)}")
        self._profile = tempfile.TemporaryDirectory(prefix="chromium_", ignore_cleanup_errors=True)
        command = [path, f"--user-data-dir={self._profile.name}", *FLAGS]
        self._process = subprocess.Popen(
            command,
            env={**os.environ, "TMPDIR": self._profile.name},  # it leaves what it puts there
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=_end_with_parent,
        )
        self._socket = connect(
            self._address(),
            max_size=None,
            proxy=None,
            open_timeout=START_SECONDS,
            ping_timeout=ANSWER_SECONDS,
        )
        self._number = 0
        self.events: list[Mapping[str, Any]] = []
        return self

    def _address(self) -> str:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            if found := re.search(r"DevTools listening on (ws://\S+)", line):
                return found[1]
        raise PageError("the browser ended before it listened")

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._socket.close()
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(START_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stderr is not None:
            self._process.stderr.close()
        self._profile.cleanup()

    def call(self, method: str, session: str = "", **parameters: Any) -> dict[str, Any]:
        """The answer to one command; events meanwhile are kept. PageError with the browser's
        words.
        """
        self._number += 1
        request = {"id": self._number, "method": method, "params": parameters}
        if session:
            request["sessionId"] = session
        self._socket.send(json.dumps(request))
        while True:
            message = json.loads(_received(self._socket))
            if message.get("id") == self._number:
                if "error" in message:
                    raise PageError(f"{method}: {message['error']['message']}")
                result: dict[str, Any] = message["result"]
                return result
            self.events.append(message)

    def open(self, page: Path | str, wide: int, high: int, **options: Any) -> Page:
        """A page of a file or an address, in a window of its own; options as of Page."""
        return Page(self, page, wide, high, **options)


def _received(socket: ClientConnection) -> str | bytes:
    return socket.recv(timeout=ANSWER_SECONDS)


class Page:
    """A page that is loaded, and operated as a person does."""

    def __init__(
        self,
        browser: Browser,
        page: Path | str,
        wide: int,
        high: int,
        *,
        dark: bool = False,
        touch: bool = False,
    ) -> None:
        self._browser = browser
        self._address = page if isinstance(page, str) else page.resolve().as_uri()
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = browser.call("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        self._target = target
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.size(wide, high, touch=touch)
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=scheme)
        self.call("Page.navigate", url=self._address)
        asked = json.dumps(self._address.partition("#")[0])
        self.wait(f"location.href.split('#')[0] === {asked} && document.readyState === 'complete'")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The answer to one command of this page."""
        return self._browser.call(method, self._session, **parameters)

    def size(self, wide: int, high: int, *, touch: bool = False) -> None:
        """Sets the window's inner size [px]; touch: a phone's screen, operated by a finger."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=wide,
            height=high,
            deviceScaleFactor=1,
            mobile=touch,
        )
        self.call("Emulation.setTouchEmulationEnabled", enabled=touch)

    def run(self, script: str) -> Any:
        """The value of an expression in the page, a promise awaited; PageError where it throws."""
        answer = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in answer:
            thrown = answer["exceptionDetails"]
            raise PageError(str(thrown.get("exception", thrown).get("description", thrown)))
        return answer["result"].get("value")

    def wait(self, condition: str, seconds: float = START_SECONDS) -> None:
        """Waits until an expression is true; PageError when it doesn't become so."""
        deadline = time.monotonic() + seconds
        while not self.run(f"Boolean({condition})"):
            if time.monotonic() > deadline:
                raise PageError(f"never became true: {condition}")
            self.frame()

    def frame(self) -> None:
        """Waits until the page was drawn twice: what was asked for before is on the screen."""
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def pointer(self, kind: str, x: float, y: float, **more: Any) -> None:
        """A movement of the pointer, a press or a release: "mouseMoved", "mousePressed",
        "mouseReleased".
        """
        held = {} if kind == "mouseMoved" and not more else {"button": "left", "clickCount": 1}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **{**held, **more})

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Presses at one point, moves to another, and releases there."""
        self.pointer("mouseMoved", *start)
        self.pointer("mousePressed", *start)
        self.pointer("mouseMoved", *end, button="left", buttons=1)
        self.pointer("mouseReleased", *end)

    def key(self, key: str) -> None:
        """Presses and releases a key in what has the focus."""
        text = {"text": key} if len(key) == 1 else {}
        self.call(
            "Input.dispatchKeyEvent",
            type="keyDown",
            key=key,
            code="Space" if key == " " else key,
            **text,
        )
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def middle(self, selector: str) -> tuple[float, float, float, float]:
        """x, y, width and height [px] of an element, scrolled into view."""
        found = f"document.querySelector({json.dumps(selector)})"
        self.run(f"{found}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
        left, top, wide, high = self.run(
            f"(({{x, y, width, height}}) => [x, y, width, height])({found}.getBoundingClientRect())"
        )
        return left + wide / 2.0, top + high / 2.0, wide, high

    def picture(self, path: Path, *, whole: bool = True) -> Path:
        """Writes a PNG of the page, or of the window alone."""
        self.frame()
        if whole:
            self._joined().save(path)
            return path
        answer = self.call("Page.captureScreenshot", format="png")
        path.write_bytes(base64.b64decode(answer["data"]))
        return path

    def _joined(self) -> Image.Image:
        """The whole page, of pieces below each other: Chromium repeats the top of one that is
        higher than a texture, 8192 pixels.
        """
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        wide = math.ceil(size["width"])
        high = math.ceil(size["height"])
        whole = Image.new("RGB", (wide, high))
        for top in range(0, high, _PIECE):
            clip = {
                "x": 0,
                "y": top,
                "width": wide,
                "height": min(_PIECE, high - top),
                "scale": 1.0 / self.run("window.devicePixelRatio"),
            }
            answer = self.call(
                "Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip
            )
            piece = Image.open(io.BytesIO(base64.b64decode(answer["data"])))
            whole.paste(piece, (0, top))
        return whole

    def downloads(self, folder: Path) -> None:
        """Files that the page offers go into a folder without asking."""
        self._browser.call(
            "Browser.setDownloadBehavior", behavior="allow", downloadPath=str(folder)
        )

    def close(self) -> None:
        """Closes the page."""
        self._browser.call("Target.closeTarget", targetId=self._target)

    def _events(self, wanted: Callable[[str, Mapping[str, Any]], str]) -> list[str]:
        own = [event for event in self._browser.events if event.get("sessionId") == self._session]
        return [words for event in own if (words := wanted(event["method"], event["params"]))]

    @property
    def faults(self) -> list[str]:
        """Errors and warnings of the console and the log, and exceptions that nobody caught."""

        def fault(method: str, event: Mapping[str, Any]) -> str:
            if method == "Runtime.exceptionThrown":
                return str(event["exceptionDetails"])
            if method == "Runtime.consoleAPICalled" and event["type"] in (
                "error",
                "warning",
                "assert",
            ):
                return str(event["args"])
            if method == "Log.entryAdded" and event["entry"]["level"] == "error":
                return str(event["entry"]["text"])
            return "a dialog" if method == "Page.javascriptDialogOpening" else ""

        return self._events(fault)

    @property
    def requests(self) -> list[str]:
        """Addresses that were asked for but for the page itself and what it holds in itself."""

        def asked(method: str, event: Mapping[str, Any]) -> str:
            if method != "Network.requestWillBeSent":
                return ""
            address = str(event["request"]["url"])
            return (
                ""
                if address.startswith(("data:", "blob:")) or address == self._address
                else address
            )

        return self._events(asked)
