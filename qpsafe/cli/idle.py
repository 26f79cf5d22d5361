"""Options that do nothing beside the others, and numbers without an end: whoever types one of them is told.

A table says of every command when its options count; those that it does not name always do.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import typer
from typer.core import TyperCommand

from qpsafe.errors import ConfigurationError

#: Shares and times of `qpsafe irc5-sim` that make its wire a bad one.
WIRE = ("loss", "delay", "reorder", "duplicate", "garbage", "wrong_sender")


class Rule(NamedTuple):
    """When options count.

    Attributes:
        options: Names of the options, as the command's function has them.
        useful: Whether they do, from the values of all options.
        expected: When, in words.
    """

    options: tuple[str, ...]
    useful: Callable[[Mapping[str, Any]], object]
    expected: str


PROJECTION = Rule(("projection",), lambda given: given["law"] == "hierarchical", "only with --law hierarchical")
SOLVER = Rule(("solver",), lambda given: given["law"] != "nullspace", "only with a law that solves QPs, not nullspace")
VIDEO = Rule(
    ("video",), lambda given: not (given["video"] and given["view"]), "only without --view, which films nothing"
)
WORKERS = Rule(("workers",), lambda given: not given["dask"], "only without --dask, whose workers play")
PAGE = Rule(("web_host", "web_port", "web_token"), lambda given: given["web"], "only together with --web")

#: Command -> when its options count.
RULES: dict[str, tuple[Rule, ...]] = {
    "demo fixed": (
        PROJECTION,
        SOLVER,
        VIDEO,
        Rule(
            ("spots",),
            lambda given: {"ideal", "sharp"} & {*given["sensor"].split("+")},
            "only with spots among the --sensor, ideal or sharp",
        ),
    ),
    "demo path": (VIDEO,),
    "demo fast-person": (PROJECTION, VIDEO),
    "demo pick-and-place": (PROJECTION, SOLVER, VIDEO),
    "campaign run": (WORKERS,),
    "campaign worst": (WORKERS,),
    "campaign limit": (
        WORKERS,
        Rule(
            ("dask", "workers"),
            lambda given: os.path.isdir(given["trial"]),
            "only with a campaign's folder: one trial is searched here",
        ),
    ),
    "tune": (WORKERS,),
    "compare": (
        Rule(
            ("duration", "full"), lambda given: given["closed_loop"], "only with whole runs, not with --no-closed-loop"
        ),
    ),
    "bench": (Rule(("ticks",), lambda given: not given["compile"], "only without --compile, which times no ticks"),),
    "check": (Rule(("clearance",), lambda given: given["cell"], "only together with --cell: it is that of furniture"),),
    "calibrate-camera": (
        Rule(("out",), lambda given: not given["write"], "only without --write, which writes into the cell's own file"),
    ),
    "place": (Rule(("time_limit",), lambda given: given["exact"], "only with the 0-1 program, not with --no-exact"),),
    "replay": (PAGE,),
    "stream": (
        Rule(("sensor_host",), lambda given: given["sensors"], "only with sensors, not with --no-sensors"),
        Rule(  # 0 asks for nothing in particular
            ("sensor_port",),
            lambda given: given["sensors"] or not given["sensor_port"],
            "only with sensors, not with --no-sensors",
        ),
        Rule(("priority",), lambda given: given["real_time"], "only together with --real-time"),
        Rule(("unchecked",), lambda given: given["program"] or given["cell"], "only together with --program or --cell"),
        PROJECTION,
        PAGE,
    ),
    "irc5-sim": (
        Rule(("sensor",), lambda given: given["sensor_port"], "only with a --sensor-port: distances go nowhere"),
        Rule(
            ("faulty",), lambda given: any(given[name] for name in WIRE), "only with a fault of the wire, as --loss 0.1"
        ),
        Rule(("real_time",), lambda given: not given["lockstep"], "only without --lock-step, which keeps no time"),
    ),
}


class Command(TyperCommand):
    """A command that refuses, before it begins, options that do nothing and numbers that are none or have no end."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the options from the words, and look at them."""
        rest = super().parse_args(ctx, args)
        if not ctx.resilient_parsing:  # which completes words
            refuse_endless(ctx)
            refuse_unused(ctx)
        return list(rest)


def check_all(app: typer.Typer) -> None:
    """Make every command of a group, and of the groups in it, a `Command`."""
    for command in app.registered_commands:
        command.cls = Command
    for group in app.registered_groups:
        if group.typer_instance is not None:
            check_all(group.typer_instance)


def refuse_endless(context: typer.Context) -> None:
    """Refuse infinite numbers, unless an option is so by default, and those that are none.

    Args:
        context: Of the command.

    Raises:
        ConfigurationError: One of them was typed.
    """
    for parameter in context.command.params:
        found = context.params.get(str(parameter.name))
        for value in found if isinstance(found, list | tuple) else (found,):
            if isinstance(value, float) and not math.isfinite(value) and value != parameter.default:
                raise ConfigurationError(f"qpsafe {_path(context)}", parameter.opts[0], value, "a finite number")


def refuse_unused(context: typer.Context) -> None:
    """Refuse options that were typed and do nothing.

    Args:
        context: Of the command.

    Raises:
        ConfigurationError: One of them was typed.
    """
    found = {str(parameter.name): parameter for parameter in context.command.params}
    for rule in RULES.get(_path(context), ()):
        for name in () if rule.useful(context.params) else rule.options:
            if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE":
                option, value = found[name].opts[0], context.params[name]
                value = str(value) if hasattr(value, "__fspath__") else getattr(value, "value", value)
                raise ConfigurationError(f"qpsafe {_path(context)}", option, value, rule.expected)


def _path(context: Any) -> str:
    """Of a command: its name, behind those of the groups it is in, without the program's."""
    words = []
    while context.parent is not None:
        words.append(str(context.info_name))
        context = context.parent
    return " ".join(reversed(words))
