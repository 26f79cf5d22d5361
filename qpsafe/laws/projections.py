"""The pure regimes of the paper's law by orthogonal projections, compiled; they know no limits.

    q̇_k = Σ_(i<=k) N_(i-1) P(J_i) ẋ_i + N_k q̇0,   N_i the projector onto the common null space of tasks 1..i

For one and two tasks these are the regimes of which (18) and (22) are blends; for more, their continuation. No inverse
is formed: the rows of J and ẋ are turned together until they are orthogonal, U J = diag(σ) V (one-sided Jacobi), then

    P(J) ẋ = Σ_a (U ẋ)_a σ_a v_a / σ_a²,   N x = x - Σ_a v_a (v_a · x)

over the rows with σ_a > `RANK` σ_1. Turning rows changes neither; so the rows of all tasks above, turned
already, and those of the next one make the stacked Jacobian of which N_k is.

Source of the method: J. Demmel, K. Veselić, "Jacobi's method is more accurate than QR", SIAM J. Matrix Anal. Appl.
13(4), 1992.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import entry, inline, linked
from qpsafe.compiled.memory import view
from qpsafe.hqp.own import level, linear, state
from qpsafe.hqp.own.level import RANK
from qpsafe.hqp.own.linear import along, jacobi
from qpsafe.hqp.own.solver import read
from qpsafe.hqp.own.state import HUGE

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ROUNDING = 1e-15  # rows shorter than this, relative to the longest, and smaller cosines of angles are left alone
SWEEPS = 20  # six are usual
#: All the code that goes into the kernel.
USES = (linear, level, state)


@inline
def measure(S: Array, squares: Array, first: int, last: int) -> float:
    """Squares of the lengths of rows; returns the largest."""
    most = 0.0
    for a in range(first, last):
        squares[a] = along(S, a, S[a], S.shape[1])
        most = max(most, squares[a])
    return most


@inline
def orthogonalise(S: Array, c: Array, squares: Array, first: int, last: int) -> float:
    """Turn rows first..last of S, and the same numbers of c with them, until they are orthogonal.

    Returns:
        σ_1²; `squares` of the rows are σ².
    """
    n = S.shape[1]
    for _sweep in range(SWEEPS):
        small = ROUNDING * ROUNDING * measure(S, squares, first, last)
        turned = False
        for a in range(first, last - 1):
            for b in range(a + 1, last):
                aa, bb, ab = squares[a], squares[b], along(S, a, S[b], n)
                if not (min(aa, bb) > small and abs(ab) > ROUNDING * sqrt(aa * bb)):
                    continue
                turned = True
                cosine, sine = jacobi(aa, bb, ab)
                for j in range(n):
                    p, q = S[a, j], S[b, j]
                    S[a, j], S[b, j] = cosine * p - sine * q, sine * p + cosine * q
                c[a], c[b] = cosine * c[a] - sine * c[b], sine * c[a] + cosine * c[b]
                squares[a], squares[b] = max(aa - sine / cosine * ab, 0.0), bb + sine / cosine * ab
        if not turned:
            break
    return measure(S, squares, first, last)


@inline
def move(S: Array, squares: Array, first: int, last: int, largest: float, c: Array, wished: bool, x: Array) -> None:
    """x += P(S) c where it is `wished`, else x -= P(S) S x, for orthogonal rows first..last of S."""
    n = x.shape[0]
    least = RANK * RANK * largest
    for a in range(first, last):
        if squares[a] > least:
            factor = (c[a] if wished else -along(S, a, x, n)) / squares[a]
            for j in range(n):
                x[j] += factor * S[a, j]


@entry(
    types.boolean(read(2), read(1), read(1).copy(dtype=types.int64), read(1), types.int64, types.float64[::1],
               types.float64[:, ::1]),
    *USES,
)  # fmt: skip
def paper_regimes(A: Array, b: Array, ends: Index, qd0: Array, spared: int, work: Array, x: Array) -> bool:
    """Joint velocities of the regimes that keep 0, 1, ... tasks.

    Args:
        A: (rows, n) Jacobians of the tasks, one below the other.
        b: (rows,) their velocities ẋ.
        ends: (tasks,) one past the last row of each.
        qd0: (n,) evasive velocity.
        spared: So many tasks, from the first, take their null space only: their own part is left out of the sum.
        work: (rows (n + 2) + 2 n,) or more, overwritten.
        x: (tasks + 1, n) results.

    Returns:
        False, and NaN in x, where numbers of A are not finite, or beyond what can be squared.
    """
    n, rows = qd0.shape[0], int(ends[ends.shape[0] - 1]) if ends.shape[0] > 0 else 0
    S, c = view(work, 0, (rows, n)), view(work, rows * n, (rows,))
    y, above = view(work, rows * (n + 1), (n,)), view(work, rows * (n + 1) + n, (n,))
    squares, largest = view(work, rows * (n + 1) + 2 * n, (rows,)), 0.0
    fine = True
    for i in range(rows):
        c[i] = b[i]
        for j in range(n):
            S[i, j] = A[i, j]
            fine = fine and abs(A[i, j]) < HUGE  # false for NaN
    for j in range(n):
        above[j] = 0.0 if fine else np.nan
    first, last = np.int64(0), np.int64(0)
    for kept in range(x.shape[0]):
        if kept > 0 and fine:
            first, last = last, ends[kept - 1]
            if kept > spared:  # N_(k-1) P(J_k) ẋ_k
                for j in range(n):
                    y[j] = 0.0
                move(S, squares, first, last, orthogonalise(S, c, squares, first, last), c, True, y)
                move(S, squares, 0, first, largest, c, False, y)
                for j in range(n):
                    above[j] += y[j]
            largest = orthogonalise(S, c, squares, 0, last)
        # + N_k q̇0
        for j in range(n):
            x[kept, j] = qd0[j]
        move(S, squares, 0, last, largest, c, False, view(x, kept * n, (n,)))
        for j in range(n):
            x[kept, j] += above[j]
    return fine


regimes_compiled = linked(paper_regimes, *USES)
"""`paper_regimes` for compiled code."""


def regimes_of(tasks: Sequence[tuple[Array, Array]], qd0: Array, spared: int = 0) -> Array:
    """`paper_regimes` of (J, ẋ) pairs, in memory of their own.

    Args:
        tasks: Highest priority first; J is (rows, n), ẋ (rows,).
        qd0: (n,) [rad/s].
        spared: As above.

    Returns:
        (tasks + 1, n) [rad/s].

    Raises:
        ValueError: A number of a Jacobian is not finite, or cannot be squared.
    """
    n, ends = len(qd0), np.cumsum([len(b) for _, b in tasks], dtype=np.int64)
    A, b = np.zeros((ends[-1] if len(ends) else 0, n)), np.zeros(ends[-1] if len(ends) else 0)
    for (J, xd), last in zip(tasks, ends, strict=True):
        A[last - len(xd) : last], b[last - len(xd) : last] = J, xd
    x = np.empty((len(tasks) + 1, n))
    if not paper_regimes(A, b, ends, np.array(qd0, dtype=np.float64), spared, np.empty(len(b) * (n + 2) + 2 * n), x):
        raise ValueError(f"a Jacobian has numbers that are not finite, or beyond {HUGE:g}")
    return x
