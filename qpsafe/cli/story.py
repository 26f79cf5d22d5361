"""`qpsafe story`: check a story, say who does what when, draw it from above."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from qpsafe.cli.common import console, print_json
from qpsafe.cli.outputs import DRAWN, output_file


def story(
    file: Annotated[Path, typer.Argument(help="TOML file of a story.")],
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw paths and footprints from above to this PNG file.", callback=output_file(*DRAWN)),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the times as JSON to standard output.")] = False,
) -> None:
    """Check a story of people around the robot, and say when who does what.

    Exit code 1 if it is wrong; the message names line, key and what was expected.
    """
    from qpsafe.sim.stories.file import load_story

    screen, told = console(json), load_story(file)
    rows = [
        {"person": actor.name, "from": round(step.start, 3), "to": round(step.end, 3), "does": step.do}
        for actor in told.people
        for step in actor.steps
    ]
    if plot is not None:
        from qpsafe.sim.drawing.stories import plan_figure

        plan_figure(told, plot)
    if json:
        events = [{"time": time, "person": name, "event": event} for time, name, event in told.events]
        print_json({"duration": told.duration, "steps": rows, "events": events})
        return
    from qpsafe.cli.sheet import Sheet

    sheet = Sheet(told.table.title or file.name, ("who", "from [s]", "to [s]", "does"), text=(0, 3))
    for row in rows:
        sheet.add_row(str(row["person"]), f"{row['from']:.2f}", f"{row['to']:.2f}", str(row["does"]))
    screen.print(sheet)
    screen.print(f"{told.duration:.2f} s" + (f"; drawn into {plot}" if plot else ""))
