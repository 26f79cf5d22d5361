"""`qpsafe campaign show` and `qpsafe campaign worst`: one trial again, and the worst that can be found."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.campaign.options import (
    WORKERS,
    Dask,
    FileOption,
    Json,
    Typed,
    Workers,
    counting,
    executor_at,
    make_plan,
    one_trial,
    planned,
)
from qpsafe.cli.common import console, print_json, write_text
from qpsafe.cli.outputs import output_folder
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.campaign.worst.search import Found


@planned
def show(
    *,
    trial: Annotated[str, typer.Argument(help="Trial number, or FILE.json#K: case K written by `worst`.")],
    controller: Annotated[
        str | None, typer.Option(help="Controller to show; by default that of the case, or `default`.")
    ] = None,
    plan: FileOption = None,
    typed: Typed,
    out: Annotated[Path, typer.Option(help="Folder for the video and the table.", callback=output_folder)] = Path(
        "out/campaign-show"
    ),
    json: Json = False,
) -> None:
    """Play one trial again in the full MuJoCo scene: a video, and a table of all its ticks."""
    screen = console(json)
    one = one_trial("qpsafe campaign show", trial, plan, typed, controller)
    from qpsafe.sim.campaign.show import show as play

    with counting("ticks", screen) as count:
        shown = play(
            one.plan, one.what, one.controller, out, label=one.label, progress=count,
            notice=lambda text: screen.print(text, style="yellow"),
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
    from qpsafe.sim.campaign.trials.rows import COLUMNS

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


@planned
def worst(
    *,
    controller: Annotated[str, typer.Argument(help="Controller whose worst case is wanted.")],
    trials: Annotated[
        int, typer.Option(min=1, max=10_000_000, help="Trials for the search, and as many again at random.")
    ] = 2000,
    plan: FileOption = None,
    typed: Typed,
    workers: Workers = WORKERS,
    dask: Dask = None,
    out: Annotated[Path, typer.Option(help="Folder for the cases.", callback=output_folder)] = Path(
        "out/campaign-worst"
    ),
    json: Json = False,
) -> None:
    """Search for the worst encounter of a controller, among all that the model of people allows, by CMA-ES.

    Exit code 1 if the search could not find ten cases nearer than 50 mm that random trials did not.
    """
    screen = console(json)
    from qpsafe.sim.campaign.digests import file_name_of
    from qpsafe.sim.campaign.worst.cases import cases_to_dict, find_worst
    from qpsafe.sim.campaign.worst.search import WANTED

    made = make_plan(plan, "qpsafe campaign worst", **typed, controllers=(controller,))
    with executor_at(dask) as executor, counting("trials", screen) as count:
        found = find_worst(made, controller, trials, executor, count, workers=workers)
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"worst-{file_name_of(controller)}.json"
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
        screen.print(f"to see the first one: qpsafe campaign show {shlex.quote(str(file))}#0", soft_wrap=True)
