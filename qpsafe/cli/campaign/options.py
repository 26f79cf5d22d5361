"""What the campaign's commands share: options that make a plan, and who plays it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from qpsafe.sim.campaign.plan import Plan

WORKERS = os.cpu_count() or 1

File = Annotated[Path | None, typer.Argument(help="A plan, see docs/files.md; options go before what it says.")]
Seed = Annotated[int | None, typer.Option(help="Of the first trial; the others' follow one by one.")]
Robot = Annotated[str | None, typer.Option(help="A bundled robot, or the path of a robot folder, MJCF or URDF file.")]
Motions = Annotated[str | None, typer.Option(help="hold, line, pick or programs' files, separated by commas.")]
Sight = Annotated[str | None, typer.Option("--sensor", help="What they see by: ideal, sharp or perfect.")]
Lag = Annotated[float | None, typer.Option(help="Of the servos, a multiple of 0.004 [s]; 0: they follow perfectly.")]
People = Annotated[
    Path | None, typer.Option(help="A TOML file with a model of people or a story, or a folder of these.")
]
Workers = Annotated[int, typer.Option(min=1, help="Processes; by default one a processor.")]
Dask = Annotated[str | None, typer.Option(help="Address of a Dask scheduler, which takes the place of --workers.")]


def make_plan(file: Path | Plan | None, **given: Any) -> Plan:
    """A plan, that of a file, or the default one, with options in the place of what it says.

    Args:
        file: The plan, or its file; None for the default one.
        given: Keys of the plan; None where nothing was typed; several names in one word, separated by commas.

    Raises:
        ConfigurationError: Names the option, or the file with the line.
    """
    from qpsafe.robot.loader import load_robot
    from qpsafe.sim.campaign.plan import Plan, load_plan

    plan = Plan() if file is None else file if isinstance(file, Plan) else load_plan(file)
    typed = {key: value for key, value in given.items() if value is not None}
    for key in ("motions", "controllers"):
        if key in typed:
            typed[key] = tuple(word.strip() for word in typed[key].split(","))
    if "people" in typed:
        typed["people"] = str(typed["people"])
    try:
        made = replace(plan, **typed)
    except ConfigurationError as wrong:
        raise ConfigurationError("qpsafe campaign", f"--{wrong.key}", wrong.value, wrong.expected) from None
    if load_robot(made.robot).spots_path is None:
        expected = "a robot with distance sensors (spots.toml)"
        raise ConfigurationError("qpsafe campaign", "--robot", made.robot, expected)
    return made


@contextmanager
def executor_at(address: str | None) -> Iterator[Executor | None]:
    """The executor of a Dask cluster, None if there is no address."""
    if address is None:
        yield None
        return
    from qpsafe.sim.campaign.executors import dask_executor

    with dask_executor(address) as executor:
        yield executor
