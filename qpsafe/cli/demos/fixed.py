"""`qpsafe demo fixed`: the first experiment in MuJoCo."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from qpsafe.cli.common import (
    Lag,
    LawName,
    ProjectionName,
    console,
    make_law,
    print_json,
    progress_bar,
    say,
    show_checks,
    write_text,
)
from qpsafe.cli.demos.any_robot import any_robot
from qpsafe.cli.demos.watching import observed
from qpsafe.cli.outputs import output_folder
from qpsafe.errors import ConfigurationError
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
    from qpsafe.sim.experiments.shared.report import Report
    from qpsafe.sim.recording.log import RunLog


def fixed(
    robot: Annotated[
        str,
        typer.Option(help="A bundled robot, a robot folder, MJCF or URDF; 'all': a table over all bundled ones."),
    ] = "irb140",
    law: Annotated[LawName, typer.Option(help="Control law.")] = LawName.hierarchical,
    projection: Annotated[
        ProjectionName,
        typer.Option(help="Projection of the hierarchical law: paper reproduces (22), strict is lexicographic."),
    ] = ProjectionName.strict,
    solver: Annotated[str | None, typer.Option(help="Solver of the QPs; by default the project's own.")] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**53, help="Seed of how the person moves; 0 is nominal.")] = 0,
    lag: Lag = 0.0,
    duration: Annotated[
        float | None, typer.Option(min=0.1, max=600.0, help="Length of the run [s]; 60, or the story's.")
    ] = None,
    sensor: Annotated[
        str,
        typer.Option(
            help="ideal: perfect distances at the spots; sharp: simulated Sharp sensors; vl53l5cx: arrays of 8x8 zones "
            "in their place; depth: a depth camera in the cell. Joined by +, as sharp+depth, several are there; "
            "vl53l5cx-ideal and depth-ideal have no noise."
        ),
    ] = "ideal",
    cap: Annotated[
        float | None, typer.Option(min=0.1, help="Cap the danger field at this value; by default there is no cap.")
    ] = None,
    spots: Annotated[
        str | None,
        typer.Option(help="Other sensors: a file in the robot's folder, such as spots-by-hand.toml, or a path."),
    ] = None,
    story: Annotated[Path | None, typer.Option(help="TOML file of a story, instead of the paper's.")] = None,
    parameters: Annotated[
        str | None,
        typer.Option(help="paper: the paper's, as without --story; robot: those of the robot's file, as with it."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.", callback=output_folder)] = Path("out/demo-fixed"),
    video: Annotated[bool, typer.Option(help="Write an mp4; needs OpenGL.")] = True,
    view: Annotated[bool, typer.Option("--view", help="Show the run in MuJoCo's viewer; needs a display.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Write the report as JSON to standard output.")] = False,
) -> None:
    """First experiment: keep a fixed tool pose while a person with a card board comes from three sides."""
    from qpsafe.cli.demos.all_robots import every_robot

    screen = console(json)
    if spots is not None and robot == "all":
        raise ConfigurationError("qpsafe demo fixed", "spots", spots, "one robot, not 'all': sensors fit one robot")
    if parameters not in (None, "paper", "robot"):
        raise ConfigurationError("qpsafe demo fixed", "--parameters", parameters, "paper or robot")
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.sim.experiments.encounter import encounter
    from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
    from qpsafe.sim.experiments.fixed.stage import robot_stage
    from qpsafe.sim.ranging.sets import sensor_kinds
    from qpsafe.sim.stories.file import load_story

    make_law(law, projection, solver)  # what is wrong there is said before anything is loaded
    if sensor_kinds(sensor).spots == "perfect":
        raise ConfigurationError(
            "qpsafe demo fixed", "sensor", sensor, "sensors: a run is remembered by their readings"
        )
    if story is not None:
        load_story(story)  # a wrong one is refused before anything is written

    def make(name: str) -> FixedExperiment:
        chosen = any_robot("qpsafe demo fixed", name, out, screen, joints=4)
        chosen = chosen if spots is None else chosen.with_spots(spots)
        told = None if story is None else load_story(story, floor=-robot_stage(chosen).pedestal)
        return FixedExperiment(
            chosen,
            make_law(law, projection, solver),
            seed=seed,
            lag=lag,
            duration=duration or (60.0 if told is None else told.duration),
            story=told,
            sensor=sensor,
            cap=cap,
            parameters=parameters,
        )

    title = f"{law.value} law" + (f", {projection.value} projection" if law is LawName.hierarchical else "")
    title += "" if sensor == "ideal" else f", sensors {sensor}"
    title += "" if parameters is None else f", parameters: {parameters}"
    if robot == "all":

        def run(experiment: FixedExperiment, folder: Path) -> Report:
            return _once(experiment, title, folder, video, view, screen)[0]

        kept = every_robot(make, run, out, json, screen)
    else:
        experiment = make(robot)
        report, log, files = _once(experiment, title, out, video, view, screen)
        kept, near = report.kept, encounter(log, experiment)
        if json:
            print_json(report.to_dict() | {"sensor": sensor, "encounter": near.to_dict()})
        else:
            show(report, title, screen)
            if story is not None:
                screen.print(near.sentence())
            screen.print(f"written to {out}: {', '.join(files)}")
    if not kept:
        raise typer.Exit(1)


def _once(
    experiment: FixedExperiment, title: str, out: Path, video: bool, view: bool, screen: Console
) -> tuple[Report, RunLog, list[str]]:
    """One run with its files."""
    out.mkdir(parents=True, exist_ok=True)
    files = ["signals.csv", "figure.png", "distance.png", "report.json", "run.npz"]
    log, filmed = _run(experiment, out, video, view, screen)
    if filmed:
        files.append("video.mp4")
    return _write(experiment, log, title, out), log, files


def _run(experiment: FixedExperiment, out: Path, video: bool, view: bool, screen: Console) -> tuple[RunLog, bool]:
    """Run with a progress bar, filmed if possible, and write the run's file."""
    from qpsafe.sim.recording.run_file import StateRecorder, write_run
    from qpsafe.sim.replay.settings import settings_of

    label, states = f"{experiment.robot.name}, {experiment.duration:g} s, 250 Hz", StateRecorder()
    say(screen, "added to its model for the simulation:", experiment.scene.said)
    with (
        progress_bar(screen) as progress,
        observed(experiment, out / "video.mp4", video, view, screen, progress, label, states) as (observer, filmed),
    ):
        log = experiment.run(observer)
    write_run(out / "run.npz", log, settings_of(experiment), experiment.robot, states)
    return log, filmed


