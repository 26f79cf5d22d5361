"""What a controller is made of: which parts may be exchanged while it runs, and which are given for good.

A part never changes, see `qpsafe.fixed`; another one may take its place, and counts from the next tick on.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.activation import Activation
from qpsafe.danger.evasion import Evasion
from qpsafe.danger.separation_limit import SeparationLevel, SeparationLimit, oldest
from qpsafe.gate.pack import surroundings
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.geometry.clearance import ClearanceLimit, checked_clearance
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.laws.problem import Law
from qpsafe.limits import JointLimits, checked_limits
from qpsafe.pipeline.checks import (
    check_tasks,
    checked_activation,
    checked_barrier,
    checked_evasion,
    checked_field,
    checked_gate,
    checked_law,
    checked_separation,
    own_evasion,
)
from qpsafe.pipeline.sensors import Sensors
from qpsafe.recovery.recovery import Recovery, RecoveryRules
from qpsafe.sensing.detection import as_joint_position
from qpsafe.text.words import call

if TYPE_CHECKING:
    from qpsafe.gate.gate import Gate
    from qpsafe.geometry.clearance_level import ClearanceLevel
    from qpsafe.pipeline.sense import Seen
    from qpsafe.pipeline.stages import Stages
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.tasks.task import Task


class Parts(Sensors):
    """The parts of a `SafetyController`.

    Given at construction: `robot`, `dt`, `spots`, `known`, `carried`, `range_sensors`, `rules`, `sensing`, `ranging`,
    `recovery_rules`, `recovery`; setting one is an AttributeError. Exchanged by assignment: `law`, `field`,
    `activation`, `evasion`, `limits`, `barrier`, `gate`, `clearance`, `separation`; what does not fit is a
    ConfigurationError, and nothing has changed. Tasks by `set_tasks`.
    """

    _tasks: tuple[Task, ...]
    _labels: tuple[str, ...]
    _law: Law
    _field: Any
    _activation: Activation
    _evasion: Evasion
    _limits: JointLimits | None
    _braking: JointLimits
    _barrier: DangerBarrier | None
    _separation: SeparationLimit | None
    _stages: Stages
    _clearance: ClearanceLimit | None
    _recovery_rules: RecoveryRules
    _recovery: Recovery
    _qd: NDArray[np.float64]
    _qd_before: NDArray[np.float64]

    def __repr__(self) -> str:
        return call(self, self._robot.name, self._labels, self._law, dt=self._dt, phase=self._recovery.phase)

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def dt(self) -> float:
        """Tick [s]."""
        return self._dt

    @property
    def tasks(self) -> tuple[Task, ...]:
        """What the robot is asked to do, highest priority first; see `set_tasks`."""
        return self._tasks

    @property
    def law(self) -> Law:
        """How tasks and evasion are combined."""
        return self._law

    @law.setter
    def law(self, law: Law) -> None:
        self._law = checked_law(law, len(self._tasks))

    @property
    def field(self) -> Any:
        """The danger field."""
        return self._field

    @field.setter
    def field(self, field: Any) -> None:
        field = checked_field(field)
        checked_barrier(self._barrier, field)
        self._field = field

    @property
    def activation(self) -> Activation:
        """Thresholds of the tasks."""
        return self._activation

    @activation.setter
    def activation(self, activation: Activation) -> None:
        activation = checked_activation(self._tasks, activation, self._robot)
        self._recovery.suspend_above = activation.suspend_above
        self._activation = activation

    @property
    def evasion(self) -> Evasion:
        """The admittance (16); its velocity is remembered in it."""
        return self._evasion

    @evasion.setter
    def evasion(self, evasion: Evasion | str | None) -> None:
        self._evasion = own_evasion(self, checked_evasion(evasion, self._robot, self._dt))

    @property
    def limits(self) -> JointLimits | Literal["off"]:
        """Joint limits; braking, without data or after a fault, keeps to them too."""
        return "off" if self._limits is None else self._limits

    @limits.setter
    def limits(self, limits: JointLimits | str | None) -> None:
        limits = checked_limits("SafetyController", limits, self._robot, self._dt)
        # braking must not depend on code of the user's: plain limits of the same numbers
        braking = JointLimits.of(self._robot, self._dt) if limits is None else limits.plain()
        self._limits, self._braking = limits, braking

    @property
    def barrier(self) -> DangerBarrier | None:
        """A cap on the danger field."""
        return self._barrier

    @barrier.setter
    def barrier(self, barrier: DangerBarrier | None) -> None:
        self._barrier = checked_barrier(barrier, self._field)

    @property
    def gate(self) -> VerifiedMotion | Literal["off"]:
        """Figures of the last step, which verifies the command; it is off without limits too."""
        return "off" if self._gate is None else self._gate

    @gate.setter
    def gate(self, gate: VerifiedMotion | str | None) -> None:
        self._gate = checked_gate(gate, self._robot)

    @property
    def verifies(self) -> Gate | None:
        """What verifies commands now, with its tables; None where that is off."""
        if self._gate is None or self._limits is None:
            return None
        return self._stages.gate(self._gate, self._braking)

    @property
    def clearance(self) -> ClearanceLimit | Literal["off"]:
        """How near the robot may come to furniture, to what it carries and to itself."""
        return "off" if self._clearance is None else self._clearance

    @clearance.setter
    def clearance(self, clearance: ClearanceLimit | str | None) -> None:
        self._clearance = checked_clearance(
            clearance, self._robot, lambda: surroundings(self._robot, self._known, self._carried)[0]
        )

    @property
    def separation(self) -> SeparationLimit | None:
        """Speed and separation monitoring: how fast any link may approach what is seen."""
        return self._separation

    @separation.setter
    def separation(self, separation: SeparationLimit | None) -> None:
        self._separation = checked_separation(separation)

    @property
    def recovery_rules(self) -> RecoveryRules:
        """How the robot returns to its path after danger."""
        return self._recovery_rules

    @property
    def recovery(self) -> Recovery:
        """Where it is on that way."""
        return self._recovery

    def set_tasks(self, tasks: Sequence[Task], activation: Activation | None = None, *, restart: bool = False) -> None:
        """Redefine or reorder the tasks, from the next tick on; the command goes on inside the limits.

        Where the robot is not on the new tasks' trajectories, it is led there as after a suspension. A law with weights
        for another number of tasks has to make way for one without any before.

        Args:
            tasks: What it is asked to do now, highest priority first.
            activation: Their thresholds; by default the present ones if the number of tasks stays.
            restart: Whether the trajectories' clock, and their events, start from zero; else it goes on.

        Raises:
            ConfigurationError: Names the argument that is wrong; the tasks are then as they were.
        """
        labels = check_tasks(self._robot, tasks, self._dt)
        checked_law(self._law, len(tasks))
        if activation is None and len(tasks) == len(self._tasks):
            activation = self._activation
        activation = checked_activation(tuple(tasks), activation, self._robot)
        self._recovery.set_tasks(tuple(tasks), activation.suspend_above, restart)
        self._tasks, self._labels, self._activation = tuple(tasks), labels, activation

    def __copy__(self) -> Self:
        """A run of its own that goes on from here, as a deep copy is; parts that do not change are shared."""
        shared = (
            self._robot, *self._tasks, self._law, self._field, self._activation, self._spots, self._rules,
            self._clearance,
        )  # fmt: skip
        return copy.deepcopy(self, {id(part): part for part in shared})

    def pause(self) -> None:
        """Bring the path's clock to rest within `recovery_rules.ramp`; danger is evaded as ever."""
        self._recovery.paused = True

    def resume(self) -> None:
        """Let the path's clock run again."""
        self._recovery.paused = False

    @property
    def _acceleration(self) -> NDArray[np.float64]:
        """That led to the commanded velocity (n,) [rad/s²]."""
        return (self._qd - self._qd_before) / self._dt

    def _kept_clear(self, commanded: RobotState) -> tuple[ClearanceLevel, ...]:
        """Rows that keep the robot clear of furniture and itself; none where nothing can come too near."""
        if self._clearance is None or self._limits is None:
            return ()
        rows = self._clearance.level(commanded, self._qd, self._limits)
        return () if rows is None else (rows,)

    def _near(self, commanded: RobotState) -> tuple[tuple[str, str, float], ...]:
        """What the robot is kept clear of and comes near to: names, and distances up to twice the margin [m]."""
        rows = self._kept_clear(commanded)
        return rows[0].nearer(2.0 * self._clearance.margin) if rows and self._clearance is not None else ()

    def _kept_apart(self, measured: ArrayLike, seen: Seen, ages: Any) -> tuple[SeparationLevel, ...]:
        """Rows that keep links from approaching what is seen too fast, at the measured position (n,) [rad]."""
        if self._separation is None:
            return ()
        state = self._robot.at(as_joint_position(measured, self._robot))
        age = oldest(ages, self._rules.max_age)
        # leads are told for people of one speed: in part they are errors of places
        fast = max(self._separation.separation.person_speed, self._person_speed)
        come = fast * float(seen.leads.max(initial=0.0))
        rows = self._separation.level(
            state, self._stages.link_parts, seen.people, age, come=come, qd=self._qd, limits=self._limits
        )
        return () if rows is None else (rows,)
