"""What was found of a program, in a table; and what to do about it, for commands that are about to run one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpsafe.cli.common import verdict
from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.check.check import PathCheck


def show(result: PathCheck, title: str, screen: Console) -> None:
    """Print what was found as a table.

    Args:
        result: What was found.
        title: Of the table.
        screen: Where to.
    """
    from rich.text import Text

    from qpsafe.check.report import TITLES, words
    from qpsafe.cli.sheet import Sheet

    sheet, kept = Sheet(title, ("", "", "found"), text=range(3)), result.kept
    for name, said in words(result).items():
        good = kept[name]
        word = Text("-", "dim") if good is None else verdict(good, "good", "NOT good")
        sheet.add_row(word, TITLES[name], said.replace("; ", "\n"))
    screen.print(sheet)


def refuse_or_warn(where: str, program: Path | None, result: PathCheck, unchecked: bool, screen: Console) -> None:
    """Refuse a program that cannot be run as it is planned, or, where that is wanted, only say so.

    Args:
        where: The command.
        program: The file; None where the robot keeps its pose.
        result: What was found.
        unchecked: Whether it is to be run all the same.
        screen: Where warnings go.

    Raises:
        ConfigurationError: It cannot, with all that is wrong in words.
    """
    if result.good:
        return
    from qpsafe.check.report import troubles

    wrong: Any = troubles(result)
    if not unchecked:
        key, value = ("--cell", "the robot's home pose") if program is None else ("--program", str(program))
        expected = f"what can be run as planned, or --unchecked; {'; '.join(wrong)}"
        raise ConfigurationError(where, key, value, expected)
    for line in wrong:
        screen.print(line, style="bold yellow")
