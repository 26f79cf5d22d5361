"""The two rules of the active-set method: which constraint stops a step, and which one is let go."""

from __future__ import annotations

from math import sqrt

from qpsafe.hqp.own_linear import along, dot, image, jit
from qpsafe.hqp.own_state import FREE, State

GRAZE = 1e-12  # a constraint moving slower than this, relative to the step, does not block it


@jit
def ratio_test(s: State, first: int, last: int, careful: bool) -> tuple[float, int]:
    """Largest fraction of the step d that breaks no constraint, and the constraint met there (-1 if none)."""
    n = s.x.shape[0]
    square = 0.0
    for i in range(n):
        square += s.d[i] * s.d[i]
    graze = GRAZE * sqrt(square)
    alpha, met, speed = 1.0, -1, 0.0
    for c in range(n + last):
        if c < n:
            if s.kind[c] != FREE:
                continue
            value, rate, slow = s.x[c], s.d[c], graze
        elif c < n + first:  # rows of levels above
            if s.kind[c] != FREE:
                continue
            row = c - n
            value, rate, slow = dot(s.A, row, s.x), dot(s.A, row, s.d), graze * sqrt(image(s.A, row, s.A, row))
        else:  # rows of this level that are met: the step ends where they would be violated
            if s.side[c] != 0:
                continue
            row = c - n
            value, rate, slow = dot(s.A, row, s.x), s.d[c - first], graze * sqrt(image(s.A, row, s.A, row))
        if rate > slow:
            t = (s.high[c] - value) / rate
        elif rate < -slow:
            t = (s.low[c] - value) / rate
        else:
            continue
        t = max(t, 0.0)
        if t < alpha or (t == alpha and met >= 0 and not careful and abs(rate) > abs(speed)):
            alpha, met, speed = t, c, rate
    if met >= 0:
        s.side[met] = 1 if speed > 0.0 else -1
    return alpha, met


@jit
def multipliers(s: State, start: int, w: int, count: int, uniform: bool, scale: float) -> float:
    """u[:w] = λ with gradient -Aᵀr = Σ λ_j c_j over the freedom; returns the smallest pivot of the triangle."""
    n = s.x.shape[0]
    pivot = 1.0
    for j in range(w - 1, -1, -1):
        value = 0.0
        if uniform:
            value = -scale * along(s.G, start + j, s.r, n)
        else:
            for a in range(count):
                value -= s.G[start + j, n + s.chosen[a]] * s.r[a]
        for l in range(j + 1, w):
            value -= s.R[j, l] * s.u[l]
        s.u[j] = value / s.R[j, j]
        pivot = min(pivot, abs(s.R[j, j]))
    return pivot


@jit
def wrong_way(
    s: State, first: int, w: int, count: int, inequalities: int, threshold: float, norm: float, careful: bool
) -> int:
    """Working constraint j, or w + index of the chosen row, that pushes the wrong way most; -1 if none does.

    λ must be >= 0 at a lower bound and <= 0 at an upper one; the residual of a row is its multiplier.
    """
    n = s.x.shape[0]
    worst, gone = threshold, -1
    for j in range(w):
        wrong = s.u[j] * s.side[s.working[j]]
        if wrong > worst:
            gone, worst = j, wrong
            if careful:
                return gone
    for a in range(count):
        side = s.side[n + first + s.chosen[a]] if inequalities else 2
        if side != 2:
            wrong = norm * s.r[a] * side
            if wrong > worst:
                gone, worst = w + a, wrong
                if careful:
                    return gone
    return gone
