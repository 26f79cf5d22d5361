"""Jerk-limited time laws: how far along, how fast, how hard, at every time; computed by ruckig once, sampled exactly.

Ruckig finds the switching times; the result is kept as plain pieces of constant jerk, which can be copied, compared and
sampled at any time, so a clock that stands still pauses a motion exactly where it is.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.tasks.trajectory import checked_vector
from qpsafe.text.given import number

Array = NDArray[np.float64]

#: Ruckig tells nothing apart that is nearer than 1e-8: with smaller rates it may answer a jump.
SLOWEST = 1e-8


class Motion(NamedTuple):
    """Position, velocity and acceleration of every coordinate, (n,) each."""

    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class Rates:
    """Largest speed, acceleration and jerk of a motion, SI units of whatever moves.

    Raises:
        ConfigurationError: One is not a finite number > 0.
    """

    speed: float
    acceleration: float
    jerk: float

    def __post_init__(self) -> None:
        for key in ("speed", "acceleration", "jerk"):
            value = number("Rates", key, getattr(self, key), "a finite number > 0", above=0.0)
            object.__setattr__(self, key, value)

    def over(self, length: float) -> Rates:
        """The same rates of a parameter that is 1 at the end of a path of this length."""
        return Rates(self.speed / length, self.acceleration / length, self.jerk / length)

    def both(self, other: Rates) -> Rates:
        """The stricter of two."""
        return Rates(
            min(self.speed, other.speed),
            min(self.acceleration, other.acceleration),
            min(self.jerk, other.jerk),
        )


class TimeLaw(Fixed):
    """The quickest motion from a state to rest at a goal, all coordinates arriving together.

    Args:
        start: (n,).
        goal: (n,).
        speed, acceleration, jerk: Largest ones, (n,) each.
        velocity, start_acceleration: At the start (n,); zero by default. Where they are beyond the largest ones, the
            motion brakes first.

    Raises:
        ConfigurationError: Something is not finite, a rate is below `SLOWEST`, or the numbers are so large, so small or
            so far apart that no switching times can be computed.
    """

    fixed = frozenset(("start", "goal", "duration"))

    def __init__(
        self,
        start: ArrayLike,
        goal: ArrayLike,
        speed: ArrayLike,
        acceleration: ArrayLike,
        jerk: ArrayLike,
        velocity: ArrayLike | None = None,
        start_acceleration: ArrayLike | None = None,
    ) -> None:
        import ruckig

        first = checked_vector("TimeLaw", "start", start)
        n = len(first)
        given = {
            "goal": goal,
            "speed": speed,
            "acceleration": acceleration,
            "jerk": jerk,
            "velocity": np.zeros(n) if velocity is None else velocity,
            "start_acceleration": np.zeros(n) if start_acceleration is None else start_acceleration,
        }
        checked = {key: checked_vector("TimeLaw", key, value, n) for key, value in given.items()}
        for key in ("speed", "acceleration", "jerk"):
            if not (checked[key] >= SLOWEST).all():
                raise ConfigurationError("TimeLaw", key, given[key], f"numbers >= {SLOWEST:g}")
        problem = ruckig.InputParameter(n)
        problem.current_position, problem.target_position = first.tolist(), checked["goal"].tolist()
        problem.current_velocity = checked["velocity"].tolist()
        problem.current_acceleration = checked["start_acceleration"].tolist()
        problem.max_velocity, problem.max_acceleration = checked["speed"].tolist(), checked["acceleration"].tolist()
        problem.max_jerk = checked["jerk"].tolist()
        found = ruckig.Trajectory(n)
        try:
            result = ruckig.Ruckig(n).calculate(problem, found)
        except ruckig.RuckigError:
            result = ruckig.Result.Error
        if result not in (ruckig.Result.Working, ruckig.Result.Finished) or not math.isfinite(found.duration):
            rates = ", ".join(f"{key} {given[key]}" for key in ("speed", "acceleration", "jerk"))
            raise ConfigurationError("TimeLaw", "goal", goal, f"a motion that ruckig can time with {rates}")
        self.start, self.goal = first, checked["goal"]
        self.duration = float(found.duration)
        pieces = [_phases(profile) for profile in found.profiles[0]]
        self._pieces = [
            _Pieces(p0, v0, a0, *piece)
            for p0, v0, a0, piece in zip(first, checked["velocity"], checked["start_acceleration"], pieces, strict=True)
        ]

    def at(self, t: float) -> Motion:
        """The motion at time t [s]; at rest at the goal from `duration` on, at the start's position before 0."""
        if not t < self.duration:
            return Motion(self.goal, np.zeros(len(self.goal)), np.zeros(len(self.goal)))
        return Motion(*np.array([piece.at(max(t, 0.0)) for piece in self._pieces]).T)

    def first(self, t: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration of the first coordinate at time t [s], as `at` has them."""
        return self._pieces[0].at(max(t, 0.0)) if t < self.duration else (float(self.goal[0]), 0.0, 0.0)


def _phases(profile: object) -> tuple[list[float], list[float]]:
    """Durations and jerks of a ruckig profile: at most two of braking into the limits, then seven."""
    brake = profile.brake  # type: ignore[attr-defined]
    return [*brake.t, *profile.t], [*brake.j, *profile.j]  # type: ignore[attr-defined]


class _Pieces:
    """One coordinate: constant jerk j_i from time t_i on, where position, velocity and acceleration are known."""

    def __init__(self, p: float, v: float, a: float, durations: Sequence[float], jerks: Sequence[float]) -> None:
        self.times: list[float] = []
        self.states: list[tuple[float, float, float, float]] = []
        t = 0.0
        for duration, j in zip(durations, jerks, strict=True):
            if duration > 0.0:
                self.times.append(t)
                self.states.append((float(p), float(v), float(a), float(j)))
                p, v, a = _integrate(p, v, a, j, duration)
                t += duration
        self.times.append(t)
        self.states.append((float(p), 0.0, 0.0, 0.0))

    def at(self, t: float) -> tuple[float, float, float]:
        k = max(bisect_right(self.times, t) - 1, 0)
        return _integrate(*self.states[k], t - self.times[k])


def _integrate(p: float, v: float, a: float, j: float, t: float) -> tuple[float, float, float]:
    return p + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j
