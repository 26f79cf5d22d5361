"""Whatever a user gives a part of the wire that is not what it takes: an error that names part and argument, at once.

One table of all constructors and their arguments, by what each takes, and one of values that are none of it.
"""

from __future__ import annotations

import inspect
import math
import types
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from egm_wire import LIMITS, N

from qpsafe.errors import ConfigurationError
from qpsafe.irc5.distances import MOST_AGED, MOST_SPOTS, Distances, SensorInput, SensorOutput, encode
from qpsafe.irc5.loop import LoopRules, StreamLoop
from qpsafe.irc5.messages import RobotPacket, decode_robot, decode_sensor, encode_robot
from qpsafe.irc5.process.outlet import Outlet
from qpsafe.irc5.process.watchdog import Watchdog
from qpsafe.irc5.records.gears import GearRatios
from qpsafe.irc5.records.log import ReferenceWriter, read_references, write_references
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.run import run_stream
from qpsafe.irc5.session import EgmSession
from qpsafe.irc5.streamer import EgmStreamer
from qpsafe.irc5.supervisor import Supervisor
from qpsafe.irc5.transport.axes import Axes
from qpsafe.irc5.transport.event_output import EventOutput


class Hostile:
    """Whatever is asked of it, it raises."""

    def __array__(self, *arguments: object, **named: object) -> np.ndarray:
        raise RuntimeError("no array")

    def __iter__(self) -> Any:
        raise RuntimeError("no parts")

    def __repr__(self) -> str:
        raise RuntimeError("no words")


NO_NUMBER: list[Any] = ["a", "", "1", b"1", True, [1.0], {}, object(), Hostile(), math.nan, 1j, np.array([1.0, 2.0])]
NO_TIME = [*NO_NUMBER, 0.0, -1.0, -math.inf]  # > 0
NO_WHOLE = [*NO_NUMBER, math.inf, 1.5, 2.0, 10**30]
NO_COUNT = [*NO_WHOLE, -1]
NO_TEXT: list[Any] = [5, 1.5, True, b"127.0.0.1", ["lo"], object(), Hostile()]
NO_HOST = ["", "no such host", "a" * 300, "a\0b", "::1", *NO_TEXT]
NO_FLAG: list[Any] = ["no", "", 0, 1, 1.0, None, [], object(), Hostile()]
NO_OBJECT: list[Any] = ["a", 5, 1.5, True, [1], {}, object(), Hostile()]
NO_PLACES: list[Any] = ["a", 5, [1.5], [True], ["0"], [0, 0], [-1], [N], [None], object(), Hostile()]
NO_JOINTS: list[Any] = ["a", 5, ["1"] * N, [True] * N, [1j] * N, np.zeros((N, 1)), Hostile()]
NO_ROW: list[Any] = ["a", 5, ["1"] * 3, [None] * 3, [1j] * 3, [[0.0], [0.0, 1.0]], np.zeros((3, 2)), Hostile()]
NO_ROW += [np.ma.masked_array(np.zeros(3), [True, False, False]), [True] * 3, {}, object()]
NO_NUMBERS = [*NO_JOINTS, [None] * N, [math.nan] * N, [[1.0], [1.0, 2.0]]]


def none_too(values: list[Any]) -> list[Any]:
    return [*values, None]


def packet(**changes: Any) -> bytes:
    return encode_robot(RobotPacket(**({"seq": 1, "time_ms": 4, "q": np.zeros(N)} | changes)))


def looped(**changes: Any) -> StreamLoop:
    controller = types.SimpleNamespace(robot=types.SimpleNamespace(sliding=np.zeros(N, bool)), step=len)
    return StreamLoop(**({"controller": controller, "session": EgmSession(LIMITS)} | changes))


def streamed(**changes: Any) -> None:
    with closing(EgmStreamer(LIMITS, port=0)) as streamer:
        run_stream(**({"streamer": streamer, "loop": looped(session=streamer.session)} | changes))


def sent(**changes: Any) -> None:
    with closing(SensorOutput()) as output:
        output.send(**({"values": np.zeros(3)} | changes))


def encoded(**changes: Any) -> bytes:
    return encode(Distances(**({"seq": 0, "time": 0.0, "values": np.zeros(3)} | changes)))


def broken() -> float:
    raise RuntimeError("no time")


def written(**changes: Any) -> ReferenceWriter:
    return ReferenceWriter(**({"path": "unwritten.qpref", "n": N} | changes))


SPOTS = {"count": 3, "port": 0}
WIRE = {"limits": LIMITS, "port": 0}

