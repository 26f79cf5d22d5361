"""The parameters of a controller that are tuned: those of a robot now, and as parts of a controller."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from qpsafe.danger.activation import Activation, Threshold
from qpsafe.danger.evasion import Evasion, friction_of
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.recovery.returns import RecoveryRules
from qpsafe.sensing.rules import SensingRules
from qpsafe.sim.campaign.trials.servo import DT

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


@dataclass(frozen=True)
class Values:
    """What `robot.toml` may state of a controller, SI.

    Attributes:
        delta, epsilon, delta_f, epsilon_f: Thresholds (19), (21).
        mass, damping: M and D of every joint (n,).
        speed, angular_speed, joint_speed, acceleration, ramp, calm, dwell: Of `RecoveryRules`.
        hold_time: Of `SensingRules` [s].
        approach, sidestep: Of `VerifiedMotion`.
    """

    delta: float
    epsilon: float
    delta_f: float
    epsilon_f: float
    mass: tuple[float, ...]
    damping: tuple[float, ...]
    speed: float
    angular_speed: float
    joint_speed: float
    acceleration: float
    ramp: float
    calm: float
    dwell: float
    hold_time: float
    approach: float
    sidestep: float

    def tables(self) -> dict[str, dict[str, Any]]:
        """The same as tables of a `robot.toml`, but for its units: table -> key -> value."""
        return {table: {key: getattr(self, key) for key in keys} for table, keys in TABLES.items()}

    def parts(self, robot: Robot) -> dict[str, Any]:
        """Arguments of `Station.controller`, fresh ones: what a robot has whose file states these values.

        Args:
            robot: Whose they are; what is not tuned stays as its file states it.
        """
        count, said = len(robot.tool_frames), self.tables()
        high, low = Threshold(self.delta, self.epsilon), Threshold(self.delta_f, self.epsilon_f)
        now = robot.tuned
        return {
            "activation": Activation((high,) * count + (low,) * count),
            "evasion": self.evasion(robot),
            "recovery": RecoveryRules(**dict(now.recovery) | said["recovery"]),
            "sensing": SensingRules(**dict(now.sensing) | said["sensing"]),
            "gate": VerifiedMotion(**dict(now.gate) | said["gate"]),
        }

    def evasion(self, robot: Robot) -> Evasion:
        """M and D as they are here, friction as the robot's file has it, else by the rule for the thresholds here."""
        stated = None if robot.tuned.evasion is None else robot.tuned.evasion[2]
        friction = stated or friction_of(robot, Threshold(self.delta, self.epsilon))
        return Evasion(self.mass, self.damping, robot.nq, DT, friction)

    def rounded(self) -> Values:
        """The same to four digits, Δ_f downwards, so that Table I stays possible: what is tried is what is written."""
        numbers = {key: value for key, value in vars(self).items() if isinstance(value, float)}
        short: dict[str, Any] = {key: float(f"{value:.4g}") for key, value in numbers.items()}
        short |= {key: tuple(float(f"{x:.4g}") for x in getattr(self, key)) for key in ("mass", "damping")}
        found = replace(self, **short)
        # Δ_f (1 + ε_f) <= Δ (1 - ε): the low task is released before the release of the high one begins
        most = found.delta * (1.0 - found.epsilon) / (1.0 + found.epsilon_f)
        if found.delta_f <= most:
            return found
        step = 10.0 ** (len(str(int(most))) - 4)
        return replace(found, delta_f=float(f"{step * int(most / step):.4g}"))


#: Tables of `robot.toml`, and their keys.
TABLES = {
    "danger": ("delta", "epsilon", "delta_f", "epsilon_f"),
    "evasion": ("mass", "damping"),
    "recovery": ("speed", "angular_speed", "joint_speed", "acceleration", "ramp", "calm", "dwell"),
    "sensing": ("hold_time",),
    "gate": ("approach", "sidestep"),
}


def present(robot: Robot) -> Values:
    """The values of a robot's controllers now, whether its file states them or not."""
    high, low = robot_thresholds(robot)
    evasion, now = Evasion.for_robot(robot, DT), robot.tuned
    rules = RecoveryRules(**dict(now.recovery))
    gate = VerifiedMotion(**dict(now.gate))
    return Values(
        high.delta, high.epsilon, low.delta, low.epsilon,
        tuple(evasion.mass.diagonal().tolist()), tuple(evasion.damping.diagonal().tolist()),
        **{key: float(getattr(rules, key)) for key in TABLES["recovery"]},
        hold_time=SensingRules(**dict(now.sensing)).hold_time,
        **{key: float(getattr(gate, key)) for key in TABLES["gate"]},
    )  # fmt: skip
