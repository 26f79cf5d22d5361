"""Every tutorial runs from start to end in an empty folder, and prints what its page says; `.ci/run` asks for that."""

from __future__ import annotations

import os
import re
import shlex
import socket
import subprocess
import sys
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
#: What a page says about setting up; here everything is set up, in an empty folder.
SET_UP = ("make ", "source ", "cd ", "pip ")
QPSAFE = "from qpsafe.cli.main import main; main()"
PAGES = [pytest.param(page, id=page.name) for page in sorted(FOLDER.glob("*.md")) if page.name != "index.md"]


class Block(NamedTuple):
    """A fenced block: its language, its text, and the line of the page that it begins at."""

    language: str
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page."""
    text = page.read_text(encoding="utf-8")
    return [Block(found[1], found[2], text.count("\n", 0, found.start()) + 1) for found in FENCE.finditer(text)]


def matches(expected: str, printed: str) -> bool:
    """Whether a text is as a page shows it; an ellipsis stands for anything."""
    return (
        re.fullmatch(".*?".join(map(re.escape, expected.strip().split("..."))), printed.strip(), re.DOTALL) is not None
    )


@cache
def ports() -> dict[str, list[str]]:
    """Options that give the wire ports of its own: others may stream on this computer."""
    with ExitStack() as held:
        sockets = [held.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(3)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        robot, sensors, events = (str(one.getsockname()[1]) for one in sockets)
    both = ["--port", robot, "--sensor-port", sensors]
    return {"stream": [*both, "--events", f"127.0.0.1:{events}"], "irc5-sim": [*both, "--event-port", events]}


def run(command: str, folder: Path, started: list[subprocess.Popen[bytes]]) -> str:
    """What a command line prints to standard output; it has to end well.

    Args:
        command: The line.
        folder: Where it runs.
        started: What runs beside, by `&`; added to.
    """
    words = shlex.split(command, comments=True)
    program = {"python": [sys.executable], "qpsafe": [sys.executable, "-c", QPSAFE]}[words[0]]
    beside = words[-1] == "&"
    words = [*words[: -1 if beside else None], *ports().get(words[1], [])]
    if beside:
        started.append(subprocess.Popen([*program, *words[1:]], cwd=folder, stdout=subprocess.DEVNULL))
        return ""
    done = subprocess.run(
        [*program, *words[1:]],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=900,
        env=os.environ | {"NO_COLOR": "1"},
    )
    assert done.returncode == 0, f"{command}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_the_tutorial_runs_in_an_empty_folder(page: Path, tmp_path: Path) -> None:
    """A block that begins with `# save as NAME` is a file; text that follows a command is what it prints."""
    printed, ran = "", 0
    started: list[subprocess.Popen[bytes]] = []
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if saved := re.match(r"(?:#|<!--) save as (\S+)", block.text):
            (tmp_path / saved[1]).parent.mkdir(exist_ok=True)
            (tmp_path / saved[1]).write_text(block.text, encoding="utf-8")
        elif block.language == "bash":
            printed = ""
            for line in block.text.splitlines():
                if line.strip() and not line.startswith((*SET_UP, "#")):
                    printed += run(line, tmp_path, started)
                    ran += 1
        elif block.language == "text":
            assert matches(block.text, printed), f"{where}: the page says\n{block.text}\nit prints\n{printed}"
        else:
            raise AssertionError(f"{where}: nothing is done with this block")
    assert ran
    assert [process.wait(60.0) for process in started] == [0] * len(started)
