"""What `SafetyController` is made of, checked at construction: a mistake is an error that names the argument."""

from __future__ import annotations

from collections.abc import Sequence
from inspect import signature
from typing import TYPE_CHECKING, Any
from weakref import ref

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, entry, readable
from qpsafe.danger.activation import Activation
from qpsafe.danger.evasion import Evasion
from qpsafe.danger.separation_limit import SeparationLimit
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.errors import ConfigurationError
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.laws.kinds import check_fit
from qpsafe.laws.problem import Law, LawResult
from qpsafe.limits import KINDS, SHORTEST_TICK, Box, JointLimits
from qpsafe.recovery.returns import RecoveryRules
from qpsafe.sensing.detection import reals
from qpsafe.tasks.task import Task
from qpsafe.text.given import number
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

_FLOAT = np.dtype(np.float64)

#: A law that moves a joint by more than this in one tick is broken [rad].
ABSURD_STEP = 1e3
#: Limits of another making may go beyond what their numbers allow by this, for rounding [rad/s].
BEYOND = 1e-9
#: A tick that is longer is meant in other units [s].
LONGEST_TICK = 0.1


def default_activation(tasks: tuple[Task, ...], robot: Robot) -> Activation:
    """The robot's thresholds (the IRB 140's are the paper's): (18) for one task, (22) for two."""
    if len(tasks) <= 2:
        return Activation(robot_thresholds(robot)[: len(tasks)])
    raise ConfigurationError(
        "SafetyController", "activation", None, f"an Activation with {len(tasks)} thresholds for as many tasks"
    )


def checked_activation(tasks: tuple[Task, ...], activation: Activation | None, robot: Robot) -> Activation:
    """The given activation, or the default one, if it has as many thresholds as there are tasks.

    Args:
        tasks: Highest priority first.
        activation: As given; None for the robot's.
        robot: Whose thresholds are the default.
    """
    activation = default_activation(tasks, robot) if activation is None else activation
    if not isinstance(activation, Activation):
        raise ConfigurationError("SafetyController", "activation", activation, "an Activation")
    if len(activation.thresholds) != len(tasks):
        found = f"{len(activation.thresholds)} thresholds"
        raise ConfigurationError("SafetyController", "activation", found, f"{len(tasks)}")
    return activation


def checked_dt(where: str, dt: float) -> float:
    """A tick as a float."""
    expected = f"a time in seconds, above 0 (from {SHORTEST_TICK:g}), up to {LONGEST_TICK}; 4 ms is 0.004"
    return number(where, "dt", dt, expected, SHORTEST_TICK, most=LONGEST_TICK)


def check_tasks(robot: Robot, tasks: Sequence[Task], dt: float) -> tuple[str, ...]:
    """What reports call the tasks; those that the robot cannot do are refused.

    Args:
        robot: Who has to do them.
        tasks: As given.
        dt: Tick [s]; K dt has to be below 1.
    """
    if not (isinstance(tasks, Sequence) and len(tasks) > 0):
        raise ConfigurationError("SafetyController", "tasks", tasks, "a list of at least one task")
    for k, task in enumerate(tasks):
        if not isinstance(task, Task):
            raise ConfigurationError("SafetyController", f"tasks[{k}]", task, "a Task, e.g. PositionTask")
        misfit = task.misfit(robot)
        if misfit is not None:
            raise ConfigurationError("SafetyController", f"tasks[{k}].{misfit.key}", misfit.value, misfit.expected)
        if not task.gain * dt < 1.0:
            expected = f"less than 1/dt = {1.0 / dt:g} for a stable loop"
            raise ConfigurationError("SafetyController", f"tasks[{k}].gain", task.gain, expected)
    for task in tasks:
        task.settle()
    return tuple(task.label for task in tasks)


def checked_robot(where: str, robot: Robot) -> Robot:
    """`robot`, if it is one."""
    if not hasattr(robot, "wire_frames"):
        raise ConfigurationError(where, "robot", robot, "a Robot, e.g. qpsafe.load_robot('irb140')")
    return robot


def checked_law(law: Law, tasks: int | None = None) -> Law:
    """`law`, if it can be asked, and fits as many tasks, where that is known."""
    if isinstance(law, type) or not callable(getattr(law, "solve", None)):
        raise ConfigurationError("SafetyController", "law", law, "a law with solve(problem), e.g. HierarchicalLaw()")
    if tasks is not None:
        check_fit(law, tasks)
    return law


def checked_field(field: Any, where: str = "SafetyController") -> Any:
    """`field`, if it can be asked; the error says who asks."""
    if isinstance(field, type) or not callable(getattr(field, "evaluate", None)):
        raise ConfigurationError(where, "field", field, "a DangerField")
    return field


def checked_gate(gate: VerifiedMotion | str | None, robot: Robot) -> VerifiedMotion | None:
    """Figures of the gate, those of the robot's file or the default ones for None; None where it is "off"."""
    if gate is None:
        return VerifiedMotion(**dict(robot.tuned.gate))
    if isinstance(gate, str) and gate == "off":
        return None
    if not isinstance(gate, VerifiedMotion):
        raise ConfigurationError("SafetyController", "gate", gate, 'a VerifiedMotion or "off"')
    return gate


