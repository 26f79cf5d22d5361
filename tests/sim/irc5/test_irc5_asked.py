"""What cannot be asked of the simulated IRC5 is refused before it runs, in a line that names it."""

from __future__ import annotations

import math
import socket
from contextlib import suppress
from typing import Any

import pytest
from amounts import first
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sim.irc5 import fault_matrix
from qpsafe.sim.irc5.link import NO_FAULTS
from qpsafe.sim.irc5.process import happenings
from qpsafe.sim.irc5.udp import UdpExchange

GOOD: dict[str, Any] = {"restarts": [1.0], "motors_off": [(1.0, math.inf)], "rapid_stop": [(0.0, 0.5)]}
GOOD |= {"faults": NO_FAULTS, "faulty": (0.0, math.inf), "strangers": 0.5}
BAD = (math.nan, -5.0, math.inf)


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The one name that has an address is `cell`; names that were looked up."""
    asked: list[str] = []

    def found(name: str) -> str:
        asked.append(name)
        if name not in ("cell", "127.0.0.1"):
            raise socket.gaierror(-2, "Name or service not known")
        return "127.0.0.1"

    monkeypatch.setattr(socket, "gethostbyname", found)
    return asked


def test_what_happens_is_in_order_of_time() -> None:
    assert [item.time for item in happenings(**GOOD)] == [0.0, 0.0, 0.5, 1.0, 1.0, math.inf, math.inf]


@pytest.mark.parametrize("time", BAD)
@pytest.mark.parametrize("key", ["restarts", "motors_off", "rapid_stop", "faulty"])
def test_a_time_that_is_none_is_refused(key: str, time: float) -> None:
    given = {"restarts": [time], "faulty": (time, 1.0)}.get(key, [(time, 1.0)])
    with pytest.raises(ConfigurationError, match=f"happenings: {key} = .*a time from 0 on"):
        happenings(**GOOD | {key: given})


@pytest.mark.parametrize("wrong", [{"motors_off": [(1.0, -0.5)]}, {"faulty": (0.0, math.nan)}, {"strangers": math.nan}])
def test_a_length_or_a_share_that_is_none_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError, match=f"happenings: {next(iter(wrong))} = "):
        happenings(**GOOD | wrong)


@pytest.mark.parametrize("time", BAD)
@pytest.mark.parametrize("option", ["--restart", "--motors-off", "--rapid-stop", "--faulty"])
def test_the_command_names_the_option_of_a_time(option: str, time: float) -> None:
    said = f"{time}" if option == "--restart" else f"{time}:1"
    result = CliRunner().invoke(app, ["irc5-sim", "--loss", "0.1", f"{option}={said}"])
    assert isinstance(result.exception, ConfigurationError)
    assert str(result.exception).startswith(f"qpsafe irc5-sim: {option} = ")
    assert ("a finite number" if option == "--restart" and not math.isfinite(time) else "seconds") in str(
        result.exception
    )


@pytest.mark.parametrize("host", ["nosuch.invalid", "", "a" * 300])
def test_a_host_without_an_address_is_refused_by_its_option(host: str, nowhere: list[str]) -> None:
    result = CliRunner().invoke(app, ["irc5-sim", "--host", host])
    assert isinstance(result.exception, ConfigurationError)
    assert str(result.exception).startswith("qpsafe irc5-sim: --host = ")
    with pytest.raises(ConfigurationError, match="UdpExchange: host"):
        UdpExchange(6, (host, 6510))


def test_a_host_is_looked_up_once_and_not_in_the_loop(nowhere: list[str]) -> None:
    exchange = UdpExchange(6, ("cell", 6510))
    assert nowhere == ["cell"]
    assert exchange._stream == ("127.0.0.1", 6510)
    exchange.close()


@pytest.mark.long
@pytest.mark.parametrize(("count", "expected"), first(1, [(2, [2]), (1, [])]))
def test_there_are_never_more_processes_than_moments(
    count: int, expected: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    class Forked(Exception):
        pass

    def pool(jobs: int, *_: Any) -> None:
        asked.append(jobs)
        raise Forked

    monkeypatch.setattr(fault_matrix, "ProcessPoolExecutor", pool)
    with suppress(Forked):
        fault_matrix.run_faults(load_robot("irb140"), count, cases=(), jobs=10**20, latest=fault_matrix.EARLIEST + 2)
    assert asked == expected
