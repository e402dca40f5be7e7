"""A Chromium that stays open while it is asked: for pages that wait for a server, and for many pages one by one."""

from __future__ import annotations

import base64
import itertools
import json
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import connect
from websockets.sync.connection import Connection

from falsework.view.viewer import LOOPBACK
from tests.falsework.browser import WORDS, chromium
from tests.patience import left

SAID = ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded")


class Tab:
    """The one page of a browser."""

    def __init__(self, line: Connection) -> None:
        """Listen to the page.

        Args:
            line: Its debugging connection.
        """
        self.line, self.numbers, self.console = line, itertools.count(1), list[str]()
        self.said = list[str]()  # all that it is told of pages: their console at any level, and what they may not do
        for domain in ("Runtime", "Log", "Page"):
            self.tell(f"{domain}.enable")

    def tell(self, method: str, **params: Any) -> dict[str, Any]:
        """Call a method of the browser, and take down what its console says meanwhile."""
        number = next(self.numbers)
        self.line.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            told = json.loads(self.line.recv(left()))
            if told.get("method") == "Runtime.consoleAPICalled" and told["params"]["type"] == "error":
                self.console.append(json.dumps(told["params"]["args"]))
            if told.get("method") == "Runtime.exceptionThrown":
                self.console.append(json.dumps(told["params"]["exceptionDetails"]))
            if told.get("method") in SAID:
                self.said.append(json.dumps(told["params"]))
            if told.get("id") == number:
                return told.get("result", {})

    def ask(self, script: str) -> Any:
        """Evaluate an expression, a promise included."""
        answer = self.tell("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        return answer["result"].get("value")

    def open(self, page: Path, width: int = 800, height: int = 600) -> None:
        """Go to a page in a window of a size [px], and wait until it is loaded.

        Args:
            page: HTML file.
            width: Of the window.
            height: Of the window.
        """
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.tell("Emulation.setDeviceMetricsOverride", **size)
        self.tell("Page.navigate", url=page.as_uri())
        self.wait_for(f"location.href === {json.dumps(page.as_uri())} && document.readyState === 'complete'")

    def run(self, script: str) -> Any:
        """Give what the body of an async function returns as JSON; a mistake in it is an error."""
        answer = self.tell(
            "Runtime.evaluate", expression=f"(async () => {{ {script} }})()", awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in answer:
            raise AssertionError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def wait_for(self, script: str) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + left()
        while not self.ask(script):
            assert time.monotonic() < end, script
            time.sleep(0.2)

    def click(self, x: float, y: float) -> None:
        """Click a place of the window [px]."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.tell("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def screenshot(self) -> bytes:
        """Take a picture of the window, as PNG."""
        return base64.b64decode(self.tell("Page.captureScreenshot")["data"])


@contextmanager
def open_tab(address: str, folder: Path) -> Iterator[Tab]:
    """Open an address, and close the browser in the end.

    Args:
        address: Where to go.
        folder: Folder for the browser's profile.
    """
    words = [chromium(), *WORDS, f"--user-data-dir={folder}", "--remote-debugging-port=0", "--window-size=1000,700"]
    browser = subprocess.Popen([*words, address], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port, end = folder / "DevToolsActivePort", time.monotonic() + left()
        while not (port.is_file() and port.read_text()):
            assert time.monotonic() < end, "the browser does not start"
            time.sleep(0.1)
        with urllib.request.urlopen(
            f"http://{LOOPBACK}:{port.read_text().split()[0]}/json/list", timeout=left()
        ) as answer:
            (page,) = [row for row in json.load(answer) if row["type"] == "page"]
        with connect(page["webSocketDebuggerUrl"], max_size=None, proxy=None) as line:
            yield Tab(line)
    finally:
        browser.terminate()
        try:
            browser.wait(20)
        except subprocess.TimeoutExpired:
            browser.kill()
            browser.wait()
