"""What `SafetyController` is made of, checked at construction: a mistake is an error that names the argument."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numba import types
from numpy.typing import NDArray

from qpsafe.danger.activation import Activation
from qpsafe.danger.compiled import Array, entry, readable
from qpsafe.danger.evasion import Evasion
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.errors import ConfigurationError
from qpsafe.laws.problem import Law, LawResult
from qpsafe.limits import JointLimits
from qpsafe.sensing.spots import SpotArray
from qpsafe.tasks.task import Task
from qpsafe.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

_FLOAT = np.dtype(np.float64)

#: A law that moves a joint by more than this in one tick is broken [rad].
ABSURD_STEP = 1e3


def default_activation(tasks: tuple[Task, ...], robot: Robot) -> Activation:
    """The robot's thresholds (the IRB 140's are the source's): (18) for one task, (22) for two."""
    if len(tasks) <= 2:
        return Activation(robot_thresholds(robot)[: len(tasks)])
    raise ConfigurationError(
        "SafetyController", "activation", None, f"an Activation with {len(tasks)} thresholds for as many tasks"
    )


def checked_activation(tasks: tuple[Task, ...], activation: Activation | None, robot: Robot) -> Activation:
    """The given activation, or the default one, if it has as many thresholds as there are tasks."""
    activation = default_activation(tasks, robot) if activation is None else activation
    if len(activation.thresholds) != len(tasks):
        found = f"{len(activation.thresholds)} thresholds"
        raise ConfigurationError("SafetyController", "activation", found, f"{len(tasks)}")
    return activation


def check_arguments(robot: Robot, tasks: Sequence[Task], law: Law | None, dt: float) -> None:
    """Refuse a configuration that cannot work, by name."""
    if not hasattr(robot, "wire_frames"):
        raise ConfigurationError("SafetyController", "robot", robot, "a Robot, e.g. qpsafe.load_robot('irb140')")
    if not (isinstance(tasks, Sequence) and len(tasks) > 0):
        raise ConfigurationError("SafetyController", "tasks", tasks, "a list of at least one task")
    if not (isinstance(dt, int | float) and not isinstance(dt, bool) and np.isfinite(dt) and dt > 0.0):
        raise ConfigurationError("SafetyController", "dt", dt, "a finite time > 0 [s]")
    if law is not None and not callable(getattr(law, "solve", None)):
        raise ConfigurationError("SafetyController", "law", law, "a law with solve(problem), e.g. HierarchicalLaw()")
    for k, task in enumerate(tasks):
        if not isinstance(task, Task):
            raise ConfigurationError("SafetyController", f"tasks[{k}]", task, "a Task, e.g. PositionTask")
        misfit = task.misfit(robot)
        if misfit is not None:
            raise ConfigurationError("SafetyController", f"tasks[{k}].{misfit.key}", misfit.value, misfit.expected)
        if not task.gain * dt < 1.0:
            expected = f"less than 1/dt = {1.0 / dt:g} for a stable loop"
            raise ConfigurationError("SafetyController", f"tasks[{k}].gain", task.gain, expected)


def check_parts(
    robot: Robot, dt: float, field: object, activation: object, evasion: object, limits: JointLimits | str | None
) -> None:
    """Refuse parts of the wrong kind, and parts made for another robot or another tick, by name."""
    n = robot.nq
    if field is not None and not callable(getattr(field, "evaluate", None)):
        raise ConfigurationError("SafetyController", "field", field, "a DangerField")
    if activation is not None and not isinstance(activation, Activation):
        raise ConfigurationError("SafetyController", "activation", activation, "an Activation")
    if evasion is not None and not (isinstance(evasion, Evasion) and evasion.velocity.shape == (n,)):
        raise ConfigurationError("SafetyController", "evasion", evasion, f"an Evasion of {counted(n, 'joint')}")
    if limits is None or (isinstance(limits, str) and limits == "robot"):
        return
    if not isinstance(limits, JointLimits):
        raise ConfigurationError("SafetyController", "limits", limits, '"robot", a JointLimits or None')
    if limits.lower.shape != (n,):
        raise ConfigurationError("SafetyController", "limits", f"limits of shape {limits.lower.shape}", f"({n},)")
    if limits.dt != dt:
        raise ConfigurationError("SafetyController", "limits.dt", limits.dt, f"the controller's tick, dt = {dt} s")


def checked_spots(spots: SpotArray, robot: Robot) -> SpotArray:
    """`spots`, if this robot can carry them."""
    if not isinstance(spots, SpotArray):
        raise ConfigurationError("SafetyController", "spots", spots, "a SpotArray, e.g. qpsafe.load_spots(robot)")
    spots.check(robot)
    return spots


def checked_velocity(result: LawResult, q: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
    """The velocity a law returned, if the robot at q could be sent it; the law's own array if it may be."""
    if not isinstance(result, LawResult):
        raise TypeError(f"the law returned {type(result).__name__}, expected a LawResult")
    qd = result.qd
    if not (type(qd) is np.ndarray and qd.dtype is _FLOAT):
        qd = np.asarray(qd)
    if qd.shape != q.shape or qd.dtype.kind not in "fiu":
        raise ValueError(f"the law returned a velocity of shape {qd.shape}, {qd.dtype}, expected {len(q)} real numbers")
    qd = np.asarray(qd, dtype=float)
    if not _all_below(qd, ABSURD_STEP / dt):  # without limits nothing else would stop it
        raise ValueError(f"the law returned a velocity that is not finite or absurd: {qd}")
    return qd


@entry(types.boolean(readable(1), types.float64))
def _all_below(qd: Array, largest: float) -> bool:
    good = True
    for i in range(qd.shape[0]):
        good = good and abs(qd[i]) < largest  # false for NaN
    return good
