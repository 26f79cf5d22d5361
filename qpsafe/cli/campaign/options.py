"""What the campaign's commands share: options that make a plan, and who plays it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from qpsafe.cli.campaign.ready import plan_for_its_robot
from qpsafe.cli.common import progress_bar
from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from rich.console import Console

    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.worst.cases import Encounter

WORKERS = os.cpu_count() or 1

File = Annotated[Path | None, typer.Argument(help="A plan, docs/reference/files.md; options override it.")]
FileOption = Annotated[Path | None, typer.Option("--file", help="A plan, as the argument; options override it.")]
Workers = Annotated[int, typer.Option(min=1, max=1024, help="Number of processes; by default one per processor.")]
Dask = Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead of --workers.")]
Json = Annotated[bool, typer.Option("--json", help="Write the result as JSON to standard output.")]

#: Options that make a plan, by its keys.
PLAN = {
    "seed": Annotated[int | None, typer.Option(help="Seed of the first trial; the others count up from it.")],
    "robot": Annotated[
        str | None, typer.Option(help="A bundled robot, or the path of a robot folder, MJCF or URDF file.")
    ],
    "motions": Annotated[str | None, typer.Option(help="hold, line, pick or program files, separated by commas.")],
    "sensor": Annotated[
        str | None, typer.Option(help="Sensors: ideal, sharp, perfect, vl53l5cx, depth, or sharp+depth.")
    ],
    "lag": Annotated[float | None, typer.Option(help="Servo lag, a multiple of 0.004 [s]; 0: perfect following.")],
    "people": Annotated[
        Path | None, typer.Option(help="TOML file with a model of people or a story, or a folder of these.")
    ],
    "cell": Annotated[Path | None, typer.Option(help="TOML file of furniture in the cell.")],
}
#: What was typed of them, by the plan's keys; None for what was not.
Typed = dict[str, Any]


def planned(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of `PLAN`, all of which come to it in one argument, `typed`."""
    own = signature(command, eval_str=True)
    options = [Parameter(key, Parameter.KEYWORD_ONLY, default=None, annotation=kind) for key, kind in PLAN.items()]
    others = [part.replace(kind=Parameter.KEYWORD_ONLY) for part in own.parameters.values() if part.name != "typed"]

    @wraps(command)
    def whole(**given: Any) -> None:
        command(typed={key: given.pop(key) for key in PLAN}, **given)

    place = [*own.parameters].index("typed")
    parameters = [*others[:place], *options, *others[place:]]
    whole.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    whole.__annotations__ = {part.name: part.annotation for part in parameters}
    return whole


def make_plan(file: Path | Plan | None, where: str = "qpsafe campaign", **given: Any) -> Plan:
    """A plan, that of a file, or the default one, with options in the place of what it says.

    Args:
        file: The plan, or its file; None for the default one.
        where: The command, for the error.
        given: Keys of the plan; None where nothing was typed; several names in one word, separated by commas. A
            tuple of controllers has the only one of a command that takes one.

    Raises:
        ConfigurationError: Names the option, or the file with the line.
    """
    from qpsafe.sim.campaign.plan import Plan, load_plan

    plan = Plan() if file is None else file if isinstance(file, Plan) else load_plan(file)
    typed = {key: value for key, value in given.items() if value is not None}
    for key in ("motions", "controllers"):
        if isinstance(typed.get(key), str):
            typed[key] = tuple(word.strip() for word in typed[key].split(","))
    for key in ("people", "cell"):
        if key in typed:
            typed[key] = str(typed[key])
    try:
        made = replace(plan, **typed)
    except ConfigurationError as wrong:
        alone = wrong.key == "controllers" and not isinstance(given.get("controllers"), str)
        option = "controller" if alone else f"--{wrong.key}"
        raise ConfigurationError(where, option, wrong.value, wrong.expected) from None
    _read_files(made)
    named = "motions" in typed or made.motions != Plan.motions
    return plan_for_its_robot(where, made, named)


def _read_files(plan: Plan) -> None:
    """Read the files that a plan names: what is wrong in them is said before anything begins."""
    from qpsafe.sensing.cell_file import load_cell
    from qpsafe.sim.campaign.people import EncounterModel

    if plan.people is not None:
        EncounterModel.load(plan.people)
    if plan.cell is not None:
        load_cell(plan.cell)


@contextmanager
def executor_at(address: str | None) -> Iterator[Executor | None]:
    """The executor of a Dask cluster, None if there is no address."""
    if address is None:
        yield None
        return
    from qpsafe.sim.campaign.executors import dask_executor

    with dask_executor(address) as executor:
        yield executor


@contextmanager
def counting(what: str, screen: Console) -> Iterator[Callable[[int, int], None]]:
    """A progress bar; what was there at the beginning does not count for the time left.

    Args:
        what: Is counted.
        screen: Where to.
    """
    with progress_bar(screen) as progress:
        task = progress.add_task(what, total=None)

        def count(done: int, total: int) -> None:
            if progress.tasks[0].total is None:
                progress.reset(task, completed=done, total=total)
            else:
                progress.update(task, completed=done)

        yield count


class Single(NamedTuple):
    """One trial, or case, and who plays it.

    Attributes:
        plan: Of it, with this controller alone.
        what: Number of the trial, or the case.
        controller: Its name.
        label: For what is written of a case; empty for a trial.
    """

    plan: Plan
    what: int | Encounter
    controller: str
    label: str = ""


def one_trial(
    where: str, text: str, file: Path | None, typed: Typed, controller: str | None, others: str = ""
) -> Single:  # fmt: skip
    """What one trial, or case, is; the case's controller, or `default`, if nobody is named.

    Args:
        where: The command, for errors.
        text: What was typed of it: a number, or FILE.json#K.
        file: The plan's, None if there is none.
        typed: Options that make a plan.
        controller: Its name, if it was typed.
        others: What else `text` may be, for the error.
    """
    from qpsafe.sim.campaign.plan import MOST_TRIALS
    from qpsafe.sim.campaign.worst.cases import check_case, load_case

    path, mark, number = text.rpartition("#")
    if not number.isdecimal() or (mark and not path):
        expected = f"the number of a trial, or FILE.json#K with the number of a case{others}"
        raise ConfigurationError(where, "TRIAL", text, expected)
    if len(number) > len(str(MOST_TRIALS)) or int(number) >= MOST_TRIALS:  # Python reads no 5,000 digits
        raise ConfigurationError(where, "TRIAL", text[:40], f"a number from 0 to {MOST_TRIALS - 1}")
    if not mark:
        name = "default" if controller is None else controller
        return Single(make_plan(file, where, **typed, controllers=(name,)), int(number), name)
    if file is not None:
        raise ConfigurationError(where, "--file", str(file), "none: a case has its plan with it")
    if typed["motions"] is not None:
        raise ConfigurationError(where, "--motions", typed["motions"], "none: a case has its motion with it")
    case = load_case(Path(path), int(number))
    name = case.controller if controller is None else controller
    plan = make_plan(case.plan, where, **typed, controllers=(name,))
    check_case(text, plan, case.encounter)
    return Single(plan, case.encounter, name, f"{Path(path).stem}-{int(number)}")
