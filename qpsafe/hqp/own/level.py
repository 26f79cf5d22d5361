"""One level of the own solver: least squares over the freedom left, by a primal active-set method.

    min_q̇ ½ Σ v_i²,  v_i the distance of row i to its interval,  over  q̇ = x + N p  and the constraints

Each turn: factorise the rows that count (equalities and rows outside their interval), step towards their least-squares
point, stop at the first constraint met (ratio test) and hold it; where nothing stops the step, release the constraint
whose multiplier has the wrong sign (multiplier test), or finish. A row whose residual has the wrong sign is met and no
longer counts, or it was crossed whole and counts on at its other bound. After `BLAND` turns both choices follow Bland's
rule, which cannot cycle.

At the end a constraint with a clearly non-zero multiplier is active in every optimum, so it is locked for the levels
below; the others are released and stay plain inequalities. A row of the level that stays violated keeps its violation
(it is unique), one that is met becomes a constraint of the levels below.

Sources: J. Nocedal, S. Wright, "Numerical Optimization", alg. 16.3; A. Escande, N. Mansard, P.-B. Wieber,
"Hierarchical quadratic programming", IJRR 33(7), 2014.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types

from qpsafe.compiled import by_reference as by_reference_module
from qpsafe.compiled.compiled import entry, inline, linked
from qpsafe.hqp.own import damping as damping_module
from qpsafe.hqp.own import linear, rules, state
from qpsafe.hqp.own.damping import damp, nearly_singular
from qpsafe.hqp.own.linear import along, dot, factorise, image, least_squares, reflect, unturn
from qpsafe.hqp.own.rules import multipliers, ratio_test, wrong_way
from qpsafe.hqp.own.state import FREE, LOCKED, STATE, State, hold, release

RANK = 1e-10  # rows shorter than this in the freedom left, relative to their level, count as dependent
BLAND = 40  # turns after which Bland's rule chooses
ROUNDING = 2e-14  # relative size below which a wrong sign of a multiplier is rounding
STRICT = 1e-9  # relative size above which a multiplier is certainly not zero
EVEN = 1e-5  # rows shorter than this, relative to their level, press with forces near the rounding of the others'
PARALLEL = 1e-6  # sine of the angle between held constraints below which their multipliers are near rounding
NOISE = 1e-13  # rows shorter than this, relative to their level, are zero up to the rounding of who computed them


@inline
def choose(s: State, first: int, last: int) -> tuple[int, int, float, float]:
    """Which rows count at the start.

    Returns:
        Their number, the number of inequalities, the norm of the level, and its shortest row relative to that (not
        larger than 1, and 1 where it does not matter).
    """
    A, low, high, side, chosen, x, n = s.A, s.low, s.high, s.side, s.chosen, s.x, s.x.shape[0]
    count, inequalities, square, least = 0, 0, 0.0, np.inf
    for row in range(first, last):
        c = n + row
        length = image(A, row, A, row)
        square += length
        least = min(least, length)
        if low[c] == high[c]:
            side[c] = 2
        else:
            value = dot(A, row, x)
            side[c] = 1 if value > high[c] else -1 if value < low[c] else 0
            inequalities += 1
        if side[c] != 0:
            chosen[count] = row - first
            count += 1
    if least >= EVEN * EVEN * square:
        return count, inequalities, sqrt(square), 1.0
    least = square
    for row in range(first, last):
        length = image(A, row, A, row)
        if length > NOISE * NOISE * square:
            least = min(least, length)
    return count, inequalities, sqrt(square), sqrt(least / square) if square > 0.0 else 1.0


@inline
def normalise(s: State, row: int) -> None:
    """Give a row about unit length: its multiplier is then as large as its force. A power of two rounds nothing."""
    A, n = s.A, s.x.shape[0]
    length = sqrt(image(A, row, A, row))
    if length > 0.0:
        factor = 2.0 ** -np.floor(np.log2(length))
        for i in range(n):
            A[row, i] *= factor
        s.low[n + row] *= factor
        s.high[n + row] *= factor


@inline
def residuals(s: State, first: int, last: int, count: int) -> float:
    """r = target - A x of the chosen rows; returns the size of the numbers they are the difference of."""
    A, low, high, side, chosen, x, n = s.A, s.low, s.high, s.side, s.chosen, s.x, s.x.shape[0]
    spare = A.shape[0] - n - (last - first)  # rows beyond those of the level are rows of damping
    size = 0.0
    for a in range(count):
        row = chosen[a] + (first if first + chosen[a] < last else spare)
        target = low[n + row] if side[n + row] == -1 else high[n + row]
        value, magnitude = 0.0, abs(target)
        for i in range(n):
            term = A[row, i] * x[i]
            value += term
            magnitude += abs(term)
        s.r[a] = target - value
        size = max(size, magnitude)
    return size


@inline
def load_factor(s: State, start: int, w: int, count: int, tolerance: float) -> int:
    """Factorise the images of N under the chosen rows; returns the rank."""
    G, F, chosen, n = s.G, s.F, s.chosen, s.x.shape[0]
    k = n - start - w
    for j in range(k):
        for a in range(count):
            F[a, j] = G[start + w + j, n + chosen[a]]
    return factorise(F, chosen, count, k, s.tau, s.diagonal, tolerance)


@entry(
    types.UniTuple(types.int64, 2)(STATE, *[types.int64] * 6, types.float64),
    by_reference_module, linear, state, damping_module, rules,
    python=False,
)  # fmt: skip
def minimise_level(
    s: State, level: int, first: int, last: int, start: int, limit: int, mode: int, damping: float
) -> tuple[int, int]:  # fmt: skip
    """Minimise the level of rows first..last over the freedom of basis vectors start.. .

    Args:
        s: arrays. x moves, the basis turns, locked constraints and the level's directions leave the freedom.
        level: its number, remembered in `kind` of the constraints it locks.
        first: first row of the level.
        last: one past its last row.
        start: basis vectors already used.
        limit: turns allowed.
        mode: what to do with singular values below `damping`, see `damping`.
        damping: the ε of `damping`; 0 for none.

    Returns:
        New number of used basis vectors (-1 if the turns did not suffice), and the turns taken.
    """
    A, low, high, kind, side, x, G = s.A, s.low, s.high, s.kind, s.side, s.x, s.G
    working, chosen, d, r, u, reach = s.working, s.chosen, s.d, s.r, s.u, s.reach
    n, m = x.shape[0], last - first
    count, inequalities, norm, least = choose(s, first, last)
    scale = A[first, 0]
    uniform = m == n and inequalities == 0 and scale > 0.0  # A = scale I: a projection, the usual closing level
    for a in range(m):
        for i in range(n):
            uniform = uniform and A[first + a, i] == (scale if i == a else 0.0)
    width = n if uniform else n + m
    if not uniform:
        for j in range(start, n):
            for a in range(m):
                G[j, n + a] = image(G, j, A, first + a)

    tolerance = RANK * norm
    undamped = damping > 0.0 and inequalities == 0 and not uniform
    rank, size, pivot = 0, 0.0, 1.0
    w, turn = np.int64(0), np.int64(0)
    while True:
        if turn == limit:
            return -1, int(turn)
        turn += 1
        # the least-squares step d over N
        base = start + w
        if uniform:
            rank = n - base
            residuals(s, first, last, count)
            for j in range(rank):
                u[j] = along(G, base + j, r, n) / scale
        else:
            rank = load_factor(s, start, w, count, tolerance)
            if undamped and rank > 0 and nearly_singular(s.diagonal, rank, damping):
                count = damp(s, mode, first, count, start, damping, tolerance)
                width = n + m + n
                rank = load_factor(s, start, w, count, tolerance)
            undamped = False
            residuals(s, first, last, count)  # after the pivoting, which permutes the rows
            least_squares(s.F, count, rank, s.diagonal, r, u)
            unturn(s.F, s.tau, rank, n - base, u)
        # go until a constraint is met
        met = -1
        if rank > 0:
            for i in range(width):
                d[i] = 0.0
            for j in range(n - base):
                for i in range(width):
                    d[i] += u[j] * G[base + j, i]
            alpha, met = ratio_test(s, first, last, turn > BLAND)
            for i in range(n):
                x[i] = min(max(x[i] + alpha * d[i], low[i]), high[i])
            for j in range(w):
                c = working[j]
                if c < n:
                    x[c] = low[c] if side[c] < 0 else high[c]
        if met >= 0:
            if met < n:
                x[met] = low[met] if side[met] < 0 else high[met]
            if met < n + first:
                hold(s, width, start, w, met)
                w += 1
            else:
                chosen[count] = met - n - first
                count += 1
            continue
        for i in range(n):
            reach[0] = max(reach[0], abs(x[i]))
        if w == 0 and inequalities == 0:
            break
        size = max(residuals(s, first, last, count), norm * reach[0])
        pivot = multipliers(s, start, w, count, uniform, scale)
        gone = wrong_way(s, first, w, count, inequalities, ROUNDING * norm * size / pivot, norm, turn > BLAND)
        if gone < 0:
            break
        if gone < w:
            release(s, width, start, w, gone)
            w -= 1
            continue
        a = gone - w
        c = n + first + chosen[a]
        if abs(r[a]) > high[c] - low[c]:  # crossed whole: it counts on, at its other bound
            side[c] = -side[c]
        else:
            side[c] = 0
            count -= 1
            chosen[a] = chosen[count]

    # whether signs of multipliers decided where rounding may be as large as they are, or rows were left out
    decided = w > 0 or count > m - inequalities
    if least < RANK or (decided and (least < EVEN or pivot < PARALLEL)):
        s.flags[1] = max(s.flags[1], level + 1)
    # lock what is active in every optimum, release the rest
    released = False
    for j in range(w - 1, -1, -1):
        c = working[j]
        if -u[j] * side[c] > STRICT * norm * size / pivot:
            kind[c] = LOCKED + level
        elif not uniform:
            release(s, width, start, w, j)
            w -= 1
            released = True
    if inequalities > 0:
        for a in range(count - 1, -1, -1):
            c = n + first + chosen[a]
            if side[c] != 2 and abs(r[a]) <= STRICT * size:
                side[c] = 0
                count -= 1
                chosen[a] = chosen[count]
                released = True
        for row in range(first, last):
            c = n + row
            if side[c] == 0:
                normalise(s, row)
                value = dot(A, row, x)
                low[c], high[c], kind[c] = min(low[c], value), max(high[c], value), FREE
    if uniform:
        return n, int(turn)
    if released:
        rank = load_factor(s, start, w, count, tolerance)
    for step in range(rank):
        reflect(G, start + w + step, n, s.F, step, step, s.tau[step], s.scratch)
    return int(start + w + rank), int(turn)


minimise_compiled = linked(minimise_level, by_reference_module, linear, state, damping_module, rules)
"""`minimise_level` for compiled code."""
