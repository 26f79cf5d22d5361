"""`qpsafe check`: whether a program can be run as planned; and the same for commands that are about to run one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import RobotName, console, load_named, print_json, verdict, write_text
from qpsafe.cli.outputs import output_folder
from qpsafe.errors import ConfigurationError
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.check.check import PathCheck


def check(
    program: Annotated[Path, typer.Argument(help="TOML file of the program that the tool follows.")],
    robot: RobotName = "irb140",
    cell: Annotated[Path | None, typer.Option(help="TOML file of the furniture in the cell.")] = None,
    clearance: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Smallest distance to furniture that is accepted [m].")
    ] = 0.004,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the report and a plot over time.", callback=output_folder)
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the report as JSON to standard output.")] = False,
) -> None:
    """Check a program before anything moves: reach, joint limits, singular poses, furniture, the robot itself, sensors.

    Exit code 1 if it cannot be run as it is planned.
    """
    screen = console(json)
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.check.check import check_path
    from qpsafe.check.report import to_dict
    from qpsafe.sensing.cell_file import load_cell
    from qpsafe.tasks.program_file import ProgramError, load_program

    found, known = load_named(robot, screen), () if cell is None else load_cell(cell)
    names = {"program": str(program), "cell": None if cell is None else str(cell)}
    try:
        plan = load_program(program, found)
    except ProgramError as problem:  # not to be read, or out of reach
        if json:
            print_json({"good": False, "robot": found.name, **names, "checks": {}, "error": str(problem)})
        raise
    result = check_path(found, plan, known=known, clearance=clearance)
    report = names | to_dict(result)
    if out is not None:
        from qpsafe.sim.drawing.checks import check_figure

        out.mkdir(parents=True, exist_ok=True)
        check_figure(result, out / "check.png", f"{program.name}, {found.name}")
        write_text(out / "check.json", json_text(report) + "\n")
    if json:
        print_json(report)
    else:
        show(result, program.name, screen)
        if out is not None:
            screen.print(f"written to {out}: check.png, check.json")
    if not result.good:
        raise typer.Exit(1)


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
