"""Damping near singular poses, where 1/σ grows without bound and then, at σ = 0, a direction is suddenly free.

A direction v of a level with a small singular value, σ < ε, is a wish the level can hardly act on. Undamped, it moves
by r/σ (r the error along it), and every level below keeps off v; at σ = 0 the level lets go of v and the levels below
take it. Both ends are joined continuously:

    v·q̇ = (σ r + (ε² - σ²) y) / ε²      y = v·q̇ of the same hierarchy with v left to the levels below

which is r/σ at σ = ε, y at σ = 0, and at most |r|/ε + |y| between. So the hierarchy is solved twice where, and only
where, such a direction exists: first without v, for y; then with v, and one more row δ v·(q̇ - q̇_first) = 0 with
δ² = ε² - σ². The rows belong to the level itself, in directions it takes from the levels below: no level above
notices.

Source of the idea: Y. Nakamura, H. Hanafusa, ASME J. Dyn. Sys. 108(3), 1986; A. Maciejewski, C. Klein, "Numerical
filtering", J. Robotic Systems 5(6), 1988. That the levels below decide where a damped direction rests is ours.
"""

from __future__ import annotations

from math import sqrt

from qpsafe.compiled.compiled import inline
from qpsafe.hqp.own.linear import Array, jacobi
from qpsafe.hqp.own.state import State

WITHOUT, WITH = 1, 2  # what to do with nearly singular directions


@inline
def nearly_singular(diagonal: Array, rank: int, damping: float) -> bool:
    """Whether a singular value may be below `damping`, by the diagonal of `factorise`: false alarms only.

    Pivoting makes |d_r| the least of the diagonal, and σ_r >= 3 |d_r| / sqrt(4^r + 6 r - 1) (Faddeev et al.; Higham,
    "Accuracy and Stability of Numerical Algorithms", theorem 8.14).
    """
    return 9.0 * diagonal[rank - 1] ** 2 < (4.0**rank + 6.0 * rank - 1.0) * damping * damping


@inline
def separate(s: State, first: int, count: int, start: int) -> None:
    """Mix the rows of an equality level orthogonally until their images in the freedom left are orthogonal.

    One-sided Jacobi rotations of rows and targets: s.F becomes diag(σ) Vᵀ, and the least squares stay the same.
    """
    A, low, high, G, F, n = s.A, s.low, s.high, s.G, s.F, s.x.shape[0]
    k = n - start
    for j in range(k):
        for a in range(count):
            F[a, j] = G[start + j, n + a]
    for _sweep in range(12):
        turned = False
        for a in range(count - 1):
            for b in range(a + 1, count):
                aa, bb, ab = 0.0, 0.0, 0.0
                for j in range(k):
                    aa += F[a, j] * F[a, j]
                    bb += F[b, j] * F[b, j]
                    ab += F[a, j] * F[b, j]
                if not abs(ab) > 1e-15 * sqrt(aa * bb):
                    continue
                turned = True
                cosine, sine = jacobi(aa, bb, ab)
                for j in range(k):
                    p, q = F[a, j], F[b, j]
                    F[a, j], F[b, j] = cosine * p - sine * q, sine * p + cosine * q
                for i in range(n):
                    p, q = A[first + a, i], A[first + b, i]
                    A[first + a, i], A[first + b, i] = cosine * p - sine * q, sine * p + cosine * q
                c, d = n + first + a, n + first + b
                p, q = low[c], low[d]
                low[c], low[d] = cosine * p - sine * q, sine * p + cosine * q
                high[c], high[d] = low[c], low[d]
        if not turned:
            break
    for j in range(k):
        for a in range(count):
            G[start + j, n + a] = F[a, j]


@inline
def damp(s: State, mode: int, first: int, count: int, start: int, damping: float, tolerance: float) -> int:
    """Leave out (WITHOUT) or resist (WITH) the directions of the level with tolerance < σ < damping.

    Returns:
        How many rows count now; s.flags[0] counts the directions found.
    """
    A, G, F, chosen, flags, n = s.A, s.G, s.F, s.chosen, s.flags, s.x.shape[0]
    k, m = n - start, count
    separate(s, first, count, start)
    left, added = 0, 0
    for a in range(m):
        square = 0.0
        for j in range(k):
            square += F[a, j] * F[a, j]
        sigma = sqrt(square)
        near = tolerance < sigma < damping and added < n
        if near:
            flags[0] += 1
        if near and mode == WITHOUT:
            continue
        chosen[left] = a
        left += 1
        if near:
            factor = sqrt(damping * damping - sigma * sigma) / sigma
            row = A.shape[0] - n + added
            target = 0.0
            for i in range(n):
                value = 0.0
                for j in range(k):
                    value += F[a, j] * G[start + j, i]
                A[row, i] = factor * value
                target += factor * value * s.reference[i]
            for j in range(k):
                G[start + j, n + m + added] = factor * F[a, j]
            s.low[n + row] = s.high[n + row] = target
            s.side[n + row] = 2
            added += 1
    for a in range(added):
        chosen[left] = m + a
        left += 1
    return left
