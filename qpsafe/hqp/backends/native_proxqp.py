"""PROXQP as a back end: one dense workspace a level, kept between calls and warm started.

Level k solves, over q̇ and, where rows are intervals, their violations v,

    min  ½ ||A q̇ - b||²   or   min ½ ||v||²,  low <= A q̇ - v <= high
    subject to  A_j q̇ = A_j q̇*  for the rows of levels j above that are equalities or cannot be met,
                low <= A_j q̇ <= high  for those that are met,  and the box.

In these coordinates (not in those of a null space, whose basis turns from tick to tick) a level keeps its shape while
the same rows are met, so a workspace is only updated and starts from its last answer. The levels above enter as an
orthonormal basis of the directions they used. PROXQP finds, roughly, what presses; `_polish` then solves the
optimality conditions for that exactly and checks them. Where they do not hold, PROXQP goes on to a sharper tolerance,
then starts cold.

Warm started, the last bits of an answer depend on what was solved before.

Source: A. Bambade, F. Schramm, S. El Kazdadi, S. Caron, A. Taylor, J. Carpentier, "PROXQP: an efficient and versatile
quadratic programming solver for real-time robotics applications and beyond", IEEE T-RO 41, 2025.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from proxsuite import proxqp

from qpsafe.hqp.backends.cascade import RANK_TOLERANCE
from qpsafe.hqp.level import Level

Array = NDArray[np.float64]

_INFINITE = 1e20  # what PROXQP takes for no bound
_ACCURACIES = (1e-6, 1e-9)  # of the gradient; see `_solve`
_TURNS = 1000
_PULL = 1e-9  # smaller multipliers are left over from the last answer


class _Kept(threading.local):
    """Workspaces by level and shape, apart for each thread."""

    def __init__(self) -> None:
        self.workspaces: dict[tuple[int, ...], Any] = {}


_kept = _Kept()


class Program(NamedTuple):
    """min ½ yᵀH y + gᵀy  subject to  E y = e,  low <= C y <= high,  box_low <= y <= box_high."""

    H: Array
    g: Array
    E: Array
    e: Array
    C: Array
    low: Array
    high: Array
    box_low: Array
    box_high: Array


def forget() -> None:
    """Drop this thread's workspaces: the next solves start cold."""
    _kept.workspaces.clear()


def solve_proxqp(levels: list[Level], lower: Array, upper: Array) -> tuple[Array, int, list[int]]:
    """Solve a hierarchy of usable levels.

    Args:
        levels: highest priority first, hard rows among them.
        lower: (n,) lower limits, may be infinite.
        upper: (n,) upper limits, may be infinite.

    Returns:
        q̇ (n,) inside the box, PROXQP's iterations, and the levels at which it failed (one past the last for the closing
        smallest norm).
    """
    n = lower.shape[0]
    cascade = _Cascade(lower, upper)
    for k, level in enumerate(levels):
        cascade.add(level, k)
    if cascade.Z.shape[1]:
        cascade.add(Level.equality(np.eye(n), np.zeros(n)), len(levels))
    return cascade.x, cascade.turns, cascade.failures


