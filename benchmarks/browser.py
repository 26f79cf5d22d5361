"""A real browser without a display, and commands that serve pages in processes of their own: for tests and timing."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from qpsafe.sim.web.view import ANGLE, EYE, LOOK

#: Without a display and a graphics card: WebGL by software.
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-gpu-compositing",  # 60 pictures a second instead of 37, and of 2 with two pages
]
NAMES = ("chromium", "chromium-browser", "google-chrome")
SIZE = {"width": 760, "height": 620}  # little of the scene: it is drawn by software
WIDE = {"width": 1180, "height": 640}
COARSE = 0.25  # resolution that software draws in no time
#: Remembers when the mouse has moved last, by the clock of the day [s].
NOTE = """() => window.addEventListener("pointermove", event => {
    window.moved = 1e-3 * (performance.timeOrigin + event.timeStamp) }, true)"""
WARM = 5.0  # until all has been drawn once [s]
QUIET = 0.3  # without news a drag is over, what viser holds back included [s]
READY = 300.0  # to load, to compile if need be, and to be drawn, by a machine with much else to do [s]


def chromium() -> str | None:
    """Where Chromium is; None where there is none."""
    return next((path for name in NAMES if (path := shutil.which(name)) is not None), None)


@contextmanager
def launched(path: str) -> Iterator[Any]:
    """Chromium, steered by Playwright."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as steered:
        browser = steered.chromium.launch(executable_path=path, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


class Tab:
    """A page, with whatever its console complained about.

    Args:
        browser: Chromium.
        address: What is opened.
        size: Width and height [px].
        resolution: Pixels that are drawn of the scene, per pixel of the screen and direction.
    """

    def __init__(
        self, browser: Any, address: str, size: dict[str, int] | None = None, resolution: float = COARSE
    ) -> None:
        self.complaints: list[str] = []
        self.page = browser.new_page(viewport=size or SIZE)
        self.page.set_default_timeout(1e3 * READY)
        self.page.on("console", lambda message: message.type == "error" and self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(address + ("&" if "?" in address else "?") + f"fixedDpr={resolution:g}")
        self.page.wait_for_selector("#qp-distance", timeout=1e3 * READY)

    def text(self, key: str) -> str:
        """What stands in an element with an id."""
        return str(self.page.locator(f"#{key}").text_content(timeout=1e3 * READY))

    def number(self, key: str) -> float:
        """The first number in it."""
        found = re.search(r"-?\d+\.?\d*", self.text(key))
        assert found is not None, self.text(key)
        return float(found[0])

    def joints(self) -> list[float]:
        """Where the robot's joints are [rad]."""
        return [float(word) for word in self.text("qp-joints").split()]

    def until(self, true: Callable[[], bool], patience: float = READY) -> None:
        """Wait until something is true."""
        end = time.monotonic() + patience
        while not true():
            assert time.monotonic() < end, f"waited {patience:g} s; {self.text('qp-note')}"
            self.page.wait_for_timeout(50)

    def at(self, point: tuple[float, float, float]) -> tuple[float, float]:
        """Where a point of the scene is on the screen, as the camera stands at first [px]."""
        box = self.page.locator("canvas").first.bounding_box()
        eye, forward = np.array(EYE), np.subtract(LOOK, EYE)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        seen = np.subtract(point, eye)
        scale = 0.5 * box["height"] / np.tan(np.radians(0.5 * ANGLE)) / (seen @ forward)
        x, y = scale * (seen @ right), scale * (seen @ np.cross(right, forward))
        return box["x"] + 0.5 * box["width"] + x, box["y"] + 0.5 * box["height"] - y

    def drag(self, start: tuple[float, float, float], end: tuple[float, float, float], steps: int = 12) -> None:
        """Drag along an arrow with the mouse, from a point of the scene to another."""
        mouse = self.page.mouse
        here, there = self.at(start), self.at(end)
        mouse.move(*here)
        self.page.wait_for_timeout(1500)  # until the arrow knows of the mouse
        mouse.down()
        for k in range(1, steps + 1):
            mouse.move(*(a + (b - a) * k / steps for a, b in zip(here, there, strict=True)))
            self.page.wait_for_timeout(60)
        mouse.up()

    def settled(self) -> bool:
        """Whether the newest wish of the page has been followed."""
        return self.text("qp-asked") == self.text("qp-wish").split()[0]

    def drag_delays(
        self, start: tuple[float, float, float], end: tuple[float, float, float], count: int
    ) -> list[float]:
        """Times from when Chromium got a move of the mouse to the end of the first tick that counted with it [s]."""
        self.page.evaluate(NOTE)
        mouse, delays = self.page.mouse, []
        here, there = np.array(self.at(start)), np.array(self.at(end))
        mouse.move(*here)
        self.page.wait_for_timeout(1e3 * WARM)
        mouse.down()
        for k in range(1, count + 2):
            known = self.quiet_wish()
            mouse.move(*(here + (there - here) * k / (count + 1)))
            self.until(lambda known=known: self.wish() > known)  # type: ignore[misc]
            moved = float(self.page.evaluate("() => window.moved")) - (time.time() - time.monotonic())
            delays.append(float(self.text("qp-wish").split()[1]) - moved)
        mouse.up()
        return delays[1:]  # the first one began the drag

    def wish(self) -> int:
        """Number of the newest wish that has been followed."""
        return int(self.text("qp-wish").split()[0])

    def quiet_wish(self) -> int:
        """The same, once nothing more is on its way."""
        known, since = -1, time.monotonic()
        while time.monotonic() - since < QUIET:
            if self.wish() != known or not self.settled():
                known, since = self.wish(), time.monotonic()
            self.page.wait_for_timeout(30)
        return known

    def choose(self, label: str, option: str) -> None:
        """Choose in a dropdown of the open tab."""
        box = self.page.get_by_label(label, exact=True)
        box.first.click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def open(self, name: str) -> None:
        """Open a tab of the panel."""
        self.page.get_by_role("tab", name=name, exact=True).click()


class Program:
    """A qpsafe command that serves a page.

    Args:
        words: What is typed after `qpsafe`.
        folder: Where.
        serves: Whether to wait for the address of its page.
    """

    def __init__(self, words: list[str], folder: Path, serves: bool = True) -> None:
        code = "from qpsafe.cli.main import main; main()"
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "NO_COLOR": "1"}
        self.log = folder / "said.txt"
        with self.log.open("wb") as said:
            self.process = subprocess.Popen(
                [sys.executable, "-c", code, *words], cwd=folder, env=environment, stdout=said, stderr=said
            )
        atexit.register(self.process.kill)
        self.address, end = "", time.monotonic() + READY
        while serves and (found := re.search(r"http://\S+", self.said)) is None:
            assert self.process.poll() is None, self.said
            assert time.monotonic() < end, self.said
            time.sleep(0.1)
        if serves and found is not None:
            self.address = found[0]

    @property
    def said(self) -> str:
        """What it has printed."""
        return self.log.read_text("utf-8")

    def interrupt(self) -> int:
        """Press Ctrl-C, and wait for its exit code."""
        self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(30.0)
        finally:
            self.process.kill()
