"""The paper's law by pseudoinverses and null-space projections, eqs. (17), (18), (20), (22). It knows no limits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import inline
from qpsafe.danger.activation import regime_weights
from qpsafe.fixed import Fixed
from qpsafe.hqp.own.level import RANK
from qpsafe.hqp.own.state import HUGE
from qpsafe.laws.problem import LawProblem, LawResult
from qpsafe.text.words import call

Array = NDArray[np.float64]

#: Singular values below this fraction of the largest count as zero, as in the QP solvers.
RANK_TOLERANCE = RANK


def pseudoinverse(A: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moore-Penrose pseudoinverse P(A), (n, rows), of A (rows, n); A may be rank-deficient or have no rows.

    Raises:
        ValueError: A number of A is not finite, or cannot be squared: LAPACK may then never come back.
    """
    if not (np.abs(A) < HUGE).all():  # false for NaN
        raise ValueError(f"a Jacobian has numbers that are not finite, or beyond {HUGE:g}")
    return np.asarray(np.linalg.pinv(A, rcond=RANK_TOLERANCE), dtype=np.float64)


def nullspace_velocity(
    J_H: NDArray[np.float64],
    J_L: NDArray[np.float64],
    xd_H: NDArray[np.float64],
    xd_L: NDArray[np.float64],
    qd0: NDArray[np.float64],
    m: float,
    f: float,
) -> NDArray[np.float64]:
    """Joint velocity of eq. (22), with the tasks of eq. (20); eq. (18) with `J_L` empty and f = 1.

    Args:
        J_H: Jacobian of the high-priority task (h, n).
        J_L: Jacobian of the low-priority task (l, n); (0, n) if there is none.
        xd_H: CLIK velocity ẋ_H (h,).
        xd_L: CLIK velocity ẋ_L (l,).
        qd0: Evasive velocity q̇0 (n,).
        m: Switch (19), 1 keeps the main task.
        f: Switch (21), 1 keeps the low-priority task.

    Returns:
        q̇ (n,).
    """
    identity = np.eye(len(qd0))
    P_H = pseudoinverse(J_H)
    N_H = identity - P_H @ J_H
    qd_task = P_H @ xd_H + f * (N_H @ (pseudoinverse(J_L) @ xd_L))  # (20), with q̇_task,L = P(J_L) ẋ_L
    J = np.vstack((J_H, J_L))
    N_m = identity - m * (pseudoinverse(J) @ J)  # (18)
    N_Hm = identity - m * (P_H @ J_H)  # (22), second line
    return m * qd_task + (f * N_m + (1.0 - f) * N_Hm) @ qd0  # (22)


class NullspaceLaw(Fixed):
    """The law of the paper: (18) for one task, (22) for two, the same blend of pure regimes for more.

    It ignores limits; the controller clips what it returns.
    """

    def __init__(self) -> None:
        import qpsafe.laws.projections  # noqa: F401  compile it now if need be, not within the first tick

    def __repr__(self) -> str:
        return call(self)

    def solve(self, problem: LawProblem) -> LawResult:
        """Evaluate the law for one tick; see `LawProblem` for shapes."""
        from qpsafe.laws.projections import regimes_of

        weights = regime_weights(problem.activations)
        most = int(np.flatnonzero(weights)[-1])  # tasks that are kept at all
        return LawResult(blend(weights, regimes_of(problem.tasks[:most], problem.qd0), np.zeros(len(problem.qd0))))


def blend(weights: Any, x: Array, qd: Array) -> Array:
    """Add Σ_k w_k x_k to qd and return it; regimes without weight do not count.

    Args:
        weights: (tasks + 1,), see `regime_weights`.
        x: (tasks + 1, n) or less, where no others have weight.
        qd: (n,).
    """
    for k in range(x.shape[0]):
        if weights[k] > 0.0:
            for j in range(qd.shape[0]):
                qd[j] += weights[k] * x[k, j]
    return qd


blend_compiled = inline(blend)
