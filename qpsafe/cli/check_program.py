"""`qpsafe check`: whether a program can be run as planned."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from qpsafe.cli.check import show
from qpsafe.cli.common import RobotName, console, load_named, print_json, write_text
from qpsafe.cli.demos.any_robot import ready_name
from qpsafe.cli.outputs import output_folder
from qpsafe.text.json_text import json_text


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

    known = () if cell is None else load_cell(cell)
    found = load_named(ready_name("qpsafe check", robot, screen), screen)
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
