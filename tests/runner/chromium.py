"""A headless Chromium to look at pages with, driven through its DevTools pipe:
no package and no port needed.
"""

from __future__ import annotations

import base64
import fcntl
import json
import os
import shutil
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest

_CANDIDATES = ("chromium", "chromium-browser", "google-chrome")
_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--hide-scrollbars",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    "--remote-debugging-pipe",
)
_GRAPHICS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""What makes WebGL work without a graphics card"""
_CONTROLS = {
    "button",
    "link",
    "searchbox",
    "textbox",
    "slider",
    "combobox",
    "checkbox",
    "image",
    "img",
    "DisclosureTriangle",
}
"""Roles in the tree that screen readers see"""


def chromium() -> str:
    """The browser's command; tests are skipped where there is none."""
    found = next((path for name in _CANDIDATES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no Chromium is installed (Debian: apt-get install chromium)")
    return found


class Browser:
    """One page of a headless Chromium.

    Args:
        folder: for its profile.
        graphics: whether pages have WebGL, drawn by software.
    """

    def __init__(self, folder: Path, graphics: bool = False) -> None:
        to_child, self._out = os.pipe()
        self._in, from_child = os.pipe()
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (to_child, from_child)]

        def connect() -> None:
            for end, wanted in zip(
                ends, (3, 4), strict=True
            ):  # the numbers that the DevTools pipe has
                os.dup2(end, wanted)

        self._process = subprocess.Popen(
            [
                chromium(),
                *_FLAGS,
                *(_GRAPHICS if graphics else ("--disable-gpu",)),
                f"--user-data-dir={folder}",
            ],
            preexec_fn=connect,
            pass_fds=(3, 4),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for end in (to_child, from_child, *ends):
            os.close(end)
        self._rest, self._number = b"", 0
        self.errors: list[str] = []
        """Uncaught errors and messages of the console"""
        self.requests: list[str] = []
        """Addresses that pages have asked for"""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session: str | None = self.call(
            "Target.attachToTarget", targetId=target, flatten=True
        )["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    _session = None

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.terminate()
        self._process.wait(10)
        os.close(self._out)
        os.close(self._in)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Ask the browser for something and wait for the answer."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return answer["result"]

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            data = os.read(self._in, 1 << 20)
            assert data, "the browser has ended"
            self._rest += data
        text, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(text)
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, method: str, values: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent":
            self.requests.append(values["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            details = values["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Runtime.consoleAPICalled" or (
            method == "Log.entryAdded" and values["entry"]["level"] == "error"
        ):
            self.errors.append(json.dumps(values))

    def open(
        self,
        page: Path | str,
        fragment: str = "",
        *,
        width: int = 1280,
        height: int = 900,
        dark: bool = False,
    ) -> None:
        """Show a file, or what is at an address, in a window of a size, and wait
        until it is drawn.
        """
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url="about:blank")
        address = page if isinstance(page, str) else page.as_uri()
        self.call("Page.navigate", url=address + (f"#{fragment}" if fragment else ""))
        self.run(
            "new Promise(done => document.readyState === 'complete' ? done() : "
            "addEventListener('load', () => done()))"
        )
        self.settle()

    def settle(self) -> None:
        """Wait until what has changed is drawn."""
        self.run(
            "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done())))"
        )

    def run(self, script: str) -> Any:
        """The value of a JavaScript expression; promises are awaited."""
        answer = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def text(self, selector: str) -> str:
        """Text of the first element that a selector finds."""
        return str(self.run(f"document.querySelector({json.dumps(selector)}).textContent"))

    def unnamed(self) -> list[str]:
        """Roles of the controls that a screen reader has no name for."""
        nodes = self.call("Accessibility.getFullAXTree")["nodes"]
        shown = [
            node
            for node in nodes
            if not node.get("ignored") and node.get("role", {}).get("value") in _CONTROLS
        ]
        assert shown, "there are controls"
        return [
            node["role"]["value"]
            for node in shown
            if not node.get("name", {}).get("value", "").strip()
        ]

    def press(self, key: str, *, shift: bool = False) -> None:
        """Press and release a key."""
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                modifiers=8 if shift else 0,
                **(text if kind == "keyDown" else {}),
            )
        self.settle()

    def drag(self, x: float, y: float, dx: float = 0.0, dy: float = 0.0) -> None:
        """Press at a place of the window, move by some pixels, and release;
        without movement this is a click.
        """
        self.call(
            "Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1
        )
        if dx or dy:
            self.call(
                "Input.dispatchMouseEvent",
                type="mouseMoved",
                x=x + dx,
                y=y + dy,
                button="left",
                buttons=1,
            )
        self.call(
            "Input.dispatchMouseEvent",
            type="mouseReleased",
            x=x + dx,
            y=y + dy,
            button="left",
            clickCount=1,
        )
        self.settle()

    def wheel(self, x: float, y: float, down: float) -> None:
        """Turn the mouse wheel at a place of the window."""
        self.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=down)
        self.settle()

    def picture(self, path: Path, *, whole: bool = False) -> Path:
        """Write a PNG of what is seen, or of the whole page."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)[
            "data"
        ]
        path.write_bytes(base64.b64decode(data))
        return path
