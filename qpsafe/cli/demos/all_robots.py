"""`qpsafe demo fixed --robot all`: the first experiment on every bundled robot, in one table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from qpsafe.cli.common import print_json, verdict, write_text
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
    from qpsafe.sim.experiments.fixed.table import RobotRow
    from qpsafe.sim.experiments.shared.report import Report


def every_robot(
    make: Callable[[str], FixedExperiment],
    run: Callable[[FixedExperiment, Path], Report],
    out: Path,
    json: bool,
    screen: Console,
) -> bool:
    """Run the experiment on every bundled robot and show one table.

    Args:
        make: Makes the experiment of a robot.
        run: Runs it and writes its files into a folder.
        out: Gets a folder for each robot, and robots.json.
        json: Whether the table goes to standard output as JSON.
        screen: Where people read.

    Returns:
        Whether every robot kept every promise.
    """
    from qpsafe.robot.loader import bundled_robots
    from qpsafe.sim.experiments.fixed.table import robot_row

    rows = []
    for name in bundled_robots():
        experiment = make(name)
        rows.append(robot_row(experiment.robot, run(experiment, out / name)))
    table = [row.to_dict() for row in rows]
    write_text(out / "robots.json", json_text(table) + "\n")
    if json:
        print_json(table)
    else:
        show_robots(rows, screen)
        screen.print(f"written to {out}: robots.json and a folder for each robot")
    return all(row.kept for row in rows)


def show_robots(rows: list[RobotRow], screen: Console) -> None:
    """Print the table."""
    from qpsafe.cli.sheet import Sheet

    headings = ("robot", "joints", "links", "order", "peak CDF", "limits", "gained, mm", "kept")
    sheet = Sheet("First experiment on every bundled robot", headings)
    for row in rows:
        good, of = row.in_order
        sheet.add_row(
            row.robot,
            str(row.joints),
            str(row.links),
            f"{good} of {of}",
            f"{row.peak:.1f}",
            verdict(row.limits_held, "held", "PASSED"),
            " ".join(f"{1e3 * value:+.0f}" for value in row.gained),
            verdict(row.kept, "yes", "NO"),
        )
    screen.print(sheet)
