"""`qpsafe campaign` and `qpsafe campaign report`: play trials, judge them, write the report."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.campaign.options import (
    WORKERS,
    Dask,
    File,
    Json,
    Typed,
    Workers,
    counting,
    executor_at,
    make_plan,
    planned,
)
from qpsafe.cli.common import console, print_json, write_text
from qpsafe.cli.outputs import output_folder
from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.runner import Results


@planned
def run(
    *,
    file: File = None,
    quick: Annotated[bool, typer.Option("--quick", help="12 trials, a minute; only --out keeps them.")] = False,
    trials: Annotated[int | None, typer.Option(help="Number of trials; 3,000 by default.")] = None,
    controllers: Annotated[str | None, typer.Option(help="Controllers to compare, separated by commas.")] = None,
    typed: Typed,
    workers: Workers = WORKERS,
    dask: Dask = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for trials and report; by default a folder in out/ named after the plan.",
            callback=output_folder,
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Play a campaign: in every trial the same people meet the robot under every controller, one after the other.

    Trials that are finished are kept in the folder: the same command goes on where it was stopped. Results do not
    depend on how many processes play them. Exit code 1 if a controller passes a limit, gives a bad command, or is
    worse for people than no control.
    """
    screen = console(json)
    from qpsafe.sim.campaign.plan import QUICK
    from qpsafe.sim.campaign.runner import run_campaign

    plan = make_plan(
        file,
        trials=QUICK if quick and trials is None else trials,
        controllers=controllers,
        **typed,
    )
    folder = Path("out") / f"campaign-{plan.digest()[:8]}" if out is None and not quick else out
    with executor_at(dask) as executor, _kept(folder, screen), counting("trials", screen) as count:
        results = run_campaign(
            plan,
            folder,
            executor,
            count,
            workers=workers,
            notice=lambda text: screen.print(text, style="yellow"),
        )
    _report(results, folder, screen, json)


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of a campaign.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the report; by default the campaign's.", callback=output_folder)
    ] = None,
    json: Json = False,
) -> None:
    """Judge and report again what a folder holds, be it finished or not.

    Exit code 1 as by the campaign.
    """
    screen = console(json)
    from qpsafe.sim.campaign.runner import stored_results

    _report(stored_results(folder), out or folder, screen, json, folder)


@contextmanager
def _kept(folder: Path | None, screen: Console) -> Iterator[None]:
    """Say how to go on, whatever ended it."""
    try:
        yield
    except (ConfigurationError, MissingExtraError):
        raise  # it has not begun
    except BaseException:
        if folder is None:
            screen.print("nothing is kept without --out", style="yellow")
        elif any(folder.glob("trials-*.parquet")):
            text = f"finished trials are kept in {folder}: the same command goes on there"
            screen.print(text, style="yellow")
            text = f"to judge what there is: qpsafe campaign report {shlex.quote(str(folder))}"
            screen.print(text, style="yellow", soft_wrap=True)
        raise


def _report(
    results: Results, folder: Path | None, screen: Console, json: bool, trials: Path | None = None
) -> None:  # fmt: skip
    """Judge, write, print; exit code 1 if there are faults.

    Args:
        results: What there is.
        folder: For the report; None for none.
        screen: Where to.
        json: Whether to print JSON.
        trials: Folder of the trials, if it is another one.
    """
    from qpsafe.sim.campaign.limit.folder import stored_limits
    from qpsafe.sim.campaign.report.page import report_page
    from qpsafe.sim.campaign.report.summary import summary

    kept = trials or folder
    limits = {} if kept is None else stored_limits(kept, results)
    with counting("resampling", screen) as count:
        found = summary(results, count, _speed(results.plan), limits)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / "report.json", json_text(found) + "\n")
        write_text(folder / "report.html", report_page(results, found))
    if json:
        print_json(found)
    else:
        show_table(found, screen)
        if folder is not None:
            screen.print(f"written to {folder}: report.html, report.json")
    if found["findings"]:
        raise typer.Exit(1)


def _speed(plan: Plan) -> float | None:
    """Of the engine in this plan's encounters; None where its files have gone since."""
    from qpsafe.sim.campaign.speed import engine_speed

    try:
        return engine_speed(plan, trials=3).engine
    except (ConfigurationError, OSError):
        return None


#: Measures of the printed table, besides contacts.
_SHOWN = (
    *("moving", "towards", "over_limit", "furniture", "self"),
    *("distance_median", "distance_p10", "energy_p95", "lost_time_mean", "suspensions_mean"),
)


def show_table(found: dict[str, Any], screen: Console) -> None:
    """Print controllers by measures, comparisons with the first reference, and faults."""
    from qpsafe.cli.sheet import Sheet
    from qpsafe.sim.campaign.report.measures import MEASURES, percent

    measures = [MEASURES[name] for name in _SHOWN]
    done = found["trials"]["finished"]
    title = f"{done:,} of {found['trials']['planned']:,} trials, contacts with limits at 95 %"
    sheet = Sheet(title, ("controller", "contacts", "", *(m.heading for m in measures)))
    for name, controller in found["controllers"].items():
        low, high = controller["intervals"]["contacts"]
        values = (m.cells(controller)[0].partition(" ")[0] for m in measures)  # counts without their shares
        sheet.add_row(name, f"{controller['contacts']:,}", f"{percent(low)}-{percent(high)} %", *values)
    screen.print(sheet)
    for reference in found["references"][:1]:
        _show_differences(found, reference, screen)
    for fault in found["findings"]:
        screen.print(fault, style="red")


def _show_differences(found: dict[str, Any], reference: str, screen: Console) -> None:
    """Contacts, distance and lost time, less those of a reference."""
    from qpsafe.cli.sheet import Sheet
    from qpsafe.sim.campaign.report.measures import MEASURES

    items = {(i["controller"], i["measure"]): i for i in found["comparisons"] if i["reference"] == reference}
    measures = [MEASURES[name] for name in ("distance_median", "lost_time_mean")]
    heads = [text for m in measures for text in (m.heading, "95 %", "p")]
    title = f"Less {reference}, trial by trial, p corrected for all comparisons"
    sheet = Sheet(title, ("controller", "contacts more", "fewer", "p", *heads))
    for name in dict.fromkeys(controller for controller, _ in items):
        touched = items[name, "contacts"]
        cells = [f"{touched['only_controller']:,}", f"{touched['only_reference']:,}", f"{touched['p_holm']:.2g}"]
        for measure in measures:
            cells += [*measure.difference(items[name, measure.name]), f"{items[name, measure.name]['p_holm']:.2g}"]
        sheet.add_row(name, *cells)
    if sheet.rows:
        screen.print(sheet)
