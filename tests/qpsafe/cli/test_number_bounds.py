"""No number is so large that a command takes it and then breaks, forks without end, or never comes back."""

from __future__ import annotations

import inspect
import types
from collections.abc import Iterator
from typing import Any, get_args

import pytest
import typer
from typer.models import OptionInfo
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError

HUGE = 10**20
#: What stands before the options.
FIRST = {"campaign show": ["0"], "campaign limit": ["0"], "campaign worst": ["default"]}


def commands(group: typer.Typer, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for command in group.registered_commands:
        assert command.callback is not None
        yield (*path, command.name or command.callback.__name__.replace("_", "-")), command.callback
    for inner in group.registered_groups:
        assert inner.typer_instance is not None
        yield from commands(inner.typer_instance, (*path, str(inner.name)))


def integers() -> Iterator[tuple[str, str, OptionInfo]]:
    """All options that take whole numbers: command, option, what is declared of it."""
    for path, function in commands(app):
        for name, parameter in inspect.signature(function, eval_str=True).parameters.items():
            kind, *said = get_args(parameter.annotation)[:2] or (parameter.annotation,)
            kinds = get_args(kind) if isinstance(kind, types.UnionType) else (kind,)
            if int in kinds and said and isinstance(said[0], OptionInfo):
                yield " ".join(path), next(iter(said[0].param_decls or ()), "--" + name.replace("_", "-")), said[0]


ALL = {(command, option): info for command, option, info in integers()}


def test_options_of_every_command_are_looked_at() -> None:
    assert {("irc5-faults", "--jobs"), ("campaign worst", "--trials"), ("tune", "--workers")} <= set(ALL)


@pytest.mark.parametrize(("command", "option"), ALL)
def test_a_huge_number_is_refused_in_a_line_that_names_it(command: str, option: str) -> None:
    result = CliRunner().invoke(app, [*command.split(), *FIRST.get(command, []), option, str(HUGE)])
    assert result.exit_code != 0
    if ALL[command, option].max is not None:
        assert result.exit_code == 2
        assert option in result.output
    else:
        assert isinstance(result.exception, ConfigurationError)
        assert option.strip("-") in str(result.exception)
        assert str(HUGE) in str(result.exception)


@pytest.mark.parametrize("key", [key for key in ALL if key[1] in ("--jobs", "--workers")], ids=" ".join)
def test_processes_are_at_most_1024(key: tuple[str, str]) -> None:
    assert ALL[key].max == 1024
