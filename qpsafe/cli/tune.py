"""`qpsafe tune`: the parameters of a controller for one's own robot and work, by a search that is judged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.campaign.options import WORKERS, Dask, Json, Workers, counting, executor_at, make_plan
from qpsafe.cli.common import RobotName, console, print_json, progress_bar, write_text
from qpsafe.cli.outputs import output_folder
from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.extras import require
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.tuning.journal import Journal
    from qpsafe.sim.tuning.judge import Judged
    from qpsafe.sim.tuning.result import Tuned
    from qpsafe.sim.tuning.search import Progress, Search

WHERE = "qpsafe tune"
JOURNAL, JUDGED = "search.jsonl", "judged"


def tune(
    robot: RobotName = "irb140",
    program: Annotated[
        Path | None, typer.Option(help="TOML file of its work; by default hold, line and pick, in turn.")
    ] = None,
    cell: Annotated[Path | None, typer.Option(help="TOML file of the furniture in the cell.")] = None,
    people: Annotated[
        Path | None, typer.Option(help="TOML file with a model of people or a story, or a folder of these.")
    ] = None,
    trials: Annotated[
        int, typer.Option(min=1, max=10_000_000, help="How many values to try, the present ones among them.")
    ] = 400,
    minutes: Annotated[float | None, typer.Option(min=0.0, help="No more are begun after this time.")] = None,
    seed: Annotated[int, typer.Option(help="Number of the search, 0 to 99: of its people and all else random.")] = 0,
    prefer: Annotated[str, typer.Option(help="What is chosen of the front: safety, balanced or work.")] = "balanced",
    finals: Annotated[
        int,
        typer.Option(
            min=0, max=10_000_000, help="New encounters by which the choice is made among the best; 0 for none."
        ),
    ] = 972,
    judge: Annotated[
        int, typer.Option(min=0, max=10_000_000, help="Encounters that judge the choice; 0 for none.")
    ] = 1200,
    workers: Workers = WORKERS,
    dask: Dask = None,
    write: Annotated[
        bool, typer.Option("--write", help="Write the values into the robot's own robot.toml if they are better.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the result; by default one in out/ named after the plan.", callback=output_folder
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Search for better parameters of the controller among people at random, and judge them by others.

    What is found is written to a copy of the robot's folder (its present values, where nothing speaks for others), with
    a report. The search goes on where it was stopped by the same command. Exit code 1 if with the values found it
    touches furniture or itself more often than with the present ones, or passes a joint limit; more harm or more work
    lost is in the report only.
    """
    screen = console(json)
    require("tune", WHERE, "optuna", "pyarrow")
    from qpsafe.robot.loader import load_quietly
    from qpsafe.sim.experiments.shared.folder import check_place
    from qpsafe.sim.tuning.finals import MOST as FINALS
    from qpsafe.sim.tuning.front import PREFERENCES
    from qpsafe.sim.tuning.robot_file import check_writing
    from qpsafe.sim.tuning.search import MOST, Search

    if prefer not in PREFERENCES:
        raise ConfigurationError(WHERE, "--prefer", prefer, "one of " + ", ".join(PREFERENCES))
    if not 0 <= seed <= MOST:
        raise ConfigurationError(WHERE, "--seed", seed, f"a whole number from 0 to {MOST}")
    if finals > FINALS:
        raise ConfigurationError(WHERE, "--finals", finals, f"at most {FINALS:,}")
    if write:
        _own(robot)
    plan = _plan(robot, program, cell, people)
    search = Search(plan, seed)
    folder = Path("out") / f"tune-{search.plan.digest()[:8]}" if out is None else out
    for copy in ("robot", JUDGED):  # where copies with the values go
        check_place(load_quietly(plan.robot), folder / copy)
    check_writing(load_quietly(plan.robot))
    with executor_at(dask) as executor, _kept(folder, screen):
        crew = {"executor": executor, "workers": workers}
        journal = _searched(search, trials, folder, minutes, screen, crew)
        found = _chosen(search, journal, finals, prefer, screen, crew)
        judged = _judged(found, folder, judge, screen, crew)
    _report(found, judged, folder, screen, json)
    if write:
        _written(found, judged, screen)
    if judged is not None and judged.new_faults:
        raise typer.Exit(1)


def _plan(robot: str, program: Path | None, cell: Path | None, people: Path | None) -> Plan:
    """The encounters' plan; errors name this command's options."""
    if program is not None and not (program.suffix == ".toml" and program.is_file()):
        raise ConfigurationError(WHERE, "--program", str(program), "a program's TOML file that is there")
    motions = None if program is None else str(program)
    given = {"robot": robot, "motions": motions, "people": people, "cell": cell}
    return make_plan(None, WHERE, **given)


def _own(robot: str) -> None:
    """Refuse to write into the package, and into a folder that the next run of a bare model makes anew."""
    from qpsafe.robot.loader import bundled_robots, find_robot

    if find_robot(robot).suffix != ".toml":
        expected = "--robot with the folder of a robot of your own: `qpsafe robots add` makes one of a model file"
        raise ConfigurationError(WHERE, "--write", robot, expected)
    if robot in bundled_robots():
        expected = "--robot with the folder of a robot of your own: the bundled ones are part of the package"
        raise ConfigurationError(WHERE, "--write", robot, expected)


