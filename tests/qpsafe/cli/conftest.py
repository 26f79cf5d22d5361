"""What tests of printed tables share."""

from __future__ import annotations

import io
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import made_up_trials
import pytest
import typer
from rich.cells import cell_len
from rich.console import Console
from typer.testing import CliRunner

from qpsafe.cli.main import app, main
from qpsafe.cli.sheet import Sheet
from qpsafe.sim.campaign.speed import Speed
from qpsafe.sim.drawing.gl import gl_available
from qpsafe.text.json_text import json_text


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


@pytest.fixture(scope="session")
def parsed() -> Callable[[str, list[str]], Any]:
    """The context of a command with words, behind one for each argument that it must have; nothing is run."""
    group: Any = typer.main.get_command(app)

    def parse(path: str, words: list[str]) -> Any:
        command, context, name = group, None, "qpsafe"
        for inner in path.split():
            context = typer.Context(command, info_name=name, parent=context)
            command, name = command.commands[inner], inner
        needed = ["x" for part in command.params if part.param_type_name == "argument" and part.required]
        return command.make_context(name, [*needed, *words], parent=context)

    return parse


@pytest.fixture
def campaign(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Any]:
    """`qpsafe campaign` with some words, in a current folder of its own; trials are made up, none is simulated."""
    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: made_up_trials.run)
    monkeypatch.setattr("qpsafe.sim.campaign.speed.engine_speed", lambda plan, trials: Speed(100.0, 90.0, float("nan")))
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(app, ["campaign", *words])


@pytest.fixture
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures take most of a command's time; tests/sim/campaign looks at the page."""
    monkeypatch.setattr("qpsafe.sim.campaign.report.page.report_page", lambda results, found: json_text(found))


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
