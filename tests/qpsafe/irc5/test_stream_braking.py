"""Whatever ends the stream, in any order and however often: the robot is at rest first, and the report says why.

`run_stream` itself, with real signals, in simulated time: a robot in lock-step, and references that never rest.
"""

from __future__ import annotations

import math
import os
import signal
import types
from collections.abc import Callable

import numpy as np
import pytest
from amounts import crossed, some
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.irc5.loop import LoopRules, StreamLoop
from qpsafe.irc5.messages import decode_sensor, encode_robot
from qpsafe.irc5.process.requests import LEAVE, Requests
from qpsafe.irc5.rules import SessionRules
from qpsafe.irc5.run import CHECK, GONE, StreamRun, run_stream
from qpsafe.irc5.session import Cycle, EgmSession
from qpsafe.irc5.streamer import EgmStreamer
from qpsafe.irc5.supervisor import State, Supervisor, Transition
from qpsafe.limits import JointLimits
from qpsafe.reference import JointReference
from qpsafe.sim.irc5.controller import IdealBody, SimulatedIrc5
from qpsafe.tick import OK

ROBOT = qpsafe.load_robot("irb140")
LIMITS = JointLimits(ROBOT.lower, ROBOT.upper, ROBOT.max_velocity, ROBOT.max_acceleration, 0.004)
PEER = ("127.0.0.1", 6599)


class Swaying:
    """In the controller's place: all joints swing, from wherever the robot stands; every 20th tick has an event."""

    robot, dt = ROBOT, LIMITS.dt

    def __init__(self) -> None:
        self.q, self.k, self.anew = ROBOT.home, 0, True

    def reseed(self) -> None:
        self.anew = True

    def pause(self) -> None: ...

    def resume(self) -> None: ...

    def acknowledge(self) -> None: ...

    def step(self, q: np.ndarray, qd: np.ndarray, *_: object, **__: object) -> types.SimpleNamespace:
        if self.anew:
            self.q, self.k, self.anew = q, 0, False
        self.k += 1
        speed = np.full(ROBOT.nq, 0.3) * np.sin(0.03 * self.k)
        self.q = self.q + speed * self.dt
        reference = JointReference(self.k, self.k * self.dt, self.q, speed)
        events = ("grip",) if self.k % 20 == 0 else ()
        return types.SimpleNamespace(
            reference=reference, events=events, status=OK, unseen=(), messages=(), solve_time=1e-4
        )


class Stage(EgmStreamer):
    """`run_stream`'s streamer, clock and robot; `deeds` are done at the beginning of their cycles."""

    def __init__(
        self,
        deeds: dict[int, list[Callable[[], object]]],
        silent_after: float = math.inf,
        silent_until: float = math.inf,
        silence: float = 0.1,
    ) -> None:
        self.now, self.cycle, self.response = 0.0, 0, 1e-4
        self.deeds, self.silent_after, self.silent_until = deeds, silent_after, silent_until
        self.session = EgmSession(LIMITS, SessionRules(ramp_in=0.1, silence=max(1.0, silence)))
        self.said: list[Transition] = []
        supervisor = Supervisor(lambda: self.now, on_transition=self.said.append)
        rules = LoopRules(silence=silence)
        self.loop = StreamLoop(Swaying(), self.session, supervisor, rules)  # type: ignore[arg-type]
        self.irc5 = SimulatedIrc5(IdealBody(ROBOT.home, lag=0.0))
        self.q: list[np.ndarray] = []
        self.qd: list[np.ndarray] = []
        self.answered: list[int] = []

    def wait(self, timeout: float) -> Cycle | None:
        self.cycle += 1
        assert self.cycle < 3000, "the stream did not end"
        for deed in self.deeds.get(self.cycle, ()):
            deed()
        if self.silent_after < self.cycle <= self.silent_until:
            self.now += timeout
            return None
        self.now += 0.004
        packet = self.irc5.packet()
        assert packet is not None
        self.session.offer(encode_robot(packet), PEER, self.now)
        return self.session.take()

    def answer(self, reference: JointReference | None) -> bool:
        data = self.session.answer(reference)
        if data is None:
            return False
        answer = decode_sensor(data, ROBOT.nq)
        self.answered.append(self.cycle)
        self.q.append(answer.q_ref)
        self.qd.append(answer.qd_ref)
        self.irc5.take([answer])
        self.irc5.advance()
        return True

    def finish(self, patience: float = 0.2, meanwhile: Callable[[], None] = lambda: None) -> bool:
        self.session.stop("the stream ends")
        while not self.session.at_rest:
            if self.wait(patience) is None:
                return False
            meanwhile()
            self.answer(None)
        return True

    def run(self, **named: object) -> StreamRun:
        return run_stream(self, self.loop, **({"clock": lambda: self.now} | named))  # type: ignore[arg-type]

    def check_braked(self, from_cycle: int, settled: bool = True) -> None:
        """From a cycle on: never beyond the joints' limits, at rest at the end, and that was sent for a while."""
        since = self.answered.index(from_cycle)
        assert np.abs(self.qd[since - 60 : since]).max() > 0.2  # else there was nothing to brake
        change = np.abs(np.diff(self.qd[since:], axis=0))
        assert (change <= LIMITS.max_acceleration * LIMITS.dt * (1.0 + 1e-6)).all()
        assert not self.qd[-1].any()
        if settled:
            assert all((q == self.q[-1]).all() for q in self.q[-45:])


