"""Sick sensors in closed loop: every case of docs/reference/sensing.md, injected at random moments of experiment one.

With spots their readings are spoilt, with sensors of many zones their images.

The healthy run is simulated once. At every moment it is copied, and each copy goes on with another fault for a while.
What is checked: no contact that the healthy run did not have, no limit passed, and the reaction that the table states
within the ticks that it states.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop
from qpsafe.sim.sick.cases import CASES, WINDOW, Case
from qpsafe.sim.sick.frame_cases import FRAME_CASES, FrameCase
from qpsafe.sim.sick.moment import Outcome, at_moment
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.sim.experiments.fixed.experiment import FixedExperiment

Array = NDArray[np.float64]

LIMIT_TOLERANCE = 1e-9


class Result(NamedTuple):
    """One case over all moments.

    Attributes:
        case: Its name.
        promise: The reaction.
        within: Ticks it may take.
        moments: How many moments were simulated.
        applied: In how many of them the case could show (what is held must have been seen).
        slowest: Ticks the reaction took at most.
        missing: In how many moments it did not come.
        contacts: In how many moments the robot touched board or person, where the healthy run did not.
        passed: Largest excess over a joint limit, relative to it.
        nearest: Smallest distance to board or person [m].
        nearest_healthy: The same in the healthy run over the same windows [m].
    """

    case: str
    promise: str
    within: int
    moments: int
    applied: int
    slowest: int
    missing: int
    contacts: int
    passed: float
    nearest: float
    nearest_healthy: float

    @property
    def kept(self) -> bool | None:
        """Whether all that is promised was seen; None if the case could show at no moment and nothing else broke."""
        if not self.applied and self.contacts == 0 and self.passed <= LIMIT_TOLERANCE:
            return None
        in_time = self.missing == 0 and self.slowest <= self.within
        return in_time and self.contacts == 0 and self.passed <= LIMIT_TOLERANCE


def random_moments(experiment: FixedExperiment, count: int, seed: int) -> list[int]:
    """Ticks at random within the approaches.

    Args:
        experiment: Whose approaches.
        count: How many.
        seed: Of the choice.
    """
    rng = np.random.default_rng(seed)
    windows = np.array(experiment.windows())
    chosen = windows[rng.integers(len(windows), size=count)]
    times = rng.uniform(chosen[:, 0] + 0.8, chosen[:, 1])
    return sorted(int(t / 0.004) for t in times)


def run_matrix(
    experiment: FixedExperiment,
    count: int = 20,
    seed: int = 0,
    cases: Sequence[Case | FrameCase] | None = None,
    jobs: int = 2,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Inject every case at `count` random moments of the experiment.

    Args:
        experiment: The first experiment.
        count: Number of moments, at random while somebody is seen during an approach.
        seed: Of the moments and of the sensors that fall sick.
        cases: Lines of the table; by default those of images where the experiment has sensors that make some.
        jobs: Processes, where the system can fork, never more than moments; 1 elsewhere.
        progress: Called with work done and to do.

    Raises:
        ConfigurationError: There are no sensors that could fall sick, or fewer moments than asked for.
    """
    jobs = min(jobs, count)
    moments = random_moments(experiment, 5 * count, seed)
    copies: list[tuple[FixedLoop, Array]] = []
    loop = FixedLoop(experiment)
    if not loop.sensor_names:
        expected = "sensors that can fall sick: ideal, sharp, vl53l5cx, depth, or several joined by +"
        raise ConfigurationError("run_matrix", "sensor", experiment.sensor, expected)
    if cases is None:
        cases = CASES if loop.ranging is None else FRAME_CASES
    total = moments[-1] + 1 + count * (len(cases) + 1) * WINDOW
    reading, seen = np.full(0, np.inf), False
    for k in range(moments[-1] + 1):
        if k in moments and seen:  # where nobody sees anything there is nothing to lose
            copies += [(loop.copy(), reading)] * moments.count(k)
        moment = loop.step()
        reading = moment.distances
        seen = bool(np.isfinite(reading).any() if loop.ranging is None else len(moment.tick.points))
        loop.advance()
        if progress is not None and k % 100 == 0:
            progress(k, total)
    if len(copies) < count:
        raise ConfigurationError("run_matrix", "count", count, f"at most {counted(len(copies), 'moment')} for this run")
    chosen = np.random.default_rng((seed, 1)).permutation(len(copies))[:count]
    work = [(*copies[n], cases, seed + i) for i, n in enumerate(np.sort(chosen))]
    done: list[list[Outcome]] = []
    if jobs > 1 and "fork" in multiprocessing.get_all_start_methods():
        _WORK[:] = work
        with multiprocessing.get_context("fork").Pool(jobs, initializer=_plain_signals) as pool:
            for item in pool.imap(_inherited, range(count)):
                done.append(item)
                if progress is not None:
                    progress(total - (count - len(done)) * (len(cases) + 1) * WINDOW, total)
            pool.close()
            pool.join()
        _WORK.clear()
    else:
        for task in work:
            done.append(at_moment(*task))
            if progress is not None:
                progress(total - (count - len(done)) * (len(cases) + 1) * WINDOW, total)
    return [_summary(case, [item[c] for item in done]) for c, case in enumerate(cases)]


_WORK: list[
    tuple[FixedLoop, Array, Sequence[Case | FrameCase], int]
] = []  # inherited by forked processes, never pickled


def _plain_signals() -> None:
    """Let the parent alone answer Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _inherited(n: int) -> list[Outcome]:
    return at_moment(*_WORK[n])


def _summary(case: Case | FrameCase, rows: list[Outcome]) -> Result:
    reactions = [row.reaction for row in rows]
    return Result(
        case=case.name,
        promise=case.promise,
        within=case.within,
        moments=len(rows),
        applied=sum(r.applies for r in reactions),
        slowest=max((r.tick or 0 for r in reactions if r.applies), default=0),
        missing=sum(r.tick is None for r in reactions),
        contacts=sum(row.contact for row in rows),
        passed=max(row.passed for row in rows),
        nearest=min(row.nearest for row in rows),
        nearest_healthy=min(row.nearest_healthy for row in rows),
    )
