"""`qpsafe place`: how many distance sensors a robot needs, and where, section III of the paper."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.cli.common import console, print_json, progress_bar, write_text
from qpsafe.cli.outputs import output_folder
from qpsafe.errors import ConfigurationError
from qpsafe.placement.objective import Objective, SensorName, check_request
from qpsafe.text.json_text import json_text
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from rich.console import Console
    from rich.progress import Progress, TaskID

    from qpsafe.placement.study import Study


def place(
    context: typer.Context,
    robot: Annotated[str, typer.Argument(help="A bundled robot, or the path of a robot folder.")] = "irb140",
    sensor: Annotated[SensorName, typer.Option(help="What is placed.")] = SensorName.sharp,
    spots: Annotated[
        int | None, typer.Option(help="Number of spots; by default 20, or as many as the regions hold.")
    ] = None,
    probability: Annotated[
        float | None,
        typer.Option(help="Find the fewest spots that reach this detection probability instead, eq. (13)."),
    ] = None,
    objective: Annotated[
        Objective,
        typer.Option(
            help="cost is (10)-(12); the others give nothing for redundant spots. nearest: detected close to the "
            "person's nearest point; with --probability too."
        ),
    ] = Objective.detection,
    caps: Annotated[
        bool, typer.Option(help="Respect at_most of the regions (not in the curves, nor for (13)).")
    ] = True,
    nodes: Annotated[int, typer.Option(max=10_000, help="Number of candidate nodes to aim for.")] = 254,
    pairs: Annotated[
        int, typer.Option(max=10_000_000, help="Random pairs of robot and person in each of the two samples.")
    ] = 3000,
    seed: Annotated[int, typer.Option(min=0, max=2**53, help="Seed of everything random.")] = 0,
    radius: Annotated[
        float | None,
        typer.Option(
            min=0.1, max=10.0, help="Largest distance of people from the base axis [m]; by default the robot's reach."
        ),
    ] = None,
    pedestal: Annotated[
        float, typer.Option(min=0.05, max=2.0, help="Height of the robot's base above the floor [m].")
    ] = 0.55,
    workers: Annotated[
        int, typer.Option(min=0, max=1024, help="Number of processes; 0: one per processor, 1: this process only.")
    ] = 1,
    time_limit: Annotated[float, typer.Option(min=0.0, help="Time limit of the 0-1 program [s].")] = 30.0,
    exact: Annotated[
        bool, typer.Option(help="Solve the 0-1 program; otherwise the greedy choice and its bound only.")
    ] = True,
    pictures: Annotated[bool, typer.Option(help="Draw the robot with nodes and spots; needs OpenGL.")] = True,
    out: Annotated[Path, typer.Option(help="Folder for the results.", callback=output_folder)] = Path("out/place"),
    json: Annotated[bool, typer.Option("--json", help="Write the report as JSON to standard output.")] = False,
) -> None:
    """Place distance sensors: candidate nodes, Monte Carlo simulation, optimisation, Fig. 9, and a spots.toml.

    Everything is optimised on one sample of random pairs and judged on another, independent one.
    """
    screen = console(json)
    check_request(nodes, spots, probability)
    if pairs < 1:
        raise ConfigurationError("qpsafe place", "pairs", pairs, "a number of pairs >= 1")
    screen.print("Loading (the first time, compiling the kernels takes some seconds) ...", style="dim")
    from qpsafe.placement.candidates import candidate_nodes
    from qpsafe.placement.knapsack import check_spots
    from qpsafe.placement.sensors import SENSORS
    from qpsafe.placement.spots_toml import spots_toml
    from qpsafe.placement.study import study, to_dict
    from qpsafe.ranging.sensor_file import PATTERN
    from qpsafe.robot.loader import load_robot
    from qpsafe.sim.placement.figures import figure_9
    from qpsafe.sim.placement.run import MonteCarlo

    machine = load_robot(robot)
    with progress_bar(screen) as progress:
        wanted = counted(nodes, "candidate node")
        task = progress.add_task(wanted, total=None)

        def tried(grids: int, last: int) -> None:
            progress.update(
                task, completed=grids, description=f"{counted(nodes, 'candidate node')}: {last} in this grid"
            )

        found = candidate_nodes(machine, nodes, sensor=SENSORS[sensor], progress=tried)
    check_request(len(found), spots, probability)
    limits = found.caps(machine) if caps else None
    count = spots or min(20, len(found) if limits is None else limits.room())
    check_spots(count, len(found), limits)
    regions = counted(len(machine.regions), "region")
    apart = f"{1e3 * found.spacing:.1f} mm apart"
    screen.print(f"{counted(len(found), 'node')}, {apart}, on {regions}", style="dim")
    simulation = MonteCarlo(machine, found, seed=seed, radius=radius, pedestal=pedestal)
    samples = []
    with _executor(workers) as executor, progress_bar(screen) as progress:
        for number, name in enumerate(("pairs to optimise for", "independent pairs")):
            task = progress.add_task(name, total=pairs)
            samples.append(simulation.sample(pairs, number, executor, partial(_completed, progress, task)))
    with progress_bar(screen) as progress:
        task = progress.add_task("optimising", total=None)
        result = study(
            found,
            (samples[0], samples[1]),
            objective,
            spots=count,
            probability=probability,
            caps=limits,
            time_limit=time_limit,
            exact=exact,
            progress=lambda name: progress.update(task, description=f"optimising: {name}", advance=1),
        )
    report = to_dict(result) | {
        "robot": machine.name,
        "seed": seed,
        "radius": simulation.setup.radius,
        "pedestal": pedestal,
    }
    chosen = result.answer.solution.chosen
    out.mkdir(parents=True, exist_ok=True)
    figure_9(result, out / "figure-9.png", machine.title)
    if pictures:
        _draw(machine, found, chosen, out, screen)
    write_text(out / "report.json", json_text(report) + "\n")
    file = PATTERN.format(sensor.value) if found.sensor.is_array else "spots.toml"

    def text(command: str) -> str:
        return spots_toml(found, chosen.tolist(), _remark(machine.title, result, command, pairs))

    write_text(out / file, with_words(_command(context), text))
    if json:
        print_json(report)
    else:
        show(result, screen)
        screen.print(f"written to {out}: {file}, report.json, figure-9.png")


def _completed(progress: Progress, task: TaskID, done: int) -> None:
    progress.update(task, completed=done)


@contextmanager
def _executor(workers: int) -> Iterator[Executor | None]:
    """Local worker processes, None for none; what waits is dropped on Ctrl-C."""
    count = workers or os.cpu_count() or 1
    if count == 1:
        yield None
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"))
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _draw(machine: Any, found: Any, chosen: Any, out: Path, screen: Console) -> None:
    from qpsafe.sim.drawing.gl import gl_available

    available, why = gl_available()
    if not available:
        screen.print(f"no pictures of the robot: {why}", style="yellow")
        return
    from qpsafe.sim.placement.picture import save_picture

    save_picture(out / "nodes.png", machine, found.nodes)
    save_picture(out / "spots.png", machine, found.nodes, chosen)


#: What changes no placement.
_BESIDES = ("out", "json", "pictures", "workers")


def _command(context: typer.Context) -> list[str]:
    """The words of the command that makes the placement again: the options that were given."""
    words, last = ["qpsafe", "place"], list[str]()
    for parameter in context.command.params:
        name = parameter.name or ""
        given = getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"
        if not given or name in _BESIDES:
            continue
        value = getattr(context.params[name], "value", context.params[name])
        if parameter.param_type_name == "argument" and str(value).startswith("-"):
            last = ["--", str(value)]
        elif parameter.param_type_name == "argument":
            words.append(str(value))
        elif isinstance(value, bool):
            words.append((parameter.opts if value else parameter.secondary_opts)[0])
        else:
            words += [parameter.opts[0], str(value)]
    return words + last


def with_words(words: Sequence[str], text: Callable[[str], str]) -> str:
    """A text that quotes a command for a shell and breaks lines, which no word of the command is broken by.

    Args:
        words: Of the command.
        text: Makes the text of the command. Signs nobody writes stand for its words meanwhile, as long as a line takes.
    """
    quoted = [shlex.quote(re.sub(r"[\x00-\x1f\x7f]", " ", word)) for word in words]
    signs = [chr(0xE000 + k) * min(len(word), 100) for k, word in enumerate(quoted)]
    made = text(" ".join(signs))
    for sign, word in zip(signs, quoted, strict=True):
        made = made.replace(sign, word)
    return made


def _remark(title: str, result: Study, command: str, pairs: int) -> str:
    """What stands at the head of the file."""
    answer, found = result.answer, result.candidates
    goal = "fewest spots for a probability, eq. (13)" if answer.objective == "probability" else answer.objective
    array = found.sensor.is_array
    acts = (
        "What an array sees acts on the link nearest to it; link counts wire links from 1 and says which carries it."
        if array
        else "link counts wire links from 1: the spot's danger vector acts there, eq. (8)."
    )
    fair, thing = answer.fair, "array" if array else "spot"
    return (
        f"{counted(len(answer.solution.chosen), thing)} on the {title}, made by `{command}`: chosen out of "
        f"{counted(len(found), 'node')} {1e3 * found.spacing:.0f} mm apart for the objective: {goal} "
        f"({counted(pairs, 'pair')}, {answer.solution.method}, gap {100 * answer.solution.gap:.1f} %). They detect "
        f"{100 * fair.probability:.1f} % of an independent sample (95 %: {100 * fair.low:.1f} to "
        f"{100 * fair.high:.1f}), and of {100 * fair.nearest:.1f} % ({100 * fair.nearest_low:.1f} to "
        f"{100 * fair.nearest_high:.1f}) the part that is nearest to the robot. position [m] and direction (unit) are "
        f"given in the frame of the link that carries the {thing}, eq. (7). {acts}"
    )


def show(result: Study, screen: Console) -> None:
    """Print the placements and the chosen spots."""
    from qpsafe.cli.sheet import Sheet

    pairs = result.samples[1].pairs
    headings = ("objective", "spots", "detected", "95 %", "optimised", "nearest", "danger", "method", "gap")
    sheet = Sheet(f"Judged on {counted(pairs, 'independent pair')}, but for `optimised`", headings, text=(0, 7))
    for name, item in result.placements.items():
        fair, solution = item.fair, item.solution
        sheet.add_row(
            ("> " if name == result.wanted else "") + ("(13)" if name == "probability" else name),
            str(len(solution.chosen)),
            f"{100 * fair.probability:.1f} %",
            f"{100 * fair.low:.1f}-{100 * fair.high:.1f}",
            f"{100 * item.flattered.probability:.1f} %",
            f"{100 * fair.nearest:.1f} %",
            f"{100 * fair.danger:.1f} %",
            solution.method,
            f"{100 * solution.gap:.1f} %",
        )
    screen.print(sheet)
    names = [result.candidates.nodes.names[i] for i in result.answer.solution.chosen]
    screen.print("chosen: " + ", ".join(names))
