"""The simulated IRC5 in a process of its own, on its own clock: every 4 ms, whatever the other end does."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.irc5.irc5_loop import Irc5Loop
from qpsafe.sim.irc5.link import NO_FAULTS, WireFaults
from qpsafe.sim.irc5.udp import NoAnswerError, UdpExchange

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Happening:
    """Something that is done to the robot, at a time of the run [s], counted from the first answer."""

    time: float
    do: Callable[[Irc5Loop, UdpExchange], None]


def happenings(
    restarts: list[float],
    motors_off: list[tuple[float, float]],
    rapid_stop: list[tuple[float, float]],
    faults: WireFaults,
    faulty: tuple[float, float],
    strangers: float,
) -> list[Happening]:
    """What the options of `qpsafe irc5-sim` ask for, in order of time.

    Args:
        restarts: When the RAPID program starts anew [s].
        motors_off: When the motors go off, and for how long [s].
        rapid_stop: The same for the RAPID program.
        faults: Of the wire.
        faulty: From when on, and for how long [s].
        strangers: Share of cycles in which somebody else sends, during the same time.

    Raises:
        ConfigurationError: A time that is none, or a share that is none.
    """
    times = {"restarts": [(t, 0.0) for t in restarts], "motors_off": motors_off, "rapid_stop": rapid_stop}
    for key, spans in (times | {"faulty": [faulty]}).items():
        for start, length in spans:
            if not (0.0 <= start < math.inf and length >= 0.0):  # true for NaN
                expected = "a time from 0 on, and where it has a length one from 0 on [s]"
                raise ConfigurationError("happenings", key, (start, length), expected)
    if not 0.0 <= strangers <= 1.0:
        raise ConfigurationError("happenings", "strangers", strangers, "0 to 1")
    found = [Happening(t, lambda run, wire: run.irc5.restart(0.1)) for t in restarts]
    for start, length in motors_off:
        found.append(Happening(start, lambda run, wire: run.irc5.motors(False)))
        found.append(Happening(start + length, lambda run, wire: run.irc5.motors(True)))
    for start, length in rapid_stop:
        found.append(Happening(start, lambda run, wire: run.irc5.program(False)))
        found.append(Happening(start + length, lambda run, wire: run.irc5.program(True)))

    def spoil(wire: UdpExchange, how: WireFaults, share: float) -> None:
        wire.set_faults(how)
        wire.strangers = share

    if faults != NO_FAULTS or strangers > 0.0:
        found.append(Happening(faulty[0], lambda run, wire: spoil(wire, faults, strangers)))
        found.append(Happening(sum(faulty), lambda run, wire: spoil(wire, NO_FAULTS, 0.0)))
    return sorted(found, key=lambda item: item.time)


@dataclass
class RobotRun:
    """What the robot's end has seen.

    Attributes:
        cycles: How many cycles were run.
        late: Of these, how many began more than a period late: the simulation itself was not on time.
        latest: How late at most [s].
        counts: See `qpsafe.sim.irc5.controller.Counts`.
        rejected: Datagrams that were no answer.
        speed: Largest joint speed measured [rad/s].
        q: Measured positions, every cycle from the first answer (N, n) [rad], if kept.
        reference: Positions last answered (N, n) [rad], if kept.
        events: (cycle, name) of the events taken.
    """

    cycles: int = 0
    late: int = 0
    latest: float = 0.0
    counts: dict[str, int] = field(default_factory=dict)
    rejected: int = 0
    speed: float = 0.0
    q: list[Array] = field(default_factory=list)
    reference: list[Array] = field(default_factory=list)
    events: list[tuple[int, str]] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Without the positions."""
        shown = asdict(self)
        del shown["q"], shown["reference"]
        return shown


def run_robot(
    run: Irc5Loop,
    exchange: UdpExchange,
    duration: float,
    *,
    lockstep: bool = False,
    keep: bool = False,
    todo: list[Happening] | None = None,
    progress: Callable[[RobotRun], None] | None = None,
    over: Callable[[], bool] = lambda: False,
) -> RobotRun:
    """Run until `duration` after the first answer [s], or until `over()`.

    Args:
        run: The experiment.
        exchange: Its sockets.
        duration: [s], in the robot's cycles.
        lockstep: Do not keep to the clock: the exchange waits for answers.
        keep: Keep positions.
        todo: What happens to the robot meanwhile, in order of time.
        progress: Told after every cycle.
        over: Asked after every cycle.
    """
    irc5, dt = run.irc5, run.irc5.dt
    found, left = RobotRun(), list(todo or ())
    first, before = None, run.plant.q
    deadline = time.perf_counter()
    while not over():
        if not lockstep:
            deadline = _sleep(deadline + dt, dt, found)
        moment = run.step()
        if run.running:
            first = found.cycles if first is None else first
            if keep:
                found.q.append(run.plant.q)
                found.reference.append(before if irc5.reference is None else irc5.reference.q_ref)
            found.events.extend((found.cycles - first, name) for name in moment.tick.events)
        run.advance()
        here = run.plant.q
        found.speed, before = max(found.speed, float(np.abs(here - before).max()) / dt), here
        found.cycles += 1
        if progress is not None:
            progress(found)
        if first is None:
            continue
        elapsed = (found.cycles - first) * dt
        while left and elapsed >= left[0].time:
            left.pop(0).do(run, exchange)
        if elapsed >= duration - 1e-9:
            break
    found.counts, found.rejected = asdict(irc5.counts), exchange.rejected
    return found


def farewell(run: Irc5Loop, exchange: UdpExchange, lockstep: bool = False, cycles: int = 25) -> None:
    """Stop the RAPID program and say so for some cycles, so that the other end knows why nothing comes any more.

    Args:
        run: The loop that ends.
        exchange: Sends a packet and takes what has come.
        lockstep: Whether a packet waits for its answer.
        cycles: How many.
    """
    run.irc5.program(False)
    if run.irc5.counts.answered == 0:  # there is nobody to tell
        return
    with suppress(NoAnswerError):
        for _ in range(cycles):
            if not lockstep:
                time.sleep(run.irc5.dt)
            run.step()
            run.advance()


def _sleep(deadline: float, dt: float, found: RobotRun) -> float:
    """Sleep until the deadline; the one that the next is counted from: cycles that were slept over are not made up."""
    left = deadline - time.perf_counter()
    if left > 0.0:
        time.sleep(left)
    late = time.perf_counter() - deadline
    found.latest = max(found.latest, late)
    if late > dt:
        found.late += 1
        return deadline + late
    return deadline
