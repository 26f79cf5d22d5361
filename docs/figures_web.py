"""Pictures of the page: docs/img/web*.png, as Chromium shows them: python docs/figures_web.py [NAME ...]"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "img"
sys.path.insert(0, str(ROOT / "benchmarks"))  # where the browser is steered from

from browser import Program, Tab, chromium, launched  # noqa: E402

SIZE = {"width": 1320, "height": 780}
ARROW = (1.85, 0.5, 0.0)
TRIES = 6


def patient(path: str, folder: Path) -> str:
    """Chromium that gives way to the simulation: software draws finely for seconds, and ticks would be late."""
    script = folder / "chromium"
    script.write_text(f'#!/bin/sh\nexec nice -n 15 "{path}" "$@"\n', encoding="utf-8")
    script.chmod(0o755)
    return str(script)


def quiet(shown: Tab) -> None:
    """Close the notice that WebGL is software here, unless it goes by itself first."""
    from playwright.sync_api import TimeoutError

    notice = shown.page.locator(".mantine-Notification-closeButton")
    while notice.count():
        with suppress(TimeoutError):
            notice.first.click(timeout=10_000)
        shown.page.wait_for_timeout(300)


def picture(browser: Any, program: Program, name: str, tab: str = "Plots") -> None:
    """Take a picture, finely drawn: with a tab of its own, since software takes seconds for that."""
    shown = Tab(browser, program.address, SIZE, resolution=1.0)
    quiet(shown)
    shown.open(tab)
    shown.page.wait_for_timeout(12_000)
    shown.page.screenshot(path=IMAGES / f"{name}.png", timeout=120_000)
    program.interrupt()


def web(browser: Any, folder: Path) -> None:
    """Somebody is dragged to the robot, which makes way."""
    program = Program(["web", "--port", "0"], folder)
    shown = Tab(browser, program.address, SIZE)
    shown.page.wait_for_timeout(3000)
    for _ in range(TRIES):  # on a machine with much else to do the arrow may learn of the mouse too late
        shown.drag(ARROW, (0.88, 0.5, 0.0))
        with suppress(AssertionError):
            shown.until(lambda: shown.number("qp-cdf") > 5.0, patience=20.0)
            break
    assert shown.number("qp-cdf") > 5.0, "nobody could be dragged"
    shown.page.close()
    picture(browser, program, "web")


def dark(browser: Any, folder: Path) -> None:
    """A hand before another robot, on a dark page, with the tick in words."""
    program = Program(["web", "--port", "0", "--robot", "iiwa14", "--dark"], folder)
    shown = Tab(browser, program.address, SIZE)
    shown.open("People")
    shown.choose("drag with the mouse", "hand")
    shown.until(lambda: shown.number("qp-cdf") > 5.0)
    shown.page.close()
    picture(browser, program, "web-dark", "In words")


def recorded(browser: Any, folder: Path) -> None:
    """The first experiment, recorded, in the moment of high danger."""
    run = folder / "run"
    Program(["demo", "fixed", "--duration", "14", "--no-video", "--out", str(run)], folder, serves=False).process.wait()
    program = Program(["replay", str(run / "run.npz"), "--web", "--web-port", "0"], folder)
    shown = Tab(browser, program.address, SIZE)
    shown.page.get_by_role("button", name="play or pause").click()
    field = shown.page.locator("input[inputmode='decimal']").first
    field.fill("9.6")
    field.press("Enter")
    shown.until(lambda: abs(shown.number("qp-time") - 9.6) < 0.1)
    shown.page.close()
    picture(browser, program, "web-replay")


PICTURES: dict[str, Callable[[Any, Path], None]] = {"web": web, "dark": dark, "recorded": recorded}


def main(names: list[str]) -> None:
    """Draw some, or all."""
    path = chromium()
    if path is None:
        print("figures_web: Chromium is not installed, the pictures of the page stay as they are")
        return
    for name in names or list(PICTURES):
        with tempfile.TemporaryDirectory() as folder, launched(patient(path, Path(folder))) as browser:
            PICTURES[name](browser, Path(folder))
            print(f"drawn: {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
