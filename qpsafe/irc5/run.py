"""The real-time loop of `qpsafe stream`: waits for the robot, answers, measures, and leaves only after a ramp out."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from qpsafe.errors import ConfigurationError, in_words
from qpsafe.irc5.distances import SensorInput
from qpsafe.irc5.loop import ROBOT, StreamLoop
from qpsafe.irc5.process.latency import Latency
from qpsafe.irc5.process.realtime import resident
from qpsafe.irc5.process.requests import Requests
from qpsafe.irc5.process.watchdog import Watchdog
from qpsafe.irc5.streamer import EgmStreamer
from qpsafe.irc5.supervisor import State, StopCategory, cause_in_words
from qpsafe.text.given import number, of_kind, parts, to_call
from qpsafe.tick import Tick

WAIT = 0.02  # longest time between two heartbeats [s]
CHECK = 0.05  # time between two looks at the helpers [s]
GONE = 1.0  # a robot silent for so long is not waited for when the stream is to end [s]
STEADY = 5.0  # memory is compared from this time of the stream on [s]

#: A helper of the loop: says what is wrong with it at a time of the monotonic clock [s], or nothing.
Helper = Callable[[float], str]


@dataclass
class StreamRun:
    """What became of a stream.

    Attributes:
        latency: From the arrival of the oldest packet that was not answered to the answer's leaving.
        duration: From the first answer to the last [s].
        started: Memory in use in the steady state, `STEADY` after the first answer [byte].
        ended: Memory in use at the end [byte].
        worst_tick: Longest time that the controller took [s].
        answered: Whether the robot has been answered at all.
        at_rest: Whether the last answer left the robot standing.
        silent: How long the robot has been silent [s].
        failure: What failed in the loop itself, empty if nothing.
        troubles: What was wrong with the loop's helpers, each once; empty if nothing.
        happened: How often each event of the task program happened.
        events: The last events, (time since the first answer [s], name).
    """

    latency: Latency = field(default_factory=Latency)
    duration: float = 0.0
    started: int = 0
    ended: int = 0
    worst_tick: float = 0.0
    answered: bool = False
    at_rest: bool = True
    silent: float = 0.0
    failure: str = ""
    troubles: list[str] = field(default_factory=list)
    happened: Counter[str] = field(default_factory=Counter)
    events: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=1000))

    @property
    def good(self) -> bool:
        """Whether a robot was streamed to, nothing failed, and it was left standing."""
        return self.answered and self.at_rest and not self.failure and not self.troubles


def run_stream(
    streamer: EgmStreamer,
    loop: StreamLoop,
    *,
    sensors: SensorInput | None = None,
    watchdog: Watchdog | None = None,
    helpers: Sequence[Helper] = (),
    duration: float | None = None,
    patience: float = math.inf,
    requests: Requests | None = None,
    on_tick: Callable[[Tick | None], None] | None = None,
    on_events: Callable[[list[str]], None] | None = None,
    on_second: Callable[[StreamRun], None] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> StreamRun:
    """Answer the robot until asked to leave, then ramp out, and only then fall silent.

    Args:
        streamer: The robot's end.
        loop: What answers.
        sensors: Where distances come from; None for a robot without.
        watchdog: To be told that the loop runs, and to be asked what it thinks.
        helpers: Other helpers; one that is in trouble ends the stream, with the robot braked first.
        duration: Leave this long after the first answer [s].
        patience: Leave when a robot that was answered has been silent for so long [s].
        requests: What is asked from outside.
        on_tick: Called with the controller's tick after each answer.
        on_events: Called with names of events before the answer of their tick is sent.
        on_second: Called about once a second, whether the robot speaks or not.
        clock: Tells the time [s].

    Raises:
        ConfigurationError: An argument is of another kind, the loop is another streamer's, or the watchdog does not
            watch; before anything is sent.
    """
    requests = Requests() if requests is None else requests
    kinds = {"streamer": (streamer, EgmStreamer), "loop": (loop, StreamLoop), "requests": (requests, Requests)}
    kinds |= {"sensors": (sensors, SensorInput), "watchdog": (watchdog, Watchdog)}
    for key, (value, kind) in kinds.items():
        if value is not None or key in ("streamer", "loop"):
            of_kind("run_stream", key, value, kind)
    for key, each in {"on_tick": on_tick, "on_events": on_events, "on_second": on_second}.items():
        if each is not None:
            to_call("run_stream", key, each)
    watched = [] if watchdog is None else [watchdog.trouble]
    watched += parts("run_stream", "helpers", helpers, "a list of functions")
    for helper in watched:
        to_call("run_stream", "helpers", helper)
    _check_times(duration, patience)
    if loop.session is not streamer.session:
        raise ConfigurationError("run_stream", "loop", loop, "a loop that has the streamer's session")
    if watchdog is not None and not watchdog.alive:
        raise ConfigurationError("run_stream", "watchdog", watchdog, "one that watches: inside its `with` block")
    run = StreamRun()
    heard = first = second = _began(clock)
    check = -math.inf

    def leave(cause: str) -> None:
        loop.stop(StopCategory.CONTROLLED_THEN_SILENT, cause)

    def trouble(cause: str) -> None:
        cause = cause_in_words(cause)  # whatever a helper says
        if cause not in run.troubles:
            run.troubles.append(cause)
        leave(cause)

    try:
        while True:
            cycle = streamer.wait(WAIT)
            now = clock()
            if sensors is not None:  # also while the robot is silent: else the system drops what is new
                sensors.listen(now)
            if watchdog is not None:
                watchdog.beat()
                if watchdog.asked > 0.0:
                    trouble("watchdog: no heartbeat in time")
            if now - check >= CHECK:
                check = now
                for helper in watched:
                    if found := helper(now):
                        trouble(found)
            if requests.leave:
                leave(requests.leave)
            if duration is not None and run.answered and now - first >= duration:
                leave("the duration is over")
            if requests.acknowledge:
                requests.acknowledge = False
                if not loop.leaving:  # that is not taken back
                    loop.acknowledge("operator (SIGUSR1)")
            run.silent = now - heard
            if now - second >= 1.0:
                second = now
                if run.started == 0 and run.duration >= STEADY:
                    run.started = resident()
                if on_second is not None:
                    on_second(run)
            if cycle is None:
                loop.silent(run.silent)
                if run.answered and run.silent >= patience:
                    leave(f"{ROBOT}silent for {patience:g} s")
                gone = run.silent > min(loop.rules.silence, GONE) or not run.answered
                if loop.leaving and gone:  # nobody to ramp out for
                    break
                continue
            heard = now
            distances, ages = (None, None) if sensors is None else sensors.read(now)
            reference = loop.step(cycle, distances, ages)
            if loop.over:
                break
            if not run.answered:
                run.answered, first = True, now
            run.duration = now - first
            if loop.events:
                names = loop.take_events()
                run.happened.update(names)
                run.events.extend((run.duration, name) for name in names)
                if on_events is not None:
                    on_events(names)
            streamer.answer(reference)
            run.latency.record(streamer.response)
            if loop.tick is not None:
                run.worst_tick = max(run.worst_tick, loop.tick.solve_time)
            if on_tick is not None:
                on_tick(loop.tick)
    except BaseException as error:  # the loop itself: what it would send cannot be trusted, the session can brake
        run.failure = f"{type(error).__name__}: {error}"
        leave(f"loop failed: {run.failure}")
        _last_resort(streamer, loop, watchdog)
    run.at_rest = not run.answered or loop.session.at_rest
    run.ended = resident()
    if loop.supervisor.state is not State.STOPPED:
        loop.supervisor.standstill("the stream has ended" if run.at_rest else "the stream has ended: nobody listens")
    return run


def _began(clock: Callable[[], float]) -> float:
    """What the clock tells, if it tells a time [s]."""
    to_call("run_stream", "clock", clock)
    expected = "a function that tells the time [s]"
    try:
        now = clock()
    except Exception as error:
        raise ConfigurationError("run_stream", "clock", clock, f"{expected} ({in_words(error)})") from None
    return number("run_stream", "clock", now, expected)


def _check_times(duration: float | None, patience: float) -> None:
    if duration is not None:
        number("run_stream", "duration", duration, "a finite time >= 0 [s], or None", 0.0)
    if not (isinstance(patience, float) and patience == math.inf):
        number("run_stream", "patience", patience, "a time > 0 [s]", above=0.0)


def _last_resort(streamer: EgmStreamer, loop: StreamLoop, watchdog: Watchdog | None) -> None:
    """The session brakes by itself; if even that fails, silence (category 0)."""
    try:
        streamer.finish(meanwhile=(lambda: None) if watchdog is None else watchdog.beat)
    except BaseException as error:
        loop.supervisor.stop(StopCategory.IMMEDIATE, f"session failed: {type(error).__name__}: {error}")
