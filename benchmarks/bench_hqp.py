"""Hierarchical solvers side by side on a generated family: time, wrong answers, bad status, repeatability.

"wrong": off by more than 1e-6 from the exact solution (integer arithmetic, `hqp_exact`), on the well-conditioned
problems. "worse": a level worse than the exact optimum by more than 1e-6, lexicographically, on all problems. "bad":
the solver itself says it failed, or returns no finite point. Times are of single calls, compilation and conversion of
the input excluded (the own solver's is included: it is the public call); "best" is of the fastest repeat of each
problem, which other processes on the machine disturb least.
"""

from __future__ import annotations

import argparse
import gc
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from hqp_exact import solve_exactly
from hqp_family import KINDS, Hierarchy, drift, family

from qpsafe.cli.outputs import try_file
from qpsafe.hqp.backends.cascade import solve_cascade
from qpsafe.hqp.backends.native_daqp import arrange, call_daqp
from qpsafe.hqp.backends.native_proxqp import solve_proxqp
from qpsafe.hqp.level import Level
from qpsafe.hqp.solve import solve_hierarchy
from qpsafe.text.json_text import json_text

Solver = Callable[[], np.ndarray | None]


class Case(NamedTuple):
    """A problem with its exact solution."""

    problem: Hierarchy
    levels: list[Level]
    pairs: list[Any]
    exact: np.ndarray
    well_conditioned: bool


def own(case: Case) -> Solver:
    """The public call with a list of levels."""
    p = case.problem

    def call() -> np.ndarray | None:
        solution = solve_hierarchy(case.pairs, p.lower, p.upper, rows=p.rows)
        return solution.qd if solution.status == "solved" else None

    return call


def stacked(case: Case) -> list[Level]:
    """Hard rows first."""
    return [Level(*case.problem.rows), *case.levels] if case.problem.rows else case.levels


def cascade(name: str) -> Callable[[Case], Solver]:
    """One program of qpsolvers a level."""

    def prepare(case: Case) -> Solver:
        levels, p = stacked(case), case.problem
        start = np.clip(np.zeros_like(p.lower), p.lower, p.upper)

        def call() -> np.ndarray | None:
            qd, _, failures = solve_cascade(name, levels, start, p.lower, p.upper)
            return None if failures else qd

        return call

    return prepare


def native(case: Case) -> Solver:
    """DAQP's hierarchical mode."""
    p = case.problem
    arranged = arrange(stacked(case), p.lower, p.upper, p.rows is not None)
    return lambda: call_daqp(arranged, p.lower, p.upper)[0]


def proxqp(case: Case) -> Solver:
    """PROXQP level by level in kept workspaces, warm started."""
    levels, p = stacked(case), case.problem

    def call() -> np.ndarray | None:
        qd, _, failures = solve_proxqp(levels, p.lower, p.upper)
        return None if failures else qd

    return call


def weighted(case: Case) -> Solver:
    """One program, every level 1000 times the weight of the next: 1e6 : 1e3 : 1 for three."""
    import daqp

    p, n = case.problem, case.problem.lower.size
    weights = [10.0 ** (3 * (len(case.levels) - 1 - k)) for k in range(len(case.levels))]
    soft = [i for i, level in enumerate(case.levels) if not level.is_equality]
    slack = sum(case.levels[i].rows for i in soft)
    H, f = np.zeros((n + slack, n + slack)), np.zeros(n + slack)
    rows, low, high = [np.zeros((0, n + slack))], [p.lower, np.full(slack, -1e30)], [p.upper, np.full(slack, 1e30)]
    if p.rows:
        rows.append(np.hstack((p.rows[0], np.zeros((len(p.rows[1]), slack)))))
        low.append(p.rows[1])
        high.append(p.rows[2])
    at = n
    for weight, level in zip(weights, case.levels, strict=True):
        if level.is_equality:
            H[:n, :n] += weight * level.A.T @ level.A
            f[:n] -= weight * level.A.T @ level.lower
        else:
            block = np.zeros((level.rows, n + slack))
            block[:, :n], block[:, at : at + level.rows] = level.A, np.eye(level.rows)
            H[at : at + level.rows, at : at + level.rows] = weight * np.eye(level.rows)
            rows.append(block)
            low.append(level.lower)
            high.append(level.upper)
            at += level.rows
    A, lower, upper = np.vstack(rows), np.concatenate(low), np.concatenate(high)
    sense = np.zeros(lower.size, dtype=np.int32)

    def call() -> np.ndarray | None:
        x, _, flag, _ = daqp.solve(H, f, A, upper, lower, sense)
        return x[:n] if flag > 0 else None

    return call


SOLVERS: dict[str, Callable[[Case], Solver]] = {
    "own": own,
    "DAQP, its hierarchical mode": native,
    "PROXQP, kept workspaces": proxqp,
    "DAQP cascade (qpsolvers)": cascade("daqp"),
    "PROXQP cascade (qpsolvers)": cascade("proxqp"),
    "one weighted QP (DAQP)": weighted,
}
SLOW = {"PROXQP, kept workspaces", "DAQP cascade (qpsolvers)", "PROXQP cascade (qpsolvers)"}


def prepare(problem: Hierarchy) -> Case:
    """Solve exactly and judge the conditioning."""
    levels = [Level(*level) for level in problem.levels]
    equal = all(level.is_equality for level in levels)
    pairs: list[Any] = [(level.A, level.lower) for level in levels] if equal else levels
    guess = solve_hierarchy(pairs, problem.lower, problem.upper, rows=problem.rows).qd
    triples = ([problem.rows] if problem.rows else []) + problem.levels
    exact = solve_exactly(triples, problem.lower, problem.upper, guess)
    return Case(problem, levels, pairs, exact, conditioning(problem, exact) > 1e-3)


