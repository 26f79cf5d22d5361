"""Sick sensors: what is wrong with them, and the reaction that docs/reference/sensing.md promises for each case."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sensing.health import CAPPED, STOPPED
from qpsafe.sensing.rules import SensingRules

Array = NDArray[np.float64]

WINDOW = 150  # ticks that are simulated after a fault begins
SHORT = 50  # ticks of a passing fault
BRAKE = 90  # ticks: the slowest joint to brake from full speed needs 84


class Record(NamedTuple):
    """What is kept of one tick with a fault."""

    status: str
    severity: str
    unseen: tuple[str, ...]
    counted: Array  # distance of each spot's point that counts, as last seen (k,), +inf for none
    cdf_n: float
    speed: float  # of the wire, commanded [m/s]
    q: Array
    qd: Array
    gap: float  # robot to board or person [m]
    moved: float  # by the point that the first sick spot meant when the fault began, or by the sick sensor [m]


class Window(NamedTuple):
    """A copy of the run from the moment on, with a fault."""

    sick: NDArray[np.intp]  # spots, or range sensors
    names: tuple[str, ...]
    before: Array  # readings in the tick before the fault
    run: list[Record]  # the ticks as they would have been
    ticks: list[Record]
    after: str  # severity after acknowledging at the end
    rules: SensingRules
    dt: float

    @property
    def healthy(self) -> Record:
        """The first tick as it would have been."""
        return self.run[0]


class Reaction(NamedTuple):
    """Whether and when the table's reaction came: tick from 1, None if it did not; whether it applied at all."""

    tick: int | None
    applies: bool = True


class Case(NamedTuple):
    """One line of the table.

    Attributes:
        name: What is wrong.
        share: Share of the spots that are sick, 0 for a single one.
        lasts: For how many ticks.
        spoil: Readings and ages of the sick spots, from their healthy readings and those before the fault.
        promise: The reaction.
        within: Ticks it may take.
        reaction: Finds it.
    """

    name: str
    share: float
    lasts: int
    spoil: Callable[[Array, Array], tuple[Array | float, Array | float]]
    promise: str
    within: int
    reaction: Callable[[Window], Reaction]


def first_tick(window: Window, holds: Callable[[Record], bool]) -> Reaction:
    """The first tick of which something holds."""
    return Reaction(next((k + 1 for k, record in enumerate(window.ticks) if holds(record)), None))


def _reported(window: Window) -> Reaction:
    """Named and held in the first tick, capped when dead, for good until acknowledged."""
    i, name = window.sick[0], window.names[window.sick[0]]
    first = window.ticks[0]
    kept = first.counted[i] <= window.healthy.counted[i] + window.rules.jump or not window.before[i] < np.inf
    dead = window.rules.ticks(window.rules.dead_after, window.dt)
    capped = all(record.severity == CAPPED for record in window.ticks[dead - 1 :])
    good = first.status == "degraded" and name in first.unseen and kept and capped and window.after == "clear"
    return first_tick(window, lambda record: name in record.unseen) if good else Reaction(None)


def _slowed(window: Window) -> Reaction:
    """Capped until the end, and slow from some tick on."""
    if window.ticks[-1].severity != CAPPED:
        return Reaction(None)
    fast = [k for k, record in enumerate(window.ticks) if record.speed > 1.001 * window.rules.speed_cap]
    last = max(fast, default=-1) + 2
    return Reaction(last if last <= len(window.ticks) else None)


def _held(window: Window) -> Reaction:
    """What counted goes on counting for the hold time."""
    i = window.sick[0]
    if not window.before[i] < np.inf or not window.healthy.counted[i] < np.inf:
        return Reaction(1, applies=False)
    hold = window.rules.ticks(window.rules.hold_time, window.dt)
    return Reaction(1 if all(record.counted[i] < np.inf for record in window.ticks[:hold]) else None)


def _counted(window: Window) -> Reaction:
    i = window.sick[0]
    return first_tick(window, lambda record: record.counted[i] <= 0.3 and record.cdf_n >= window.healthy.cdf_n - 1e-9)


def _unmoved(window: Window) -> Reaction:
    """A farther sample changes nothing: what counted still does."""
    i = window.sick[0]
    if not window.healthy.counted[i] < np.inf:
        return Reaction(1, applies=False)
    return Reaction(1 if window.ticks[0].counted[i] <= window.healthy.counted[i] + window.rules.jump else None)


def _stuck(window: Window) -> Reaction:
    """Named as soon as the reading is old enough and the robot has moved enough; ticks from then on."""
    i, name = window.sick[0], window.names[window.sick[0]]
    ticks = window.rules.ticks(window.rules.stuck_after, window.dt)
    due = [k for k, r in enumerate(window.ticks) if k + 2 >= ticks and r.moved >= 1.05 * window.rules.stuck_motion]
    if not due or not window.before[i] < np.inf:
        return Reaction(1, applies=False)
    found = next((k for k, record in enumerate(window.ticks) if name in record.unseen), None)
    return Reaction(None if found is None else max(found - due[0] + 1, 1))


def _stopped(window: Window) -> Reaction:
    """Braking from the first tick, at rest for good from some tick on."""
    if window.ticks[0].status != "bad_input" or window.ticks[-1].severity != STOPPED:
        return Reaction(None)
    moving = [k for k, record in enumerate(window.ticks) if np.abs(record.qd).max() > 0.0]
    last = max(moving, default=-1) + 2
    return Reaction(last if last <= len(window.ticks) else None)


def _reads(value: float) -> Callable[[Array, Array], tuple[Array | float, Array | float]]:
    return lambda now, before: (value, 0.0)


CASES: tuple[Case, ...] = (
    Case("not a number, 0.2 s", 0.0, SHORT, _reads(np.nan), "reported, held, capped", 1, _reported),
    Case("minus infinity, 0.2 s", 0.0, SHORT, _reads(-np.inf), "reported, held, capped", 1, _reported),
    Case("negative, 0.2 s", 0.0, SHORT, _reads(-0.3), "reported, held, capped", 1, _reported),
    Case(
        "stale by 0.1 s, 0.2 s", 0.0, SHORT, lambda now, before: (before, 0.1), "reported, held, capped", 1, _reported
    ),
    Case("plus infinity, 0.2 s", 0.0, SHORT, _reads(np.inf), "held, moved nearer", 1, _held),
    Case("out of range, far: 5 m, 0.2 s", 0.0, SHORT, _reads(5.0), "held, moved nearer", 1, _held),
    Case("out of range, near: 5 cm, 0.2 s", 0.0, SHORT, _reads(0.05), "counts at once", 1, _counted),
    Case("spike nearer, one sample", 0.0, 1, _reads(0.25), "counts at once", 1, _counted),
    Case("spike farther, one sample", 0.0, 1, _reads(np.inf), "not believed", 1, _unmoved),
    Case("stuck, for good", 0.0, WINDOW, lambda now, before: (before, 0.0), "reported, held, capped", 1, _stuck),
    Case("dropped out, for good", 0.0, WINDOW, _reads(np.nan), "slow until acknowledged", BRAKE, _slowed),
    Case("a quarter of the spots dead", 0.25, WINDOW, _reads(np.nan), "controlled stop", BRAKE, _stopped),
    Case("all spots dead", 1.0, WINDOW, _reads(np.nan), "controlled stop", BRAKE, _stopped),
)
