"""The plain cascade: one quadratic program a level, through any back end of qpsolvers.

With the point x and the null space Z left by the levels above, level k solves, over q̇ = x + Z y,

    min_y  ½ ||A (x + Z y) - b||²   subject to the limits,

then keeps its optimum for the levels below. The optima of a least-squares level under convex limits are exactly the
points of the limits with the same A q̇, so Z shrinks to Z null(A Z) and the limits stay. Rows of an inequality
level keep their violation if they have one, and become limits if they have none (their violations at the optimum are
unique as well).

Equality levels are solved in the coordinates y = V [s; t] of A Z = U diag(S) Vᵀ, t spanning its null space, where the
Hessian is diag(S², ρ). The small ρ only makes the program strictly convex; repeating it around its own answer (proximal
point) removes the bias that ρ leaves while limits bind.

Source: O. Kanoun, F. Lamiraux, P.-B. Wieber, "Kinematic control of redundant manipulators", IEEE T-RO 27(4), 2011.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import qpsolvers
from numpy.typing import NDArray

from qpsafe.hqp.level import Level

Array = NDArray[np.float64]

RANK_TOLERANCE = 1e-10  # relative to the level's own matrix
_PROX = (1e-6, 1e-3)  # relative ρ: small converges fast; large where the back end fails with the small one
_REPEATS = 20  # proximal repeats at most
_MET = 1e-9  # a violation below this (relative above 1) counts as none

_SETTINGS: dict[str, dict[str, Any]] = {
    "daqp": {"primal_tol": 1e-11, "dual_tol": 1e-13, "iter_limit": 1000},
    "proxqp": {"eps_abs": 1e-9, "eps_rel": 0.0, "max_iter": 10_000},
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 20_000},
    "piqp": {"eps_abs": 1e-11, "eps_rel": 1e-11},
}


def solve_cascade(
    backend: str, levels: list[Level], start: Array, lower: Array, upper: Array
) -> tuple[Array, int, list[int]]:
    """Solve a hierarchy of usable levels.

    Args:
        backend: name of a solver of qpsolvers.
        levels: highest priority first.
        start: (n,) a point of the box.
        lower: (n,) lower limits, may be infinite.
        upper: (n,) upper limits, may be infinite.

    Returns:
        q̇ (n,) inside the box, the number of programs solved, and the levels at which the back end failed (one past the
        last for the closing smallest norm).
    """
    n = start.shape[0]
    cascade = Cascade(backend, start, lower, upper)
    for k, level in enumerate(levels):
        cascade.add(level, k)
    if cascade.Z.shape[1]:
        cascade.add(Level(np.eye(n), np.zeros(n), np.zeros(n)), len(levels))
    return cascade.x, cascade.programs, cascade.failures


class Cascade:
    """State of one solve: the point reached, the freedom left, the limits that hold.

    Attributes:
        x: (n,) point reached, inside the limits.
        Z: (n, k) orthonormal basis of the freedom left.
        failures: levels at which the back end failed.
        programs: quadratic programs solved.
    """

    def __init__(self, backend: str, start: Array, lower: Array, upper: Array) -> None:
        """Begin at `start`, (n,), inside the box `lower`, `upper`, each (n,), possibly infinite.

        Args:
            backend: A solver of qpsolvers, by name.
            start: (n,) [rad/s].
            lower: (n,) [rad/s].
            upper: (n,) [rad/s].
        """
        n = start.shape[0]
        self.backend = backend
        self.x = start
        self.Z = np.eye(n)
        self.failures: list[int] = []
        self.programs = 0
        self._lower, self._upper = lower, upper
        self._G, self._G_lower, self._G_upper = np.empty((0, n)), np.empty(0), np.empty(0)

    def add(self, level: Level, number: int) -> None:
        """Minimise one level over the freedom left, then take away what it used."""
        if level.rows == 0 or self.Z.shape[1] == 0:
            self._keep(level, np.zeros(level.rows, dtype=bool))
            return
        root = np.ones(level.rows) if level.weight is None else np.sqrt(level.weight)
        A, lower, upper = root[:, None] * level.A, root * level.lower, root * level.upper
        try:
            step = self._equality_step(A, lower) if level.is_equality else self._mixed_step(A, lower, upper)
        except np.linalg.LinAlgError:
            step = None
        if step is None:
            self.failures.append(number)
        else:
            self.x = np.clip(self.x + step, self._lower, self._upper)  # by rounding only: _solve checked it
        v = level.violations(self.x)
        locked = (level.lower == level.upper) | (np.abs(v) > _MET * np.maximum(1.0, np.abs(level.A @ self.x)))
        self._keep(level, locked)
        if np.any(locked):
            scale = np.linalg.norm(A)
            _, S, Vt = np.linalg.svd(A[locked] @ self.Z)
            self.Z = self.Z @ Vt[int(np.sum(RANK_TOLERANCE * scale < S)) :].T

    def _keep(self, level: Level, locked: NDArray[np.bool_]) -> None:
        """Rows that are met and not locked bound all levels below."""
        value = level.A @ self.x
        met = ~locked & (np.isfinite(level.lower) | np.isfinite(level.upper)) & (level.lower < level.upper)
        self._G = np.vstack((self._G, level.A[met]))
        self._G_lower = np.concatenate((self._G_lower, np.minimum(level.lower, value)[met]))
        self._G_upper = np.concatenate((self._G_upper, np.maximum(level.upper, value)[met]))

    def _equality_step(self, A: Array, b: Array) -> Array | None:
        """Z y of  min_y ||A (x + Z y) - b||²  in the coordinates y = V [s; t]."""
        U, S, Vt = np.linalg.svd(A @ self.Z)
        rank = int(np.sum(RANK_TOLERANCE * np.linalg.norm(A) < S))
        if rank == 0:
            return np.zeros_like(self.x)
        T = self.Z @ Vt.T
        r = U[:, :rank].T @ (b - A @ self.x)
        S = S[:rank]
        hessian, gradient, free = np.zeros(T.shape[1]), np.zeros(T.shape[1]), np.zeros(T.shape[1])
        hessian[:rank], gradient[:rank], free[rank:] = S**2, -S * r, S[0] ** 2
        y = self._repeat(hessian, gradient, free, T, np.zeros(0))
        return None if y is None else T @ y

    def _mixed_step(self, A: Array, lower: Array, upper: Array) -> Array | None:
        """Z y of  min_{y,v} ½||v||²  subject to  lower <= A (x + Z y) - v <= upper."""
        rows, k = A.shape[0], self.Z.shape[1]
        hessian, free = np.zeros(k + rows), np.zeros(k + rows)
        hessian[k:], free[:k] = 1.0, max(float(np.linalg.norm(A @ self.Z)) ** 2, 1e-300)
        value = A @ self.x
        soft = np.hstack((A @ self.Z, -np.eye(rows)))
        v = np.maximum(value - upper, 0.0) + np.minimum(value - lower, 0.0)
        y = self._repeat(hessian, np.zeros(k + rows), free, self.Z, v, (soft, lower - value, upper - value))
        return None if y is None else self.Z @ y[:k]

    def _repeat(
        self,
        hessian: Array,
        gradient: Array,
        free: Array,
        T: Array,
        slack: Array,
        soft: tuple[Array, Array, Array] | None = None,
    ) -> Array | None:
        """Proximal point: repeat the program around its own answer until it stays; None if the back end fails.

        `free` is the scale of ρ for each variable, 0 where the Hessian needs none.
        """
        G = np.vstack((T, self._G @ T))
        low = np.concatenate((self._lower - self.x, self._G_lower - self._G @ self.x))
        high = np.concatenate((self._upper - self.x, self._G_upper - self._G @ self.x))
        if soft is not None:
            G = np.vstack((np.hstack((G, np.zeros((G.shape[0], slack.size)))), soft[0]))
            low, high = np.concatenate((low, soft[1])), np.concatenate((high, soft[2]))
        above, below = np.isfinite(high), np.isfinite(low)
        G2 = np.vstack((G[above], -G[below]))
        h2 = np.concatenate((high[above], -low[below]))
        start = np.concatenate((np.zeros(T.shape[1]), slack))
        for rho in _PROX:
            prox = rho * free
            P, y = np.diag(hessian + prox), start
            for _ in range(_REPEATS):
                y_next = _solve_qp(self.backend, P, gradient - prox * y, G2, h2)
                self.programs += 1
                if y_next is None:
                    break
                moved = float(np.max(np.abs(prox * (y_next - y)), initial=0.0))
                y = y_next
                if moved <= 1e-13 * max(1.0, float(np.max(np.abs(gradient), initial=0.0))):
                    break
            if y_next is not None:
                return _polish(P, gradient - prox * y, G2, h2, y)
        return None


def _polish(P: Array, f: Array, G: Array, h: Array, y: Array) -> Array:
    """Solve the optimality conditions of the limits that `y` touches exactly; keep `y` if that is not the optimum.

    Takes the answer of a back end with a loose tolerance to rounding.
    """
    k = y.shape[0]
    active = G[h - G @ y <= 1e-6 * np.maximum(1.0, np.abs(h))]
    bound = h[h - G @ y <= 1e-6 * np.maximum(1.0, np.abs(h))]
    kkt = np.block([[P, active.T], [active, np.zeros((bound.size, bound.size))]])
    try:
        exact = np.linalg.lstsq(kkt, np.concatenate((-f, bound)), rcond=1e-14)[0]
    except np.linalg.LinAlgError:
        return y
    better, multipliers = exact[:k], exact[k:]
    scale = max(1.0, float(np.max(np.abs(f), initial=0.0)))
    stationary = np.max(np.abs(P @ better + f + active.T @ multipliers), initial=0.0) <= 1e-12 * scale
    feasible = np.all(G @ better <= h + 1e-12 * np.maximum(1.0, np.abs(h)))
    return better if stationary and feasible and np.all(multipliers >= -1e-10 * scale) else y


def _solve_qp(backend: str, P: Array, f: Array, G: Array, h: Array) -> Array | None:
    """min ½yᵀPy + fᵀy subject to Gy <= h; None unless the answer is finite, feasible and called solved."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            problem = qpsolvers.Problem(P, f, G if h.size else None, h if h.size else None)
            solution = qpsolvers.solve_problem(problem, solver=backend, **_SETTINGS.get(backend, {}))
    except Exception:  # whatever a back end throws at bad numbers must not reach the loop
        return None
    if not solution.found or solution.x is None or not np.all(np.isfinite(solution.x)):
        return None
    y = np.asarray(solution.x, dtype=np.float64)
    return y if np.all(G @ y <= h + 1e-8 * np.maximum(1.0, np.abs(h))) else None