#: What is made, what it is given besides, and its arguments with values that are wrong for them.
WRONG: list[tuple[Callable[..., Any], dict[str, Any], dict[str, list[Any]]]] = [
    (
        SensorInput,
        SPOTS,
        {
            "count": none_too(NO_COUNT),
            "port": none_too([*NO_COUNT, 65536]),
            "host": none_too(NO_HOST),
            "peer": [*NO_HOST, "0.0.0.0", "255.255.255.255"],
        },
    ),
    (SensorOutput, {}, {"host": none_too(NO_HOST), "port": none_too([*NO_COUNT, 0, 65536])}),
    (
        LoopRules,
        {},
        {
            "silence": none_too([*NO_TIME, math.inf]),
            "settle": none_too([*NO_TIME, math.inf]),
            "bad_ticks": none_too([*NO_COUNT, 0]),
            "manual": NO_FLAG,
        },
    ),
    (
        SessionRules,
        {},
        {name: none_too([*NO_TIME, math.inf]) for name in SessionRules.__dataclass_fields__}
        | {"most_missed": none_too([*NO_COUNT, 0])},
    ),
    (
        EgmSession,
        {"limits": LIMITS},
        {
            "limits": none_too(NO_OBJECT),
            "rules": [*NO_OBJECT, LoopRules()],
            "peer": [*NO_HOST, "0.0.0.0"],
            "joint_names": ["a" * N, 5, [], ["one"] * (N + 1), [1] * N, object(), Hostile()],
            "axes": NO_OBJECT,
        },
    ),
    (
        EgmStreamer,
        WIRE,
        {
            "limits": none_too(NO_OBJECT),
            "host": none_too([*NO_HOST, "0.0.0.0"]),
            "port": none_too([*NO_COUNT, 65536]),
            "rules": NO_OBJECT,
            "peer": [*NO_HOST, "0.0.0.0"],
            "joint_names": ["a" * N, 5, [], object(), Hostile()],
            "axes": NO_OBJECT,
        },
    ),
    (
        looped,
        {},
        {
            "controller": none_too(NO_OBJECT),
            "session": none_too(NO_OBJECT),
            "supervisor": NO_OBJECT,
            "rules": NO_OBJECT,
        },
    ),
    (Supervisor, {}, {"clock": none_too(NO_OBJECT), "keep": none_too(NO_COUNT), "on_transition": NO_OBJECT}),
    (
        Watchdog,
        {},
        {
            "limit": none_too([*NO_TIME, 3600.0]),
            "grace": none_too([*NO_TIME, 3600.0]),
            "priority": none_too([*NO_COUNT, 100]),
        },
    ),
    (
        Outlet,
        {"write": len, "name": "it"},
        {"write": none_too(NO_OBJECT), "name": [5, None, b"it", object()], "due": none_too(NO_TIME)},
    ),
    (written, {}, {"path": [5, None, ["a"], object()], "n": none_too([*NO_COUNT, 0, 256]), "beside": NO_FLAG}),
    (read_references, {}, {"path": [5, None, ["a"], object()]}),
    (
        write_references,
        {"path": "unwritten.qpref", "references": []},
        {"path": [5, None, ["a"], object()], "references": [5, None, [], "abc", [1], [None], object()]},
    ),
    (
        GearRatios,
        {"ratios": [1.0] * N},
        {"ratios": none_too(NO_NUMBERS), "coupling": NO_NUMBERS, "offset": NO_NUMBERS},
    ),
    (Axes, {"n": N}, {"n": none_too([*NO_COUNT, 256]), "external": NO_PLACES, "linear": [*NO_PLACES, None]}),
    (
        EventOutput,
        {},
        {"where": [5, None, b"127.0.0.1:1", "", "127.0.0.1", "no such host:1", "127.0.0.1:0", object(), Hostile()]},
    ),
    (
        packet,
        {},
        {
            "seq": none_too(NO_WHOLE),
            "time_ms": none_too(NO_WHOLE),
            "q": none_too(NO_JOINTS),
            "q_planned": [*NO_JOINTS, np.zeros(N + 1)],
            "motors_on": NO_FLAG,
            "mci": NO_OBJECT,
            "rapid": none_too([*NO_OBJECT, "error"]),
            "converged": NO_FLAG,
            "clock": [*NO_NUMBER, -1.0, math.inf, 1e300],
        },
    ),
    (decode_robot, {"data": b""}, {"n": none_too(NO_COUNT)}),
    (decode_sensor, {"data": b""}, {"n": none_too(NO_COUNT)}),
    (
        sent,
        {},
        {
            "values": none_too([*NO_ROW, np.zeros(MOST_SPOTS + 1), np.zeros(70_000)]),
            "ages": [*NO_ROW, np.zeros(2), np.zeros(4), []],
        },
    ),
    (sent, {"ages": np.zeros(MOST_AGED + 1)}, {"values": [np.zeros(MOST_AGED + 1)]}),
    (encoded, {}, {"seq": none_too(NO_WHOLE), "time": none_too([*NO_NUMBER, math.inf, 1e300])}),
    (
        streamed,
        {},
        {
            "streamer": none_too(NO_OBJECT),
            "loop": none_too([*NO_OBJECT, looped()]),
            "watchdog": [*NO_OBJECT, Watchdog()],
            "helpers": none_too(["a", 5, 1.5, True, [1], ["a"], [len, None], {"a": 1}, object(), Hostile()]),
            "requests": NO_OBJECT,
            "clock": none_too([*NO_OBJECT, lambda: "noon", lambda: None, lambda: math.nan, broken]),
            "sensors": NO_OBJECT,
            "duration": [*NO_NUMBER, -1.0, math.inf],
            "patience": none_too([*NO_TIME]),
            "on_tick": NO_OBJECT,
            "on_events": NO_OBJECT,
            "on_second": NO_OBJECT,
        },
    ),
]

