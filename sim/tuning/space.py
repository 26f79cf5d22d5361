"""Where values are looked for: coordinates around the present ones, each with its bounds and the reason for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.danger.levers import levers
from qpsafe.sim.tuning.values import Values, present

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

#: Names and values of the coordinates.
Point = dict[str, float]

#: A joint whose longest lever is at least this share of the longest of all moves the arm, the others its wrist.
ARM = 0.5


class Dimension(NamedTuple):
    """A coordinate.

    Attributes:
        name: Of it.
        low, high: Bounds.
        log: Whether steps are factors.
        reason: For the bounds, in words.
    """

    name: str
    low: float
    high: float
    log: bool
    reason: str

    def at(self, share: float) -> float:
        """The value at a share of the way from one bound to the other."""
        if self.log:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)

    def share(self, value: float) -> float:
        """The inverse of `at`."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


@dataclass(frozen=True)
class Space:
    """All coordinates of a robot.

    Attributes:
        dimensions: In their order.
        start: The present values as a point.
        values: The present values.
        arm: Which joints move the arm (n,); the others are the wrist's.
    """

    dimensions: tuple[Dimension, ...]
    start: Point
    values: Values
    arm: tuple[bool, ...]

    @classmethod
    def of(cls, robot: Robot) -> Space:
        """Around a robot's present values."""
        now, lever = present(robot), levers(robot)
        arm = tuple((lever >= ARM * lever.max()).tolist())
        released = now.delta_f * (1.0 + now.epsilon_f) / (now.delta * (1.0 - now.epsilon))
        start = {
            "delta": now.delta, "epsilon": now.epsilon, "release": released, "epsilon_f": now.epsilon_f,
            "damping_arm": 1.0, "delay_arm": 1.0, "damping_wrist": 1.0, "delay_wrist": 1.0,
            "hold_time": now.hold_time, "calm": now.calm, "dwell": now.dwell, "pace": 1.0,
            "acceleration": now.acceleration, "ramp": now.ramp, "approach": now.approach, "sidestep": now.sidestep,
        }  # fmt: skip
        if all(arm):  # it has no wrist
            del start["damping_wrist"], start["delay_wrist"]
        if not math.isfinite(now.sidestep):  # the strictest promise: somebody's decision
            del start["sidestep"]
        bounds = _bounds(now)
        found = []
        for name, value in start.items():
            low, high, log, reason = bounds[name]
            found.append(Dimension(name, min(low, value), max(high, value), log, reason))
        return cls(tuple(found), start, now, arm)

    def at(self, point: Mapping[str, float]) -> Values:
        """What a point stands for, to four digits; every point is one that Table I allows."""
        if point == self.start:
            return self.values
        now, p = self.values, self.start | dict(point)
        arm, wrist = p["damping_arm"], p.get("damping_wrist", 1.0)
        late, late_wrist = arm * p["delay_arm"], wrist * p.get("delay_wrist", 1.0)
        damping = tuple(d * (arm if is_arm else wrist) for d, is_arm in zip(now.damping, self.arm, strict=True))
        mass = tuple(m * (late if is_arm else late_wrist) for m, is_arm in zip(now.mass, self.arm, strict=True))
        found = replace(
            now,
            delta=p["delta"], epsilon=p["epsilon"], epsilon_f=p["epsilon_f"],
            delta_f=p["release"] * p["delta"] * (1.0 - p["epsilon"]) / (1.0 + p["epsilon_f"]),
            mass=mass, damping=damping, hold_time=p["hold_time"], calm=p["calm"], dwell=p["dwell"],
            speed=p["pace"] * now.speed, angular_speed=p["pace"] * now.angular_speed,
            joint_speed=p["pace"] * now.joint_speed, acceleration=p["acceleration"], ramp=p["ramp"],
            approach=p["approach"], sidestep=p.get("sidestep", now.sidestep),
        )  # fmt: skip
        return found.rounded()

    def near(self, rng: np.random.Generator, spread: float) -> Point:
        """A point near the present one.

        Args:
            rng: Draws it.
            spread: Standard deviation, as a share of the way from bound to bound.
        """
        steps: NDArray[np.float64] = spread * rng.standard_normal(len(self.dimensions))
        shares = [d.share(self.start[d.name]) + step for d, step in zip(self.dimensions, steps.tolist(), strict=True)]
        return {d.name: d.at(min(max(s, 0.0), 1.0)) for d, s in zip(self.dimensions, shares, strict=True)}


def _bounds(now: Values) -> dict[str, tuple[float, float, bool, str]]:
    factor = "of the present one"
    return {
        "delta": (now.delta / 1.6, 1.6 * now.delta, True,
                  f"Δ, 1/1.6 to 1.6 {factor}: danger falls as 1/d, so tasks give way at 1.6 to 1/1.6 of the distance"),
        "epsilon": (0.05, 0.4, False, "ε: less makes an abrupt switch, more leaves hardly any regimes"),
        "release": (0.6, 1.0, False,
                    "Δ_f(1+ε_f) / (Δ(1-ε)): 1 is the most that Table I allows, with less the low task goes earlier"),
        "epsilon_f": (0.05, 0.5, False, "ε_f, as ε"),
        "damping_arm": (1.0 / 8.0, 8.0, True,
                        f"D of the joints with long levers, 1/8 to 8 {factor}: steady speed of evasion"),
        "delay_arm": (1.0 / 16.0, 16.0, True,
                      f"M/D of these, 1/16 to 16 {factor}: how late evasion is; a factor of ten decides over contacts"),
        "damping_wrist": (1.0 / 8.0, 8.0, True, "D of the other joints, likewise"),
        "delay_wrist": (1.0 / 16.0, 16.0, True, "M/D of these, likewise"),
        "hold_time": (0.0, 0.5, False, "s that a lost point counts; in half a second people go 0.8 m"),
        "calm": (0.3, 1.0, False, "share of Δ(1-ε) below which the way back begins; 1 is the paper's"),
        "dwell": (0.0, 1.0, False, "s of calm before it begins; 0 is the paper's, a second is a step of somebody"),
        "pace": (0.5, 2.0, True, f"speeds of the way back, 1/2 to 2 {factor}: half of them is the paper's"),
        "acceleration": (0.2, 1.0, False, "share of the joints' accelerations on the way back; 1 is all there is"),
        "ramp": (0.05, 0.5, True, "s until the path's clock runs again: some ticks to half a second"),
        "approach": (min(0.01, now.approach), now.approach, True,
                     "m/s towards somebody near; never above the present one, which keeps a blow below every limit"),
        "sidestep": (0.0, 0.15, False, "s for which people may go anywhere unseen; 0.15 s are 24 cm"),
    }  # fmt: skip
