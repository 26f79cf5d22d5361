"""A real browser, pages in it, and commands that serve them, for tests marked `web`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import NAMES, SIZE, Program, Tab, chromium, launched


@pytest.fixture
def browser() -> Iterator[Any]:
    """Chromium, a new one for each test: what one of them did to it does not matter to the next."""
    path = chromium()
    if path is None:
        pytest.skip(f"no Chromium here (looked for {', '.join(NAMES)})")
    pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install 'qpsafe[browser]'")
    with launched(path) as found:
        yield found


@pytest.fixture
def tab(browser: Any) -> Iterator[Callable[..., Tab]]:
    """Opens pages; at the end nothing may have been complained about."""
    opened: list[Tab] = []

    def make(address: str, size: dict[str, int] = SIZE) -> Tab:
        opened.append(Tab(browser, address, size))
        return opened[-1]

    yield make
    complaints = [words for one in opened for words in one.complaints]
    for one in opened:
        one.page.close()
    assert complaints == []


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Callable[..., Program]]:
    """Starts commands that serve pages; ends them."""
    started: list[Program] = []

    def start(*words: str) -> Program:
        folder = tmp_path / f"program-{len(started)}"
        folder.mkdir()
        started.append(Program(list(words), folder))
        return started[-1]

    yield start
    for one in started:
        one.process.kill()
        one.process.wait()
