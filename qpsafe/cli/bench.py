"""`qpsafe bench`: how long things take on this machine."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import console, progress_bar, write_text
from qpsafe.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.laws.problem import Law


def bench(
    ticks: Annotated[int, typer.Option(min=100, help="Number of controller ticks to time.")] = 20_000,
    json: Annotated[Path | None, typer.Option(help="Also write the results to this JSON file.")] = None,
    compile: Annotated[
        bool, typer.Option("--compile", help="Time the compilation instead, from an empty cache.")
    ] = False,
) -> None:
    """Time the danger field and the whole controller tick; compilation excluded, machine named."""
    screen = console(False)
    if compile:
        _compilation(screen, json)
        return
    screen.print("Warming up (the first time, compiling the kernels takes about 15 s) ...", style="dim")
    from rich.table import Table

    from qpsafe.timing import machine, time_danger_field, time_sensing, time_ticks
    from qpsafe.timing_peers import time_mink, time_pink

    with progress_bar(screen) as progress:
        task = progress.add_task("danger field", total=2000)
        field = time_danger_field(2000, partial(progress.advance, task))
        rows = {"danger field, 20 points x 6 links": field}
        task = progress.add_task("sensing", total=5000)
        sensing = time_sensing(5000, partial(progress.advance, task))
        rows["sensing, 20 spots, all filters"] = sensing
        for name, (law, options) in _ticks().items():
            task = progress.add_task(name, total=ticks)
            rows[name] = time_ticks(law, ticks, partial(progress.advance, task), **options)
        task = progress.add_task("mink and pink", total=2 * 5000)
        rows[MINK] = time_mink(5000, partial(progress.advance, task))
        pink = time_pink(5000, partial(progress.advance, task))
        if pink is not None:
            rows["pink.solve_ik + daqp: frame, posture, limits"] = pink
    table = Table(title=f"Wall time [µs], one thread: {machine()['processor']}, Python {machine()['python']}")
    table.add_column("what")
    for heading in ("runs", "median", "p99", "p99.9", "max"):
        table.add_column(heading, justify="right")
    for name, t in rows.items():
        table.add_row(name, str(t.runs), *(f"{1e6 * value:.1f}" for value in (t.median, t.p99, t.p999, t.maximum)))
    screen.print(table)
    ratio = rows[MAIN].median / rows[MINK].median
    screen.print(f"The whole tick takes {ratio:.2f} of mink.solve_ik with daqp (medians of this run).")
    _write(screen, json, {name: t._asdict() for name, t in rows.items()})


def _compilation(screen: Console, json: Path | None) -> None:
    """Table of what each kernel takes to compile, and to load."""
    from rich.table import Table

    from qpsafe.timing_compile import time_compilation

    with screen.status("compiling all kernels from an empty cache, in a process of its own ..."):
        first, later = time_compilation()
    table = Table(title="Processor time of each kernel")
    table.add_column("kernel")
    table.add_column("compiled [s]", justify="right")
    table.add_column("from the cache [ms]", justify="right")
    for name, taken in sorted(first.kernels.items(), key=lambda item: -item[1]):
        table.add_row(name, f"{taken:.2f}", f"{1e3 * later.kernels[name]:.0f}")
    table.add_section()
    table.add_row("the whole process, imports included", f"{first.processor:.1f}", f"{1e3 * later.processor:.0f}")
    table.add_row("the same on the clock", f"{first.wall:.1f}", f"{1e3 * later.wall:.0f}")
    screen.print(table)
    _write(screen, json, {"empty cache": first._asdict(), "from the cache": later._asdict()})


def _write(screen: Console, path: Path | None, results: dict[str, Any]) -> None:
    """The results in a file, with the machine."""
    if path is not None:
        from qpsafe.timing import machine

        write_text(path, json_text({"machine": machine(), "unit": "s", "results": results}) + "\n")
        screen.print(f"written to {path}")


#: What a robot with its own sensors runs; everything else is beside it.
MAIN = "whole tick, 20 distances"
MINK = "mink.solve_ik + daqp: frame, posture, limits"


def _ticks() -> dict[str, tuple[Law, dict[str, Any]]]:
    """Ticks to time: law and options of `time_ticks`. The hierarchical law is strict where nothing else is said."""
    from qpsafe.laws.hierarchical import HierarchicalLaw
    from qpsafe.laws.nullspace import NullspaceLaw
    from qpsafe.laws.weighted import WeightedLaw

    return {
        MAIN: (HierarchicalLaw(), {}),
        f"{MAIN}, garbage collector on": (HierarchicalLaw(), {"collector": "on"}),
        f"{MAIN}, collector on after gc.freeze": (HierarchicalLaw(), {"collector": "frozen"}),
        "whole tick, 20 points given": (HierarchicalLaw(), {"points": True}),
        f"{MAIN}, paper's projection": (HierarchicalLaw("paper"), {}),
        f"{MAIN}, weighted law": (WeightedLaw(), {}),
        f"{MAIN}, null-space law": (NullspaceLaw(), {}),
    }
