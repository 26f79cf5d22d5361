"""Exact lexicographic least squares in integer arithmetic: the judge of the solvers, slow and certain.

Every float is a fraction, and so is the solution. The method is a primal active-set method with Bland's rule, which
ends for certain; what it ends with is the optimum because its conditions hold exactly: feasible, multipliers of the
right sign, gradient zero on the freedom left. An approximate solution serves as a first guess of the active set and
saves most turns.
"""

from __future__ import annotations

from fractions import Fraction
from math import gcd, inf, lcm

import numpy as np

Row = list[int]
TURNS = 1000  # of the active-set method; far more than it needs


def eliminate(rows: list[Row], columns: int) -> tuple[list[Row], list[int]]:
    """Reduced row echelon form over the first columns, rows scaled to integers; and its pivot columns."""
    rows = [row for row in rows if any(row)]
    pivots: list[int] = []
    for column in range(columns):
        rank = len(pivots)
        found = next((i for i in range(rank, len(rows)) if rows[i][column]), None)
        if found is None:
            continue
        rows[rank], rows[found] = rows[found], rows[rank]
        pivot = rows[rank]
        p = pivot[column]
        for i, row in enumerate(rows):
            if i != rank and row[column]:
                q = row[column]
                row = [p * a - q * b for a, b in zip(row, pivot, strict=True)]
                common = gcd(*row)
                rows[i] = [a // common for a in row] if common > 1 else row
        pivots.append(column)
    return rows[: len(pivots)], pivots


def null_space(rows: list[Row], n: int) -> list[Row]:
    """Integer basis of {p : rows p = 0}."""
    reduced, pivots = eliminate(rows, n)
    basis = []
    for free in (j for j in range(n) if j not in pivots):
        scale = lcm(*(abs(row[c]) for row, c in zip(reduced, pivots, strict=True)))
        vector = [0] * n
        vector[free] = scale
        for row, column in zip(reduced, pivots, strict=True):
            vector[column] = -row[free] * scale // row[column]
        basis.append(vector)
    return basis


def solve_consistent(rows: list[list[Fraction]], n: int) -> list[Fraction]:
    """One solution z of rows[:, :n] z = rows[:, n], free unknowns 0."""
    whole = []
    for row in rows:
        scale = lcm(*(a.denominator for a in row))
        whole.append([int(a * scale) for a in row])
    reduced, pivots = eliminate(whole, n)
    z = [Fraction(0)] * n
    for row, column in zip(reduced, pivots, strict=True):
        z[column] = Fraction(row[n], row[column])
    return z


def dot(a, b) -> Fraction:
    """Exact product of two vectors."""
    return sum((Fraction(x) * y for x, y in zip(a, b, strict=True) if x and y), Fraction(0))


def integers(row) -> Row:
    """The row times a power of two that makes it whole."""
    fractions = [Fraction(float(a)) for a in row]
    scale = lcm(*(a.denominator for a in fractions))
    return [int(a * scale) for a in fractions]


class Exact:
    """State of one exact solve: the point x, directions fixed by levels, constraints, and which of them are held."""

    def __init__(self, lower, upper, guess) -> None:
        """Start at the guess, clipped to the box, with the bounds it touches held."""
        n = len(lower)
        self.n = n
        self.normals: list[Row] = [[int(i == j) for j in range(n)] for i in range(n)]
        self.scales = [Fraction(1)] * n  # normal = scale * given row
        self.low = [-inf if a == -inf else Fraction(float(a)) for a in lower]
        self.high = [inf if a == inf else Fraction(float(a)) for a in upper]
        self.fixed: list[Row] = []
        self.held: dict[int, int] = {}  # constraint -> side
        self.x = []
        for i in range(n):
            x = Fraction(round(float(guess[i]) * 2**24), 2**24)
            self.x.append(min(max(x, self.low[i]), self.high[i]))
            if self.low[i] == self.high[i]:
                self.fixed.append(self.normals[i])
            elif abs(guess[i] - float(self.low[i])) < 1e-9:
                self.x[i], self.held[i] = self.low[i], -1
            elif abs(guess[i] - float(self.high[i])) < 1e-9:
                self.x[i], self.held[i] = self.high[i], 1

    def value(self, c: int) -> Fraction:
        """The bounded quantity of constraint c."""
        return dot(self.normals[c], self.x) / self.scales[c]

    def minimise(self, A, low, high, weight=None) -> None:
        """One level `low <= A x <= high`, least squares of the violations; then it is fixed for the levels below."""
        n, rows = self.n, [[Fraction(float(a)) for a in row] for row in A]
        weight = [Fraction(1)] * len(rows) if weight is None else [Fraction(float(a)) for a in weight]
        low = [-inf if a == -inf else Fraction(float(a)) for a in low]
        high = [inf if a == inf else Fraction(float(a)) for a in high]
        side = {}  # rows that count: 0 equality, -1 below, +1 above
        for i, row in enumerate(rows):
            value = dot(row, self.x)
            if low[i] == high[i]:
                side[i] = 0
            elif value > high[i] or value < low[i]:
                side[i] = 1 if value > high[i] else -1
        for _ in range(TURNS):
            basis = null_space(self.fixed + [self.normals[c] for c in self.held], n)
            target = {i: low[i] if s < 0 else high[i] for i, s in side.items()}
            residual = {i: target[i] - dot(rows[i], self.x) for i in side}
            images = {i: [dot(rows[i], b) for b in basis] for i in side}
            k = len(basis)
            normal = [
                [sum((weight[i] * images[i][a] * images[i][b] for i in side), Fraction(0)) for b in range(k)]
                + [sum((weight[i] * images[i][a] * residual[i] for i in side), Fraction(0))]
                for a in range(k)
            ]
            y = solve_consistent(normal, k) if k else []
            p = [sum((Fraction(b[j]) * c for b, c in zip(basis, y, strict=True)), Fraction(0)) for j in range(n)]
            # ratio test, smallest index on ties
            alpha, met = Fraction(1), None
            for c in range(len(self.normals)):
                if c in self.held:
                    continue
                rate = dot(self.normals[c], p) / self.scales[c]
                bound = self.high[c] if rate > 0 else self.low[c]
                if rate and abs(bound) != inf and (t := (bound - self.value(c)) / rate) < alpha:
                    alpha, met = t, ("hold", c, 1 if rate > 0 else -1)
            for i, row in enumerate(rows):
                if i not in side:
                    rate = dot(row, p)
                    bound = high[i] if rate > 0 else low[i]
                    if rate and abs(bound) != inf and (t := (bound - dot(row, self.x)) / rate) < alpha:
                        alpha, met = t, ("count", i, 1 if rate > 0 else -1)
            self.x = [a + alpha * b for a, b in zip(self.x, p, strict=True)]
            if met is not None:
                (self.held if met[0] == "hold" else side)[met[1]] = met[2]
                continue
            residual = {i: target[i] - dot(rows[i], self.x) for i in side}
            gradient = [-sum((weight[i] * rows[i][j] * residual[i] for i in side), Fraction(0)) for j in range(n)]
            across = self.fixed + [self.normals[c] for c in self.held]
            system = [[Fraction(row[j]) for row in across] + [gradient[j]] for j in range(n)]
            multiplier = solve_consistent(system, len(across))[len(self.fixed) :]
            pushing = [c for (c, s), m in zip(self.held.items(), multiplier, strict=True) if m * s > 0]
            if pushing:
                wrong = min(pushing)  # Bland
                del self.held[wrong]
                continue
            leaving = [i for i, s in side.items() if residual[i] * s > 0]
            if leaving:  # met now, or crossed whole: then it counts at its other bound
                i = min(leaving)
                value = dot(rows[i], self.x)
                if low[i] <= value <= high[i]:
                    del side[i]
                else:
                    side[i] = -side[i]
                continue
            break
        else:
            raise RuntimeError("the exact solver does not end")
        for i, row in enumerate(rows):
            whole = integers(A[i])
            if low[i] == high[i] or (i in side and residual[i]):
                if any(whole):
                    self.fixed.append(whole)
            elif any(whole):
                self.normals.append(whole)
                j = next(j for j in range(n) if whole[j])
                self.scales.append(Fraction(whole[j]) / row[j])
                self.low.append(low[i])
                self.high.append(high[i])
        # drop what is held but has become dependent on the fixed directions: it cannot move any more
        kept: dict[int, int] = {}
        for c, s in self.held.items():
            before = self.fixed + [self.normals[k] for k in kept]
            if len(eliminate([*before, self.normals[c]], n)[1]) > len(eliminate(before, n)[1]):
                kept[c] = s
        self.held = kept


def solve_exactly(levels, lower, upper, guess) -> np.ndarray:
    """The exact solution, rounded to float64 once at the end.

    Args:
        levels: `(A, low, high)` or `(A, low, high, weight)`, highest priority first; hard rows go first.
        lower: (n,) box.
        upper: (n,) box.
        guess: (n,) approximate solution; decides how long it takes, not what comes out.
    """
    state = Exact(lower, upper, guess)
    n = len(lower)
    for level in levels:
        state.minimise(*level)
    state.minimise(np.eye(n), np.zeros(n), np.zeros(n))
    return np.array([float(a) for a in state.x])