def conditioning(problem: Hierarchy, x: np.ndarray) -> float:
    """Smallest relative singular value, zeros not counted, of a level in what levels above and active limits leave.

    What is active at x or fixed by a level above leaves the freedom; a level is judged with and without the limits.
    """
    free = (x > problem.lower + 1e-9) & (x < problem.upper - 1e-9)
    worst = 1.0
    for Z in (np.eye(x.size), np.eye(x.size)[:, free]):
        for A, _, _ in problem.levels[:-1]:
            if Z.shape[1] == 0:
                break
            _, S, Vt = np.linalg.svd(A @ Z)
            relative = S / np.linalg.norm(A, 2)
            rank = int(np.sum(relative > 1e-12))
            worst = min([worst, *relative[:rank]])
            Z = Z @ Vt[rank:].T
    return worst


def is_worse(case: Case, x: np.ndarray) -> bool:
    """Whether a level is worse than the exact optimum, lexicographically, or a hard limit is passed by 1e-6."""
    p = case.problem
    if np.any(x < p.lower - 1e-6) or np.any(x > p.upper + 1e-6):
        return True
    for level in stacked(case):
        here, best = (float(np.linalg.norm(level.violations(y))) for y in (x, case.exact))
        if abs(here - best) > 1e-6:
            return here > best
    return False


def run(name: str, cases: list[Case], repeats: int) -> dict[str, Any]:
    """One solver on all cases."""
    calls = [SOLVERS[name](case) for case in cases]
    for call in calls[:50]:
        call()
    times = np.empty((repeats, len(calls)))
    first: list[np.ndarray | None] = []
    different = 0
    gc.collect()
    gc.disable()
    for k in range(repeats):
        for i, call in enumerate(calls):
            start = time.perf_counter_ns()
            x = call()
            times[k, i] = 1e-3 * (time.perf_counter_ns() - start)
            if k == 0:
                first.append(None if x is None else x.copy())
            elif k == 1:
                y = first[i]
                different += (x is None) != (y is None) or (x is not None and y is not None and bool(np.any(x != y)))
    gc.enable()
    answers = [(c, x) for c, x in zip(cases, first, strict=True) if x is not None and np.all(np.isfinite(x))]
    errors = [float(np.abs(x - c.exact).max()) for c, x in answers if c.well_conditioned]
    median, p99, p999, largest = np.percentile(times, (50, 99, 99.9, 100))
    return {
        "solver": name,
        "median_us": float(median),
        "p99_us": float(p99),
        "p999_us": float(p999),
        "max_us": float(largest),
        "best_p99_us": float(np.percentile(times.min(axis=0), 99)),
        "best_max_us": float(times.min(axis=0).max()),
        "wrong": int(sum(error > 1e-6 for error in errors)),
        "largest_error": max(errors, default=0.0),
        "worse": int(sum(is_worse(c, x) for c, x in answers)),
        "bad_status": len(cases) - len(answers),
        "not_repeated": int(different),
    }


def bench(
    count: int = 900, ticks: int = 1000, repeats: int = 5, seed: int = 0, solvers: tuple[str, ...] = tuple(SOLVERS)
) -> dict[str, Any]:
    """Run the solvers on `count` random problems and on a drifting sequence of `ticks`."""
    random = [prepare(problem) for problem in family(count, seed)]
    sequence = [prepare(problem) for problem in drift(ticks, seed)]
    return {
        "problems": count,
        "well_conditioned": int(sum(case.well_conditioned for case in random)),
        "kinds": list(KINDS),
        "ticks": ticks,
        "repeats": repeats,
        "random": [run(name, random, 2 if name in SLOW else repeats) for name in solvers],
        "drift": [run(name, sequence, 2 if name in SLOW else repeats) for name in solvers],
    }


COLUMNS = (
    ("median", "median_us", "9.1f"),
    ("p99", "p99_us", "9.1f"),
    ("p99.9", "p999_us", "9.1f"),
    ("max", "max_us", "9.1f"),
    ("best p99", "best_p99_us", "10.1f"),
    ("best max", "best_max_us", "10.1f"),
    ("wrong", "wrong", "8d"),
    ("worse", "worse", "8d"),
    ("bad", "bad_status", "6d"),
    ("not repeated", "not_repeated", "14d"),
    ("largest error", "largest_error", "15.1e"),
)


def report(title: str, rows: list[dict[str, Any]]) -> None:
    """Print one table."""
    print(f"\n{title}")
    print(" " * 28 + "".join(f"{head:>{width.split('.')[0].rstrip('d')}}" for head, _, width in COLUMNS))
    for row in rows:
        print(f"{row['solver']:28}" + "".join(f"{row[key]:{width}}" for _, key, width in COLUMNS))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=900, help="random problems (20000 for the full family)")
    parser.add_argument("--ticks", type=int, default=1000, help="ticks of the drifting sequence")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--only", choices=SOLVERS, nargs="+", default=list(SOLVERS), metavar="SOLVER", help="of: %(choices)s"
    )
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    if arguments.out:
        try_file("bench_hqp", "--out", arguments.out)
    from qpsafe.bench.clock import machine

    a = arguments
    result = {"machine": machine(), **bench(a.count, a.ticks, a.repeats, a.seed, tuple(a.only))}
    print(", ".join(f"{key} {value}" for key, value in result["machine"].items()))
    report(
        f"{result['problems']} random problems, {result['well_conditioned']} well-conditioned [µs]", result["random"]
    )
    report(f"drifting sequence with active limits, {result['ticks']} ticks [µs]", result["drift"])
    if arguments.out:
        arguments.out.write_text(json_text(result) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
