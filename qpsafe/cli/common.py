"""What the commands share: options, progress, JSON output."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpsafe.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from qpsafe.laws.problem import Law
    from qpsafe.sim.report import Check


class LawName(StrEnum):
    """Laws that the command line offers."""

    hierarchical = "hierarchical"
    nullspace = "nullspace"
    weighted = "weighted"


class ProjectionName(StrEnum):
    """Projections of the hierarchical law."""

    strict = "strict"
    paper = "paper"


class SensorName(StrEnum):
    """Sensors that the simulation offers."""

    ideal = "ideal"
    sharp = "sharp"


def make_law(name: LawName, projection: ProjectionName, solver: str | None = None) -> Law:
    """The law of the given name."""
    from qpsafe.laws.hierarchical import HierarchicalLaw
    from qpsafe.laws.nullspace import NullspaceLaw
    from qpsafe.laws.weighted import WeightedLaw

    if name is LawName.nullspace:
        return NullspaceLaw()
    if name is LawName.weighted:
        return WeightedLaw(solver=solver)
    return HierarchicalLaw(projection.value, solver=solver)


def console(json_output: bool) -> Console:
    """Where people read: the screen, or standard error when a program reads standard output."""
    from rich.console import Console

    return Console(stderr=json_output)


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

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=screen) as progress:
        yield progress


def show_checks(title: str, checks: Sequence[Check], screen: Console) -> None:
    """Print what was measured beside what was promised."""
    from rich.table import Table

    table = Table(title=title)
    for heading in ("", "", "measured", "promised"):
        table.add_column(heading, overflow="fold")
    for check in checks:
        mark = "[green]kept[/]" if check.kept else "[red]NOT kept[/]"
        table.add_row(mark, check.name, check.measured, check.promised)
    screen.print(table)


def show_matrix(results: Sequence[Any], show: Callable[[Any, Console], None], screen: Console, as_json: bool) -> None:
    """Print results of cases, as a table or as JSON.

    Raises:
        typer.Exit: With code 1, a case was not kept.
    """
    import typer

    good = all(result.kept for result in results)
    if as_json:
        print_json({"good": good, "cases": [result._asdict() | {"kept": result.kept} for result in results]})
    else:
        show(results, screen)
    if not good:
        raise typer.Exit(1)


def print_json(value: Any) -> None:
    """Write a value to standard output as JSON."""
    sys.stdout.write(json_text(value) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    part = path.with_name("." + path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
