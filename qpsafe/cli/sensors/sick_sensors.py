"""`qpsafe sick-sensors`: every sick-sensor case, injected in closed loop at random moments."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated

import typer

from qpsafe.cli.common import console, progress_bar, show_matrix, verdict
from qpsafe.errors import ConfigurationError
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.sick.matrix import Result

WHERE = "qpsafe sick-sensors"


def sick_sensors(
    moments: Annotated[
        int, typer.Option(min=1, max=200, help="Number of random moments in the first experiment.")
    ] = 20,
    seed: Annotated[
        int, typer.Option(min=0, max=2**53, help="Seed of the moments and of the spots that fall sick.")
    ] = 0,
    sensor: Annotated[
        str,
        typer.Option(
            help="The healthy sensors: ideal or sharp spots, or vl53l5cx, sharp+depth and so on, as in `qpsafe demo "
            "fixed`, whose images are spoilt then."
        ),
    ] = "ideal",
    jobs: Annotated[
        int, typer.Option(min=1, max=1024, help="Number of processes; by default one per processor.")
    ] = os.cpu_count() or 1,
    json: Annotated[bool, typer.Option("--json", help="Write the result as JSON to standard output.")] = False,
) -> None:
    """Inject NaN, spikes, stuck, stale, dead sensors in the first experiment and print the matrix of reactions.

    Exit code 1 if a reaction listed in docs/reference (sensing.md, vl53l5cx.md) is missing or late, a limit is
    exceeded, or the robot touches something that it would not have touched with healthy sensors.
    """
    screen = console(json)
    from qpsafe.robot.loader import load_robot
    from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
    from qpsafe.sim.ranging.sets import sensor_kinds
    from qpsafe.sim.sick.matrix import run_matrix

    try:
        kinds = sensor_kinds(sensor)
    except ConfigurationError as wrong:
        raise ConfigurationError(WHERE, "--sensor", sensor, wrong.expected) from None
    if kinds.spots == "perfect":
        raise ConfigurationError(WHERE, "--sensor", sensor, "sensors that can fall sick, such as ideal or sharp")
    experiment = FixedExperiment(load_robot("irb140"), sensor=sensor)

    with progress_bar(screen) as progress:
        task = progress.add_task(counted(moments, "moment"), total=None)
        results = run_matrix(
            experiment,
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

    headings = ("", "case and promised reaction", "moments", "ticks", "contacts", "limits", "nearest, m")
    sheet = Sheet("Sick sensors in the first experiment, each case at every moment", headings, text=(0, 1))
    for r in results:
        late = f" ({r.missing} missing)" if r.missing else ""
        sheet.add_row(
            Text("not tried", "yellow") if r.kept is None else verdict(r.kept, no="NOT"),
            Text.assemble(r.case, "\n  ", (r.promise, "dim")),
            f"{r.applied}/{r.moments}",
            f"{r.slowest}/{r.within}{late}" if r.applied else f"-/{r.within}",
            str(r.contacts),
            "kept" if r.passed <= 1e-9 else f"{r.passed:.1e}",
            Text.assemble(f"{r.nearest:.3f}\n", (f"{r.nearest_healthy:.3f}", "dim")),
        )
    screen.print(sheet)
    screen.print(
        "moments: those where the case can show; ticks of 4 ms: slowest reaction and how many are promised; nearest: "
        "smallest distance to board or person with the fault, and without",
        style="dim",
    )