#: What an error calls these, and what it calls their arguments.
NAMES = {
    "looped": "StreamLoop",
    "packet": "RobotPacket",
    "written": "reference log",
    "read_references": "reference log",
    "write_references": "reference log",
    "streamed": "run_stream",
    "sent": "distances",
    "encoded": "distances",
}
KEYS = {"where": "HOST:PORT"}
PASSED_ON = {"rules", "joint_names", "axes", "limits"}  # by the streamer to its session

CASES = [
    pytest.param(make, given, key, values, id=f"{make.__name__}-{key}")
    for make, given, wrong in WRONG
    for key, values in wrong.items()
]


@pytest.mark.parametrize(("make", "given", "key", "values"), CASES)
def test_whatever_is_not_what_an_argument_takes_is_refused_by_name_at_once(
    make: Callable[..., Any], given: dict[str, Any], key: str, values: list[Any], tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    for value in values:
        with pytest.raises(ConfigurationError) as caught:
            make(**(given | {key: value}))
        error = caught.value
        passed = make is EgmStreamer and key in PASSED_ON
        assert error.where == ("EgmSession" if passed else NAMES.get(make.__name__, make.__name__))
        assert error.key == KEYS.get(key, key)
        assert error.expected
        assert str(error).startswith(f"{error.where}: {error.key} = ")
    assert not list(tmp_path.iterdir())  # nothing was made before it was refused


def test_every_argument_of_these_has_been_tried() -> None:
    """But functions that only the tests of others give, and what is no argument of a user."""
    for make, _, wrong in WRONG:
        names = list(wrong)
        if make is streamed:
            assert sorted(names) == sorted(inspect.signature(run_stream).parameters)
        if make in (SensorInput, SensorOutput, LoopRules, SessionRules, EgmSession, EgmStreamer, Supervisor, Watchdog):
            code = make.__init__.__code__  # type: ignore[misc]
            taken = code.co_varnames[1 : code.co_argcount + code.co_kwonlyargcount]
            assert sorted(names) == sorted(taken), make.__name__


@pytest.mark.parametrize("number", [np.float64, np.float32, float])
@pytest.mark.parametrize("count", [np.int64, np.uint8, int])
def test_numbers_of_numpy_are_numbers(number: type, count: type) -> None:
    assert LoopRules(silence=number(0.5), bad_ticks=count(3)).silence == 0.5
    assert SessionRules(ramp_in=number(0.5), most_missed=count(3)).most_missed == 3
    assert Axes(count(7)).n == 7
    assert repr(Watchdog(number(0.5), number(1.0), count(3)).limit) == "0.5"  # its process reads that
    entrance = SensorInput(count(3), port=count(0))
    entrance.close()
    packet(seq=count(3), motors_on=np.bool_(True), clock=number(1.0))


@pytest.mark.parametrize("make", [EgmStreamer, EgmSession])
def test_a_peer_may_be_named_wherever_one_is_given(make: Callable[..., Any]) -> None:
    made = make(LIMITS, peer="localhost", **({"port": 0} if make is EgmStreamer else {}))
    session = made.session if make is EgmStreamer else made
    data = encode_robot(RobotPacket(1, 4, np.zeros(N), clock=1.0))
    assert not session.offer(data, ("127.0.0.2", 4711), 0.0)
    assert session.offer(data, ("127.0.0.1", 4711), 0.0)
    if make is EgmStreamer:
        made.close()
