"""`qpsafe campaign show` and `qpsafe campaign worst`: one trial again, and the worst that can be found."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.campaign.options import (
    WORKERS,
    Dask,
    Lag,
    Motions,
    People,
    Robot,
    Seed,
    Sight,
    Workers,
    executor_at,
    make_plan,
)
from qpsafe.cli.common import console, print_json, progress_bar, write_text
from qpsafe.cli.outputs import output_folder
from qpsafe.errors import ConfigurationError
from qpsafe.text.json_text import json_text
from qpsafe.text.words import file_word

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.campaign.worst.cases import Case
    from qpsafe.sim.campaign.worst.search import Found


def show(
    trial: Annotated[str, typer.Argument(help="Its number, or FILE.json#K: case K that `worst` has written.")],
    controller: Annotated[
        str | None, typer.Option(help="Who is to be seen; by default the one of a case, or `default`.")
    ] = None,
    plan: Annotated[Path | None, typer.Option("--file", help="The plan's file, if it has one.")] = None,
    seed: Seed = None,
    robot: Robot = None,
    motions: Motions = None,
    sensor: Sight = None,
    lag: Lag = None,
    people: People = None,
    out: Annotated[Path, typer.Option(help="Folder for video and table.", callback=output_folder)] = Path(
        "out/campaign-show"
    ),
    json: Annotated[bool, typer.Option("--json", help="Write the trial's row as JSON to standard output.")] = False,
) -> None:
    """Play one trial again in the full MuJoCo scene: a video, and a table of all its ticks."""
    screen = console(json)
    case, label = _case(trial)
    if controller is None:
        controller = case.controller if case else "default"
    if case is not None and plan is not None:
        raise ConfigurationError("qpsafe campaign show", "--file", str(plan), "none: a case has its plan with it")
    made = make_plan(
        case.plan if case else plan, seed=seed, robot=robot, motions=motions, sensor=sensor, lag=lag, people=people,
        controllers=controller,
    )  # fmt: skip
    what = case.encounter if case else int(trial)
    from qpsafe.sim.campaign.show import show as play

    with progress_bar(screen) as progress:
        task = progress.add_task("ticks", total=None)
        shown = play(
            made, what, controller, out, label=label,
            notice=lambda text: screen.print(text, style="yellow"),
            progress=lambda done, total: progress.update(task, completed=done, total=total),
        )  # fmt: skip
    if json:
        print_json(shown.row)
    else:
        _show_row(shown.row, screen)
    screen.print(f"written to {out}: {', '.join(path.name for path in shown.files)}", soft_wrap=True)


#: Columns that say nothing without a contact, besides those that are NaN then.
OF_CONTACT = ("contact_class", "contact_region", "contact_frame", "moving", "towards", "clamped", "near_seen")


def _show_row(row: dict[str, Any], screen: Console) -> None:
    """What came of the trial: what applies to it."""
    from qpsafe.cli.sheet import Sheet
    from qpsafe.sim.campaign.rows import COLUMNS

    sheet = Sheet("What came of it", ("", "value", "unit"), text=(0, 2))
    for column in COLUMNS:
        value = row[column.name]
        beside = column.name in OF_CONTACT and not row["contact"]
        if value == value and not beside:  # no NaN
            shown = (
                f"{value:.4g}" if column.kind is float else str(value).lower() if column.kind is bool else str(value)
            )
            sheet.add_row(column.name, shown, column.unit.replace("1", ""))
    screen.print(sheet)


def _case(text: str) -> tuple[Case | None, str]:
    """The case of a file and a name for what is written of it; None where the number of a trial is meant."""
    from qpsafe.sim.campaign.worst.cases import load_case

    file, _, number = text.rpartition("#")
    if not number.isdecimal():
        expected = "the number of a trial, or FILE.json#K with the number of a case"
        raise ConfigurationError("qpsafe campaign show", "TRIAL", text, expected)
    return (load_case(Path(file), int(number)), f"{Path(file).stem}-{number}") if file else (None, "")


def worst(
    controller: Annotated[str, typer.Argument(help="Whose worst case.")],
    trials: Annotated[int, typer.Option(min=1, help="For the search, and as many again at random.")] = 2000,
    plan: Annotated[Path | None, typer.Option("--file", help="A plan, see docs/files.md.")] = None,
    seed: Seed = None,
    robot: Robot = None,
    motions: Motions = None,
    sensor: Sight = None,
    lag: Lag = None,
    people: People = None,
    workers: Workers = WORKERS,
    dask: Dask = None,
    out: Annotated[Path, typer.Option(help="Folder for the cases.", callback=output_folder)] = Path(
        "out/campaign-worst"
    ),
    json: Annotated[bool, typer.Option("--json", help="Write the cases as JSON to standard output.")] = False,
) -> None:
    """Search for the worst encounter of a controller, among all that the model of people allows, by CMA-ES.

    Exit code 1 if the search could not find ten cases nearer than 50 mm that random trials did not.
    """
    screen = console(json)
    from qpsafe.sim.campaign.worst.cases import cases_to_dict, find_worst
    from qpsafe.sim.campaign.worst.search import WANTED

    made = make_plan(
        plan, seed=seed, robot=robot, motions=motions, sensor=sensor, lag=lag, people=people, controllers=controller
    )
    with executor_at(dask) as executor, progress_bar(screen) as progress:
        task = progress.add_task("trials", total=None)
        found = find_worst(
            made,
            controller,
            trials,
            executor,
            lambda done, total: progress.update(task, completed=done, total=total),
            workers=workers,
        )
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"worst-{file_word(controller)}.json"
    table = cases_to_dict(made, controller, found)
    write_text(file, json_text(table) + "\n")
    if json:
        print_json(table)
    else:
        _show_cases(found, file, controller, screen)
    if len(found.new) < WANTED:
        raise typer.Exit(1)


def _show_cases(found: Found, file: Path, controller: str, screen: Console) -> None:
    from qpsafe.cli.sheet import Sheet

    sheet = Sheet(
        f"The worst cases of {controller}", ("case", "contact", "part", "distance [mm]", "closing [m/s]"), (1, 2)
    )
    for number, case in enumerate(found.new[:10]):
        row = case.row
        speed = f"{row['closing_speed']:.2f}" if row["contact"] else "-"
        sheet.add_row(str(number), row["contact_class"], row["contact_region"], f"{1e3 * row['distance']:.0f}", speed)
    if sheet.rows:
        screen.print(sheet)
    screen.print(found.sentence)
    if sheet.rows:
        screen.print(f"to see the first one: qpsafe campaign show {shlex.quote(str(file))}#0")
