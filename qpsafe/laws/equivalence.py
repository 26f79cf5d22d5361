"""How far a law is from the paper's, eqs. (18) and (22), over random states: the first half of `qpsafe compare`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.laws.nullspace import nullspace_velocity
from qpsafe.laws.problem import Law, LawProblem, TaskVelocity

_Matrix = NDArray[np.float64]


class State(NamedTuple):
    """One random state: the kind it was drawn from, the tasks, q̇0, and the switches m and f."""

    kind: str
    J_H: _Matrix
    J_L: _Matrix
    xd_H: _Matrix
    xd_L: _Matrix
    qd0: _Matrix
    m: float
    f: float

    def problem(self, bound: float | None = None) -> LawProblem:
        """The state as a law's problem, without limits or with -bound <= q̇ <= bound."""
        limit = None if bound is None else np.full(len(self.qd0), bound)
        tasks = (TaskVelocity(self.J_H, self.xd_H), TaskVelocity(self.J_L, self.xd_L))
        lower = None if limit is None else -limit
        return LawProblem(tasks, self.qd0, (self.m, self.m * self.f), lower, limit)

    def paper_velocity(self) -> _Matrix:
        """q̇ of eq. (22), by pseudoinverses."""
        return nullspace_velocity(self.J_H, self.J_L, self.xd_H, self.xd_L, self.qd0, self.m, self.f)


def _independent(rng: np.random.Generator, n: int) -> tuple[_Matrix, _Matrix]:
    return rng.normal(size=(3, n)), rng.normal(size=(3, n))


def _deficient_high(rng: np.random.Generator, n: int) -> tuple[_Matrix, _Matrix]:
    rank = rng.integers(0, 3)
    return rng.normal(size=(3, rank)) @ rng.normal(size=(rank, n)), rng.normal(size=(3, n))


def _deficient_low(rng: np.random.Generator, n: int) -> tuple[_Matrix, _Matrix]:
    J_H, J_L = _deficient_high(rng, n)
    return J_L, J_H


def _overlapping(rng: np.random.Generator, n: int) -> tuple[_Matrix, _Matrix]:
    """Rows of the low-priority task that the high-priority one already decides: conflicting tasks."""
    J_H, J_L = _independent(rng, n)
    shared = rng.integers(1, 4)
    J_L[:shared] = rng.normal(size=(shared, 3)) @ J_H
    return J_H, J_L


def _few_rows(rng: np.random.Generator, n: int) -> tuple[_Matrix, _Matrix]:
    return rng.normal(size=(rng.integers(1, 4), n)), rng.normal(size=(rng.integers(0, 4), n))


_RANDOM: dict[str, Callable[[np.random.Generator, int], tuple[_Matrix, _Matrix]]] = {
    "independent": _independent,
    "J_H rank-deficient": _deficient_high,
    "J_L rank-deficient": _deficient_low,
    "overlapping tasks": _overlapping,
    "fewer rows": _few_rows,
}
#: Joints (from 0) that are set to zero: the two singular families of a spherical wrist on an elbow arm.
_SINGULAR = {"irb140": None, "irb140, wrist singular": 4, "irb140, arm stretched": 2}


def _robot_jacobians(rng: np.random.Generator) -> Iterator[tuple[str, _Matrix, _Matrix]]:
    from qpsafe.robot.loader import load_robot

    robot = load_robot("irb140")
    while True:
        for kind, joint in _SINGULAR.items():
            J = np.zeros((6, robot.nq))
            while not J.any() or any(_nearly_singular(part) for part in (J[:3], J[3:], J)):
                q = rng.uniform(robot.lower, robot.upper)
                if joint == 4:
                    q[4] = 0.0  # axes 4 and 6 in line
                elif joint == 2:
                    q[2] = -np.pi / 2.0  # forearm in line with the upper arm
                J = robot.jacobian("tcp", q)
            yield kind, J[:3], J[3:]


def _nearly_singular(J: _Matrix) -> bool:
    """Whether J is neither singular nor far from it: it asks for thousands of rad/s, and any method loses digits."""
    S = np.linalg.svd(J, compute_uv=False) / np.linalg.norm(J)
    return bool(((S > 1e-10) & (S < 1e-3)).any())


def random_states(count: int, seed: int = 0) -> Iterator[State]:
    """Draw states in turn from every kind: n = 6, 7 and 9, singular and rank-deficient tasks, m and f in [0, 1].

    Switches stand at each end for about a third of the states. IRB 140 states have n = 6; poses that are nearly
    singular without being so are drawn again, since there rounding errors of any method, (22) included, outgrow the
    tolerance.

    Args:
        count: Number of states.
        seed: Of the generator; equal seeds give equal states.
    """
    rng = np.random.default_rng(seed)
    robot_states = _robot_jacobians(rng)
    kinds = [(name, n) for name in _RANDOM for n in (6, 7, 9)]
    for i in range(count):
        place = i % (len(kinds) + 3)
        if place < len(kinds):
            name, n = kinds[place]
            kind, (J_H, J_L) = f"{name}, n = {n}", _RANDOM[name](rng, n)
        else:
            kind, J_H, J_L = next(robot_states)
        n = J_H.shape[1]
        m, f = (float(rng.choice((0.0, 1.0, rng.uniform()))) for _ in range(2))
        xd_H, xd_L, qd0 = (rng.normal(size=size) for size in (len(J_H), len(J_L), n))
        yield State(kind, J_H, J_L, xd_H, xd_L, qd0, m=m, f=f)


@dataclass(frozen=True)
class Deviation:
    """Deviations of a law from eq. (22) over states of one kind.

    Attributes:
        kind: Of the states.
        values: Max-norms of the difference in q̇, one per state [rad/s].
        speeds: Max-norms of q̇ itself, to compare with [rad/s].
    """

    kind: str
    values: _Matrix
    speeds: _Matrix

    @property
    def worst(self) -> float:
        """Largest deviation [rad/s]."""
        return float(self.values.max())

    @property
    def median(self) -> float:
        """Median deviation [rad/s]."""
        return float(np.median(self.values))


def compare_states(
    law: Law,
    count: int = 10_000,
    seed: int = 0,
    with_limits: bool = False,
    progress: Callable[[int], None] | None = None,
) -> list[Deviation]:
    """Measure how far a law is from eq. (22) over random states.

    Args:
        law: The law to compare.
        count: Number of states.
        seed: Of the states.
        with_limits: Give the law limits that never bind (1 rad/s beyond the largest speed any regime asks for).
        progress: Called with the number of states done.

    Returns:
        One entry per kind of state, in order of appearance.
    """
    found: dict[str, list[tuple[float, float]]] = {}
    for i, state in enumerate(random_states(count, seed)):
        bound = None
        if with_limits:
            corners = [state._replace(m=m, f=f).paper_velocity() for m, f in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))]
            bound = 1.0 + max(float(np.abs(qd).max()) for qd in corners)
        paper = state.paper_velocity()
        difference = law.solve(state.problem(bound)).qd - paper
        norms = float(np.abs(difference).max()), float(np.abs(paper).max())
        found.setdefault(state.kind, []).append(norms)
        if progress is not None:
            progress(i + 1)
    return [Deviation(kind, *np.array(norms).T) for kind, norms in found.items()]
