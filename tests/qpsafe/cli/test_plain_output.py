"""Help, progress and errors are plain text: no bracket is eaten, nothing is cut, and no colour comes with NO_COLOR."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import typer.main

from qpsafe.cli import common, main
from qpsafe.cli.demos import fixed as demo
from qpsafe.cli.sheet import Sheet
from qpsafe.robot.loader import load_robot
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment

HOSTILE = "arm[/x] [red]b[/] :smile: [0m]"
WIDTHS = (60, 80)


def commands(command: Any = None, words: tuple[str, ...] = ()) -> list[tuple[tuple[str, ...], Any]]:
    """Every command of the app, with the words that lead to it."""
    command = typer.main.get_command(main.app) if command is None else command
    below = getattr(command, "commands", {})
    return [(words, command), *(found for name in below for found in commands(below[name], (*words, name)))]


# Help


COMMANDS = commands()


@pytest.mark.parametrize("width", [*WIDTHS, 200])
@pytest.mark.parametrize(("words", "command"), COMMANDS, ids=[" ".join(found) or "-" for found, _ in COMMANDS])
def test_help_has_every_word_of_its_source(
    words: tuple[str, ...],
    command: Any,
    width: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    with pytest.raises(SystemExit):
        COMMANDS[0][1](args=[*words, "--help"], prog_name="qpsafe")
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= max(width, 50)  # an option's own choices are one word
    shown = " ".join(shown.split()).replace("- ", "-")  # wrapped at hyphens, too
    sources = [command.help, *(getattr(parameter, "help", None) for parameter in command.params)]
    sources += [below.help.split("\n\n")[0] for below in getattr(command, "commands", {}).values()]
    for source in filter(None, sources):
        assert " ".join(source.split()).replace("- ", "-") in shown


def test_progress_shows_names_as_they_are(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for width in WIDTHS:
        monkeypatch.setenv("COLUMNS", str(width))
        with common.progress_bar(common.console(False)) as progress:
            progress.add_task(f"{HOSTILE} and a long description of what goes on for quite a while", total=1234567)
        text = capsys.readouterr().out
        assert "…" not in text
        assert set(HOSTILE.split()) | {"0/1234567"} <= set(text.split())


def test_an_extra_to_install_is_named_in_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "imageio.v2", None)
    monkeypatch.setattr("qpsafe.sim.drawing.gl.gl_available", lambda: (True, ""))
    experiment, screen = FixedExperiment(load_robot("irb140"), duration=0.1), common.console(False)
    with (
        common.progress_bar(screen) as progress,
        demo.observed(experiment, tmp_path / "a.mp4", True, False, screen, progress, "a run") as (_, filmed),
    ):
        assert not filmed
    assert "pip install 'qpsafe[video]'" in " ".join(capsys.readouterr().out.split())


def test_json_is_a_flag_of_every_command() -> None:
    for words, command in COMMANDS:
        names = {name: parameter for parameter in command.params for name in parameter.opts}
        if not getattr(command, "commands", {}):
            assert names["--json"].is_flag, words


# Colour

COLOUR = re.compile(r"\x1b\[[\d;]*m")


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def printed(monkeypatch: pytest.MonkeyPatch, settings: dict[str, str], act: Callable[[], Any]) -> str:
    """What a colour terminal, or what pretends to be one, is sent."""
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "PY_COLORS", "TERM", "COLORTERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"TERM": "xterm-256color", **settings}.items():
        monkeypatch.setenv(name, value)
    terminal = _Terminal() if "pipe" not in settings else io.StringIO()
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    act()
    return terminal.getvalue()


def command(*arguments: str) -> Callable[[], None]:
    def act() -> None:
        sys.argv = ["qpsafe", *arguments]
        with suppress(SystemExit):
            main.main()

    return act


def table() -> None:
    sheet = Sheet("title", ("what", "kept"))
    sheet.add_row("one", common.verdict(False))
    common.console(False).print(sheet)


def progress() -> None:
    with common.progress_bar(common.console(False)) as bar:
        bar.advance(bar.add_task("work", total=2))


ACTS: dict[str, Callable[[], Any]] = {
    "table": table,
    "progress": progress,
    "error": command("robots", "r2d2"),
    "usage": command("bench", "--ticks", "none"),
    "help": command("demo", "fixed", "--help"),
}


@pytest.mark.parametrize("act", ACTS)
@pytest.mark.parametrize(
    "others", [{}, {"FORCE_COLOR": "1"}, {"FORCE_COLOR": "1", "pipe": "1"}, {"TTY_COMPATIBLE": "1"}]
)
def test_no_color_means_none(act: str, others: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", sys.argv)
    assert not COLOUR.search(printed(monkeypatch, {"NO_COLOR": "1", **others}, ACTS[act]))


@pytest.mark.parametrize("act", ["table", "progress", "error"])
def test_a_terminal_is_sent_colours_otherwise(act: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", sys.argv)
    assert COLOUR.search(printed(monkeypatch, {}, ACTS[act]))