def checked_evasion(evasion: Evasion | str | None, robot: Robot, dt: float, where: str = "SafetyController") -> Evasion:
    """`evasion`, if it is one of this robot and this tick.

    Args:
        evasion: As given; None for that of the robot, "paper" for M = 4, D = 20.
        robot: Whose joints move.
        dt: Tick [s].
        where: Who asks, for the error.
    """
    if evasion is None:
        return Evasion.for_robot(robot, dt)
    if isinstance(evasion, str) and evasion == "paper":
        return Evasion.paper(robot.nq, dt)
    if not (isinstance(evasion, Evasion) and evasion.velocity.shape == (robot.nq,)):
        expected = f'an Evasion of {counted(robot.nq, "joint")}, or "paper"'
        raise ConfigurationError(where, "evasion", evasion, expected)
    if evasion.dt != dt:
        raise ConfigurationError(where, "evasion.dt", evasion.dt, f"the tick, dt = {dt} s")
    if evasion.friction.any() and not _takes_coming(evasion):
        expected = "step(sigma, coming) where there is friction; friction=0 for none"
        raise ConfigurationError(where, "evasion.step", type(evasion).__name__, expected)
    return evasion


def _takes_coming(evasion: Evasion) -> bool:
    try:
        signature(evasion.step).bind(evasion.velocity, 0.0)
    except (TypeError, ValueError):  # not so, or nobody knows
        return False
    return True


def own_evasion(user: Any, evasion: Evasion) -> Evasion:
    """`evasion`, if nobody else remembers motion in it: one would be moved by what the other one sees.

    Args:
        user: Whose `evasion` it becomes.
        evasion: That fits the user.

    Raises:
        ConfigurationError: It is the `evasion` of another user, who is still there.
    """
    other = evasion.__dict__.get("_owner", lambda: None)()
    if other is not None and other is not user and getattr(other, "evasion", None) is evasion:
        expected = f"one of its own: another {type(other).__name__} has it"
        raise ConfigurationError(type(user).__name__, "evasion", evasion, expected)
    evasion._owner = ref(user)  # type: ignore[attr-defined]
    return evasion


def checked_barrier(barrier: DangerBarrier | None, field: Any) -> DangerBarrier | None:
    """`barrier`, if it caps the controller's own field."""
    if barrier is None:
        return None
    if not isinstance(barrier, DangerBarrier):
        raise ConfigurationError("SafetyController", "barrier", barrier, "a DangerBarrier, e.g. DangerBarrier(10.5)")
    if barrier.field is not field and barrier.field != field:
        raise ConfigurationError(
            "SafetyController", "barrier.field", barrier.field, f"the controller's own field, {field}"
        )
    return barrier


def checked_separation(separation: SeparationLimit | None) -> SeparationLimit | None:
    """`separation`, if it is a limit."""
    if not (separation is None or isinstance(separation, SeparationLimit)):
        expected = "a SeparationLimit, e.g. SeparationLimit(Separation(deceleration=2.0))"
        raise ConfigurationError("SafetyController", "separation", separation, expected)
    return separation


def checked_recovery(rules: RecoveryRules) -> RecoveryRules:
    """`rules`, if they are some."""
    if not isinstance(rules, RecoveryRules):
        raise ConfigurationError("SafetyController", "recovery", rules, "RecoveryRules")
    return rules


def checked_box(box: Any, limits: JointLimits, q: NDArray[np.float64], qd: NDArray[np.float64]) -> Box:
    """The box (n,) that limits of another making gave at q, q̇, if it keeps to their own numbers.

    Args:
        box: What the limits gave.
        limits: Limits of another making.
        q: Commanded position (n,) [rad].
        qd: Last commanded velocity (n,) [rad/s].

    Raises:
        TypeError, ValueError: It is none, empty, or goes beyond what the numbers allow.
    """
    if not isinstance(box, Box):
        raise TypeError(f"the limits gave {type(box).__name__}, expected a Box")
    box = Box._make(reals(f"the limits' {key}", value, q.shape) for key, value in box._asdict().items())
    kinds = np.array(box[2:])
    if not ((kinds >= 0) & (kinds < len(KINDS)) & (kinds == np.floor(kinds))).all():
        raise ValueError(f"the limits name limits by codes that there are not: {kinds}")
    if not (box.lower <= box.upper).all():  # false for NaN
        raise ValueError(f"the limits leave nothing or are not finite: {box.lower} to {box.upper}")
    rates = limits.max_velocity, limits.max_acceleration
    most = JointLimits(limits.lower, limits.upper, *rates, limits.dt, limits.return_speed).box(q, qd)
    beyond = np.flatnonzero(~((box.lower >= most.lower - BEYOND) & (box.upper <= most.upper + BEYOND)))
    if len(beyond):
        numbers = ", ".join(str(i + 1) for i in beyond)
        raise ValueError(f"the limits go beyond their own numbers, joints by number: {numbers}")
    return box


def checked_velocity(result: LawResult, q: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
    """The velocity a law returned, if the robot at q could be sent it; the law's own array if it may be.

    Args:
        result: The law's answer.
        q: Commanded joint position (n,) [rad].
        dt: Tick [s].
    """
    if not isinstance(result, LawResult):
        raise TypeError(f"the law returned {type(result).__name__}, expected a LawResult")
    qd = reals("the law's velocity", result.qd, q.shape)
    if not _all_below(qd, ABSURD_STEP / dt):  # without limits nothing else would stop it
        raise ValueError(f"the law returned a velocity that is not finite or absurd: {qd}")
    return qd


def check_command(command: object, dt: float) -> None:
    """Refuse what limits or a barrier of another making have made of the law's velocity, if no robot could be sent it.

    Raises:
        ValueError: It is not finite, or absurd.
    """
    if not (type(command) is np.ndarray and command.dtype == _FLOAT and _all_below(command, ABSURD_STEP / dt)):
        raise ValueError(f"the limits or the barrier lead to a command that is not finite or absurd: {command}")


@entry(types.boolean(readable(1), types.float64))
def _all_below(qd: Array, largest: float) -> bool:
    good = True
    for i in range(qd.shape[0]):
        good = good and abs(qd[i]) < largest  # false for NaN
    return good
