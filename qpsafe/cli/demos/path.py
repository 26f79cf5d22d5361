"""`qpsafe demo path`: the second experiment with three laws side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import Lag, RobotName, console, print_json, progress_bar, say, show_checks, write_text
from qpsafe.cli.demos.any_robot import any_robot
from qpsafe.cli.outputs import output_folder
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.laws.problem import Law
    from qpsafe.sim.experiments.path.report import PathFigures
    from qpsafe.sim.experiments.shared.report import Check


def path(
    robot: RobotName = "irb140",
    seed: Annotated[int, typer.Option(min=0, max=2**53, help="Seed of how the person moves; 0 is nominal.")] = 0,
    lag: Lag = 0.0,
    duration: Annotated[
        float | None, typer.Option(min=3.0, max=600.0, help="Length of each run [s]; 45, or the story's.")
    ] = None,
    program: Annotated[Path | None, typer.Option(help="TOML file of the program that the tool follows.")] = None,
    unchecked: Annotated[
        bool, typer.Option("--unchecked", help="Run a program even if `qpsafe check` rejects it.")
    ] = False,
    solver: Annotated[str | None, typer.Option(help="Solver of the QPs; by default the project's own.")] = None,
    story: Annotated[Path | None, typer.Option(help="TOML file of a story, instead of the bundled one.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.", callback=output_folder)] = Path("out/demo-path"),
    video: Annotated[bool, typer.Option(help="Write an mp4 of the first run; needs OpenGL.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Show the first run in MuJoCo's viewer.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Write the report as JSON to standard output.")] = False,
) -> None:
    """Second experiment: follow a line back and forth while a person with a card board comes and goes.

    Four runs: the hierarchical law (strict, and with the paper's projection), the null-space law, and strict without
    suspension and recovery.
    """
    screen = console(json)
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.check.check import check_path
    from qpsafe.cli.check import refuse_or_warn
    from qpsafe.cli.demos.watching import observed
    from qpsafe.danger.thresholds import robot_activation
    from qpsafe.laws.hierarchical import HierarchicalLaw
    from qpsafe.laws.nullspace import NullspaceLaw
    from qpsafe.recovery.recovery import RecoveryRules
    from qpsafe.sim.drawing.plots import figure_11
    from qpsafe.sim.experiments.encounter import encounter
    from qpsafe.sim.experiments.fixed.stage import robot_stage
    from qpsafe.sim.experiments.path.experiment import ROBOT, PathExperiment
    from qpsafe.sim.experiments.path.plots import side_by_side
    from qpsafe.sim.experiments.path.report import figures, promises, to_dict
    from qpsafe.sim.recording.run_file import StateRecorder, write_run
    from qpsafe.sim.replay.settings import settings_of
    from qpsafe.sim.stories.file import load_story
    from qpsafe.sim.world.known import known_obstacles

    if story is not None:
        load_story(story)  # a wrong one is refused before anything is written
    machine, strict = any_robot("qpsafe demo path", robot, out, screen), HierarchicalLaw(solver=solver)
    told = None if story is None else load_story(story, floor=-robot_stage(machine).pedestal)
    length = duration or (45.0 if told is None else told.duration)
    laws: dict[str, Law] = {
        "strict": strict,
        "paper": HierarchicalLaw("paper", solver=solver),
        "nullspace": NullspaceLaw(),
        "strict, no recovery": strict,
    }
    experiments = {
        name: PathExperiment(
            machine,
            law,
            seed=seed,
            lag=lag,
            duration=length,
            story=told,
            recovery=RecoveryRules(enabled=False) if "no recovery" in name else None,
            program=program,
        )
        for name, law in laws.items()
    }
    first = experiments["strict"]
    cycle = first.reference.duration  # a wrong program is refused before anything is written or run
    say(screen, "added to its model for the simulation:", first.scene.said)
    screen.print(f"{first.program_name}: one cycle takes {cycle:.1f} s", style="dim")
    check = check_path(machine, first.reference, known=known_obstacles(first.scene))
    refuse_or_warn("qpsafe demo path", program, check, unchecked, screen)
    out.mkdir(parents=True, exist_ok=True)
    runs, found, near = {}, {}, {}
    with progress_bar(screen) as progress:
        for name, experiment in experiments.items():
            shown, states = (video and name == "strict", view and name == "strict"), StateRecorder()
            film = out / ("video.mp4" if name == "strict" else f"video-{name}.mp4")  # the others are not filmed
            with observed(experiment, film, *shown, screen, progress, name, states) as (observer, _):
                runs[name] = experiment.run_path(observer)
            found[name] = figures(runs[name], machine)
            near[name] = encounter(runs[name].log, experiment)
            tag = name.replace(", ", "-").replace(" ", "-")
            runs[name].log.write_csv(out / f"signals-{tag}.csv")
            write_run(out / f"run-{tag}.npz", runs[name].log, settings_of(experiment), machine, states)
    others = {name: found[name] for name in ("paper", "nullspace")}
    tuned = machine.name == ROBOT
    checks, left_out = promises(found["strict"], found["strict, no recovery"], others, tuned=tuned)
    if told is not None:  # the other promises are about the bundled people
        checks, left_out = [check for check in checks if "largest step" in check.name], []
    result = to_dict(found, checks, left_out) | {"encounters": {name: item.to_dict() for name, item in near.items()}}
    title = f"Second experiment, {machine.name}, hierarchical law, strict projection"
    figure_11(runs["strict"].log, out / "figure.png", title, robot_activation(first.robot))
    side_by_side({name: run for name, run in runs.items() if "," not in name}, first.robot, out / "side-by-side.png")
    write_text(out / "report.json", json_text(result) + "\n")
    if json:
        print_json(result)
    else:
        show(found, checks, left_out, screen)
        if told is not None:
            for name, item in near.items():
                screen.print(f"{name}: {item.sentence()}")
        files = "figure.png, side-by-side.png, report.json, signals-*.csv, run-*.npz"
        screen.print(f"written to {out}: {files}")
    if not result["kept"]:
        raise typer.Exit(1)


def show(found: dict[str, PathFigures], checks: list[Check], left_out: list[str], screen: Console) -> None:
    """Print figures and promises as tables.

    Args:
        found: Figures of each law, by its name.
        checks: What was promised and measured.
        left_out: Promises that do not apply to this run, in words.
        screen: Where to.
    """
    from qpsafe.cli.sheet import Sheet

    def shown(value: float | None, form: str, size: float = 1.0) -> str:
        return "-" if value is None else format(size * value, form)

    rows: list[tuple[str, Any]] = [
        (
            "on the line, low danger, constant speed: orientation error [rad]",
            lambda f: shown(f.line_orientation, ".2g"),
        ),
        ("... position error [mm]", lambda f: shown(f.line_position, ".3f", 1e3)),
        ("along the line, medium danger: position error [mm]", lambda f: shown(f.medium_position, ".3f", 1e3)),
        ("largest step of q̇ [a_max dt]", lambda f: f"{f.step:.6f}"),
        ("ticks clipped to the limits", lambda f: str(f.clipped)),
        ("on the way back: joint speed [limit]", lambda f: shown(f.return_speed, ".3f")),
        ("... joint acceleration [limit]", lambda f: shown(f.return_acceleration, ".3f")),
        ("... joint speed, evasion braked [limit]", lambda f: shown(f.smooth_speed, ".3f")),
        ("... joint acceleration, evasion braked [limit]", lambda f: shown(f.smooth_acceleration, ".3f")),
        ("path goes on at [mm] from where it stopped", lambda f: shown(f.resumed, ".3f", 1e3)),
        ("suspensions", lambda f: str(f.suspensions)),
        ("path travelled [s]", lambda f: f"{f.travelled:.2f}"),
    ]
    sheet = Sheet("Second experiment: largest figures of each run", ("", *found))
    for label, text in rows:
        sheet.add_row(label, *(text(item) for item in found.values()))
    screen.print(sheet)
    show_checks("What the runs should show", checks, screen, left_out)
