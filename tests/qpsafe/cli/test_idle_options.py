"""Options that do nothing beside the others are refused by name, before anything is loaded; the others are taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.core import TyperGroup

from qpsafe.cli.idle import RULES, WIRE, Command
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError

Parsed = Callable[[str, list[str]], Any]

#: Their tests, and rules, are of their own.
NONE: list[str] = []

VIDEO = {"video": (["--video"], ["--view"], [NONE])}
PROJECTION = {"projection": (["--projection", "paper"], ["--law", "weighted"], [NONE, ["--law", "hierarchical"]])}
SOLVER = {"solver": (["--solver", "own"], ["--law", "nullspace"], [NONE, ["--law", "weighted"]])}
PAGE = {
    "web_host": (["--web-host", "0.0.0.0"], NONE, [["--web"]]),
    "web_port": (["--web-port", "8080"], NONE, [["--web"]]),
    "web_token": (["--web-token", "secret"], NONE, [["--web"]]),
}
WORKERS = {"workers": (["--workers", "2"], ["--dask", "tcp://a:1"], [NONE])}
#: Command -> option -> how it is typed, beside what it does nothing, and what makes it count.
IDLE: dict[str, dict[str, tuple[list[str], list[str], list[list[str]]]]] = {
    "demo fixed": {
        **VIDEO,
        **PROJECTION,
        **SOLVER,
        "spots": (["--spots", "a.toml"], ["--sensor", "vl53l5cx"], [NONE, ["--sensor", "sharp+depth"]]),
    },
    "campaign run": WORKERS,
    "campaign worst": WORKERS,
    "campaign limit": {"workers": (["--workers", "2"], NONE, []), "dask": (["--dask", "tcp://a:1"], NONE, [])},
    "tune": WORKERS,
    "demo path": VIDEO,
    "demo fast-person": {**VIDEO, **PROJECTION},
    "demo pick-and-place": {**VIDEO, **PROJECTION, **SOLVER},
    "compare": {
        "duration": (["--duration", "3"], ["--no-closed-loop"], [NONE, ["--closed-loop"]]),
        "full": (["--full"], ["--no-closed-loop"], [NONE]),
    },
    "bench": {"ticks": (["--ticks", "200"], ["--compile"], [NONE])},
    "check": {"clearance": (["--clearance", "0.1"], NONE, [["--cell", "a.toml"]])},
    "calibrate-camera": {"out": (["--out", "a.toml"], ["--write"], [NONE])},
    "place": {"time_limit": (["--time-limit", "3"], ["--no-exact"], [NONE, ["--exact"]])},
    "replay": PAGE,
    "stream": {
        **PROJECTION,
        **PAGE,
        "sensor_host": (["--sensor-host", "10.9.9.9"], ["--no-sensors"], [NONE, ["--sensors"]]),
        "sensor_port": (["--sensor-port", "6511"], ["--no-sensors"], [NONE, ["--sensors"]]),
        "priority": (["--priority", "80"], NONE, [["--real-time"]]),
        "unchecked": (["--unchecked"], NONE, [["--program", "a.toml"], ["--cell", "a.toml"]]),
    },
    "irc5-sim": {
        "sensor": (["--sensor", "ideal"], ["--sensor-port", "0"], [NONE, ["--sensor-port", "9"]]),
        "faulty": (["--faulty", "5:10"], NONE, [[f"--{name.replace('_', '-')}", "0.1"] for name in WIRE]),
        "real_time": (["--real-time"], ["--lock-step"], [NONE]),
    },
}

#: Options that count whatever else is typed, of all commands.
ALWAYS = {
    "demo fixed": "robot law seed lag duration sensor cap story parameters out view json",
    "demo path": "robot seed lag duration program unchecked solver story out view json",
    "demo fast-person": "robot speed experiment law lag sensor out view json",
    "demo pick-and-place": "robot seed seeds cycles people program unchecked lag law sensor jobs out view json",
    "campaign run": "quick trials controllers seed robot motions sensor lag people cell dask out json",
    "campaign show": "controller plan seed robot motions sensor lag people cell out json",
    "campaign worst": "trials plan seed robot motions sensor lag people cell dask out json",
    "campaign limit": "controller plan seed robot motions sensor lag people cell evaluations json",
    "campaign report": "out json",
    "tune": "robot program cell people trials minutes seed prefer finals judge dask write out json",
    "compare": "states seed tolerance closed_loop solver json",
    "bench": "out json compile",
    "check": "robot cell out json",
    "calibrate": "robot out plot tolerance any_sensor json",
    "calibrate-camera": "camera robot guess tolerance write json",
    "story": "plot json",
    "replay": "video view web json",
    "web": "robot program story cell host port token dark shadows open_ out json",
    "place": "sensor spots probability objective caps nodes pairs seed radius pedestal workers exact pictures out json",
    "sick-sensors": "moments seed sensor jobs json",
    "stream": "robot host port peer program cell experiment law sensors events duration patience silence "
    "ramp_in ramp_out acknowledge real_time watchdog log web json",
    "irc5-sim": "experiment robot host port sensor_port event_port duration seed lockstep gain lowpass log json "
    "max_speed_deviation comm_timeout cond_time robot_ramp_in lag retry restart motors_off rapid_stop "
    + " ".join(WIRE),
    "irc5-faults": "moments seed jobs json",
    "robots inspect": "json",
    "robots add": "out force json",
}

CASES = [
    pytest.param(command, option, *words, id=f"{command}-{option}")
    for command, table in IDLE.items()
    for option, words in table.items()
]


def commands(group: TyperGroup, path: str = "") -> Iterator[tuple[str, Any]]:
    """All of them, by their words."""
    for name, command in group.commands.items():
        if isinstance(command, TyperGroup):
            yield from commands(command, f"{path}{name} ")
        else:
            yield f"{path}{name}", command


ALL = dict(commands(typer.main.get_command(app)))  # type: ignore[arg-type]


def test_every_command_looks_at_its_options() -> None:
    assert {type(command) for command in ALL.values()} == {Command}
    assert set(RULES) <= set(ALL)


@pytest.mark.parametrize("path", ALL)
def test_of_every_option_it_is_known_whether_it_always_counts(path: str) -> None:
    options = [part.name for part in ALL[path].params if part.param_type_name == "option"]
    ruled = {option for rule in RULES.get(path, ()) for option in rule.options}
    assert ruled == set(IDLE.get(path, {}))
    assert sorted(options) == sorted([*ruled, *ALWAYS[path].split()])


@pytest.mark.parametrize(("path", "option", "typed", "beside", "counts"), CASES)
def test_an_option_that_does_nothing_is_refused_by_its_name(
    path: str, option: str, typed: list[str], beside: list[str], counts: list[list[str]], parsed: Parsed
) -> None:
    for words in ([*beside, *typed], [*typed, *beside]):
        with pytest.raises(ConfigurationError) as refused:
            parsed(path, words)
        assert refused.value.where == f"qpsafe {path}"
        assert refused.value.key == typed[0]
        assert refused.value.expected.startswith("only ")
    for more in counts:
        assert option in parsed(path, [*typed, *more]).params
    parsed(path, beside)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("stream", ["--sensor-port", "0", "--no-sensors"]),  # any free one: nothing is asked for
        ("demo fixed", ["--no-video", "--view"]),
    ],
)
def test_what_asks_for_nothing_may_do_nothing(path: str, words: list[str], parsed: Parsed) -> None:
    parsed(path, words)


def test_who_searches_counts_where_there_is_a_folder_of_trials(
    parsed: Parsed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x").mkdir()
    for words in (["--workers", "2"], ["--dask", "tcp://a:1"]):
        parsed("campaign limit", words)
    with pytest.raises(ConfigurationError, match="--workers"):
        parsed("campaign limit", ["--workers", "2", "--dask", "tcp://a:1"])
