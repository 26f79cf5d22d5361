"""The own solver: lexicographic least squares under a box, level by level in one orthogonal basis.

Algorithm:

1. Start at the point of the box nearest to standstill. Fixed joints leave the freedom at once.
2. Hard rows, if any, are an inequality level of their own on top: its least violation is zero exactly if they can be
   met, and then they are constraints of everything below.
3. Each level is minimised over the freedom left (`level.minimise_level`), which starts from the point reached
   before: always inside the constraints, so no search for a feasible point is needed. The level takes the directions it
   has fixed out of the freedom; its optimum can no longer change.
4. What freedom is left goes to the smallest norm: a last level q̇ = 0.
5. Check: every number finite, q̇ inside the box, and A q̇ of every equality level what it was when the level was left.

Nothing is regularised and nothing is kept between calls, so equal data give equal bits. Work is bounded: each level
has a limit of turns; at the limit the point reached is returned (inside the box, optimal for the levels before).

Sources: A. Escande, N. Mansard, P.-B. Wieber, IJRR 33(7), 2014; D. Dimitrov, A. Sherikov, P.-B. Wieber, "Efficient
resolution of potentially conflicting linear constraints in robotics", 2015 (LexLS).
"""

from __future__ import annotations

import numpy as np

from qpsafe.compiled.by_reference import by_reference
from qpsafe.compiled.compiled import inline
from qpsafe.hqp.own.damping import WITH, WITHOUT
from qpsafe.hqp.own.level import minimise_compiled
from qpsafe.hqp.own.linear import Array, Index, dot
from qpsafe.hqp.own.state import ABSENT, LOCKED, State, cut, load_box, load_rows

# codes in info[0]
OK, ROWS, TURNS, DATA, LIMITS, INEXACT, FAILED, CONDITION = range(8)
HEADER = 3  # info = [code, turns, where, then one number a joint and row]


def run(
    floats: Array,
    integers: Index,
    m: int,
    x: Array,
    info: Index,
    rows_A: Array,
    rows_low: Array,
    rows_high: Array,
    rows_weight: Array,
    ends: Index,
    box_low: Array,
    box_high: Array,
    hard: bool,
    damping: Array,
) -> None:
    """Solve one hierarchy.

    Args:
        floats: workspace of `workspace(...)`.
        integers: workspace of `workspace(...)`.
        m: most rows in a level, at least n; as given to `workspace`.
        x: (n,) result q̇.
        info: (3 + n + rows,) result: code, turns, level (or row) the code speaks of; then per joint and row 0, or
            ±(1 + level) where that level presses against the upper (+) or lower (-) bound.
        rows_A: (rows, n) rows of all levels.
        rows_low: (rows,) their lower bounds.
        rows_high: (rows,) their upper bounds.
        rows_weight: (rows,) their weights, or (0,) for none.
        ends: (levels,) one past the last row of each level.
        box_low: (n,) lower limits.
        box_high: (n,) upper limits.
        hard: whether the first level are hard rows.
        damping: (levels,) singular values below it are damped, see `damping`; 0 for none.
    """
    n, rows, levels = box_low.shape[0], rows_A.shape[0], ends.shape[0]
    s = by_reference(cut(floats, integers, x, rows + 2 * n, m + n))
    for mode in range(WITHOUT, WITH + 1):  # one pass is enough unless damping finds something to do
        for i in range(n):
            s.reference[i] = x[i]
        floats[: floats.shape[0] - n] = 0.0  # all but the reference: equal data, equal bits
        integers[:] = 0
        info[0] = OK
        # 1. the box and the start in it
        start = load_box(s, box_low, box_high)
        if start < 0:
            info[0] = LIMITS
            return
        info[2] = load_rows(s, rows_A, rows_low, rows_high, rows_weight, ends)
        if info[2] < levels:
            info[0] = DATA
            return
        # 2. to 4. the levels, and the smallest norm
        limit = 100 + 10 * (n + rows)
        first = np.int64(0)
        for level in range(levels + 1):
            last = ends[level] if level < levels else rows + n
            if last > first and start < n:
                near = damping[level] if level < levels else 0.0
                start, turns = minimise_compiled(s, level, first, last, start, limit, mode, near)
                info[1] += turns
                if start < 0:
                    info[0], info[2] = TURNS, level
                    break
            for row in range(first, last):
                s.kept[row] = dot(s.A, row, x)
            if level == 0 and hard and violated(s, last):
                info[0] = ROWS
            first = last
        if s.flags[0] == 0:
            break
    if info[0] == OK and s.flags[1] > 0:
        info[0], info[2] = CONDITION, s.flags[1] - 1
    # 5. the check
    check(s, info, min(first, rows), rows)


@inline
def size_of(A: Array, row: int, x: Array) -> float:
    """Σ |a_i| (1 + |x_i|): how much a row changes with joint velocities of 1 rad/s, or of those at hand."""
    size = 0.0
    for i in range(x.shape[0]):
        size += abs(A[row, i]) * (1.0 + abs(x[i]))
    return size


@inline
def violated(s: State, rows: int) -> bool:
    """Whether one of the first rows is violated at x by more than rounding."""
    A, low, high, kept, x, n = s.A, s.low, s.high, s.kept, s.x, s.x.shape[0]
    found = False
    for row in range(rows):
        c, slack = n + row, 1e-8 * size_of(A, row, x)
        # a row that is met has become a constraint; a violated one stays what its level asked for
        found = found or kept[row] > high[c] + slack or kept[row] < low[c] - slack
    return found


@inline
def check(s: State, info: Index, solved: int, rows: int) -> None:
    """Judge the result: sets the code if a solved row has moved since its level was left, or x is not in the box."""
    A, low, high, kept, kind, side, x, n = s.A, s.low, s.high, s.kept, s.kind, s.side, s.x, s.x.shape[0]
    for row in range(solved):
        c, value = n + row, dot(A, row, x)
        change = abs(value - kept[row]) if kind[c] == ABSENT else max(value - high[c], low[c] - value)
        if not change <= 0.0 and not change <= 1e-8 * size_of(A, row, x):
            info[0], info[2] = INEXACT, row
    fine = True
    for c in range(n + rows):
        if c < n:
            fine = fine and low[c] <= x[c] <= high[c] and abs(x[c]) < np.inf
        if kind[c] >= LOCKED:
            info[HEADER + c] = side[c] * (1 + kind[c] - LOCKED)
    if not fine:
        info[0] = FAILED
        for i in range(n):
            x[i] = min(max(0.0, low[i]), high[i])
