"""Options of the commands for an IRC5 that do nothing beside the others: whoever types one of them is told."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import typer

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


STREAM = (
    Rule(("sensor_host",), lambda given: given["sensors"], "only with sensors, not with --no-sensors"),
    Rule(  # 0 asks for nothing in particular
        ("sensor_port",),
        lambda given: given["sensors"] or not given["sensor_port"],
        "only with sensors, not with --no-sensors",
    ),
    Rule(("priority",), lambda given: given["real_time"], "only together with --real-time"),
    Rule(("unchecked",), lambda given: given["program"] or given["cell"], "only together with --program or --cell"),
    Rule(("projection",), lambda given: given["law"] == "hierarchical", "only with --law hierarchical"),
)

#: Of a robot that has no spots, which is known when it is loaded.
BLIND = (
    Rule(("sensor_host",), lambda given: False, "only with a robot that has sensors"),
    Rule(("sensor_port",), lambda given: not given["sensor_port"], "only with a robot that has sensors"),
)

SIMULATED = (
    Rule(("sensor",), lambda given: given["sensor_port"], "only with a --sensor-port: distances go nowhere"),
    Rule(("faulty",), lambda given: any(given[name] for name in WIRE), "only with a fault of the wire, as --loss 0.1"),
    Rule(("real_time",), lambda given: not given["lockstep"], "only without --lock-step, which keeps no time"),
)


def refuse_unused(context: typer.Context, rules: Sequence[Rule]) -> None:
    """Refuse options that were typed and do nothing.

    Args:
        context: Of the command.
        rules: When its options count.

    Raises:
        ConfigurationError: One of them was typed.
    """
    found = {str(parameter.name): parameter for parameter in context.command.params}
    for rule in rules:
        for name in () if rule.useful(context.params) else rule.options:
            if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE":
                option, value = found[name].opts[0], context.params[name]
                raise ConfigurationError(context.command_path, option, getattr(value, "value", value), rule.expected)
