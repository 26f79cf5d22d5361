"""Tasks that do not push against what is above them, compiled.

A row g q̇ <= h above a task J q̇ = ẋ may ask for nearly the same as the task: g ≈ cᵀJ, as where a tool's tip meets a
table. If the task wants more than the row permits, cᵀẋ > h, a strict hierarchy sacrifices everything below the task
for the little that can still be gained: the tool turns as fast as it can about the point that it touches. So the task's
wish along c is lowered to what the row permits,

    ẋ <- ẋ - w (cᵀẋ - h') c / cᵀc,   c = (J Jᵀ)⁻¹ J gᵀ,

w being 1 where g is a combination of the task's rows up to `NEARLY` of its length, and 0 beyond `FAR`; h' = h less a
little, `SPARE`, so that the tool can still turn while the row holds its corners.
"""

from __future__ import annotations

from math import inf, sqrt

from qpsafe.compiled.compiled import Array, inline

NEARLY, FAR = 0.05, 0.2
SPARE = 0.003  # of a row's bound [m/s]
MOST = 6  # rows of a task that are looked at, those of a pose


@inline
def yield_to(J: Array, xd: Array, rows: Array, high: Array, factor: Array) -> None:
    """Lower ẋ of one task to what rows permit, one after the other.

    Args:
        J: (m, n).
        xd: (m,) ẋ.
        rows: (k, n).
        high: (k,) their upper bounds.
        factor: At least (m, m + 1) to work in.
    """
    m, n = J.shape[0], J.shape[1]
    if m > MOST or rows.shape[0] == 0:
        return
    # J Jᵀ = L Lᵀ
    for i in range(m):
        for l in range(i + 1):
            value = 0.0
            for j in range(n):
                value += J[i, j] * J[l, j]
            size = value
            for k in range(l):
                value -= factor[i, k] * factor[l, k]
            if l < i:
                factor[i, l] = value / factor[l, l]
            elif value > 1e-12 * size:
                factor[i, i] = sqrt(value)
            else:  # the task's rows depend on each other: left to the solver
                return
    for k in range(rows.shape[0]):
        if not abs(high[k]) < inf:
            continue
        square, left = 0.0, 0.0
        for j in range(n):
            square += rows[k, j] * rows[k, j]
        left = square
        for i in range(m):
            value = 0.0
            for j in range(n):
                value += J[i, j] * rows[k, j]
            for l in range(i):
                value -= factor[i, l] * factor[l, m]
            factor[i, m] = value / factor[i, i]
            left -= factor[i, m] * factor[i, m]  # |g|² - |gᵀ's part among the rows of J|²
        if not left < FAR * FAR * square:
            continue
        weight = min((FAR - sqrt(max(left, 0.0) / square)) / (FAR - NEARLY), 1.0)
        wanted, length = 0.0, 0.0
        for i in range(m - 1, -1, -1):
            for l in range(i + 1, m):
                factor[i, m] -= factor[l, i] * factor[l, m]
            factor[i, m] /= factor[i, i]
            wanted += factor[i, m] * xd[i]
            length += factor[i, m] * factor[i, m]
        permitted = high[k] - SPARE
        if wanted > permitted:
            for i in range(m):
                xd[i] -= weight * (wanted - permitted) / length * factor[i, m]
