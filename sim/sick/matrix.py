"""Sick sensors in closed loop: every case of docs/reference/sensing.md, injected at random moments of experiment one.

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
from qpsafe.sensing.speed_cap import wire_speed
from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop
from qpsafe.sim.sick.cases import CASES, WINDOW, Case, Reaction, Record, Window
from qpsafe.sim.world.distance import TrueDistances
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
    cases: Sequence[Case] = CASES,
    jobs: int = 2,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Inject every case at `count` random moments of the experiment.

    Args:
        experiment: The first experiment.
        count: Number of moments, at random while a spot sees something during an approach.
        seed: Of the moments and of the spots that fall sick.
        cases: Lines of the table.
        jobs: Processes, where the system can fork; 1 elsewhere.
        progress: Called with work done and to do.
    """
    moments = random_moments(experiment, 5 * count, seed)
    copies: list[tuple[FixedLoop, Array]] = []
    loop = FixedLoop(experiment)
    total = moments[-1] + 1 + count * (len(cases) + 1) * WINDOW
    reading = np.full(0, np.inf)
    for k in range(moments[-1] + 1):
        if k in moments and np.isfinite(reading).any():  # where nobody sees anything there is nothing to lose
            copies += [(loop.copy(), reading)] * moments.count(k)
        reading = loop.step().distances
        loop.advance()
        if progress is not None and k % 100 == 0:
            progress(k, total)
    if len(copies) < count:
        raise ConfigurationError("run_matrix", "count", count, f"at most {counted(len(copies), 'moment')} for this run")
    chosen = np.random.default_rng((seed, 1)).permutation(len(copies))[:count]
    work = [(*copies[n], cases, seed + i) for i, n in enumerate(np.sort(chosen))]
    done: list[list[tuple[Reaction, bool, float, float, float]]] = []
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
            done.append(_moment(*task))
            if progress is not None:
                progress(total - (count - len(done)) * (len(cases) + 1) * WINDOW, total)
    return [_summary(case, [item[c] for item in done]) for c, case in enumerate(cases)]


_WORK: list[tuple[FixedLoop, Array, Sequence[Case], int]] = []  # inherited by forked processes, never pickled


def _plain_signals() -> None:
    """Let the parent alone answer Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _inherited(n: int) -> list[tuple[Reaction, bool, float, float, float]]:
    return _moment(*_WORK[n])


def _summary(case: Case, rows: list[tuple[Reaction, bool, float, float, float]]) -> Result:
    reactions = [row[0] for row in rows]
    return Result(
        case=case.name,
        promise=case.promise,
        within=case.within,
        moments=len(rows),
        applied=sum(r.applies for r in reactions),
        slowest=max((r.tick or 0 for r in reactions if r.applies), default=0),
        missing=sum(r.tick is None for r in reactions),
        contacts=sum(row[1] for row in rows),
        passed=max(row[2] for row in rows),
        nearest=min(row[3] for row in rows),
        nearest_healthy=min(row[4] for row in rows),
    )


def _moment(
    loop: FixedLoop, before: Array, cases: Sequence[Case], seed: int
) -> list[tuple[Reaction, bool, float, float, float]]:
    """All cases at one moment: reaction, whether there was a new contact, excess over limits, distances."""
    rng = np.random.default_rng(seed)
    count = len(before)
    twin = loop.copy()
    healthy = _play(twin, np.zeros(0, dtype=np.intp), before, None)
    quiet = min(record.gap for record in healthy)
    results = []
    for case in cases:
        seeing = np.flatnonzero(np.isfinite(before))
        first = int(rng.choice(seeing)) if len(seeing) else int(rng.integers(count))
        number = max(round(case.share * count), 1)
        others = rng.permutation(np.delete(np.arange(count), first))
        sick = np.concatenate(([first], others[: number - 1])).astype(np.intp)
        copy = loop.copy()
        ticks = _play(copy, sick, before, case)
        copy.controller.acknowledge()
        sensing = copy.controller.sensing
        assert sensing is not None
        window = Window(
            sick,
            sensing.spots.names,
            before,
            healthy[0],
            ticks,
            sensing.health.severity,
            copy.controller.rules,
            copy.controller.dt,
        )
        gap = min(record.gap for record in ticks)
        results.append((case.reaction(window), gap <= 0.0 < quiet, _excess(loop, ticks), gap, quiet))
    return results


def _play(loop: FixedLoop, sick: NDArray[np.intp], before: Array, case: Case | None) -> list[Record]:
    """Go on for a window, the sick spots spoilt for as long as the case says."""
    records: list[Record] = []
    sensing, robot = loop.controller.sensing, loop.controller.robot
    assert sensing is not None
    anchor, gaps = None, TrueDistances(loop.scene)
    for k in range(WINDOW):
        fault = None
        if case is not None and k < case.lasts:

            def fault(distances: Array, case: Case = case) -> tuple[Array, Array]:
                spoilt, ages = distances.copy(), np.zeros(len(distances))
                spoilt[sick], ages[sick] = case.spoil(distances[sick], before[sick])
                return spoilt, ages

        moment = loop.step(fault)
        tick = moment.tick
        moved = 0.0
        if len(sick) and np.isfinite(before[sick[0]]):
            point = sensing.spots.points(moment.state, np.where(np.isfinite(before), before, 0.0))[sick[0]]
            anchor = point if anchor is None else anchor
            moved = float(np.linalg.norm(point - anchor))
        records.append(
            Record(
                tick.status,
                tick.severity,
                tick.unseen,
                sensing.counted,
                tick.cdf_n,
                wire_speed(tick.reference.qd, robot.at(tick.reference.q)),
                tick.reference.q,
                tick.reference.qd,
                min(found.distance for found in gaps.measure(loop.plant.data)),
                moved,
            )
        )
        loop.advance()
    return records


def _excess(loop: FixedLoop, ticks: list[Record]) -> float:
    """Largest excess over a joint limit of the references: position [rad], velocity and acceleration relative to it."""
    robot, dt = loop.controller.robot, loop.controller.dt
    q, qd = np.array([record.q for record in ticks]), np.array([record.qd for record in ticks])
    position = max((robot.lower - q).max(), (q - robot.upper).max())
    velocity = (np.abs(qd) / robot.max_velocity).max() - 1.0
    acceleration = (np.abs(np.diff(qd, axis=0)) / (robot.max_acceleration * dt)).max() - 1.0
    return float(max(position, velocity, acceleration))
