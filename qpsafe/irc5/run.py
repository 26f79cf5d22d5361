"""The real-time loop of `qpsafe stream`: waits for the robot, answers, measures, and leaves only after a ramp out."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import Any

from qpsafe.irc5.distances import SensorInput
from qpsafe.irc5.latency import Latency
from qpsafe.irc5.loop import StreamLoop
from qpsafe.irc5.realtime import resident
from qpsafe.irc5.streamer import EgmStreamer
from qpsafe.irc5.watchdog import Watchdog
from qpsafe.supervisor import State, StopCategory
from qpsafe.tick import Tick

WAIT = 0.02  # longest time between two heartbeats [s]
STEADY = 5.0  # memory is compared from this time of the stream on [s]


@dataclass
class StreamRun:
    """What became of a stream.

    Attributes:
        latency: From the arrival of the oldest packet that was not answered to the answer's leaving.
        duration: From the first answer to the last [s].
        started: Memory in use in the steady state, `STEADY` after the first answer [byte].
        ended: Memory in use at the end [byte].
        worst_tick: Longest time that the controller took [s].
        at_rest: Whether the reference was at rest when the stream fell silent.
        failure: What failed in the loop itself, empty if nothing.
    """

    latency: Latency = field(default_factory=Latency)
    duration: float = 0.0
    started: int = 0
    ended: int = 0
    worst_tick: float = 0.0
    at_rest: bool = True
    failure: str = ""


class Requests:
    """What signals ask of the loop: SIGINT and SIGTERM to leave, SIGUSR1 to acknowledge."""

    def __init__(self) -> None:
        self.leave = ""
        self.acknowledge = False

    @contextmanager
    def heard(self) -> Iterator[Requests]:
        """Listen to signals meanwhile; the second request to leave is the old handler's, at once."""
        before: dict[signal.Signals, Any] = {}

        def leave(number: int, frame: FrameType | None) -> None:
            if self.leave and callable(old := before[signal.Signals(number)]):
                old(number, frame)
            self.leave = "Ctrl-C" if number == signal.SIGINT else "SIGTERM"

        def acknowledge(number: int, frame: FrameType | None) -> None:
            self.acknowledge = True

        handlers = {signal.SIGINT: leave, signal.SIGTERM: leave, signal.SIGUSR1: acknowledge}
        for number, handler in handlers.items():
            before[number] = signal.signal(number, handler)
        try:
            yield self
        finally:
            for number, old in before.items():
                signal.signal(number, old)


def run_stream(
    streamer: EgmStreamer,
    loop: StreamLoop,
    *,
    sensors: SensorInput | None = None,
    watchdog: Watchdog | None = None,
    duration: float | None = None,
    requests: Requests | None = None,
    on_tick: Callable[[Tick | None], None] | None = None,
    on_events: Callable[[list[str]], None] | None = None,
    on_second: Callable[[StreamRun], None] | None = None,
) -> StreamRun:
    """Answer the robot until asked to leave, then ramp out, and only then fall silent.

    Args:
        streamer: The robot's end.
        loop: What answers.
        sensors: Where distances come from; None for a robot without.
        watchdog: To be told that the loop runs, and to be asked what it thinks.
        duration: Leave this long after the first answer [s].
        requests: What is asked from outside.
        on_tick: Called with the controller's tick after each answer.
        on_events: Called with names of events before the answer of their tick is sent.
        on_second: Called about once a second, after an answer.
    """
    run, requests = StreamRun(), Requests() if requests is None else requests
    heard = first = last = time.monotonic()
    began = False
    try:
        while True:
            cycle = streamer.wait(WAIT)
            now = time.monotonic()
            if watchdog is not None:
                watchdog.beat()
                if watchdog.asked > 0.0:
                    loop.stop(StopCategory.CONTROLLED_THEN_SILENT, "watchdog: no heartbeat in time")
            if requests.leave:
                loop.stop(StopCategory.CONTROLLED_THEN_SILENT, requests.leave)
            if duration is not None and began and now - first >= duration:
                loop.stop(StopCategory.CONTROLLED_THEN_SILENT, "the duration is over")
            if requests.acknowledge:
                requests.acknowledge = False
                loop.acknowledge("operator (SIGUSR1)")
            if cycle is None:
                loop.silent(now - heard)
                if loop.leaving and (now - heard > loop.rules.silence or not began):  # nobody to ramp out for
                    break
                continue
            heard = now
            distances, ages = (None, None) if sensors is None else sensors.read(now)
            reference = loop.step(cycle, distances, ages)
            if loop.over:
                break
            if loop.events and on_events is not None:
                on_events(loop.take_events())
            streamer.answer(reference)
            run.latency.record(streamer.response)
            if not began:
                began, first, last = True, now, now
            run.duration = now - first
            if loop.tick is not None:
                run.worst_tick = max(run.worst_tick, loop.tick.solve_time)
            if on_tick is not None:
                on_tick(loop.tick)
            if now - last >= 1.0:
                last = now
                if run.started == 0 and run.duration >= STEADY:
                    run.started = resident()
                if on_second is not None:
                    on_second(run)
    except Exception as error:  # the loop itself: nothing it would send can be trusted but a ramp out of the session
        run.failure = f"{type(error).__name__}: {error}"
        loop.stop(StopCategory.CONTROLLED_THEN_SILENT, f"loop failed: {run.failure}")
        run.at_rest = _last_resort(streamer, loop)
    run.ended = resident()
    if loop.supervisor.state is not State.STOPPED:
        loop.supervisor.standstill("the stream has ended")
    return run


def _last_resort(streamer: EgmStreamer, loop: StreamLoop) -> bool:
    """The session brakes by itself; if even that fails, silence (category 0)."""
    try:
        return streamer.finish()
    except Exception as error:
        loop.supervisor.stop(StopCategory.IMMEDIATE, f"session failed: {type(error).__name__}: {error}")
        return False
