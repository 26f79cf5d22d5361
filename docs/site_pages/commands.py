"""A page with what every command says when asked for help."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer.main
from typer.testing import CliRunner

WIDTH = "100"


def paths(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The words of every command, groups before what is in them.

    Args:
        command: As typer makes it.
        words: How it is called.
    """
    yield words
    for name, inner in getattr(command, "commands", {}).items():
        yield from paths(inner, (*words, name))


def write(folder: Path) -> None:
    """Write commands.md.

    Args:
        folder: Of the pages that are made from the code.
    """
    from qpsafe.cli.main import app

    parts = ["# Commands", "What `--help` says, command by command."]
    for words in paths(typer.main.get_command(app)):
        name = " ".join(("qpsafe", *words))
        told = CliRunner().invoke(app, [*words, "--help"], prog_name="qpsafe", env={"COLUMNS": WIDTH, "NO_COLOR": "1"})
        if told.exit_code:
            raise RuntimeError(f"{name} --help: {told.output}")
        parts += [f"{'#' * min(len(words) + 1, 3)} {name}" if words else "", f"```text\n{told.output.strip()}\n```"]
    (folder / "commands.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