def raising(number: int) -> Callable[[], None]:
    return lambda: os.kill(os.getpid(), number)


@given(st.lists(st.tuples(st.sampled_from(LEAVE), st.integers(0, 110)), min_size=1, max_size=8), st.integers(130, 300))
@settings(max_examples=some(3, of=15))
def test_signals_in_any_order_and_repeated_brake_first(signals: list[tuple[int, int]], start: int) -> None:
    deeds: dict[int, list] = {}
    for number, later in signals:
        deeds.setdefault(start + later, []).append(raising(number))
    first = min(deeds)
    stage = Stage(deeds)
    with Requests().heard() as requests:
        requests.driving = True
        run = stage.run(requests=requests)
        assert requests.leave
    stage.check_braked(first - 1)
    assert stage.cycle - first < 0.6 / 0.004  # the slowest joint needs 0.34 s, the pose is sent for 0.2 s
    assert run.good
    assert [t.cause for t in stage.said if t.after is State.STOPPING] == [requests.leave]
    assert len(stage.said) == 4  # seeding, running, stopping, stopped: a line each


CRASHES = {"SIGSEGV", "SIGBUS", "SIGFPE", "SIGILL", "SIGABRT", "SIGTRAP", "SIGSYS"}
NOT_TO_CATCH = {"SIGKILL", "SIGSTOP"}
NOTHING = {"SIGCHLD", "SIGCONT", "SIGURG", "SIGWINCH"} | {"SIGPIPE", "SIGXFSZ", "SIGTTOU"} | {"SIGUSR1"}
"""What does nothing by default; what Python or `Requests` ignore; what acknowledges."""


def test_every_signal_that_ends_or_suspends_a_process_is_one_to_leave() -> None:
    spared = {getattr(signal, name) for name in CRASHES | NOT_TO_CATCH | NOTHING if hasattr(signal, name)}
    assert signal.valid_signals() - spared == set(LEAVE)


def test_nohup_stays_nohup() -> None:
    old = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Requests().heard() as requests:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not requests.leave
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, old)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_before_a_robot_is_driven_the_second_request_ends_the_program(number: int) -> None:
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip("this process was started to ignore it, as by nohup")
    with Requests().heard() as requests:
        os.kill(os.getpid(), number)
        assert requests.leave
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)


@given(st.integers(130, 300), st.sampled_from(["watchdog: killed", "log: full", "standard error: blocked"]))
@settings(max_examples=some(2, of=6))
def test_a_helper_in_trouble_ends_the_stream_within_a_tenth_of_a_second(cycle: int, words: str) -> None:
    stage = Stage({})
    bad = cycle * 0.004
    run = stage.run(helpers=[lambda now: words if now >= bad else "", lambda now: ""])
    stage.check_braked(cycle - 1)
    stop = next(t for t in stage.said if t.after is State.STOPPING)
    assert stop.cause == words
    assert stop.category == 1
    assert stop.time - bad <= CHECK + 0.004 + 1e-9
    assert run.troubles == [words]
    assert run.at_rest
    assert not run.good


