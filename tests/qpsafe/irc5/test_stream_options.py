"""Options that do nothing beside the others are refused by name, before anything is loaded; the others are taken."""

from __future__ import annotations

from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from qpsafe.cli.irc5.idle import BLIND, SIMULATED, STREAM, WIRE, Rule, refuse_unused
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError

RULES = {"stream": STREAM, "irc5-sim": SIMULATED, "irc5-faults": ()}

#: Option -> how it is typed, beside what it does nothing, and what makes it count.
IDLE: dict[str, dict[str, tuple[list[str], list[str], list[list[str]]]]] = {
    "stream": {
        "sensor_host": (["--sensor-host", "10.9.9.9"], ["--no-sensors"], [[], ["--sensors"]]),
        "sensor_port": (["--sensor-port", "6511"], ["--no-sensors"], [[], ["--sensors"]]),
        "priority": (["--priority", "80"], [], [["--real-time"]]),
        "unchecked": (["--unchecked"], [], [["--program", "a.toml"], ["--cell", "a.toml"]]),
        "projection": (["--projection", "strict"], ["--law", "weighted"], [[], ["--law", "hierarchical"]]),
    },
    "irc5-sim": {
        "sensor": (["--sensor", "ideal"], ["--sensor-port", "0"], [[], ["--sensor-port", "9"]]),
        "faulty": (["--faulty", "5:10"], [], [[f"--{name.replace('_', '-')}", "0.1"] for name in WIRE]),
        "real_time": (["--real-time"], ["--lock-step"], [[]]),
    },
    "irc5-faults": {},
}

#: Options that count whatever else is typed; those of the page have a test of their own.
ALWAYS = {
    "stream": "robot host port peer program cell experiment law sensors events duration patience silence "
    "ramp_in ramp_out acknowledge real_time watchdog log web web_host web_port web_token json",
    "irc5-sim": "experiment robot host port sensor_port event_port duration seed lockstep gain lowpass log json "
    "max_speed_deviation comm_timeout cond_time robot_ramp_in lag retry restart motors_off rapid_stop "
    + " ".join(WIRE),
    "irc5-faults": "moments seed jobs json",
}

CASES = [
    pytest.param(command, option, *words, id=f"{command}-{option}")
    for command, table in IDLE.items()
    for option, words in table.items()
]


GROUP: Any = typer.main.get_command(app)


def parsed(command: str, words: list[str]) -> Any:
    return GROUP.commands[command].make_context(command, list(words))


@pytest.mark.parametrize("command", RULES)
def test_of_every_option_it_is_known_whether_it_always_counts(command: str) -> None:
    options = {str(parameter.name) for parameter in parsed(command, []).command.params} - {"help"}
    rules: tuple[Rule, ...] = RULES[command]
    assert {option for rule in rules for option in rule.options} == set(IDLE[command])
    assert options == set(IDLE[command]) | set(ALWAYS[command].split())


@pytest.mark.parametrize(("command", "option", "typed", "beside", "counts"), CASES)
def test_an_option_that_does_nothing_is_refused_by_its_name(
    command: str, option: str, typed: list[str], beside: list[str], counts: list[list[str]], monkeypatch: Any
) -> None:
    for module in ("stream", "irc5_sim"):
        monkeypatch.setattr(f"qpsafe.cli.irc5.{module}.console", lambda *_: pytest.fail("it went on"))
    for words in ([*beside, *typed], [*typed, *beside]):
        error = CliRunner().invoke(app, [command, *words]).exception
        assert isinstance(error, ConfigurationError)
        assert error.key == typed[0]
        assert error.expected.startswith("only ")
    for more in counts:
        refuse_unused(parsed(command, [*typed, *more]), RULES[command])
    refuse_unused(parsed(command, beside), RULES[command])


def test_any_free_port_for_distances_asks_for_nothing() -> None:
    refuse_unused(parsed("stream", ["--sensor-port", "0", "--no-sensors"]), STREAM)
    refuse_unused(parsed("stream", ["--sensor-port", "0"]), BLIND)


@pytest.mark.parametrize("words", [["--sensor-host", "10.9.9.9"], ["--sensor-port", "6511"]])
def test_a_robot_without_spots_takes_no_address_for_distances(words: list[str]) -> None:
    with pytest.raises(ConfigurationError, match="a robot that has sensors"):
        refuse_unused(parsed("stream", words), BLIND)
