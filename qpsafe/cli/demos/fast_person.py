"""`qpsafe demo fast-person`: somebody walks straight at the robot; contact or not, as one table."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import (
    Lag,
    LawName,
    ProjectionName,
    RobotName,
    console,
    make_law,
    print_json,
    progress_bar,
    say,
    verdict,
    write_text,
)
from qpsafe.cli.demos.any_robot import any_robot
from qpsafe.cli.outputs import output_folder
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.experiments.fast_person import FastRun


class SpotSensor(StrEnum):
    """Ideal distances, or simulated Sharp sensors."""

    ideal = "ideal"
    sharp = "sharp"


def fast_person(
    robot: RobotName = "irb140",
    speed: Annotated[
        list[float] | None, typer.Option(min=0.5, max=2.5, help="Walking speed [m/s]; may be repeated.")
    ] = None,
    experiment: Annotated[list[str] | None, typer.Option(help="Experiment to run; may be repeated.")] = None,
    law: Annotated[LawName, typer.Option(help="Control law.")] = LawName.hierarchical,
    projection: Annotated[
        ProjectionName, typer.Option(help="Projection of the hierarchical law.")
    ] = ProjectionName.strict,
    lag: Lag = 0.0,
    sensor: Annotated[SpotSensor, typer.Option(help="What its spots are.")] = SpotSensor.ideal,
    out: Annotated[Path, typer.Option(help="Folder for the results.", callback=output_folder)] = Path(
        "out/demo-fast-person"
    ),
    video: Annotated[bool, typer.Option(help="Write an mp4 of every run.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Show the runs in MuJoCo's viewer; needs a display.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Write the table as JSON to standard output.")] = False,
) -> None:
    """Somebody walks straight at the robot and only its pedestal stops them: contact or not, and how fast it was.

    A report, not a promise: the exit code is 0 whatever happens, 1 if a run could not be made.
    """
    screen = console(json)
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.cli.demos.watching import observed
    from qpsafe.errors import ConfigurationError
    from qpsafe.sim.experiments.fast_person import EXPERIMENTS, SPEEDS, fast_figure, runs
    from qpsafe.sim.experiments.path.for_robot import line_for
    from qpsafe.sim.experiments.pick_place.for_robot import work_for
    from qpsafe.sim.recording.run_file import StateRecorder, write_run
    from qpsafe.sim.replay.settings import settings_of

    names = tuple(experiment or EXPERIMENTS)
    for name in names:
        if name not in EXPERIMENTS:
            raise ConfigurationError("demo fast-person", "--experiment", name, "one of " + ", ".join(EXPERIMENTS))
    machine = any_robot("qpsafe demo fast-person", robot, out, screen, 4 if names == ("fixed",) else 6)
    for name, suits in (("path", line_for), ("pick-and-place", work_for)):
        if name in names:
            suits(machine)  # what it cannot do is refused before anything is run
    out.mkdir(parents=True, exist_ok=True)
    found: list[FastRun] = []
    told: set[str] = set()
    states = StateRecorder()
    with progress_bar(screen) as progress:

        @contextmanager
        def watched(name: str, speed: float, built: Any) -> Iterator[Any]:
            nonlocal states
            states, label = StateRecorder(), f"{name}, {speed:g} m/s"
            say(screen, "added to its model for the simulation:", [x for x in built.scene.said if x not in told])
            told.update(built.scene.said)
            file = out / f"video-{name}-{speed:g}.mp4"
            with observed(built, file, video, view, screen, progress, label, states) as (observe, _):
                yield observe

        for run in runs(machine, make_law(law, projection), tuple(speed or SPEEDS), names, lag, sensor.value, watched):
            found.append(run)
            file = out / f"run-{run.experiment}-{run.speed:g}.npz"
            write_run(file, run.log, settings_of(run.built), machine, states)
    rows = [run.to_dict() for run in found]
    write_text(out / "table.json", json_text(rows) + "\n")
    fast_figure(found, out / "figure.png")
    if json:
        print_json(rows)
    else:
        show(found, screen)
        screen.print(f"written to {out}: figure.png, table.json, run-*.npz")


def show(found: list[FastRun], screen: Console) -> None:
    """Print the table."""
    from qpsafe.cli.sheet import Sheet

    speeds = ("robot speed [m/s]", "closing [m/s]", "towards [m/s]")
    headings = (
        "run",
        "walks [m/s]",
        "contact",
        "at [s]",
        "smallest distance [mm]",
        "of moving links [mm]",
        *speeds,
        "moving in contact [s]",
        "CDF_n",
    )
    sheet = Sheet("Somebody walks straight at the robot", headings)
    for run in found:
        e = run.encounter
        sheet.add_row(
            run.experiment,
            f"{run.speed:.1f}",
            verdict(e.contact is None, "no", "yes"),
            f"{e.time if e.contact is None else e.contact:.2f}",
            f"{1e3 * e.distance:.0f}",
            f"{1e3 * run.moving_links:.0f}",
            f"{e.robot_speed:.3f}",
            f"{e.closing_speed:.2f}",
            "-" if e.towards_speed is None else f"{e.towards_speed:.2f}",
            f"{e.moving_contact:.2f}",
            f"{e.danger:.0f}",
        )
    screen.print(sheet)
