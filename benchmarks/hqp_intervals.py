"""Interval rows judged exactly: generated small hierarchies against integer arithmetic, and against one another.

Every problem mixes equalities, intervals, one-sided and unbounded rows, weights, several levels, hard rows, rows that
are doubled, dependent or zero, bounds that a vertex of the box meets exactly, and fixed joints. The judge is
`hqp_exact`; the data are multiples of 2^-3, 2^-10 or 2^-20, so that nothing is rounded on the way in.

    python benchmarks/hqp_intervals.py --count 200000        # about 15 minutes on one core
    python benchmarks/hqp_intervals.py --count 2000 --solver daqp --solver proxqp
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from hqp_exact import solve_exactly
from hqp_family import Array, grid

from qpsafe.hqp.level import Level
from qpsafe.hqp.solution import Solution
from qpsafe.hqp.solve import solve_hierarchy
from qpsafe.text.json_text import json_text

WRONG = 1e-7  # relative to the numbers of the problem: an answer farther from the exact one than this is wrong


class Intervals(NamedTuple):
    """One problem: box, levels with the hard rows first, and whether the first level are hard rows."""

    lower: Array
    upper: Array
    levels: list[Level]
    hard: bool


def one(rng: np.random.Generator, largest: int = 4) -> Intervals:
    """A random problem of 1 to `largest` joints."""
    n = int(rng.integers(1, largest + 1))
    bits = int(rng.choice([3, 3, 10, 20]))
    lower, upper = grid(-rng.uniform(0.125, 1.5, n), bits), grid(rng.uniform(0.125, 1.5, n), bits)
    kind = rng.random(n)
    lower = np.where(kind < 0.1, -np.inf, lower)
    upper = np.where((kind > 0.05) & (kind < 0.15), np.inf, upper)
    if rng.random() < 0.1:
        upper[0] = lower[0] = grid(rng.uniform(-1.0, 1.0), bits)
    # a vertex of the box, which degenerate rows pass through
    vertex = np.where(rng.random(n) < 0.5, lower, upper)
    vertex = np.where(np.isfinite(vertex), vertex, 0.0)
    levels: list[Level] = []
    for _ in range(int(rng.integers(1, 4))):
        rows = int(rng.integers(1, 6))
        A = grid(rng.standard_normal((rows, n)), bits)
        for i in range(rows):  # doubled, opposite, dependent, zero rows, and rows of levels above
            above = np.vstack([level.A for level in levels] + [A[:i]])
            chance = rng.random()
            if chance < 0.15 and above.size:
                A[i] = rng.choice([-1.0, 1.0, 2.0]) * above[rng.integers(len(above))]
            elif chance < 0.2 and len(above) > 1:
                A[i] = above[-1] - above[-2]
            elif chance < 0.22:
                A[i] = 0.0
            elif chance < 0.3:
                A[i] = (np.arange(n) == rng.integers(n)).astype(float)
        centre = np.where(
            rng.random(rows) < 0.3, A @ vertex, grid(rng.choice([0.5, 2.0]) * rng.standard_normal(rows), bits)
        )
        width = grid(rng.choice([2.0**-bits, 0.0625, 0.5], rows) * rng.integers(0, 4, rows), bits)
        side = rng.random(rows)
        low, high = (
            np.where(side < 0.15, -np.inf, centre),
            np.where((side > 0.13) & (side < 0.3), np.inf, centre + width),
        )
        weight = None if rng.random() < 0.5 else 2.0 ** rng.integers(-3, 4, rows)
        levels.append(Level(A, low, high, weight))
    hard = levels[0].weight is None and rng.random() < 0.25
    return Intervals(lower, upper, levels, hard)


def solve(problem: Intervals, solver: str | None = None) -> Solution:
    """The public call."""
    top = problem.levels[0]
    rows = (top.A, top.lower, top.upper) if problem.hard else None
    return solve_hierarchy(problem.levels[problem.hard :], problem.lower, problem.upper, solver, rows=rows)


def exact(problem: Intervals, guess: Array) -> Array:
    """The exact solution, rounded once."""
    levels = [(p.A, p.lower, p.upper, p.weight) for p in problem.levels]
    return solve_exactly(levels, problem.lower, problem.upper, guess)


def verdict(problem: Intervals, solution: Solution, truth: Array) -> str:
    """ "right", "wrong", or the status where the solver itself reports something else than it should."""
    top = problem.levels[0]
    slack = 1e-8 * np.abs(top.A) @ (1.0 + np.abs(truth))
    met = not problem.hard or bool(np.all(np.abs(top.violations(truth)) <= slack))
    status = "solved" if met else "rows infeasible"
    if solution.status != status:
        return solution.status
    size = max(1.0, float(np.abs(truth).max()))
    return "right" if float(np.abs(solution.qd - truth).max()) <= WRONG * size else "wrong"


def family(count: int, seed: int = 0) -> Iterator[Intervals]:
    """`count` problems."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield one(rng)


def judge(count: int, seed: int = 0, solvers: tuple[str, ...] = ("own",)) -> dict[str, Counter[str]]:
    """Verdicts over `count` problems, for each solver; answers that the own solver gave instead are "handed over"."""
    found: dict[str, Counter[str]] = {name: Counter() for name in solvers}
    for problem in family(count, seed):
        truth = exact(problem, solve(problem).qd)
        for name in solvers:
            solution = solve(problem, name)
            word = verdict(problem, solution, truth)
            found[name][word if solution.solver == name or word != "right" else "handed over"] += 1
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--solver", action="append", help="own, daqp, proxqp, qpsolvers:...; may be repeated")
    parser.add_argument("--json", action="store_true", help="write the verdicts as JSON to standard output")
    a = parser.parse_args()
    found: dict[str, Any] = judge(a.count, a.seed, tuple(a.solver or ("own",)))
    if a.json:
        print(json_text({"problems": a.count, "seed": a.seed, "verdicts": found}))
        return
    for name, verdicts in found.items():
        print(f"{name:20}" + ", ".join(f"{number} {word}" for word, number in sorted(verdicts.items())))


if __name__ == "__main__":
    main()
