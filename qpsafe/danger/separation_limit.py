"""Speed and separation monitoring as rows of a level: no link approaches what is seen faster than v_max.

For part i of a link, a capsule, and the seen point p_k,

    d = |p_k - a| - r,    n = (p_k - a)/|p_k - a|,    nᵀ J_i(a) q̇ <= v_max(d)        (derivations, section 6)

as `qpsafe.danger.link_parts` measures them. v_max >= 0: standing and moving away are always allowed, so every robot
that stands can meet the rows; they are a soft level, since one that is too fast already cannot. The speed counts that
is kept for a whole tick: S_p(v) + v dt <= d. So it is admissible still at the end of the tick, and what the next tick
asks for is reached by braking less than a_s: S_p(v) - S_p(v') = v' dt, and S_p' >= (v_h + v)/a_s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.link_parts import LinkParts
from qpsafe.danger.separation import Separation
from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import solve_hierarchy
from qpsafe.text.words import call

if TYPE_CHECKING:
    from qpsafe.limits import Box, JointLimits
    from qpsafe.robot.state import RobotState

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class SeparationLevel(Level):
    """The rows of one tick, an inequality level.

    Attributes:
        A: nᵀ J of each row (rows, n).
        upper: v_max of each (rows,) [m/s].
        names: Of the links' parts, one a row.
        points: Number of the seen point of each row (rows,).
        gaps: Its distance to that part (rows,) [m].
        beyond: nᵀ J and v_max of what is left out, where more than `MOST` rows can bind.
    """

    __slots__ = ("beyond", "gaps", "names", "points")

    def __init__(
        self, A: Array, upper: Array, names: tuple[str, ...], points: Index, gaps: Array,
        beyond: tuple[Array, Array] | None = None,
    ) -> None:  # fmt: skip
        super().__init__(A, -np.inf, upper)
        self.names, self.points, self.gaps, self.beyond = names, points, gaps, beyond

    def slowed(self, command: Array) -> Array:
        """A command (n,) [rad/s], slower by as much as the rows that were left out ask for: v_max >= 0."""
        if self.beyond is None:
            return command
        A, upper = self.beyond
        speeds = A @ command
        over = speeds > upper
        return command * float((upper[over] / speeds[over]).min(initial=1.0))

    def binding(self, qd: Array) -> tuple[tuple[str, int, float], ...]:
        """Rows that bind at q̇ (n,) [rad/s]: the part, the point's number, their distance [m]."""
        found = np.flatnonzero(~(self.A @ qd < self.upper - 1e-9)).tolist()
        return tuple((self.names[k], int(self.points[k]), float(self.gaps[k])) for k in found)


