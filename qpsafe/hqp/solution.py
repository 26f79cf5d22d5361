"""The answer of [`solve_hierarchy`][qpsafe.hqp.solve.solve_hierarchy], which explains itself."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from qpsafe.hqp.level import Level

SOLVED = "solved"
ROWS_INFEASIBLE = "rows infeasible"
STOPPED = "stopped early"
INVALID_DATA = "invalid data"
INVALID_LIMITS = "invalid limits"

MEANING = {
    SOLVED: "optimal at every level, all limits met",
    ROWS_INFEASIBLE: "the hard rows contradict the box or each other: least violation of them, box met",
    STOPPED: "a level was not finished: limits met, optimal down to the level before",
    INVALID_DATA: "a level holds NaN, infinite or unusable numbers: the point of the box nearest to standstill",
    INVALID_LIMITS: "limits hold NaN or lower > upper: standstill, or the nearest allowed speed where limits are valid",
}

_TOUCH = 1e-9  # [rad/s] a limit nearer than this (relative above 1) is reported as binding


class Solution:
    """Joint velocities with the account of how they came about.

    Everything beyond `qd`, `status`, `iterations`, `solver` and `solve_time` is computed on first access.

    Attributes:
        qd: (n,) joint velocities [rad/s], always finite, always inside the box where the box is valid.
        status: one of the keys of `MEANING`; "solved" is the only good one.
        iterations: active-set changes, or iterations of the back end, summed over levels.
        solver: what computed `qd`.
        solve_time: time inside the call [s].
        note: detail behind a status other than "solved", else empty.
    """

    def __init__(
        self,
        qd: NDArray[np.float64],
        status: str,
        iterations: int,
        solver: str,
        solve_time: float,
        levels: list[Level],
        lower: NDArray[np.float64] | None,
        upper: NDArray[np.float64] | None,
        rows: Level | None = None,
        note: str = "",
    ) -> None:
        """Store the result; arrays are kept by reference."""
        self.qd = qd
        self.status = status
        self.iterations = iterations
        self.solver = solver
        self.solve_time = solve_time
        self.note = note
        self._levels = levels
        self._lower = lower
        self._upper = upper
        self._rows = rows

    @property
    def ok(self) -> bool:
        """Whether the status is "solved"."""
        return self.status == SOLVED

    @cached_property
    def violations(self) -> tuple[NDArray[np.float64], ...]:
        """Per level (rows,) signed distance to what the level asked for; NaN where its data are."""
        with np.errstate(invalid="ignore", over="ignore"):
            return tuple(level.violations(self.qd) for level in self._levels)

    @cached_property
    def residuals(self) -> tuple[float, ...]:
        """Per level the Euclidean norm of the violations (without weights)."""
        with np.errstate(invalid="ignore", over="ignore"):
            return tuple(float(np.sqrt(v @ v)) for v in self.violations)

    @cached_property
    def binding_joints(self) -> NDArray[np.int8]:
        """(n,) -1 where the joint is at its lower limit, +1 at its upper limit, 2 at both, else 0."""
        return _touching(self.qd, self._lower, self._upper)

    @cached_property
    def binding_rows(self) -> NDArray[np.int8]:
        """(hard rows,) the same for the rows given as `rows=(G, lower, upper)`."""
        if self._rows is None:
            return np.zeros(0, dtype=np.int8)
        return _touching(self._rows.A @ self.qd, self._rows.lower, self._rows.upper)

    @cached_property
    def binding(self) -> tuple[str, ...]:
        """Names of the limits that bind, such as "joint 2 upper"; joints and rows count from 0."""
        names = {-1: "lower", 1: "upper", 2: "fixed"}
        return tuple(
            f"{kind} {i} {names[int(side)]}"
            for kind, sides in (("joint", self.binding_joints), ("row", self.binding_rows))
            for i, side in enumerate(sides)
            if side
        )

    def __repr__(self) -> str:
        return f"Solution({self.status!r}, qd={np.array2string(self.qd, precision=4, separator=', ')})"

    def __str__(self) -> str:
        lines = [
            f"{self.status}: {MEANING.get(self.status, '')}" + (f" ({self.note})" if self.note else ""),
            f"  q̇        {np.array2string(self.qd, precision=4, suppress_small=True, max_line_width=100)} rad/s",
        ]
        for k, (level, residual) in enumerate(zip(self._levels, self.residuals, strict=True)):
            word = "met" if residual <= 1e-8 else f"off by {residual:.3g}"
            lines.append(f"  level {k}  {level.rows} rows, {word}")
        lines.append(f"  binding  {', '.join(self.binding) or 'no limit'}")
        lines.append(f"  {self.solver}, {self.iterations} iterations, {1e6 * self.solve_time:.0f} µs")
        return "\n".join(lines)


def _touching(
    values: NDArray[np.float64], lower: NDArray[np.float64] | None, upper: NDArray[np.float64] | None
) -> NDArray[np.int8]:
    """Which bounds the values touch: -1, 0, +1, or 2 for both."""
    side = np.zeros(values.shape[0], dtype=np.int8)
    tolerance = _TOUCH * np.maximum(1.0, np.abs(values))
    if lower is not None:
        side[values <= lower + tolerance] = -1
    if upper is not None:
        at_upper = values >= upper - tolerance
        side[at_upper] = np.where(side[at_upper] == -1, 2, 1)
    return side
