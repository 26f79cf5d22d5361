"""`qpsafe compare`: the QP laws against the paper's null-space laws (18) and (22)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import console, print_json, progress_bar, verdict
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from qpsafe.laws.equivalence import Deviation
    from qpsafe.laws.problem import Law
    from qpsafe.sim.experiments.fixed.compare import ClosedLoop


#: (random states, seconds of each whole run): the sample, which has the worst deviations of all, and all.
SAMPLE, ALL = (10_000, 25.0), (10_000, 60.0)


def compare(
    full: Annotated[bool, typer.Option("--full", help=f"Runs of {ALL[1]:g} s, not the sample.")] = False,
    states: Annotated[
        int | None, typer.Option(min=18, max=10_000_000, help="Number of random states.", show_default=f"{SAMPLE[0]:,}")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**53, help="Seed of the random states.")] = 0,
    tolerance: Annotated[float, typer.Option(min=0.0, help="Largest deviation that is accepted [rad/s].")] = 1e-8,
    closed_loop: Annotated[bool, typer.Option(help="Also compare whole runs of the first experiment.")] = True,
    duration: Annotated[
        float | None,
        typer.Option(min=0.1, max=600.0, help="Length of each of those runs [s].", show_default=f"{SAMPLE[1]:g}"),
    ] = None,
    solver: Annotated[str | None, typer.Option(help="Solver of the QPs; by default the project's own.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the result as JSON to standard output.")] = False,
) -> None:
    """Check that the hierarchical law with the paper's projection is law (22), and say how the other laws differ.

    By default a sample: 10,000 random states and the first 25 s of runs of 60 s, which the largest difference of q̇
    falls into; --full takes all. Random states have 6, 7 and 9 joints, singular and rank-deficient
    tasks and m, f over [0, 1]. Whole runs compare the commanded joint trajectories without limits (tolerance 1e-6 rad),
    and say how often limits make a difference. Exit code 1 above a tolerance.
    """
    screen = console(json)
    from qpsafe.laws.equivalence import compare_states
    from qpsafe.laws.hierarchical import HierarchicalLaw
    from qpsafe.laws.nullspace import NullspaceLaw
    from qpsafe.laws.weighted import WeightedLaw

    usual = ALL if full else SAMPLE
    states, duration = states or usual[0], duration or usual[1]
    others = min(states, 1_000)
    paper = HierarchicalLaw("paper", solver=solver)
    runs: dict[str, tuple[Law, int, bool]] = {
        "paper": (paper, states, False),
        "paper, limits inactive": (paper, states, True),
        "null-space law": (NullspaceLaw(), others, False),
        "strict": (HierarchicalLaw("strict", solver=solver), others, False),
        "weighted 1e6 : 1e3 : 1": (WeightedLaw(1e3, solver=solver), others, False),
    }
    found: dict[str, list[Deviation]] = {}
    loop = None
    with progress_bar(screen) as progress:
        for name, (law, count, limits) in runs.items():
            task = progress.add_task(name, total=count)
            found[name] = compare_states(law, count, seed, limits, partial(_completed, progress, task))
        if closed_loop:
            from qpsafe.robot.loader import load_robot
            from qpsafe.sim.experiments.fixed.compare import compare_closed_loop

            task = progress.add_task("whole runs", total=3 * round(duration / 0.004))
            loop = compare_closed_loop(load_robot("irb140"), duration, solver, lambda: progress.advance(task))
    exact = [d for name in ("paper", "paper, limits inactive") for d in found[name]]
    good = all(d.worst <= tolerance for d in exact) and (loop is None or loop.trajectory_deviation <= 1e-6)
    if json:
        result: dict[str, Any] = {
            name: {
                d.kind: {
                    "states": len(d.values),
                    "worst": d.worst,
                    "median": d.median,
                    "speed_at_worst": float(d.speeds[d.values.argmax()]),
                }
                for d in deviations
            }
            for name, deviations in found.items()
        }
        sample = {"states": states, "seed": seed, "duration": duration if closed_loop else None}
        print_json(
            {
                "sample": sample,
                "states": result,
                "closed_loop": loop and loop.to_dict(),
                "tolerance": tolerance,
                "good": good,
            }
        )
    else:
        _show(found, loop, tolerance, good, screen)
        if states < ALL[0] or duration < ALL[1]:
            screen.print(f"a sample; --full takes {ALL[0]:,} states and runs of {ALL[1]:g} s", style="dim")
    if not good:
        raise typer.Exit(1)


def _completed(progress: Progress, task: TaskID, done: int) -> None:
    progress.update(task, completed=done)


def _show(
    found: dict[str, list[Deviation]], loop: ClosedLoop | None, tolerance: float, good: bool, screen: Console
) -> None:
    import numpy as np

    from qpsafe.cli.sheet import Sheet

    headings = ("states of the kind", "number", "median", "worst", "worst, limits inactive", "largest q̇")
    sheet = Sheet("Deviation from eq. (22), max-norm of q̇ in rad/s: paper projection", headings)
    inactive = {d.kind: d for d in found["paper, limits inactive"]}
    for d in found["paper"]:
        numbers = (f"{d.median:.1e}", f"{d.worst:.1e}", f"{inactive[d.kind].worst:.1e}", f"{d.speeds.max():.0f}")
        sheet.add_row(d.kind, str(len(d.values)), *numbers)
    screen.print(sheet)

    sheet = Sheet("All laws, all states", ("law", "number", "median", "worst"))
    for name, deviations in found.items():
        values = np.concatenate([d.values for d in deviations])
        sheet.add_row(name, str(len(values)), f"{np.median(values):.1e}", f"{values.max():.1e}")
    screen.print(sheet)
    screen.print(
        "strict differs from (22) by intent wherever tasks are not orthogonal; weighted has soft priorities",
        style="dim",
    )
    if loop is not None:
        share = 100.0 * loop.different / loop.ticks
        screen.print(
            f"whole runs of {loop.duration:g} s, limits off: joint trajectories within "
            f"{loop.trajectory_deviation:.1e} rad (tolerance 1e-06)\n"
            f"limits on: {loop.different} of {counted(loop.ticks, 'tick')} ({share:.2f} %) differ from (22), in "
            f"{loop.explained} of them a limit binds; median {loop.median:.1e}, worst {loop.worst:.2g} rad/s\n"
            f"largest step of q̇ relative to a_max dt: {loop.largest_step:.3f} with limits, "
            f"{loop.largest_step_source:.3f} by (22) alone",
            highlight=False,
        )
    screen.print(verdict(good, f"equal within {tolerance:g}", f"deviation above {tolerance:g}"))
