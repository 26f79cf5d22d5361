"""What tests of printed tables share."""

from __future__ import annotations

import io
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest
from rich.cells import cell_len
from rich.console import Console

from qpsafe.cli.main import main
from qpsafe.cli.sheet import Sheet
from qpsafe.sim.drawing.gl import gl_available


@pytest.fixture(scope="session")
def whole() -> Callable[[Sheet, int], str]:
    """A sheet as a screen of some width shows it, checked: nothing of it is lost or cut."""
    return _whole


class Done(NamedTuple):
    """How a command ended: its exit code, what it wrote."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def without_display(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Callable[..., Done]]:
    """The program's own `main` with some words, as on a machine without OpenGL or a display; in this process, since
    to start another one takes longer than the commands do.
    """
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("MUJOCO_GL", "disable")
    gl_available.cache_clear()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def run(*words: str) -> Done:
        monkeypatch.setattr(sys, "argv", ["qpsafe", *words])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        return Done(int(end.value.code or 0), *capsys.readouterr())

    yield run
    gl_available.cache_clear()
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _whole(sheet: Sheet, width: int) -> str:
    """Every word is there, as often as in the cells; numbers are in one piece; nothing is wider than the screen."""
    out = io.StringIO()
    Console(file=out, width=width, markup=False, emoji=False, highlight=False).print(sheet)
    text = out.getvalue()
    assert "…" not in text
    assert max(map(cell_len, text.splitlines())) <= width
    found = Counter(word.rstrip(";") for word in text.split())
    plain = [cell.plain for row in sheet.rows for cell in row]
    assert not Counter(" ".join(plain).split()) - found
    heads = {word.rstrip(":") for word in found}
    assert not {word.rstrip(":") for word in " ".join([sheet.title, *sheet.headings]).split()} - heads
    for row in sheet.rows:
        for number, cell in enumerate(row):
            if number not in sheet.text:
                assert all(line.strip() in text for line in cell.plain.split("\n"))
    return text