@pytest.mark.parametrize(
    ("error", "where"),
    crossed(
        [SystemExit, KeyboardInterrupt, MemoryError, ValueError, OSError, RecursionError],
        ["on_tick", "on_events", "on_second", "helper"],
    ),
)
def test_whatever_raises_in_the_loop_the_robot_is_braked(error: type[BaseException], where: str) -> None:
    stage = Stage({})

    def fail(*_: object) -> str:
        if stage.cycle >= 150:
            raise error("no more")
        return ""

    run = stage.run(helpers=[fail]) if where == "helper" else stage.run(**{where: fail})
    stage.check_braked(140, settled=False)
    assert error.__name__ in run.failure
    assert run.at_rest
    assert not run.good


@pytest.mark.parametrize("stops_first", [True, False])
def test_the_stream_ends_some_time_after_the_robot_has(stops_first: bool) -> None:
    """It says whether it left it standing: a robot whose program ended is, one that vanished on its way may not be."""
    stage = Stage({}, silent_after=200)
    if stops_first:
        stage.deeds[150] = [lambda: stage.irc5.program(False)]
    run = stage.run(patience=2.0)
    assert 2.0 <= run.silent <= 2.1
    assert run.at_rest is stops_first
    assert run.good is stops_first
    assert "silent for 2 s" in stage.loop.supervisor.causes[-1]


@pytest.mark.parametrize("silence", [0.05, 0.1, 0.7, 2.0, 60.0])
def test_a_stream_that_is_to_end_does_not_wait_long_for_a_robot_that_has_gone(silence: float) -> None:
    """However patient it is with one that it drives: that one is held after the silence, and may speak again."""
    stage = Stage({}, silent_after=200, silence=silence)
    asked = Requests()

    def leave(run: StreamRun) -> None:
        if run.silent > 0.0:
            asked.leave = "enough"

    run = stage.run(requests=asked, on_second=leave)
    assert run.silent <= max(min(silence, GONE), 0.2) + 0.05  # it is asked 0.2 s after the last packet
    assert run.silent >= min(silence, GONE)
    assert run.troubles == []


@given(st.floats(0.05, 5.0), st.integers(1, 300))
@settings(max_examples=some(3, of=60))
def test_a_robot_is_held_if_and_only_if_it_was_silent_for_longer_than_is_borne(silence: float, passes: int) -> None:
    """Within it the stream goes on as if nothing had been; also where a session by itself would see a new start."""
    assume(abs(0.02 * passes - silence) > 0.03)
    stage = Stage({}, silent_after=200, silent_until=200 + passes, silence=silence)
    stage.run(duration=2.0 + 0.02 * passes)
    stops = [t.cause for t in stage.said if t.after in (State.STOPPING, State.STOPPED)]
    assert any("silent for" in cause for cause in stops) is (0.02 * passes > silence)
    if 0.02 * passes < silence:
        assert len(stops) == 2  # at the end only
        assert sum(t.after is State.SEEDING for t in stage.said) == 1


def test_more_silence_than_the_session_bears_is_refused_by_name() -> None:
    session = EgmSession(LIMITS, SessionRules(silence=0.5))
    with pytest.raises(qpsafe.ConfigurationError, match=r"silence = 0\.6: expected at most the session's, 0\.5 s"):
        StreamLoop(Swaying(), session, None, LoopRules(silence=0.6))  # type: ignore[arg-type]


def test_events_are_in_the_report_whether_anybody_is_told_or_not() -> None:
    told: list[str] = []
    for on_events in (told.extend, None):
        stage = Stage({})
        run = stage.run(duration=1.0, on_events=on_events)
        assert run.happened == {"grip": run.happened["grip"]}
        assert run.happened["grip"] >= 11
        assert len(run.events) == run.happened["grip"]
        assert all(name == "grip" and 0.0 < moment <= 1.0 for moment, name in run.events)
        assert stage.loop.take_events() == []  # nothing is kept for ever
    assert told == ["grip"] * run.happened["grip"]


def test_an_acknowledgement_does_not_take_back_that_the_stream_ends() -> None:
    stage = Stage({150: [raising(signal.SIGTERM)], 151: [raising(signal.SIGUSR1)], 230: [raising(signal.SIGUSR1)]})
    with Requests().heard() as requests:
        requests.driving = True
        run = stage.run(requests=requests)
    stage.check_braked(149)
    assert run.good
