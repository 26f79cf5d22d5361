"""`qpsafe irc5-faults`: every fault of an IRC5 and its wire, at random moments."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated

import typer

from qpsafe.cli.common import console, progress_bar, show_matrix, verdict
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.irc5.fault_matrix import Result


def irc5_faults(
    moments: Annotated[int, typer.Option(min=1, max=500, help="Number of random moments while the robot moves.")] = 20,
    seed: Annotated[int, typer.Option(min=0, max=2**53, help="Seed of the moments and of the wire.")] = 0,
    jobs: Annotated[
        int, typer.Option(min=1, max=1024, help="Number of processes; by default one per processor.")
    ] = os.cpu_count() or 1,
    json: Annotated[bool, typer.Option("--json", help="Write the result as JSON to standard output.")] = False,
) -> None:
    """Inject loss, delay, restarts, motors off, strangers, junk ... in simulated time; print the matrix of reactions.

    Exit code 1 if a reaction is missing or late, a reference passes a limit, or an exception escapes.
    """
    screen = console(json)
    from qpsafe.robot.loader import load_robot
    from qpsafe.sim.irc5.fault_matrix import run_faults

    with progress_bar(screen) as progress:
        task = progress.add_task(counted(moments, "moment"), total=moments)
        results = run_faults(
            load_robot("irb140"),
            moments,
            seed,
            jobs=jobs,
            progress=lambda done, total: progress.update(task, completed=done, total=total),
        )
    show_matrix(results, show, screen, json)


def show(results: list[Result], screen: Console) -> None:
    """Print the matrix."""
    from rich.text import Text

    from qpsafe.cli.sheet import Sheet

    headings = ("", "fault and promised reaction", "seen", "ticks", "speed", "accel.", "seed", "errors")
    sheet = Sheet("Faults of the robot and its wire, each at every moment", headings, text=(0, 1))
    for r in results:
        sheet.add_row(
            verdict(r.kept, no="NOT"),
            Text.assemble(r.case, "\n  ", (r.promise, "dim")),
            f"{r.seen}/{r.moments}",
            f"{r.slowest}/{r.within}",
            f"{r.step:.3f}",
            f"{r.change:.3f}",
            "exact" if r.seed <= 1e-9 else f"{r.seed:.1e}",
            str(len(r.errors) + r.unpaired),
        )
    screen.print(sheet)
    screen.print(
        "seen: moments in which the reaction came; ticks of 4 ms: slowest, and how many are promised; speed, accel.: "
        "of the reference, largest of what the joint can do; seed: distance from the measured pose of a reference that "
        "starts there; errors: exceptions, and positions that do not go with their speed",
        style="dim",
    )