class _Cascade:
    """State of one solve: the point reached, and what the levels above ask of those below."""

    def __init__(self, lower: Array, upper: Array) -> None:
        n = lower.shape[0]
        self.x = np.clip(np.zeros(n), lower, upper)
        self.Z = np.eye(n)  # freedom left
        self.turns, self.failures = 0, list[int]()
        self._box = lower, upper
        self._E = np.empty((0, n))  # rows that keep their value
        self._C, self._low, self._high = np.empty((0, n)), np.empty(0), np.empty(0)  # intervals that stay met

    def add(self, level: Level, number: int) -> None:
        """Minimise one level, then keep its optimum for those below."""
        if level.rows == 0:
            return
        root = np.ones(level.rows) if level.weight is None else np.sqrt(level.weight)
        scale = float(np.linalg.norm(root[:, None] * level.A)) or 1.0  # PROXQP's tolerance is absolute
        A, low, high = ((root / scale)[:, None] * level.A, root / scale * level.lower, root / scale * level.upper)
        if self.Z.shape[1] and np.any(A):
            try:
                x = self._minimise(A, low, high, level.is_equality, number)
            except (np.linalg.LinAlgError, RuntimeError, ValueError):  # nothing of a back end reaches the loop
                x = None
            if x is None:
                self.failures.append(number)
            else:
                self.x = np.clip(x, *self._box)
        value = A @ self.x
        locked = (low == high) | (np.abs(value - np.clip(value, low, high)) > 1e-9)
        self._C = np.vstack((self._C, A[~locked]))
        self._low, self._high = np.append(self._low, low[~locked]), np.append(self._high, high[~locked])
        if np.any(locked) and self.Z.shape[1]:
            _, S, Vt = np.linalg.svd(A[locked] @ self.Z)
            rank = int(np.sum(S > RANK_TOLERANCE))
            self._E = np.vstack((self._E, Vt[:rank] @ self.Z.T))
            self.Z = self.Z @ Vt[rank:].T

    def _minimise(self, A: Array, low: Array, high: Array, equality: bool, number: int) -> Array | None:
        """(n,) minimiser of one scaled level, None if PROXQP finds none."""
        n, rows = A.shape[1], 0 if equality else A.shape[0]
        box_low = np.append(self._box[0], np.full(rows, -np.inf))
        box_high = np.append(self._box[1], np.full(rows, np.inf))
        E, C = (np.hstack((M, np.zeros((M.shape[0], rows)))) for M in (self._E, self._C))
        e, C_low, C_high = self._E @ self.x, self._low, self._high
        if equality:
            H, g = A.T @ A, -A.T @ low
        else:
            H, g = np.zeros((n + rows, n + rows)), np.zeros(n + rows)
            H[n:, n:] = np.eye(rows)
            C = np.vstack((C, np.hstack((A, -np.eye(rows)))))
            C_low, C_high = np.concatenate((C_low, low)), np.concatenate((C_high, high))
        program = Program(H, g, E, e, C, C_low, C_high, box_low, box_high)
        best: Array | None = None
        for y, e_pull, z, turns, solved in _solve(program, number):
            self.turns += turns
            kept, off = np.append(z[C_low.size :][:n], z[: self._low.size]), z[self._low.size : C_low.size]
            sharp = self._polish(A, low, high, y[:n], kept, e_pull, low == high if equality else np.abs(off) > _PULL)
            if sharp is not None:
                return sharp
            if solved and self._inside(y[:n], 1e-7):
                best = y[:n]
        return best

    def _inside(self, x: Array, tolerance: float) -> bool:
        """Whether x meets the box and what the levels above ask."""
        lower, upper = self._box
        value, kept = self._C @ x, self._E @ (x - self.x)
        return bool(
            np.all((lower - tolerance <= x) & (x <= upper + tolerance))
            and np.all((self._low - tolerance <= value) & (value <= self._high + tolerance))
            and np.all(np.abs(kept) <= tolerance)
        )

    def _polish(
        self, A: Array, low: Array, high: Array, x: Array, z: Array, w: Array, off: NDArray[np.bool_]
    ) -> Array | None:
        """Solve the optimality conditions exactly for the limits that press at x; None if that is not the optimum.

        With d the step, r the residual of the rows that are off, M the rows of what presses (limits, then the levels
        above), λ their multipliers, which PROXQP gives as z and w and which are changed as little as possible:

            A d - r = t - A x,    M d = m - M x,    Aᵀ r + Mᵀ λ = 0,    λ >= 0 at upper limits, <= 0 at lower ones
        """
        n, value = x.shape[0], A @ x
        target = np.where(value - low < high - value, low, high)[off]  # an infinite bound is the farther one
        least, most = np.append(self._box[0], self._low), np.append(self._box[1], self._high)
        fixed = least == most
        press = np.flatnonzero((np.abs(z) > _PULL) | fixed)
        rows = np.vstack((np.eye(n), self._C))[press]
        side = np.where(z[press] > 0.0, 1.0, -1.0)
        M, m = np.vstack((rows, self._E)), np.append(np.where(side > 0.0, most[press], least[press]), self._E @ self.x)
        a, k = target.size, m.size
        kkt = np.zeros((a + k + n, n + a + k))
        kkt[:a, :n], kkt[:a, n : n + a], kkt[a : a + k, :n] = A[off], -np.eye(a), M
        kkt[a + k :, n : n + a], kkt[a + k :, n + a :] = A[off].T, M.T
        pull = np.append(z[press], w)
        right = np.concatenate((target - value[off], m - M @ x, -M.T @ pull))
        if not np.all(np.isfinite(right)):
            return None
        solution = np.linalg.lstsq(kkt, right, rcond=1e-13)[0]
        better, pull = x + solution[:n], side * (pull + solution[n + a :])[: side.size]
        met = A @ better
        optimal = (
            np.all(np.abs(kkt @ solution - right) <= 1e-12 * max(1.0, float(np.max(np.abs(right), initial=0.0))))
            and np.all((pull >= -1e-10) | fixed[press])
            and np.all(((low - 1e-11 <= met) & (met <= high + 1e-11)) | off)
            and self._inside(better, 1e-11)
        )
        return better if optimal else None


def _solve(program: Program, number: int) -> Iterator[tuple[Array, Array, Array, int, bool]]:
    """PROXQP's answers, each better than the last, with its iterations and whether it calls them solved.

    First roughly, from the kept workspace; then, if more is asked for, sharply; then cold.
    """
    bounded = Program(*program[:5], *(np.clip(b, -_INFINITE, _INFINITE) for b in program[5:]))
    shape = number, program.g.size, program.e.size, program.low.size
    kept = _kept.workspaces
    qp = kept.pop(shape, None)
    for warm in (True, False) if qp is not None else (False,):
        if warm:
            qp.update(*bounded)
        else:
            qp = proxqp.dense.QP(*shape[1:], True)
            s = qp.settings
            s.eps_rel, s.max_iter = 0.0, _TURNS
            s.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
            qp.init(*bounded)
        for eps in _ACCURACIES:
            qp.settings.eps_abs = eps
            qp.solve()
            y, status = np.array(qp.results.x), qp.results.info.status
            if not np.all(np.isfinite(y)):
                break
            solved = status == proxqp.QPSolverOutput.PROXQP_SOLVED
            if solved:
                kept[shape] = qp
            else:
                kept.pop(shape, None)
            yield y, np.array(qp.results.y), np.array(qp.results.z), int(qp.results.info.iter), solved
