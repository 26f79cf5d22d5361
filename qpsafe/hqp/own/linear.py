"""Small dense linear algebra of the own solver: one orthonormal basis, turned in place.

The solver keeps an orthonormal basis of joint space in the rows of G; beside each basis vector stands its image under
the rows A of the level at work:

    G[j] = [ b_j | A b_j ]       j in  0..start: used up by levels above
                                 j in  start..start+w: Y, held by the w working constraints
                                 j in  start+w..n: N, the freedom left

All it does is turn these rows, by Householder reflections and Givens rotations; the images turn with them, so A is
never multiplied again, nothing is inverted, and equal input gives equal bits. Loops are written out: at n = 7 a call
into LAPACK costs more than the arithmetic, and `numpy.linalg` would multiply the compile time. No fast-math.
"""

from __future__ import annotations

from math import copysign, sqrt

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import inline

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@inline
def dot(A: Array, row: int, x: Array) -> float:
    """A[row] · x, over the columns of A."""
    value = 0.0
    for i in range(A.shape[1]):
        value += A[row, i] * x[i]
    return value


@inline
def along(G: Array, j: int, r: Array, n: int) -> float:
    """G[j, :n] · r."""
    value = 0.0
    for i in range(n):
        value += G[j, i] * r[i]
    return value


@inline
def image(G: Array, j: int, A: Array, row: int) -> float:
    """G[j] · A[row], over the columns of A."""
    value = 0.0
    for i in range(A.shape[1]):
        value += G[j, i] * A[row, i]
    return value


@inline
def householder(V: Array, row: int, first: int, last: int) -> tuple[float, float]:
    """Reflection I - τ v vᵀ that turns V[row, first:last] into (value, 0, ..., 0).

    v overwrites the row. Returns value and τ, both 0 for a zero row.
    """
    square = 0.0
    for j in range(first, last):
        square += V[row, j] * V[row, j]
    if square == 0.0:
        return 0.0, 0.0
    value = -copysign(sqrt(square), V[row, first])
    tau = 1.0 / (square - value * V[row, first])
    V[row, first] -= value
    return value, tau


@inline
def reflect(G: Array, first: int, width: int, V: Array, row: int, column: int, tau: float, scratch: Array) -> None:
    """Turn rows first.. of G, over `width` columns, by I - τ v vᵀ with v = V[row, column:]."""
    n = G.shape[0]
    for i in range(width):
        scratch[i] = 0.0
    for j in range(first, n):
        factor = tau * V[row, column + j - first]
        for i in range(width):
            scratch[i] += factor * G[j, i]
    for j in range(first, n):
        factor = V[row, column + j - first]
        for i in range(width):
            G[j, i] -= factor * scratch[i]


@inline
def factorise(F: Array, chosen: Index, count: int, k: int, tau: Array, diagonal: Array, tolerance: float) -> int:
    """Pivoted Householder factorisation F = L Q of a wide or tall matrix, in place: L lower trapezoidal, Q orthogonal.

    Args:
        F: (count, k) matrix; below the diagonal it becomes L, right of it the reflections.
        chosen: (count,) names of its rows, permuted into pivot order with them.
        count: rows of F.
        k: columns of F.
        tau: (>= rank,) factors of the reflections.
        diagonal: (>= rank,) diagonal of L.
        tolerance: rows whose part in the freedom left is shorter than this count as dependent.

    Returns:
        The rank.
    """
    rank = 0
    while rank < count and rank < k:
        longest, best = 0.0, rank
        for a in range(rank, count):
            square = 0.0
            for j in range(rank, k):
                square += F[a, j] * F[a, j]
            if square > longest:
                longest, best = square, a
        if longest <= tolerance * tolerance:
            break
        if best != rank:
            chosen[rank], chosen[best] = chosen[best], chosen[rank]
            for j in range(k):
                F[rank, j], F[best, j] = F[best, j], F[rank, j]
        diagonal[rank], tau[rank] = householder(F, rank, rank, k)
        for a in range(rank + 1, count):
            s = 0.0
            for j in range(rank, k):
                s += F[a, j] * F[rank, j]
            s *= tau[rank]
            for j in range(rank, k):
                F[a, j] -= s * F[rank, j]
        rank += 1
    return rank


@inline
def least_squares(F: Array, count: int, rank: int, diagonal: Array, r: Array, u: Array) -> None:
    """u = argmin ||L u - r|| for the L of `factorise`.

    With as many rows as rank a forward substitution; else Householder QR of L, copied below row `count` of F, which
    overwrites r.
    """
    if rank == count:
        for j in range(rank):
            s = r[j]
            for l in range(j):
                s -= F[j, l] * u[l]
            u[j] = s / diagonal[j]
        return
    for j in range(rank):  # row count + j: column j of L, contiguous
        t = count + j
        for a in range(j):
            F[t, a] = 0.0
        F[t, j] = diagonal[j]
        for a in range(j + 1, count):
            F[t, a] = F[a, j]
    for j in range(rank):
        t = count + j
        u[j], tau = householder(F, t, j, count)
        for l in range(t + 1, count + rank):
            s = 0.0
            for a in range(j, count):
                s += F[t, a] * F[l, a]
            s *= tau
            for a in range(j, count):
                F[l, a] -= s * F[t, a]
        s = 0.0
        for a in range(j, count):
            s += F[t, a] * r[a]
        s *= tau
        for a in range(j, count):
            r[a] -= s * F[t, a]
    for j in range(rank - 1, -1, -1):
        s = r[j]
        for l in range(j + 1, rank):
            s -= F[count + l, j] * u[l]
        u[j] = s / u[j]


@inline
def unturn(F: Array, tau: Array, rank: int, k: int, p: Array) -> None:
    """p = Qᵀ [u; 0] for p[:rank] = u and the Q of `factorise`."""
    for j in range(rank, k):
        p[j] = 0.0
    for step in range(rank - 1, -1, -1):
        s = 0.0
        for j in range(step, k):
            s += F[step, j] * p[j]
        s *= tau[step]
        for j in range(step, k):
            p[j] -= s * F[step, j]


@inline
def jacobi(aa: float, bb: float, ab: float) -> tuple[float, float]:
    """Cosine and sine of the rotation (a, b) -> (c a - s b, s a + c b) that makes two rows orthogonal.

    Args:
        aa: a·a.
        bb: b·b.
        ab: a·b, not 0.
    """
    zeta = (bb - aa) / (2.0 * ab)
    t = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta))
    cosine = 1.0 / sqrt(1.0 + t * t)
    return cosine, cosine * t


@inline
def remove_column(G: Array, width: int, R: Array, start: int, w: int, gone: int) -> None:
    """Take working constraint `gone` out of the triangle R, (w, w), and give its direction back to N.

    R[i, j] is the component of working constraint j along basis vector start + i; deleting one leaves a Hessenberg
    matrix, which Givens rotations of neighbouring basis vectors make triangular again.
    """
    for j in range(gone, w - 1):
        for i in range(j + 2):
            R[i, j] = R[i, j + 1]
    for j in range(gone, w - 1):
        length = sqrt(R[j, j] * R[j, j] + R[j + 1, j] * R[j + 1, j])
        c, s = R[j, j] / length, R[j + 1, j] / length
        R[j, j] = length
        for l in range(j + 1, w - 1):
            R[j, l], R[j + 1, l] = c * R[j, l] + s * R[j + 1, l], c * R[j + 1, l] - s * R[j, l]
        for i in range(width):
            p, q = G[start + j, i], G[start + j + 1, i]
            G[start + j, i] = c * p + s * q
            G[start + j + 1, i] = c * q - s * p
