"""`qpsafe bench`: how long things take on this machine."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import console, print_json, progress_bar, write_text
from qpsafe.cli.outputs import output_file
from qpsafe.text.json_text import json_text

if TYPE_CHECKING:
    from rich.console import Console

    from qpsafe.bench.clock import Times
    from qpsafe.bench.compilation import Start


def bench(
    ticks: Annotated[int, typer.Option(min=100, max=10_000_000, help="Number of controller ticks to time.")] = 20_000,
    out: Annotated[
        Path | None, typer.Option(help="Also write the results to this JSON file.", callback=output_file(".json"))
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the results as JSON to standard output.")] = False,
    compile: Annotated[bool, typer.Option("--compile", help="Time compilation instead, from an empty cache.")] = False,
) -> None:
    """Time the danger field and the whole controller tick; compilation excluded, machine named."""
    screen = console(json)
    if compile:
        _compilation(screen, out, json)
        return
    screen.print("Warming up (the first time, compiling the kernels takes a minute or two) ...", style="dim")
    from qpsafe.bench.clock import machine, time_rows
    from qpsafe.bench.peers import MINK, PINK, mink_row, pink_row
    from qpsafe.bench.ticks import rows

    timed = {**rows(), MINK: mink_row()}
    pink = pink_row()
    if pink is not None:
        timed[PINK] = pink
    with progress_bar(screen) as progress:
        task = progress.add_task("timing, block by block", total=len(timed) * ticks)
        times = time_rows(timed, ticks, peer=MINK, progress=partial(progress.advance, task))
        progress.add_task("the campaign's engine, and MuJoCo with the controller in a loop", total=None)
        from qpsafe.sim.campaign.speed import engine_speed

        speed = engine_speed(mujoco=True)
    if not json:
        show(times, machine(), screen)
        screen.print(
            f"Encounters, simulated seconds a second of one core: engine {speed.engine:.0f}, with planning what people "
            f"do {speed.planned:.0f}, MuJoCo in a loop {speed.mujoco:.1f}; ratio {speed.ratio:.0f}"
        )
    content = {name: t._asdict() for name, t in times.items()}
    _write(screen, out, json, content, {**speed._asdict(), "ratio": speed.ratio})


def show(times: dict[str, Times], machine: dict[str, str], screen: Console) -> None:
    """Print the percentiles and ratios.

    Args:
        times: Of every row that was timed.
        machine: What it was timed on, by name.
        screen: Where to.
    """
    from qpsafe.cli.sheet import Sheet

    title = f"Wall time [µs], one thread, blocks in turn: {machine['processor']}, Python {machine['python']}"
    sheet = Sheet(title, ("what", "runs", "median", "p99", "p99.9", "max", "of mink", "quartiles"))
    for name, t in times.items():
        figures = (f"{1e6 * value:.1f}" for value in (t.median, t.p99, t.p999, t.maximum))
        spread = f"{t.ratio_low:.2f} to {t.ratio_high:.2f}"
        sheet.add_row(name, str(t.runs), *figures, f"{t.ratio:.2f}", spread)
    screen.print(sheet)


def _compilation(screen: Console, out: Path | None, json: bool) -> None:
    """What each kernel takes to compile, and to load."""
    from qpsafe.bench.compilation import time_compilation

    with progress_bar(screen) as progress:
        progress.add_task("compiling all kernels from an empty cache, in a process of its own", total=None)
        first, later = time_compilation()
    if not json:
        show_compilation(first, later, screen)
    _write(screen, out, json, {"empty cache": first._asdict(), "from the cache": later._asdict()})


def show_compilation(first: Start, later: Start, screen: Console) -> None:
    """Print what each kernel takes.

    Args:
        first: A start that compiles.
        later: One that finds everything compiled.
        screen: Where to.
    """
    from qpsafe.cli.sheet import Sheet

    sheet = Sheet("Processor time of each kernel", ("kernel", "compiled [s]", "from the cache [ms]"))
    for name, taken in sorted(first.kernels.items(), key=lambda item: -item[1]):
        sheet.add_row(name, f"{taken:.2f}", f"{1e3 * later.kernels[name]:.0f}")
    sheet.add_row("the whole process, imports included", f"{first.processor:.1f}", f"{1e3 * later.processor:.0f}")
    sheet.add_row("the same on the clock", f"{first.wall:.1f}", f"{1e3 * later.wall:.0f}")
    screen.print(sheet)


def _write(
    screen: Console, out: Path | None, json: bool, results: dict[str, Any], engine: dict[str, float] | None = None
) -> None:
    """The results with the machine, in a file and on standard output where they are wanted.

    Args:
        screen: Where to say so.
        out: The file, if any.
        json: Whether they are wanted on standard output.
        results: By name, in seconds.
        engine: Simulated seconds a second, if they were measured.
    """
    from qpsafe.bench.clock import machine

    content = {"machine": machine(), "unit": "s", "results": results}
    if engine is not None:
        content["engine"] = {"unit": "simulated s/s", **engine}
    if out is not None:
        write_text(out, json_text(content) + "\n")
        screen.print(f"written to {out}")
    if json:
        print_json(content)