def _write(experiment: FixedExperiment, log: RunLog, title: str, out: Path) -> Report:
    """Write csv, figures and report, each whole or not at all."""
    from qpsafe.danger.thresholds import robot_activation
    from qpsafe.sim.drawing.plots import distance_figure, figure_11
    from qpsafe.sim.drawing.stories import encounter_figure
    from qpsafe.sim.experiments.fixed.stage import robot_stage
    from qpsafe.sim.experiments.shared.report import summarise

    without = experiment.board_distance_without_controller()
    tuned = robot_stage(experiment.robot).listed
    within, kept = experiment.moving_links(log)
    report = summarise(log, kept, experiment.walk.windows, experiment.robot, tuned=tuned, within=within)
    log.write_csv(out / "signals.csv")
    activation = robot_activation(experiment.robot)
    figure_11(log, out / "figure.png", f"First experiment, {experiment.robot.name}, {title}", activation)
    if experiment.story is None:
        distance_figure(log, without, out / "distance.png")
    else:
        encounter_figure(log, out / "distance.png")
    write_text(out / "report.json", json_text(report.to_dict() | {"sensor": experiment.sensor}) + "\n")
    return report


def show(report: Report, title: str, screen: Console) -> None:
    """Print the report as tables.

    Args:
        report: What was measured.
        title: Of the first table.
        screen: Where to.
    """
    from rich.text import Text

    from qpsafe.cli.sheet import Sheet

    sheet = Sheet(
        f"First experiment, {title}: largest errors in each regime, commanded and measured pose",
        ("danger", "from, s", "to, s", "CDF_n", "error, mm", "error, rad", "meas., mm", "meas., rad"),
    )
    colours = {"low": "green", "medium": "yellow", "high": "red"}
    for row in report.regimes:
        sheet.add_row(
            Text(row.regime, colours.get(row.regime, "")),
            f"{row.entered:.2f}",
            f"{row.left:.2f}",
            f"{row.cdf_n:.2f}",
            f"{1e3 * row.position_error:.3f}",
            f"{row.orientation_error:.4f}",
            f"{1e3 * row.measured_position_error:.3f}",
            f"{row.measured_orientation_error:.4f}",
        )
    screen.print(sheet)

    if report.approaches:
        headings = ("approach [s]", "with controller [m]", "without [m]", "gained [m]")
        sheet = Sheet("Smallest true distance between links that move and board", headings, text=())
        for approach in report.approaches:
            gained = approach.with_controller - approach.without_controller
            numbers = (approach.with_controller, approach.without_controller, gained)
            sheet.add_row(f"{approach.start:.1f} to {approach.end:.1f}", *(f"{value:.3f}" for value in numbers))
        screen.print(sheet)

    show_checks("What the run should show", report.checks, screen, report.left_out)
    position, orientation = report.tracking
    screen.print(
        f"largest gap between commanded and measured tool pose: {1e3 * position:.2f} mm, {orientation:.4f} rad; "
        f"ticks with a message: {report.unusual[0]}" + (f" (mostly: {report.unusual[1]})" if report.unusual[0] else "")
    )