class SeparationLimit(Fixed):
    """Limits how fast any link approaches anything that is seen.

    Args:
        separation: The figures. Their deceleration is that of the robot, the smallest that was measured.

    Raises:
        ConfigurationError: `separation` is not a `Separation`.
    """

    fixed = frozenset(("separation",))

    def __init__(self, separation: Separation) -> None:
        if not isinstance(separation, Separation):
            expected = "a Separation, e.g. Separation(deceleration=2.0)"
            raise ConfigurationError("SeparationLimit", "separation", separation, expected)
        self.separation = separation
        import qpsafe.danger.gaps_kernel
        import qpsafe.hqp.own.solver  # noqa: F401  compile them now if need be, not within the first tick

    def __repr__(self) -> str:
        return call(self, self.separation)

    def level(
        self,
        state: RobotState,
        parts: LinkParts,
        points: Array,
        age: float = 0.0,
        *,
        come: float = 0.0,
        qd: Array | None = None,
        limits: JointLimits | None = None,
    ) -> SeparationLevel | None:
        """The rows of one tick; None where none can bind.

        Args:
            state: The robot at its measured position.
            parts: Capsules around its links.
            points: What is seen (p, 3) [m].
            age: How old that is [s]: the person may be nearer by v_h age.
            come: How much nearer anybody may be, if that is more [m].
            qd: Last commanded velocity (n,) [rad/s]; with `limits`, rows that no command of the tick can reach are left
                out. They would change nothing.
            limits: Joint limits of the tick.
        """
        count = len(parts.radii)
        if not len(points) or not count:
            return None
        figures, come = self.separation, max(self.separation.person_speed * age, come)
        if limits is None or qd is None:
            which, distances, A = parts.gaps(state, points)
            upper = figures.speed(distances - come, 0.0 if limits is None else limits.dt)
            kept = np.isfinite(upper)
        else:  # the largest nᵀJ q̇ of any q̇ within a dt of the last one; who is farther than that asks for is left out
            gained = limits.max_acceleration * limits.dt
            fastest, dt = np.abs(qd) + gained, limits.dt
            which, distances, A = parts.gaps(
                state, points, lambda levers: (come + figures.distance(levers @ fastest, dt)) * (1.0 + 1e-9)
            )
            upper = figures.speed(distances - come, dt)
            kept = np.isfinite(upper) & (A @ qd + np.abs(A) @ gained > upper)
        if not kept.any():
            return None
        rows, distances, A, upper = which[kept], distances[kept], A[kept], upper[kept]
        chosen, left = nearest_first(np.arange(len(rows)), rows // len(points), distances, MOST)
        beyond = (A[left], upper[left]) if len(left) else None
        if len(left):
            rows, distances, A, upper = rows[chosen], distances[chosen], A[chosen], upper[chosen]
        names = tuple([parts.names[k // len(points)] for k in rows.tolist()])
        return SeparationLevel(A, upper, names, rows % len(points), distances, beyond)


def nearest_first(rows: Index, parts: Index, gaps: Array, most: int) -> tuple[Index, Index]:
    """Some of the rows, in their order, and the others: what is nearest to each part, then what is second nearest ...

    Args:
        rows: Their numbers, rising (r,).
        parts: Of which part each is (r,), rising.
        gaps: Distances (r,) [m].
        most: How many.
    """
    if len(rows) <= most:
        return rows, rows[:0]
    order = np.lexsort((gaps, parts))
    rank = np.empty(len(rows), dtype=np.int64)
    rank[order] = np.arange(len(rows)) - np.searchsorted(parts, parts[order])
    chosen = np.zeros(len(rows), dtype=np.bool_)
    chosen[np.lexsort((gaps, rank))[:most]] = True
    return rows[chosen], rows[~chosen]


def kept_apart(soft: Sequence[Level], command: Array, box: Box | None) -> Array:
    """The velocity nearest to a command that meets the rows of separation, as well as they can be met in the box.

    The answer of a law that obeys soft levels stays as it is; laws that ignore such levels need this correction.

    Args:
        soft: Levels under the joint limits, highest priority first; without rows of separation nothing is done.
        command: Joint velocity (n,) [rad/s], inside the box.
        box: Admissible velocities, if there are limits.
    """
    apart = [level for level in soft if isinstance(level, SeparationLevel)]
    if not all((level.A @ command <= level.upper + _MET).all() for level in apart):
        bounds = (None, None) if box is None else (box.lower, box.upper)
        nearest = solve_hierarchy([*soft, (np.eye(len(command)), command)], *bounds).qd
        if np.isfinite(nearest).all():
            command = nearest if box is None else box.clip(nearest)
    for level in apart:
        if level.beyond is not None:
            slowed = level.slowed(command)
            command = slowed if box is None else box.clip(slowed)
    return command


def oldest(ages: Array, max_age: float) -> float:
    """The largest age of a reading that counts [s]: those that are older are not readings any more.

    Args:
        ages: Of all spots (k,) [s].
        max_age: Beyond which they are stale [s].
    """
    return float(ages[(ages > 0.0) & (ages <= max_age)].max(initial=0.0))  # false for NaN


_MET = 1e-9  # [m/s]
MOST = 600  # rows of a tick: thirty parts and twenty points; memory and time of the solver grow with their square
