"""`qpsafe demo pick-and-place`: the third experiment, one day in pictures or many in numbers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qpsafe.cli.common import (
    Lag,
    LawName,
    ProjectionName,
    RobotName,
    SensorName,
    console,
    make_law,
    print_json,
    progress_bar,
    say,
    show_checks,
    write_text,
)
from qpsafe.cli.demos.any_robot import any_robot
from qpsafe.cli.outputs import output_folder
from qpsafe.text.json_text import json_text
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment, PickRun
    from qpsafe.sim.experiments.pick_place.report import PickFigures
    from qpsafe.sim.experiments.shared.report import Check


def pick_and_place(
    robot: RobotName = "irb140",
    seed: Annotated[
        int, typer.Option(min=0, max=2**53, help="Seed of where, when and how fast people go; 0 is nominal.")
    ] = 0,
    seeds: Annotated[
        int, typer.Option(min=1, max=10_000, help="Number of seeds to run, from --seed on; prints the spread.")
    ] = 1,
    cycles: Annotated[int, typer.Option(min=1, max=100, help="Screws to carry in each run.")] = 10,
    people: Annotated[
        Path | None, typer.Option(help="TOML file of a story; by default the bundled two people.")
    ] = None,
    program: Annotated[Path | None, typer.Option(help="TOML file of the program that the tool follows.")] = None,
    unchecked: Annotated[
        bool, typer.Option("--unchecked", help="Run a program even if `qpsafe check` rejects it.")
    ] = False,
    lag: Lag = 0.0,
    law: Annotated[LawName, typer.Option(help="Control law.")] = LawName.hierarchical,
    projection: Annotated[
        ProjectionName,
        typer.Option(help="Projection of the hierarchical law: paper reproduces (22), strict is lexicographic."),
    ] = ProjectionName.strict,
    solver: Annotated[str | None, typer.Option(help="Solver of the QPs; by default the project's own.")] = None,
    sensor: Annotated[
        SensorName, typer.Option(help="Perfect distances, or simulated Sharp sensors.")
    ] = SensorName.ideal,
    jobs: Annotated[
        int, typer.Option(min=1, max=1024, help="Number of processes; by default one per processor.")
    ] = os.cpu_count() or 1,
    out: Annotated[Path, typer.Option(help="Folder for the results.", callback=output_folder)] = Path(
        "out/demo-pick-and-place"
    ),
    video: Annotated[bool, typer.Option(help="Write an mp4 of the first run; needs OpenGL.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Show the first run in MuJoCo's viewer.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Write the report as JSON to standard output.")] = False,
) -> None:
    """Third experiment: carry screws from a support into a box while two people take screws and bring new ones.

    The first seed runs in full, with snapshots, figure and csv; further seeds and the run without people give the cost.
    """
    screen = console(json)
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.check.check import check_path
    from qpsafe.cli.check import refuse_or_warn
    from qpsafe.cli.demos.watching import forget
    from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
    from qpsafe.sim.experiments.pick_place.for_robot import ROBOT
    from qpsafe.sim.experiments.pick_place.plots import seeds_figure
    from qpsafe.sim.experiments.pick_place.report import figures, promises, to_dict
    from qpsafe.sim.experiments.pick_place.seeds import run_seeds
    from qpsafe.sim.experiments.pick_place.settings import PEOPLE
    from qpsafe.sim.world.known import known_obstacles

    make_law(law, projection, solver)  # what is wrong there is said before a minute is spent
    if robot != ROBOT:
        screen.print("looking for a layout of the cell that suits the arm (up to a minute) ...", style="dim")
    machine = any_robot("qpsafe demo pick-and-place", robot, out, screen, picks=program is None)
    experiment = PickPlaceExperiment(
        machine,
        make_law(law, projection, solver),
        seed=seed,
        cycles=cycles,
        people_file=PEOPLE if people is None else people,
        program=program,
        lag=lag,
        sensor=sensor.value,
    )
    if experiment.robot.name != ROBOT:
        say(screen, "cell chosen for it:", [experiment.work.sentence])
    say(screen, "added to its model for the simulation:", experiment.scene.said)
    # wrong files are refused before anything is written or run
    length = experiment.reference.duration / len(experiment.cell.holes)
    names = [person.name for person in experiment.people]
    screen.print(f"a cycle takes {length:.1f} s by the program; {' and '.join(names)} come", style="dim")
    check = check_path(experiment.robot, experiment.reference, known=known_obstacles(experiment.scene))
    refuse_or_warn("qpsafe demo pick-and-place", program, check, unchecked, screen)
    out.mkdir(parents=True, exist_ok=True)
    with progress_bar(screen) as progress:
        run = _first(experiment, out, video, view, screen, progress)
        others: list[int | None] = [None, *range(seed + 1, seed + seeds)]
        task = progress.add_task("without people" + (f", and seeds to {others[-1]}" if seeds > 1 else ""), total=seeds)
        found = run_seeds(experiment, others, jobs, lambda count: progress.update(task, completed=count))
    alone, runs = found[0], [figures(run, seed), *found[1:]]
    checks = promises(runs, alone, cycles)
    result = to_dict(runs, alone, checks)
    files = _write(experiment, run, out, screen)
    if seeds > 1:
        seeds_figure(runs, alone, out / "seeds.png")
        files.append("seeds.png")
    else:
        forget(out / "seeds.png", screen)
    write_text(out / "report.json", json_text(result) + "\n")
    if json:
        print_json(result)
    else:
        show(runs, alone, checks, screen)
        screen.print(f"written to {out}: {', '.join([*files, 'report.json'])}")
    if not result["kept"]:
        raise typer.Exit(1)


def _first(
    experiment: PickPlaceExperiment, out: Path, video: bool, view: bool, screen: Console, progress: object
) -> PickRun:
    """The run that is shown, filmed if wanted."""
    from qpsafe.cli.demos.watching import observed
    from qpsafe.sim.recording.run_file import StateRecorder, write_run
    from qpsafe.sim.replay.settings import settings_of

    label, states = f"seed {experiment.seed}, 250 Hz", StateRecorder()
    with observed(experiment, out / "video.mp4", video, view, screen, progress, label, states) as (observer, _):  # type: ignore[arg-type]
        run = experiment.run(observer)
    write_run(out / "run.npz", run.log, settings_of(experiment), experiment.robot, states)
    return run


def _write(experiment: PickPlaceExperiment, run: PickRun, out: Path, screen: Console) -> list[str]:
    """Write csv, figure and snapshots, each whole or not at all; returns their names."""
    from qpsafe.cli.demos.watching import forget
    from qpsafe.sim.drawing.gl import gl_available
    from qpsafe.sim.experiments.pick_place.plots import timeline
    from qpsafe.sim.experiments.pick_place.snapshots import draw

    run.log.write_csv(out / "signals.csv")
    names = [person.name for person in experiment.people]
    timeline(run, names, out / "figure.png", f"Third experiment, seed {experiment.seed}")
    files = ["signals.csv", "figure.png", "run.npz"]
    available, reason = gl_available()
    if not available:
        screen.print(f"no snapshots: {reason}", style="yellow")
    elif draw(experiment, run, out / "snapshots.png"):
        files.append("snapshots.png")
    if "snapshots.png" not in files:
        forget(out / "snapshots.png", screen)
    return files


def show(runs: Sequence[PickFigures], alone: PickFigures, checks: Sequence[Check], screen: Console) -> None:
    """Print figures and promises as tables.

    Args:
        runs: Figures of every seed.
        alone: Those of the run without people.
        checks: What was promised and measured.
        screen: Where to.
    """
    from qpsafe.cli.sheet import Sheet
    from qpsafe.sim.experiments.pick_place.report import cost, spread

    counts = ("delivered", "missed", "lost", "taken", "placed")
    sheet = Sheet("Third experiment: screws", ("seed", *counts, "all cycles, s", "cost, s/cycle"))
    for item in (alone, *runs):
        numbers = (item.delivered, item.missed, item.lost, item.taken, item.placed)
        extra = "-" if item is alone else f"{cost(item, alone):.2f}"
        sheet.add_row(_seed(item, alone), *map(str, numbers), f"{item.duration:.1f}", extra)
    screen.print(sheet)
    headings = ("seed", "nearest, m", "moving, m", "contacts", "tables, mm", "suspended", "largest CDF_n")
    sheet = Sheet("Third experiment: safety", headings)
    for item in (alone, *runs):
        gaps = ("-" if item is alone else f"{value:.3f}" for value in (item.nearest, item.nearest_moving))
        rest = (str(item.contacts), f"{1e3 * item.clearance:.1f}", str(item.suspensions), f"{item.danger:.1f}")
        sheet.add_row(_seed(item, alone), *gaps, *rest)
    screen.print(sheet)
    costs = spread([cost(item, alone) for item in runs])
    cycle = alone.duration / max(len(alone.cycle_times), 1)
    text = f"a cycle takes {cycle:.2f} s without people; with them it costs {costs['median']:.2f} s more"
    if len(runs) > 1:
        text += (
            f" (median of {counted(len(runs), 'seed')}; quartiles {costs['quartile_1']:.2f} and "
            f"{costs['quartile_3']:.2f}, range {costs['smallest']:.2f} to {costs['largest']:.2f})"
        )
    screen.print(text)
    show_checks("What the runs should show", checks, screen)


def _seed(item: PickFigures, alone: PickFigures) -> str:
    return "nobody" if item is alone else str(item.seed)
