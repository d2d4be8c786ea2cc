"""Clients of the viewer's page: its stream of events, and a headless browser."""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import subprocess
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np


def wait_for(condition: Callable[[], object], limit: float = 10.0) -> None:
    """Wait until a condition holds, at most ``limit`` [s]."""
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, f"the condition did not hold within {limit:g} s"
        time.sleep(0.02)


def read_event(stream: Any) -> str:
    """Next event of a stream, as text."""
    lines = []
    while (line := stream.readline().decode().strip()) or not lines:
        lines.append(line)
    return "\n".join(lines)


CHROME = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
CHROMEDRIVER = shutil.which("chromedriver") or ""


class Browser:
    """Headless Chromium, controlled through chromedriver by the W3C WebDriver protocol.

    Args:
        folder: home folder of the browser.
    """

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        home = {**os.environ, "HOME": str(folder)}
        self._driver = subprocess.Popen(
            [CHROMEDRIVER, f"--port={port}"], stdout=subprocess.DEVNULL, env=home
        )
        self._base = f"http://127.0.0.1:{port}/session"
        wait_for(lambda: self._is_listening(port))
        flags = ["headless=new", "no-sandbox", "disable-dev-shm-usage", "window-size=1280,940"]
        options = {"binary": CHROME, "args": [f"--{flag}" for flag in flags]}
        capabilities = {"alwaysMatch": {"goog:chromeOptions": options}}
        self._base += f"/{self._send('', capabilities=capabilities)['sessionId']}"

    def _is_listening(self, port: int) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) == 0

    def _send(self, command: str, **arguments: Any) -> Any:
        body = json.dumps(arguments).encode()
        request = urllib.request.Request(self._base + command, body)
        with urllib.request.urlopen(request, timeout=60) as response:
            return json.load(response)["value"]

    def open(self, address: str) -> None:
        self._send("/url", url=address)

    def run(self, script: str) -> Any:
        """Run a script in the page; returns its result."""
        return self._send("/execute/sync", script=script, args=[])

    def screenshot(self) -> np.ndarray:
        """Screenshot of the page, shape (h, w, 3), BGR."""
        with urllib.request.urlopen(f"{self._base}/screenshot", timeout=60) as response:
            data = base64.b64decode(json.load(response)["value"])
        return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)

    def close(self) -> None:
        request = urllib.request.Request(self._base, method="DELETE")
        urllib.request.urlopen(request, timeout=60).close()
        self._driver.terminate()
        self._driver.wait(10)
