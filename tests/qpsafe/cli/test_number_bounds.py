"""No number is so large that a command takes it and then breaks, forks without end, or never comes back."""

from __future__ import annotations

import inspect
import math
import types
from collections.abc import Callable, Iterator
from typing import Any, get_args

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.models import OptionInfo
from typer.testing import CliRunner

from qpsafe.cli.common import STEP
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.sim.world.scene import build_scene

Parsed = Callable[[str, list[str]], Any]
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


def numbers(wanted: type) -> Iterator[tuple[tuple[str, str], OptionInfo]]:
    """All options that take whole numbers, or other ones: command and option, what is declared of it."""
    for path, function in commands(app):
        for name, parameter in inspect.signature(function, eval_str=True).parameters.items():
            kind, *said = get_args(parameter.annotation)[:2] or (parameter.annotation,)
            kinds = get_args(kind) if isinstance(kind, types.UnionType) else (kind,)
            inside = {inner for one in kinds for inner in get_args(one)}  # of a list
            if wanted in {*kinds, *inside} and said and isinstance(said[0], OptionInfo):
                option = next(iter(said[0].param_decls or ()), "--" + name.replace("_", "-"))
                yield (" ".join(path), option), said[0]


ALL, FLOATS = dict(numbers(int)), dict(numbers(float))
#: Infinite unless something else is typed, as their help says.
ENDLESS = {("irc5-sim", "--cond-time")}


def test_options_of_every_command_are_looked_at() -> None:
    assert {("irc5-faults", "--jobs"), ("campaign worst", "--trials"), ("tune", "--workers")} <= set(ALL)
    assert {("stream", "--duration"), ("irc5-sim", "--restart"), ("tune", "--minutes")} <= set(FLOATS)


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


@pytest.mark.parametrize("value", ["inf", "-inf", "nan"])
@pytest.mark.parametrize(("command", "option"), FLOATS)
def test_what_has_no_end_or_is_no_number_is_refused_by_its_name(
    command: str, option: str, value: str, parsed: Parsed
) -> None:
    if (command, option) in ENDLESS and value == "inf":
        assert math.inf in parsed(command, [option, value]).params.values()
        return
    with pytest.raises((ConfigurationError, typer.BadParameter)) as refused:
        parsed(command, [option, value])
    if isinstance(refused.value, ConfigurationError):
        assert str(refused.value) == f"qpsafe {command}: {option} = {value}: expected a finite number"
    else:  # outside the range that is taken
        assert option in refused.value.format_message()


LAGS = [command for command, option in FLOATS if option == "--lag" and not command.startswith("campaign")]


@pytest.mark.parametrize("command", LAGS)
@given(tenths=st.integers(0, 1000))
def test_a_lag_that_the_plant_would_round_is_refused(command: str, tenths: int, parsed: Parsed) -> None:
    lag = tenths * 1e-4
    if tenths % 10 == 0:
        assert parsed(command, ["--lag", repr(lag)]).params["lag"] == lag
        return
    with pytest.raises(ConfigurationError, match=r"--lag = .* a multiple of the plant's step, 0\.001 s"):
        parsed(command, ["--lag", repr(lag)])


def test_that_is_the_step_of_the_plant() -> None:
    default = inspect.signature(build_scene).parameters["timestep"].default
    assert default == STEP
