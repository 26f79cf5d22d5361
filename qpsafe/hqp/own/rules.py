"""The two rules of the active-set method: which constraint stops a step, and which one is let go."""

from __future__ import annotations

from math import sqrt

from qpsafe.compiled.compiled import inline
from qpsafe.hqp.own.linear import along, dot, image
from qpsafe.hqp.own.state import FREE, State

GRAZE = 1e-12  # a constraint moving slower than this, relative to the step, does not block it


@inline
def ratio_test(s: State, first: int, last: int, careful: bool) -> tuple[float, int]:
    """Largest fraction of the step d that breaks no constraint, and the constraint met there (-1 if none)."""
    A, low, high, kind, side, x, d, n = s.A, s.low, s.high, s.kind, s.side, s.x, s.d, s.x.shape[0]
    square = 0.0
    for i in range(n):
        square += d[i] * d[i]
    graze = GRAZE * sqrt(square)
    alpha, met, speed = 1.0, -1, 0.0
    for c in range(n + last):
        if c < n:
            if kind[c] != FREE:
                continue
            value, rate, slow = x[c], d[c], graze
        elif c < n + first:  # rows of levels above
            if kind[c] != FREE:
                continue
            row = c - n
            value, rate, slow = dot(A, row, x), dot(A, row, d), graze * sqrt(image(A, row, A, row))
        else:  # rows of this level that are met: the step ends where they would be violated
            if side[c] != 0:
                continue
            row = c - n
            value, rate, slow = dot(A, row, x), d[c - first], graze * sqrt(image(A, row, A, row))
        if rate > slow:
            t = (high[c] - value) / rate
        elif rate < -slow:
            t = (low[c] - value) / rate
        else:
            continue
        t = max(t, 0.0)
        if t < alpha or (t == alpha and met >= 0 and not careful and abs(rate) > abs(speed)):
            alpha, met, speed = t, c, rate
    if met >= 0:
        side[met] = 1 if speed > 0.0 else -1
    return alpha, met


@inline
def multipliers(s: State, start: int, w: int, count: int, uniform: bool, scale: float) -> float:
    """u[:w] = λ with gradient -Aᵀr = Σ λ_j c_j over the freedom; returns the smallest pivot of the triangle."""
    G, R, u, r, chosen, n = s.G, s.R, s.u, s.r, s.chosen, s.x.shape[0]
    pivot = 1.0
    for j in range(w - 1, -1, -1):
        value = 0.0
        if uniform:
            value = -scale * along(G, start + j, r, n)
        else:
            for a in range(count):
                value -= G[start + j, n + chosen[a]] * r[a]
        for l in range(j + 1, w):
            value -= R[j, l] * u[l]
        u[j] = value / R[j, j]
        pivot = min(pivot, abs(R[j, j]))
    return pivot


@inline
def wrong_way(
    s: State, first: int, w: int, count: int, inequalities: int, threshold: float, norm: float, careful: bool
) -> int:
    """Working constraint j, or w + index of the chosen row, that pushes the wrong way most; -1 if none does.

    λ must be >= 0 at a lower bound and <= 0 at an upper one; the residual of a row is its multiplier. `careful` takes
    the lowest number instead of the worst (Bland).
    """
    side, working, chosen, u, r, n = s.side, s.working, s.chosen, s.u, s.r, s.x.shape[0]
    worst, gone, lowest = threshold, -1, side.shape[0]
    for j in range(w):
        wrong = u[j] * side[working[j]]
        if wrong > worst and working[j] < lowest:
            gone = j
            if careful:
                lowest = working[j]
            else:
                worst = wrong
    if inequalities == 0:
        return gone
    for a in range(count):
        c = n + first + chosen[a]
        wrong = norm * r[a] * side[c]
        if side[c] != 2 and wrong > worst and c < lowest:
            gone = w + a
            if careful:
                lowest = c
            else:
                worst = wrong
    return gone
