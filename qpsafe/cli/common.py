"""What the commands share: options, progress, JSON output."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from qpsafe.errors import ConfigurationError
from qpsafe.text.json_text import json_text
from qpsafe.text.whole_file import whole_file

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress
    from rich.text import Text

    from qpsafe.laws.problem import Law
    from qpsafe.robot.robot import Robot
    from qpsafe.sim.experiments.shared.report import Check


class LawName(StrEnum):
    """Laws that the command line offers."""

    hierarchical = "hierarchical"
    nullspace = "nullspace"
    weighted = "weighted"


class ProjectionName(StrEnum):
    """Projections of the hierarchical law."""

    strict = "strict"
    paper = "paper"


#: What the simulated plant rounds to: its physics step [s].
STEP = 0.001


def whole_steps(context: typer.Context, param: typer.CallbackParam, value: float) -> float:
    """Callback of an option: a time that the plant need not round.

    Args:
        context: The command's.
        param: The option.
        value: What was typed [s].

    Raises:
        ConfigurationError: It is no whole number of its steps.
    """
    if abs(value - STEP * round(value / STEP)) > 1e-9:
        expected = f"a multiple of the plant's step, {STEP} s"
        raise ConfigurationError(context.command_path, param.opts[0], value, expected)
    return value


Lag = Annotated[
    float,
    typer.Option(
        min=0.0, max=0.1, callback=whole_steps,
        help=f"Servo lag of the plant, a multiple of {STEP} [s]; EGM has 0.01 to 0.02.",
    ),
]  # fmt: skip
RobotName = Annotated[str, typer.Option(help="A bundled robot, a robot folder, MJCF or URDF, or PACKAGE:MODEL.")]


class Group(TyperGroup):
    """A group whose help shows the whole first paragraph of each command, wrapped.

    Attributes:
        default: The command that is meant where none is named; none by default.
    """

    default = ""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the default command where none is named."""
        if self.default and not {*args[:1]} & {*self.commands, *ctx.help_option_names}:
            args = [self.default, *args]
        return list(super().parse_args(ctx, args))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write name and first paragraph of every command."""
        rows = [(name, " ".join((c.help or "").split("\n\n")[0].split())) for name, c in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


class SensorName(StrEnum):
    """Sensors that the simulation offers."""

    ideal = "ideal"
    sharp = "sharp"


def load_named(name: str, screen: Console) -> Robot:
    """A robot; what is missing or doubtful in its files is said in a short list, not warned of.

    Args:
        name: What was typed.
        screen: Where it is said.
    """
    from qpsafe.robot.loader import load_quietly

    robot = load_quietly(name)
    say(screen, f"{robot.name}:", robot.notes)
    return robot


def say(screen: Console, heading: str, said: Sequence[str]) -> None:
    """A short list; nothing where there is nothing to say.

    Args:
        screen: Where to.
        heading: Above it.
        said: What was chosen or added, in words.
    """
    if said:
        screen.print(heading, style="yellow")
        for line in said:
            screen.print(f"  {line}", style="yellow")


def make_law(name: LawName, projection: ProjectionName, solver: str | None = None) -> Law:
    """The law of the given name.

    Args:
        name: Which law.
        projection: Of the hierarchical law; the others have none.
        solver: Of the QPs; the law's default if None.
    """
    from qpsafe.laws.by_name import law_named

    return law_named(name.value, projection.value, solver)


def console(json_output: bool) -> Console:
    """Where people read: the screen, or standard error when a program reads standard output.

    Text is plain: brackets and colons in names from files mean nothing, colours are given as styles. With NO_COLOR set
    there are none at all, whatever else is set. Where COLUMNS is 0, 80 are meant.
    """
    from rich.console import Console

    colours = None if os.environ.get("NO_COLOR") else "auto"
    screen = Console(stderr=json_output, markup=False, emoji=False, highlight=False, color_system=colours)  # type: ignore[arg-type]
    if screen.width < 1:
        screen.width = 80
    return screen


def verdict(good: bool, yes: str = "kept", no: str = "NOT kept") -> Text:
    """A word in green, or another one in red.

    Args:
        good: Which of the two.
        yes: The green word.
        no: The red one.
    """
    from rich.text import Text

    return Text(yes, "green") if good else Text(no, "red")


@contextmanager
def progress_bar(screen: Console) -> Iterator[Progress]:
    """A progress bar with time left."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.table import Column

    columns = (  # where room is short, the bar gives way and a long description is wrapped: nothing is cut
        TextColumn("{task.description}", markup=False, table_column=Column()),
        BarColumn(bar_width=20),
        MofNCompleteColumn(table_column=Column(no_wrap=True)),
        TimeElapsedColumn(table_column=Column(no_wrap=True)),
        TimeRemainingColumn(table_column=Column(no_wrap=True)),
    )
    with Progress(*columns, console=screen) as progress:
        yield progress


def show_checks(title: str, checks: Sequence[Check], screen: Console, left_out: Sequence[str] = ()) -> None:
    """Print what was measured beside what was promised, and which promises the run could neither keep nor break.

    Args:
        title: Of the table.
        checks: What was promised and measured.
        screen: Where to.
        left_out: Promises that do not apply to this run, in words.
    """
    from rich.text import Text

    from qpsafe.cli.sheet import Sheet

    sheet = Sheet(title, ("", "", "measured", "promised"), text=range(4))
    for check in checks:
        word = verdict(check.kept) if check.counts else Text("as there" if check.kept else "not as there", "dim")
        sheet.add_row(word, check.name, check.measured, check.promised)
    screen.print(sheet)
    if not all(check.counts for check in checks):
        screen.print("no promise: it depends on distances that were chosen for another robot", style="dim")
    if left_out:
        screen.print("left out, since nothing of the kind happened, or no sensor saw it:", style="yellow")
        for name in left_out:
            screen.print(f"  {name}")


def show_matrix(results: Sequence[Any], show: Callable[[Any, Console], None], screen: Console, as_json: bool) -> None:
    """Print results of cases, as a table or as JSON.

    Args:
        results: Each with `ok`, and what its `to_dict` or `show` needs.
        show: Prints one result.
        screen: Where to.
        as_json: JSON instead.

    Raises:
        typer.Exit: With code 1, a case was not kept.
    """
    import typer

    good = all(result.kept is not False for result in results)  # None: it could show at no moment
    if as_json:
        print_json({"good": good, "cases": [result._asdict() | {"kept": result.kept} for result in results]})
    else:
        show(results, screen)
    if not good:
        raise typer.Exit(1)


def print_json(value: Any) -> None:
    """Write a value to standard output as JSON; nowhere if that is closed."""
    if sys.stdout is not None:
        sys.stdout.write(json_text(value) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")
