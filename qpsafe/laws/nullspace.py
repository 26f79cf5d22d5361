"""The paper's law by pseudoinverses and null-space projections, eqs. (17), (18), (20), (22). It knows no limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.activation import regime_weights
from qpsafe.hqp.own.state import HUGE
from qpsafe.laws.problem import LawProblem, LawResult
from qpsafe.text.words import call

#: Singular values below this fraction of the largest count as zero, here and in the QP solvers.
RANK_TOLERANCE = 1e-10


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


def paper_regime(problem: LawProblem, kept: int) -> NDArray[np.float64]:
    """Joint velocity of the pure regime that keeps the first `kept` tasks, by pseudoinverses.

    q̇ = Σ_i N_(i-1) P(J_i) ẋ_i + N_kept q̇0, where N_i projects onto the common null space of tasks 1..i. For one and two
    tasks these are the pure regimes of (18) and (22); for more, their continuation.
    """
    n = len(problem.qd0)
    qd = np.zeros(n)
    N = np.eye(n)
    stacked = np.zeros((0, n))
    for J, xd in problem.tasks[:kept]:
        qd = qd + N @ (pseudoinverse(J) @ xd)
        stacked = np.vstack((stacked, J))
        N = np.eye(n) - pseudoinverse(stacked) @ stacked
    return qd + N @ problem.qd0


class NullspaceLaw:
    """The law of the paper: (18) for one task, (22) for two, the same blend of pure regimes for more.

    It takes no notice of limits; the controller clips what it returns.
    """

    def __repr__(self) -> str:
        return call(self)

    def solve(self, problem: LawProblem) -> LawResult:
        """Evaluate the law for one tick; see `LawProblem` for shapes."""
        n = len(problem.qd0)
        tasks, a = problem.tasks, problem.activations
        if len(tasks) == 1:
            (J, xd), none = tasks[0], np.zeros(0)
            qd = nullspace_velocity(J, np.zeros((0, n)), xd, none, problem.qd0, a[0], 1.0)
        elif len(tasks) == 2:
            (J_H, xd_H), (J_L, xd_L) = tasks
            m = a[0]
            f = a[1] / m if m > 0.0 else 0.0  # a_2 = m f
            qd = nullspace_velocity(J_H, J_L, xd_H, xd_L, problem.qd0, m, f)
        else:
            qd = np.zeros(n)
            for kept, weight in enumerate(regime_weights(a)):
                if weight > 0.0:
                    qd += weight * paper_regime(problem, kept)
        return LawResult(qd)