def _searched(
    search: Search, trials: int, folder: Path, minutes: float | None, screen: Console, crew: dict[str, Any]
) -> Journal:
    """Search with a progress bar that shows the present front.

    Args:
        search: Which.
        trials: How many.
        folder: Of its journal.
        minutes: At most.
        screen: Where to.
        crew: Who plays.
    """
    from qpsafe.sim.tuning.search import run_search

    screen.print("Loading (the first time, compiling the kernels takes a minute) ...", style="dim")
    with progress_bar(screen) as bar:
        return run_search(
            search, trials, folder / JOURNAL, progress=_shown(bar, trials), minutes=minutes,
            notice=_notice(screen), **crew,
        )  # fmt: skip


def _chosen(
    search: Search, journal: Journal, encounters: int, prefer: str, screen: Console, crew: dict[str, Any]
) -> Tuned:
    """Choose, by the finals if there are any.

    Args:
        search: Which.
        journal: Of it.
        encounters: Of the finals; none for 0.
        prefer: What is chosen.
        screen: Where to.
        crew: Who plays.
    """
    from qpsafe.sim.tuning.finals import finalists, run_finals
    from qpsafe.sim.tuning.result import Tuned

    met = []
    if encounters and finalists(journal.trials):
        with counting("runs of the finals", screen) as count:
            met = run_finals(search, journal, encounters, progress=count, notice=_notice(screen), **crew)
    return Tuned.of(search, search.space(), journal, prefer, met)


def _notice(screen: Console) -> Callable[[str], None]:
    return lambda text: screen.print(text, style="yellow")


def _shown(bar: Any, trials: int) -> Progress:
    from qpsafe.sim.tuning.trial import front_of

    task = bar.add_task("trials", total=None)

    def show(done: int, journal: Any) -> None:
        best = [trial.score for trial in front_of(journal.trials)]
        said = "trials"
        if best:
            harms, lost = (f"{getattr(best[0], key):.4g} to {getattr(best[-1], key):.4g}" for key in ("harm", "lost"))
            said = f"trials; front: harm {harms}, lost {lost} s"
        if bar.tasks[0].total is None:
            bar.reset(task, completed=done, total=trials, description=said)
        else:
            bar.update(task, completed=min(done, trials), description=said)

    return show


def _judged(found: Tuned, folder: Path, encounters: int, screen: Console, crew: dict[str, Any]) -> Judged | None:
    """Judge what a copy of the robot's folder says that states the chosen values.

    Args:
        found: Of the search.
        folder: For the copy and the trials.
        encounters: How many; none for 0.
        screen: Where to.
        crew: Who plays.
    """
    from qpsafe.robot.loader import load_quietly
    from qpsafe.sim.tuning.judge import judge
    from qpsafe.sim.tuning.robot_file import write_folder

    plan = found.search.plan
    if encounters == 0 or found.chosen.number == 0:
        return None
    copy = write_folder(load_quietly(plan.robot), found.space.at(found.chosen.point), found.run, folder / JUDGED)
    with counting("encounters that judge", screen) as count:
        return judge(plan, copy, encounters, folder, progress=count, **crew)


@contextmanager
def _kept(folder: Path, screen: Console) -> Iterator[None]:
    """Say how to go on, whatever ended it."""
    try:
        yield
    except (ConfigurationError, MissingExtraError):
        raise
    except BaseException:
        if (folder / JOURNAL).exists():
            screen.print(f"finished trials are kept in {folder}: the same command goes on there", style="yellow")
        raise


def _report(found: Tuned, judged: Judged | None, folder: Path, screen: Console, json: bool) -> None:
    """Write and print what was found.

    Args:
        found: Of the search.
        judged: The judgement, if there was one.
        folder: For the report.
        screen: Where to.
        json: Whether to print JSON.
    """
    from qpsafe.sim.tuning.page import tuning_page
    from qpsafe.sim.tuning.result import result
    from qpsafe.sim.tuning.robot_file import write_choice

    said, copy = result(found, judged), write_choice(found, judged, folder)
    write_text(folder / "tune.json", json_text(said) + "\n")
    write_text(folder / "tune.html", tuning_page(said))
    if json:
        print_json(said)
        return
    _show(said, screen)
    screen.print(f"written to {folder}: tune.html, tune.json, {copy}", soft_wrap=True)


def _show(said: dict[str, Any], screen: Console) -> None:
    from qpsafe.cli.sheet import Sheet

    sheet = Sheet(
        "The front" if said["finals"] is None else "The front, among new people", ("", "harm", "work lost [s]")
    )
    for name, point in (("present", said["present"]), *((f"trial {p['number']}", p) for p in said["front"])):
        chosen = " *" if name != "present" and point["number"] == said["chosen"]["number"] else ""
        sheet.add_row(name + chosen, f"{point['harm']:.4f}", f"{point['lost']:.3f}")
    screen.print(sheet)
    if said["sensitivity"]:
        for key, title in (("harm", "harm"), ("lost", "work lost")):
            most = sorted(said["sensitivity"][key].items(), key=lambda item: -item[1])[:4]
            screen.print(f"matters for {title}: " + ", ".join(f"{name} {100 * share:.0f} %" for name, share in most))
    judged = said["judgement"]
    worst = judged is not None and bool(judged["new_faults"])
    screen.print(said["sentence"], style="red" if worst else "green", soft_wrap=True)


def _written(found: Tuned, judged: Judged | None, screen: Console) -> None:
    """Into the robot's own file, if the judgement says that they are worth it."""
    from qpsafe.robot.loader import find_robot, load_quietly
    from qpsafe.sim.tuning.robot_file import write_values

    file = find_robot(found.search.plan.robot)
    if judged is None or not judged.worth:
        screen.print(f"{file} stays as it is: nothing surely better was found", style="yellow", soft_wrap=True)
        return
    write_values(file, load_quietly(file.parent), found.space.at(found.chosen.point), found.run)
    screen.print(f"written into {file}", soft_wrap=True)
