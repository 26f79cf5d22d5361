"""The answer of `solve_hierarchy`, which explains itself."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qpsafe.hqp.packing import Packed

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SOLVED = "solved"
ROWS_INFEASIBLE = "rows infeasible"
STOPPED = "stopped early"
INEXACT = "inexact"
ILL_CONDITIONED = "ill-conditioned"
FAILED = "failed"
INVALID_DATA = "invalid data"
INVALID_LIMITS = "invalid limits"

MEANING = {
    SOLVED: "optimal at every level, all limits met",
    ROWS_INFEASIBLE: "the hard rows contradict the box or each other: least violation of them, box met",
    STOPPED: "a level was not finished: limits met, optimal down to the level before",
    INEXACT: "the check found a level worse than it was when solved: limits met",
    ILL_CONDITIONED: "rows of a level differ in size by 1e5, or limits are nearly parallel: limits met, rest uncertain",
    FAILED: "numbers overflowed: the point of the box nearest to standstill",
    INVALID_DATA: "a level holds NaN, infinite or unusable numbers: the point of the box nearest to standstill",
    INVALID_LIMITS: "limits hold NaN or lower > upper: standstill, or the nearest allowed speed where limits are valid",
}

_TOUCH = 1e-9  # [rad/s] a limit nearer than this (relative above 1) is reported as binding


class Solution:
    """Joint velocities with the account of how they came about.

    Everything beyond `qd`, `status`, `iterations`, `solver`, `solve_time` and `note` is computed on first access.

    Attributes:
        qd: (n,) joint velocities [rad/s], always finite, always inside the box where the box is valid.
        status: one of the keys of `MEANING`; "solved" is the only good one.
        iterations: turns of the active-set method, or programs solved by the back end, summed over levels.
        solver: what computed `qd`.
        solve_time: time inside the call [s].
        note: detail behind a status other than "solved" or a change of solver, else empty.
    """

    def __init__(
        self,
        qd: Array,
        status: str,
        iterations: int,
        solver: str,
        solve_time: float,
        problem: Packed | Callable[[], Packed],
        pressing: Index | None = None,
        note: str = "",
    ) -> None:
        """Store the result.

        Args:
            qd: As above.
            status: As above.
            iterations: As above.
            solver: As above.
            solve_time: As above [s].
            problem: What was solved; may be built when needed.
            pressing: Where limits are pressed against, (n + rows,), as `qpsafe.hqp.own.hierarchy.run` tells.
            note: As above.
        """
        self.qd = qd
        self.status = status
        self.iterations = iterations
        self.solver = solver
        self.solve_time = solve_time
        self.note = note
        self._given = problem
        self._pressing = pressing

    @cached_property
    def _problem(self) -> Packed:
        return self._given() if callable(self._given) else self._given

    @property
    def ok(self) -> bool:
        """Whether the status is "solved"."""
        return self.status == SOLVED

    @cached_property
    def _values(self) -> Array:
        """(rows,) A q̇ of all rows."""
        with np.errstate(invalid="ignore", over="ignore"):
            return self._problem.A @ self.qd

    @cached_property
    def _row_violations(self) -> tuple[Array, ...]:
        """Violations of all levels, hard rows first."""
        p = self._problem
        with np.errstate(invalid="ignore", over="ignore"):
            v = np.maximum(self._values - p.high, 0.0) + np.minimum(self._values - p.low, 0.0)
        return tuple(np.split(v, np.cumsum(p.counts)[:-1])) if p.counts else ()

    @property
    def violations(self) -> tuple[Array, ...]:
        """Per level (rows,) signed distance to what the level asked for, without weights; NaN where its data are."""
        return self._row_violations[1:] if self._problem.hard else self._row_violations

    @cached_property
    def residuals(self) -> tuple[float, ...]:
        """Per level the Euclidean norm of the violations (without weights)."""
        with np.errstate(invalid="ignore", over="ignore"):
            return tuple(float(np.sqrt(v @ v)) for v in self.violations)

    @property
    def costs(self) -> tuple[float, ...]:
        """Per level, hard rows first, the root of what is minimised: the norm of the violations with weights."""
        p = self._problem
        roots = np.ones(p.low.shape[0]) if p.weight is None else np.sqrt(p.weight)
        parts = np.split(roots, np.cumsum(p.counts)[:-1])
        return tuple(float(np.linalg.norm(w * v)) for w, v in zip(parts, self._row_violations, strict=False))

    @cached_property
    def binding_joints(self) -> NDArray[np.int8]:
        """(n,) -1 where the joint is at its lower limit, +1 at its upper limit, 2 at both, else 0."""
        return _touching(self.qd, self._problem.box_low, self._problem.box_high)

    @cached_property
    def binding_rows(self) -> NDArray[np.int8]:
        """(hard rows,) the same for the rows given as `rows=(G, lower, upper)`."""
        rows = self._problem.counts[0] if self._problem.hard else 0
        return _touching(self._values[:rows], self._problem.low[:rows], self._problem.high[:rows])

    @cached_property
    def pressed_by(self) -> tuple[int, ...]:
        """Per joint the first level that presses against its limit, -1 for none (or where the solver cannot tell)."""
        return tuple(self._level_pressing(i) for i in range(self.qd.shape[0]))

    @cached_property
    def binding(self) -> tuple[str, ...]:
        """Names of the limits that bind, such as "joint 2 upper"; joints and rows count from 0."""
        return tuple(name for name, _ in self._binding())

    def _binding(self) -> list[tuple[str, int]]:
        """Names of the limits that bind, and the level that presses."""
        names = {-1: "lower", 1: "upper", 2: "fixed"}
        n = self.qd.shape[0]
        found = [(f"joint {i} {names[int(side)]}", i) for i, side in enumerate(self.binding_joints) if side]
        found += [(f"row {i} {names[int(side)]}", n + i) for i, side in enumerate(self.binding_rows) if side]
        return [(name, self._level_pressing(c)) for name, c in found]

    def _level_pressing(self, constraint: int) -> int:
        if self._pressing is None or self._pressing[constraint] == 0:
            return -1
        return abs(int(self._pressing[constraint])) - 1 - self._problem.hard

    def __repr__(self) -> str:
        return f"Solution({self.status!r}, qd={np.array2string(self.qd, precision=4, separator=', ')})"

    def __str__(self) -> str:
        lines = [
            f"{self.status}: {MEANING.get(self.status, '')}" + (f" ({self.note})" if self.note else ""),
            f"  q̇        {np.array2string(self.qd, precision=4, suppress_small=True, max_line_width=100)} rad/s",
        ]
        for k, violations in enumerate(self.violations):
            word = "met" if self.residuals[k] <= 1e-8 else f"off by {self.residuals[k]:.3g}"
            lines.append(f"  level {k}  {violations.size} rows, {word}")
        limits = [f"{name} (holds back level {k})" if k >= 0 else name for name, k in self._binding()]
        lines.append(f"  binding  {', '.join(limits) or 'no limit'}")
        lines.append(f"  {self.solver}, {self.iterations} iterations, {1e6 * self.solve_time:.0f} µs")
        return "\n".join(lines)


def _touching(values: Array, lower: Array, upper: Array) -> NDArray[np.int8]:
    """Which bounds the values touch: -1, 0, +1, or 2 for both."""
    side = np.zeros(values.shape[0], dtype=np.int8)
    with np.errstate(invalid="ignore"):
        tolerance = _TOUCH * np.maximum(1.0, np.abs(values))
        at_lower, at_upper = values <= lower + tolerance, values >= upper - tolerance
    side[at_lower] = -1
    side[at_upper] = np.where(at_lower[at_upper], 2, 1)
    return side
