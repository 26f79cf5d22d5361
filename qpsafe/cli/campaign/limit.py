"""`qpsafe campaign limit`: what the arm could have reached in a trial, or in all contacts of a campaign."""

from __future__ import annotations

import os
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
    one_trial,
    planned,
)
from qpsafe.cli.common import console, print_json
from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.campaign.limit.row import Limit

WHERE = "qpsafe campaign limit"


@planned
def limit(
    *,
    trial: Annotated[
        str, typer.Argument(help="Trial number; FILE.json#K: case K written by `worst`; or a campaign's folder.")
    ],
    controller: Annotated[
        str | None, typer.Option(help="Controller to begin from; by default that of the case, or `default`.")
    ] = None,
    plan: FileOption = None,
    typed: Typed,
    evaluations: Annotated[
        int | None, typer.Option(min=100, max=1_000_000, help="Motions to try per trial; 800 by default.")
    ] = None,
    workers: Workers = WORKERS,
    dask: Dask = None,
    json: Json = False,
) -> None:
    """Search for the best motion of the arm with foresight, from the first detection on: was the contact avoidable?

    Same state, same joint limits; how people move is known. What is found is a lower bound of what is possible. With
    a campaign's folder: all contacts of one controller; what is found is kept there, the same command goes on where it
    was stopped, and the report takes it in.
    """
    screen = console(json)
    from qpsafe.sim.campaign.limit.search import EVALUATIONS

    tries = evaluations or EVALUATIONS
    if os.path.isdir(trial):  # unlike Path.is_dir, False for what cannot be a name
        for key, value in {"file": plan, **typed}.items():
            if value is not None:
                raise ConfigurationError(WHERE, f"--{key}", value, "nothing: the folder has its own plan")
        with executor_at(dask) as executor:
            search = {"executor": executor, "workers": workers, "evaluations": tries}
            _folder(Path(trial), "default" if controller is None else controller, search, screen, json)
        return
    one = one_trial(WHERE, trial, plan, typed, controller, ", or a campaign's folder")
    from qpsafe.sim.campaign.limit.limit import limit_of

    found = limit_of(one.plan, one.what, one.controller, tries).limit
    if json:
        print_json(found.to_dict())
    else:
        _show(found, screen)


def _show(found: Limit, screen: Console) -> None:
    """What was possible in one trial."""
    from qpsafe.cli.sheet import Sheet

    sheet = Sheet("What was possible", ("", "mm"), text=(0,))
    for name, value in (
        (f"smallest distance, {found.controller}", found.distance),
        ("without control", found.alone),
        ("best motion found, with foresight", found.limit),
        ("no motion can exceed", found.fixed),
    ):
        if value == value:  # no NaN
            sheet.add_row(name, f"{1e3 * value:.0f}")
    screen.print(sheet)
    if found.first_sight == found.first_sight:
        screen.print(f"first detection after {found.first_sight:.2f} s; {found.evaluations:,} motions were tried")
    if found.reached == found.reached:
        gained = f"{100.0 * found.reached:.0f} %"
        screen.print(f"of the distance that could be gained over no control {found.controller} gained {gained}")
    screen.print(found.sentence)


def _folder(folder: Path, controller: str, search: dict[str, Any], screen: Console, json: bool) -> None:
    """All contacts of a controller in a campaign's folder.

    Args:
        folder: The campaign's.
        controller: Whose contacts.
        search: More arguments of `limits_of`.
        screen: Where to.
        json: Whether to print JSON.
    """
    from qpsafe.sim.campaign.limit.folder import limits_of
    from qpsafe.sim.campaign.report.limits import limits_summary

    try:
        with counting("contacts", screen) as count:
            found = limits_of(folder, controller, progress=count, **search)
    except KeyboardInterrupt:
        screen.print(f"what was found is kept in {folder}: the same command goes on there", style="yellow")
        raise
    said = limits_summary(found)
    if json:
        print_json({"controller": controller, **said, "trials": [item.to_dict() for item in found]})
        return
    _show_summary(controller, said, screen)
    screen.print(f"into the report: qpsafe campaign report {shlex.quote(str(folder))}", soft_wrap=True)


def _show_summary(controller: str, said: dict[str, Any], screen: Console) -> None:
    from qpsafe.cli.sheet import Sheet
    from qpsafe.sim.campaign.report.limits import MEASURES

    sheet = Sheet(f"Contacts of {controller}, and the best motion with foresight", ("", "value", "unit"), text=(0, 2))
    for measure in MEASURES:
        sheet.add_row(measure.title, measure.shown(said), measure.unit.replace("1", ""))
    screen.print(sheet)
