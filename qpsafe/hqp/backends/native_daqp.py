"""DAQP's own hierarchical mode as a back end: one call for all levels.

    min ½||q̇ - q̇0||²  subject to levels of constraints, each violated as little as those before allow

The closing level gives q̇0 if it is an identity (a scaled one included), else q̇0 = 0. DAQP normalises the rows it is
given, which changes the weights within a level; rows of equal length are left alone, so the rows of an equality level
are mixed orthogonally beforehand until they are equally long. Rows of an inequality level cannot be mixed: there the
weights are DAQP's. All-zero rows have no length and are left out.

Source: D. Arnström, A. Bemporad, D. Axehill, "A dual active-set solver for embedded quadratic programming using
recursive LDLᵀ updates", IEEE TAC 67(8), 2022.
"""

from __future__ import annotations

from typing import NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from qpsafe.hqp.level import Level

Array = NDArray[np.float64]

_FOUND = (1, 2)  # exit flags: optimal, and optimal with soft constraints violated


def solve_daqp(levels: list[Level], lower: Array, upper: Array, hard: bool) -> tuple[Array | None, int]:
    """Solve a hierarchy of usable levels.

    Args:
        levels: highest priority first.
        lower: (n,) lower limits, may be infinite.
        upper: (n,) upper limits, may be infinite.
        hard: whether the first level are hard rows.

    Returns:
        q̇ (n,), clipped to the box by rounding only, or None if DAQP did not find one; and its iterations.
    """
    return call_daqp(arrange(levels, lower, upper, hard), lower, upper)


class Arranged(NamedTuple):
    """Arguments of `daqp.solve`; the last row of each level is in `ends`, counted with the box."""

    H: Array
    f: Array
    A: Array
    upper: Array
    lower: Array
    sense: NDArray[np.int32]
    ends: NDArray[np.int32]


def call_daqp(arranged: Arranged, lower: Array, upper: Array) -> tuple[Array | None, int]:
    """Let DAQP solve; see `solve_daqp`.

    Args:
        arranged: From `arrange`.
        lower: (n,) of q̇ [rad/s].
        upper: (n,) of q̇ [rad/s].
    """
    *arguments, ends = arranged
    if not arranged.A.size:  # nothing but the box
        return np.clip(-arranged.f, lower, upper), 0
    x, _, flag, info = daqp.solve(*arguments, break_points=ends, rho_soft=1e-8, primal_tol=1e-9)
    clipped = np.clip(x, lower, upper)
    if flag not in _FOUND or not np.all(np.abs(clipped - x) <= 1e-8):
        return None, int(info["iterations"])
    return clipped, int(info["iterations"])


def arrange(levels: list[Level], lower: Array, upper: Array, hard: bool) -> Arranged:
    """Lay a hierarchy out for DAQP.

    Args:
        levels: Highest priority first.
        lower: (n,) of q̇ [rad/s].
        upper: (n,) of q̇ [rad/s].
        hard: Whether the first level holds hard rows, which go with the box.
    """
    n = lower.shape[0]
    target = np.zeros(n)
    stack = list(levels)
    if stack and _is_identity(stack[-1]):
        last = stack.pop()
        target = last.lower / last.A[0, 0]
    matrices, lows, highs, ends = [np.empty((0, n))], [lower], [upper], [n]
    for k, level in enumerate(stack):
        A, low, high = prepared(level)
        matrices.append(A)
        lows.append(low)
        highs.append(high)
        if hard and k == 0:
            ends[0] += low.size
        elif low.size:
            ends.append(ends[-1] + low.size)
    low, high = np.maximum(np.concatenate(lows), -1e30), np.minimum(np.concatenate(highs), 1e30)
    sense, last_rows = np.zeros(low.size, dtype=np.int32), np.array(ends, dtype=np.int32)
    return Arranged(np.eye(n), -target, np.vstack(matrices), high, low, sense, last_rows)


def prepared(level: Level) -> tuple[Array, Array, Array]:
    """The rows that DAQP gets: weighted, without zero rows, equally long where that is possible."""
    root = np.ones(level.rows) if level.weight is None else np.sqrt(level.weight)
    A, low, high = root[:, None] * level.A, root * level.lower, root * level.upper
    if level.is_equality:
        A, low = equal_lengths(A, low)
        high = low
    keep = np.any(A != 0.0, axis=1)
    return A[keep], low[keep], high[keep]


def equal_lengths(A: Array, b: Array) -> tuple[Array, Array]:
    """Mix rows of A q̇ = b orthogonally until all are equally long: rotate the longest with the shortest."""
    A, b = A.copy(), b.copy()
    for _ in range(4 * b.size):
        squares = np.einsum("ij,ij->i", A, A)
        i, j, mean = int(squares.argmax()), int(squares.argmin()), float(squares.mean())
        if squares[i] - squares[j] <= 1e-12 * mean:
            break
        # row i becomes cos A_i + sin A_j with squared length = mean: a quadratic in t = tan
        p, q, r = squares[j] - mean, 2.0 * (A[i] @ A[j]), squares[i] - mean
        t = -2.0 * r / (q + np.copysign(np.sqrt(max(q * q - 4.0 * p * r, 0.0)), q))
        cosine = 1.0 / np.sqrt(1.0 + t * t)
        turn = np.array([[cosine, t * cosine], [-t * cosine, cosine]])
        A[[i, j]], b[[i, j]] = turn @ A[[i, j]], turn @ b[[i, j]]
    return A, b


def _is_identity(level: Level) -> bool:
    """Whether a level is q̇ = q̇0 times a positive number."""
    n = level.A.shape[1]
    if level.rows != n or not level.is_equality or level.weight is not None or not level.A[0, 0] > 0.0:
        return False
    return bool(np.all(level.A[0, 0] * np.eye(n) == level.A))
