"""`qpsafe campaign show` and `qpsafe campaign worst`: one trial again, and the worst that can be found."""

from __future__ import annotations

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

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.campaign.worst.cases import Encounter
    from qpsafe.sim.campaign.worst.search import Found


def show(
    trial: Annotated[str, typer.Argument(help="Its number, or FILE.json#K: case K that `worst` has written.")],
    controller: Annotated[str, typer.Option(help="Who is to be seen.")] = "default",
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
    made = make_plan(
        plan, seed=seed, robot=robot, motions=motions, sensor=sensor, lag=lag, people=people, controllers=controller
    )
    what = _trial_or_case(trial)
    from qpsafe.sim.campaign.show import show as play  # type: ignore[import-not-found,unused-ignore]

    out.mkdir(parents=True, exist_ok=True)
    row = play(made, what, controller, out)
    if json:
        print_json(row)
    else:
        _show_row(row, screen)
    screen.print(f"written to {out}: {', '.join(sorted(path.name for path in out.iterdir()))}")


def _show_row(row: dict[str, Any], screen: Console) -> None:
    """What came of the trial: what applies to it."""
    from qpsafe.cli.sheet import Sheet
    from qpsafe.sim.campaign.rows import COLUMNS

    sheet = Sheet("What came of it", ("", "value", "unit"), text=(0, 2))
    for column in COLUMNS:
        value = row[column.name]
        if value == value and value != "":  # neither NaN nor empty
            shown = (
                f"{value:.4g}" if column.kind is float else str(value).lower() if column.kind is bool else str(value)
            )
            sheet.add_row(column.name, shown, column.unit.replace("1", ""))
    screen.print(sheet)


def _trial_or_case(text: str) -> int | Encounter:
    """The number of a trial, or a case of a file."""
    from qpsafe.sim.campaign.worst.cases import load_case

    file, _, number = text.rpartition("#")
    if not number.isdecimal():
        expected = "the number of a trial, or FILE.json#K with the number of a case"
        raise ConfigurationError("qpsafe campaign show", "TRIAL", text, expected)
    return load_case(Path(file), int(number)) if file else int(number)


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
    file = out / f"worst-{controller}.json"
    table = cases_to_dict(made, controller, found)
    write_text(file, json_text(table) + "\n")
    if json:
        print_json(table)
    else:
        _show_cases(found, file, controller, made.options(("trials", "controllers")), screen)
    if len(found.unlike) < WANTED:
        raise typer.Exit(1)


def _show_cases(found: Found, file: Path, controller: str, options: str, screen: Console) -> None:
    from qpsafe.cli.sheet import Sheet

    sheet = Sheet(
        f"The worst cases of {controller}", ("case", "contact", "part", "distance [mm]", "closing [m/s]"), (1, 2)
    )
    for number, case in enumerate(found.unlike[:10]):
        row = case.row
        speed = f"{row['closing_speed']:.2f}" if row["contact"] else "-"
        sheet.add_row(str(number), row["contact_class"], row["contact_region"], f"{1e3 * row['distance']:.0f}", speed)
    if sheet.rows:
        screen.print(sheet)
    screen.print(found.sentence)
    command = f"qpsafe campaign show {file}#0 --controller {controller} {options}".rstrip()
    screen.print(f"to see the first one: {command}")
