"""When tasks are released: the smooth activations m and f, eqs. (19) and (21), and the regimes of Table I.

Every task has one threshold. With the danger rising, the task of lowest priority is released first. For two tasks the
paper's parameters are a_1 = m and a_2 = m f, and the regimes are its low, medium and high danger. Neighbouring tasks
with equal thresholds are released together, by one switch: the positions of two tools at m, their orientations at m f.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import inline
from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.text.given import number, parts
from qpsafe.text.words import call, counted

#: Between these Δ and ε Δ can be computed with.
LEAST, MOST = 1e-100, 1e100


def switch(danger: float, start: float, end: float, delta: float, epsilon: float) -> float:
    """A smooth switch; anything that is not a number counts as full danger and gives 0.

    Args:
        danger: CDF_n.
        start, end: Δ(1-ε) and Δ(1+ε).
        delta, epsilon: Δ and ε.
    """
    if danger <= start:
        return 1.0
    if danger < end:
        # (19), (21)
        return 0.5 - 0.5 * math.sin(math.pi * (danger - delta) / (2.0 * epsilon * delta))
    return 0.0


switch_compiled = inline(switch)


def multiply(switches: Any, counts: Any, activations: Any) -> Any:
    """Fill in and return the activations: products of the first switches, (m, m f, ...).

    Args:
        switches: One a level of danger; a list or an array.
        counts: How many tasks each of them switches.
        activations: One a task.
    """
    product, task = 1.0, 0
    for k, count in enumerate(counts):
        product *= switches[k]
        for _ in range(count):
            activations[task] = product
            task += 1
    return activations


multiply_compiled = inline(multiply)


@dataclass(frozen=True)
class Threshold:
    """One smooth switch, eq. (19) or (21): 1 below Δ(1-ε), 0 above Δ(1+ε), a half sine wave between.

    Attributes:
        delta: Δ, the danger at which the switch stands at 1/2 (same unit as the field, 1/m for a robot at rest).
        epsilon: ε in (0, 1), half the width of the transition relative to Δ.
    """

    delta: float
    epsilon: float

    def __post_init__(self) -> None:
        expected = f"a number > 0, from {LEAST:g} to {MOST:g}"
        delta = number("Threshold", "delta", self.delta, expected, LEAST, most=MOST)
        expected = "a number strictly between 0 and 1"
        epsilon = number("Threshold", "epsilon", self.epsilon, expected, LEAST)
        if not epsilon < 1.0:
            raise ConfigurationError("Threshold", "epsilon", self.epsilon, expected)
        object.__setattr__(self, "delta", delta)
        object.__setattr__(self, "epsilon", epsilon)

    @cached_property
    def start(self) -> float:
        """Δ(1-ε): the release begins above it."""
        return self.delta * (1.0 - self.epsilon)

    @cached_property
    def end(self) -> float:
        """Δ(1+ε): the release is complete from here on."""
        return self.delta * (1.0 + self.epsilon)

    def __call__(self, danger: float) -> float:
        """Evaluate the switch; anything that is not a number counts as full danger and gives 0."""
        return switch(danger, self.start, self.end, self.delta, self.epsilon)


#: Names of the regimes by the number of tasks that are kept, for one and for two tasks (Table I).
REGIME_NAMES = {1: ("high", "low"), 2: ("high", "medium", "low")}


class Switching(NamedTuple):
    """What a danger switches.

    Attributes:
        switches: m, f, ...
        activations: a_1..a_N.
        regime: Name of the danger level.
    """

    switches: tuple[float, ...]
    activations: tuple[float, ...]
    regime: str


class Activation(Fixed):
    """Activations 1 >= a_1 >= ... >= a_N >= 0 of N tasks, highest priority first, from the danger CDF_n.

    Args:
        thresholds: One per task, highest priority first; equal neighbours share a switch. Defaults to the paper's
            values for two tasks: Δ = 11.5, ε = 0.15 for the high-priority task (m) and Δ_f = 7.5, ε_f = 0.25 for the
            low one (f).

    Raises:
        ConfigurationError: A task would begin its release before one of lower priority is released completely,
            Δ_f (1+ε_f) > Δ (1-ε): Table I's impossible situation m = 0, f = 1 must not come near.
    """

    fixed = frozenset(("thresholds", "levels", "counts"))

    def __init__(self, thresholds: tuple[Threshold, ...] = (Threshold(11.5, 0.15), Threshold(7.5, 0.25))) -> None:
        self.thresholds = parts("Activation", "thresholds", thresholds, "at least one Threshold")
        if not self.thresholds:
            raise ConfigurationError("Activation", "thresholds", thresholds, "at least one Threshold")
        for k, threshold in enumerate(self.thresholds):
            if not isinstance(threshold, Threshold):
                raise ConfigurationError("Activation", f"thresholds[{k}]", threshold, "a Threshold(delta, epsilon)")
        # the different ones, and the number of tasks that each one switches
        self.levels = tuple(threshold for threshold, _ in groupby(self.thresholds))
        self.counts = tuple(len(tuple(group)) for _, group in groupby(self.thresholds))
        n = len(self.levels)
        self._names = REGIME_NAMES.get(n, ("high", *(f"medium-{kept}" for kept in range(1, n)), "low"))
        self._plain = all(type(threshold) is Threshold for threshold in self.levels)
        self._numbers = [(level, (level.start, level.end, level.delta, level.epsilon)) for level in self.levels]
        self._calm = Switching((1.0,) * n, (1.0,) * len(self.thresholds), self._names[-1])
        self._released = Switching((0.0,) * n, (0.0,) * len(self.thresholds), self._names[0])
        self._least, self._most = self.levels[-1].start, self.levels[0].end if self._plain else math.inf
        for k in range(len(self.thresholds) - 1):
            upper, lower = self.thresholds[k], self.thresholds[k + 1]
            if lower != upper and lower.end > upper.start:
                raise ConfigurationError(
                    "Activation",
                    f"thresholds[{k + 1}]",
                    lower,
                    f"Δ(1+ε) <= {upper.start:g}, where the release of the task above it begins (found {lower.end:g})",
                )

    def __repr__(self) -> str:
        return call(self, self.thresholds)

    @property
    def suspend_above(self) -> float:
        """Δ(1-ε) of the task of highest priority: beyond it the path is suspended (section IV-C)."""
        return self.thresholds[0].start

    def scaled(self, *factors: float) -> Activation:
        """Other thresholds with the same ε: with factors above 1 work goes on up to more danger, and protects less.

        Args:
            factors: What each Δ is multiplied by, one a level of danger, the highest priority first; of two levels the
                position's release, then the orientation's.

        Returns:
            The scaled activation of the same tasks.

        Raises:
            ConfigurationError: Not one number a level; a Δ beyond 1e-100 to 1e100; a release would begin before the one
                below it is complete, or with it; or an activation or a threshold of a derived class, of which nobody
                knows how it scales.
        """
        if type(self) is not Activation or not self._plain:
            expected = "an Activation of Thresholds, not of classes derived from them"
            raise ConfigurationError("Activation.scaled", "self", type(self).__name__, expected)
        if len(factors) != len(self.levels):
            raise ConfigurationError("Activation.scaled", "factors", factors, f"{counted(len(self.levels), 'factor')}")
        expected = f"a number > 0, from {LEAST:g} to {MOST:g}"
        own = [number("Activation.scaled", "factors", factor, expected, LEAST, most=MOST) for factor in factors]
        scaled = [Threshold(level.delta * by, level.epsilon) for level, by in zip(self.levels, own, strict=True)]
        found = Activation(tuple(new for new, count in zip(scaled, self.counts, strict=True) for _ in range(count)))
        if found.counts != self.counts:
            expected = "factors that leave levels apart: equal thresholds would be one level"
            raise ConfigurationError("Activation.scaled", "factors", factors, expected)
        return found

    def switches(self, cdf_n: float) -> tuple[float, ...]:
        """The switches (m, f, ...) of eqs. (19), (21), one per level of danger, each in [0, 1]."""
        return tuple([threshold(cdf_n) for threshold in self.levels])

    def activations(self, cdf_n: float) -> tuple[float, ...]:
        """Activations a_1..a_N = products of the first switches: (m, m f, ...); (m, m, m f, m f) for two and two."""
        return tuple(multiply(self.switches(cdf_n), self.counts, [1.0] * len(self.thresholds)))

    def at(self, cdf_n: float) -> Switching:
        """Switches, activations and the regime's name, in one pass.

        Raises:
            ValueError: A derived class returned something that is not activations.
        """
        if type(self) is not Activation:
            found = tuple([float(a) for a in self.activations(cdf_n)])
            falling = all(above >= a for above, a in pairwise((1.0, *found, 0.0)))  # false for NaN
            if not (falling and len(found) == len(self.thresholds)):
                expected = f"1 >= a_1 >= ... >= 0 for {counted(len(self.thresholds), 'task')}"
                raise ValueError(f"the activations are {found}, expected {expected}")
            return Switching(self.switches(cdf_n), found, self.regime(cdf_n))
        if cdf_n <= self._least:  # below the lowest threshold
            return self._calm
        if cdf_n >= self._most:  # beyond the highest one
            return self._released
        switches, kept = [], 0
        for level, numbers in self._numbers:
            if cdf_n <= numbers[0]:
                switches.append(1.0)
                kept += 1
            else:
                switches.append(switch(cdf_n, *numbers) if self._plain else level(cdf_n))
        activations = multiply(switches, self.counts, [1.0] * len(self.thresholds))
        # without a detour through Python
        return tuple.__new__(Switching, (tuple(switches), tuple(activations), self._names[kept]))

    def kept(self, cdf_n: float) -> int:
        """Number of tasks not yet being released: N in low danger, 0 in high danger."""
        return sum([cdf_n <= threshold.start for threshold in self.thresholds])

    def regime(self, cdf_n: float) -> str:
        """Name of the danger level (Table I): ``low``, ``medium`` or ``high``.

        A level begins where its release begins, Δ(1-ε), as the paper shades its figures. With more than two different
        thresholds the levels between are named ``medium-1`` (most released) to ``medium-(N-1)``.
        """
        return self._names[sum([cdf_n <= threshold.start for threshold in self.levels])]


def regime_weights(activations: tuple[float, ...]) -> NDArray[np.float64]:
    """Weights of the N+1 regimes (derivations, section 1): w_k = a_k - a_(k+1), with a_0 = 1, a_(N+1) = 0.

    Args:
        activations: 1 >= a_1 >= ... >= a_N >= 0.

    Returns:
        (N+1,), >= 0, summing to 1. Entry k weighs the regime that keeps tasks 1..k; for two tasks that is
        (1-m, m(1-f), m f): high, medium, low danger.
    """
    a = np.array((1.0, *activations, 0.0))
    return a[:-1] - a[1:]
