"""The fault matrix: every fault of an IRC5 and its wire, at random moments of a moving robot, in simulated time."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import QpsafeError
from qpsafe.limits import JointLimits
from qpsafe.robot.robot import Robot
from qpsafe.sim.irc5.bench import Turn, Workbench
from qpsafe.sim.irc5.fault_cases import CASES, Case
from qpsafe.text.words import counted

Array = NDArray[np.float64]

EARLIEST, LATEST = 200, 2500  # ticks between which a moment is drawn
ROUNDING = 1e-6  # of a step, relative to its limit


class Outcome(NamedTuple):
    """One fault at one moment.

    Attributes:
        tick: Of the reaction, None if it did not come.
        step: Largest step of the reference from one answer to the next, of what the joints can do (speed dt).
        change: Largest change of its speed, of what they can do (acceleration dt).
        seed: Largest distance from the measured pose of a reference that was set to it, one step of ramping in
            deducted [rad].
        unpaired: Answers whose position did not move by their speed.
        error: An exception that escaped, empty if none.
    """

    tick: int | None
    step: float
    change: float
    seed: float
    unpaired: int
    error: str


class Result(NamedTuple):
    """One fault over all moments.

    Attributes:
        case: Its name.
        promise: What the streamer must do.
        within: Ticks it may take.
        moments: How many were simulated.
        seen: In how many the reaction came.
        slowest: Ticks it took at most.
        step, change, seed, unpaired: Largest ones, see `Outcome`.
        errors: Exceptions that escaped.
    """

    case: str
    promise: str
    within: int
    moments: int
    seen: int
    slowest: int
    step: float
    change: float
    seed: float
    unpaired: int
    errors: tuple[str, ...]

    @property
    def kept(self) -> bool:
        """Whether all that is promised was seen."""
        in_time = self.seen == self.moments and self.slowest <= self.within
        inside = self.step <= 1.0 + ROUNDING and self.change <= 1.0 + ROUNDING and self.seed <= ROUNDING
        return in_time and inside and self.unpaired == 0 and not self.errors


def run_faults(
    robot: Robot,
    count: int = 20,
    seed: int = 0,
    cases: Sequence[Case] = CASES,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
    latest: int = LATEST,
) -> list[Result]:
    """Do every fault at `count` random moments.

    Args:
        robot: With spots.
        count: Number of moments.
        seed: Of the moments and of the wire.
        cases: Lines of the matrix.
        jobs: Processes, where the system can fork, never more than moments; 1 elsewhere.
        progress: Called with moments done and to do.
        latest: Tick before which all moments lie.

    Raises:
        QpsafeError: A worker process died.
    """
    jobs = min(jobs, count)
    rng = np.random.default_rng(seed)
    moments = np.sort(rng.integers(EARLIEST, latest, size=count)).tolist()
    bench, copies = Workbench(robot, seed=seed), []
    last: Turn | None = None
    for k in range(moments[-1] + 1):
        copies += [(bench.copy(), last)] * moments.count(k) if last is not None else []
        last = bench.turn()
    work = [(robot, *item, seed + i, cases) for i, item in enumerate(copies)]
    done: list[list[Outcome]] = []
    if jobs > 1 and "fork" in multiprocessing.get_all_start_methods():
        _WORK[:] = work
        try:
            with ProcessPoolExecutor(jobs, multiprocessing.get_context("fork"), _plain_signals) as pool:
                for outcomes in pool.map(_inherited, range(count)):
                    done.append(outcomes)
                    if progress is not None:
                        progress(len(done), count)
        except BrokenProcessPool:
            raise QpsafeError(
                f"a worker process died after {len(done)} of {counted(count, 'moment')} (out of memory?)"
            ) from None
        finally:
            _WORK.clear()
    else:
        for item in work:
            done.append(_moment(*item))
            if progress is not None:
                progress(len(done), count)
    return [_summary(case, [outcomes[c] for outcomes in done]) for c, case in enumerate(cases)]


_WORK: list[tuple] = []  # inherited by forked processes, never pickled


def _plain_signals() -> None:
    """Let the parent alone answer Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _inherited(n: int) -> list[Outcome]:
    return _moment(*_WORK[n])


def _moment(robot: Robot, bench: Workbench, before: Turn, seed: int, cases: Sequence[Case]) -> list[Outcome]:
    """All cases at one moment."""
    found = []
    for c, case in enumerate(cases):
        if case.wraps:  # a run of its own, whose numbers wrap around 30 to 100 ticks after the ramp
            after = int(np.random.default_rng((seed, c)).integers(30, 100))
            copy, last = Workbench(robot, seq=2**32 - EARLIEST - after, seed=seed), before
            for _ in range(EARLIEST):
                last = copy.turn()
        else:
            copy, last = bench.copy(), before
        for k, wire in enumerate((copy.out, copy.back)):
            wire.draw_anew(np.random.default_rng((seed, c, k)))
        found.append(_outcome(copy, last, case))
    return found


def _outcome(bench: Workbench, before: Turn, case: Case) -> Outcome:
    """The fault, and what became of it."""
    turns: list[Turn] = []
    error = ""
    try:
        case.start(bench)
        for k in range(case.window):
            if k == case.lasts:
                case.end(bench)
            turns.append(bench.turn())
    except Exception as problem:
        error = f"{type(problem).__name__}: {problem}"
    tick = case.seen(turns, before) if not error else None
    return Outcome(tick, *_steps([before, *turns], bench.here.loop.session.limits), error)


def _steps(turns: Sequence[Turn], limits: JointLimits) -> tuple[float, float, float, int]:
    """Of the references: largest step, change of speed, distance from the measured pose when set to it, unpaired."""
    step = change = seeded = 0.0
    unpaired = 0
    dt, fastest, most = limits.dt, limits.max_velocity, limits.max_acceleration
    q, qd = turns[0].q_ref, turns[0].qd_ref
    for turn in turns[1:]:
        if turn.q_ref is None or turn.qd_ref is None:
            continue
        if turn.seeded or q is None or qd is None:  # from the measured pose, at rest
            q, qd = turn.q, np.zeros_like(turn.q)
            seeded = max(seeded, float((np.abs(turn.q_ref - q) - most * dt**2).max()))
        moved = np.abs(turn.q_ref - q)
        step = max(step, float((moved / (fastest * dt)).max()))
        change = max(change, float((np.abs(turn.qd_ref - qd) / (most * dt)).max()))
        unpaired += bool(np.abs(turn.q_ref - q - turn.qd_ref * dt).max() > 1e-9)
        q, qd = turn.q_ref, turn.qd_ref
    return step, change, seeded, unpaired


def _summary(case: Case, outcomes: Sequence[Outcome]) -> Result:
    ticks = [outcome.tick for outcome in outcomes if outcome.tick is not None]
    return Result(
        case=case.name,
        promise=case.promise,
        within=case.within,
        moments=len(outcomes),
        seen=len(ticks),
        slowest=max(ticks, default=0),
        step=max(outcome.step for outcome in outcomes),
        change=max(outcome.change for outcome in outcomes),
        seed=max(outcome.seed for outcome in outcomes),
        unpaired=sum(outcome.unpaired for outcome in outcomes),
        errors=tuple(outcome.error for outcome in outcomes if outcome.error),
    )
