"""The own solver's memory: one problem laid out in arrays, and what it means to hold or release a constraint."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import types

from qpsafe.compiled.by_reference import Reference
from qpsafe.compiled.compiled import inline
from qpsafe.compiled.memory import view
from qpsafe.hqp.own.linear import Array, Index, householder, image, reflect, remove_column

HUGE = 1e60  # numbers beyond cannot be squared safely: unusable in A, no bound as bounds

# kind of a constraint; LOCKED + k: locked by level k
ABSENT, FREE, WORKING, LOCKED = 0, 1, 2, 3


class State(NamedTuple):
    """Arrays of one solve. Constraint c < n is joint c of the box, constraint n + i is row i; at most m rows a level.

    Attributes:
        A: (rows, n) all rows of all levels; then the closing identity; then n rows for damping.
        low: (n + rows,) lower bounds of the box, then of the rows.
        high: (n + rows,) upper bounds.
        kept: (n + rows,) values of the rows when their level was left.
        kind: (n + rows,) ABSENT (no constraint, or not yet), FREE, WORKING or LOCKED.
        side: (n + rows,) bound held or wanted: -1 lower, +1 upper, 2 equality, 0 none.
        x: (n,) the point, always inside the box.
        G: (n, n + m) basis and images, see `linear`.
        R: (n, n) triangle of the working constraints in the directions Y.
        F: (2 m, max(n, m)) factors of the level.
        working: (n,) constraints of Y in order.
        chosen: (m,) rows of the level that count.
        d: (n + m,) step and its image.
        r: (m,) residuals of the chosen rows.
        u: (n + m,) solution in basis coordinates, then multipliers.
        tau: (n,) reflections of F; diagonal: (n,) of L; scratch: (n + m,).
        reach: (1,) largest joint velocity on the way so far, which all later rounding is relative to.
        reference: (n,) solution without the nearly singular directions, see `damping`; flags: (2,) how many, and
            one more than the last ill-conditioned level, 0 for none.
    """

    A: Array
    low: Array
    high: Array
    kept: Array
    kind: Index
    side: Index
    x: Array
    G: Array
    R: Array
    F: Array
    working: Index
    chosen: Index
    d: Array
    r: Array
    u: Array
    tau: Array
    diagonal: Array
    scratch: Array
    reach: Array
    reference: Array
    flags: Index


_WHOLE, _MATRICES = ("kind", "side", "working", "chosen", "flags"), ("A", "G", "R", "F")
_arrays = [
    types.Array(types.int64 if name in _WHOLE else types.float64, 2 if name in _MATRICES else 1, "C")
    for name in State._fields
]
#: Type of a state that is handed on by reference.
STATE = Reference(types.NamedTuple(_arrays, State))


def workspace(n: int, rows: int, m: int) -> tuple[Array, Index]:
    """Memory for problems of n joints, `rows` rows in all and m >= n rows in the largest level.

    Args:
        n: Joints.
        rows: Of all levels.
        m: Rows of the largest level, >= n.
    """
    return np.zeros(floats_of(n, rows, m)), np.zeros(2 * (n + rows + 2 * n) + n + m + n + 2, np.int64)


def floats_of(n: int, rows: int, m: int) -> int:
    """How many floats `workspace` has, exactly.

    Args:
        n: Joints.
        rows: Of all levels.
        m: Rows of the largest level, >= n.
    """
    rows, m = rows + 2 * n, m + n  # the closing identity, and rows that damping adds
    return rows * n + 3 * (n + rows) + n * (n + m) + n * n + 2 * m * m + 3 * (n + m) + m + 1 + 3 * n


@inline
def cut(f: Array, i: Index, x: Array, rows: int, m: int) -> State:
    """The arrays of one solve, cut from two blocks: each allocation would cost as much as a factorisation."""
    n = x.shape[0]
    c, width = n + rows, n + m
    A, at = view(f, 0, (rows, n)), rows * n
    G, at = view(f, at, (n, width)), at + n * width
    R, at = view(f, at, (n, n)), at + n * n
    F, at = view(f, at, (2 * m, m)), at + 2 * m * m
    low, high, kept, at = view(f, at, (c,)), view(f, at + c, (c,)), view(f, at + 2 * c, (c,)), at + 3 * c
    d, u, at = view(f, at, (width,)), view(f, at + width, (width,)), at + 2 * width
    scratch, r, at = view(f, at, (width,)), view(f, at + width, (m,)), at + width + m
    reach, at = view(f, at, (1,)), at + 1
    tau, diagonal, reference = view(f, at, (n,)), view(f, at + n, (n,)), view(f, at + 2 * n, (n,))
    kind, side, at = view(i, 0, (c,)), view(i, c, (c,)), 2 * c
    working, chosen, flags = view(i, at, (n,)), view(i, at + n, (m,)), view(i, at + n + m, (2,))
    return State(
        A, low, high, kept, kind, side, x, G, R, F, working, chosen, d, r, u, tau, diagonal, scratch, reach, reference,
        flags,
    )  # fmt: skip


@inline
def load_box(s: State, box_low: Array, box_high: Array) -> int:
    """Set the box, the start x and the basis, fixed joints first. Returns how many are fixed, -1 for a bad box.

    Every comparison is written so that NaN fails it.
    """
    low, high, kind, x, G, n = s.low, s.high, s.kind, s.x, s.G, s.x.shape[0]
    good = True
    front, back = 0, n
    for i in range(n):
        if box_low[i] <= box_high[i] and box_low[i] < HUGE and box_high[i] > -HUGE:
            low[i] = box_low[i] if box_low[i] > -HUGE else -np.inf
            high[i] = box_high[i] if box_high[i] < HUGE else np.inf
            x[i] = min(max(0.0, low[i]), high[i])
            s.reach[0] = max(s.reach[0], abs(x[i]))
        else:
            good = False
            x[i] = 0.0
        if low[i] == high[i]:
            G[front, i] = 1.0
            kind[i] = LOCKED - 1
            front += 1
        else:
            back -= 1
            G[back, i] = 1.0
            kind[i] = FREE
    return front if good else -1


@inline
def load_rows(s: State, A: Array, low: Array, high: Array, weight: Array, ends: Index) -> int:
    """Copy the rows times the roots of their weights, and the closing identity. Returns the first bad level."""
    own_A, own_low, own_high, n, rows = s.A, s.low, s.high, s.x.shape[0], A.shape[0]
    weighted = weight.shape[0] > 0
    for level in range(ends.shape[0]):
        first = ends[level - 1] if level > 0 else 0
        for row in range(first, ends[level]):
            c = n + row
            good = low[row] <= high[row] and low[row] < HUGE and high[row] > -HUGE
            root = 1.0
            if weighted:
                good = good and 0.0 < weight[row] < HUGE
                root = sqrt(weight[row])
            for i in range(n):
                good = good and abs(A[row, i]) < HUGE
                own_A[row, i] = root * A[row, i]
            if not good:
                return level
            own_low[c] = root * low[row] if low[row] > -HUGE else -np.inf
            own_high[c] = root * high[row] if high[row] < HUGE else np.inf
    for i in range(n):
        own_A[rows + i, i] = 1.0
        own_low[n + rows + i] = own_high[n + rows + i] = 0.0
    return int(ends.shape[0])


@inline
def hold(s: State, width: int, start: int, w: int, c: int) -> None:
    """Make constraint c working number w: its direction in N becomes the last of Y."""
    A, G, R, F, working, kind, n = s.A, s.G, s.R, s.F, s.working, s.kind, s.x.shape[0]
    for j in range(n - start):
        F[0, j] = G[start + j, c] if c < n else image(G, start + j, A, c - n)
    for j in range(w):
        R[j, w] = F[0, j]
    R[w, w], tau = householder(F, 0, w, n - start)
    reflect(G, start + w, width, F, 0, w, tau, s.scratch)
    working[w] = c
    kind[c] = WORKING


@inline
def release(s: State, width: int, start: int, w: int, j: int) -> None:
    """Give working constraint number j of w back."""
    working = s.working
    s.kind[working[j]] = FREE
    remove_column(s.G, width, s.R, start, w, j)
    for l in range(j, w - 1):
        working[l] = working[l + 1]
