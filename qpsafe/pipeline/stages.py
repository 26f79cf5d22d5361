"""The two halves of a tick with the present parts of a controller, made again when somebody exchanged one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.danger.link_parts import LinkParts
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.pipeline.checks import check_command
from qpsafe.pipeline.resolve import Array, Resolve
from qpsafe.pipeline.resolved import Resolved
from qpsafe.pipeline.sense import Seen, Sense
from qpsafe.sensing.body import body_hulls

if TYPE_CHECKING:
    from qpsafe.danger.evasion import Evasion
    from qpsafe.gate.gate import Gate
    from qpsafe.gate.rules import VerifiedMotion
    from qpsafe.laws.problem import Law
    from qpsafe.limits import JointLimits
    from qpsafe.ranging.ranging import RangeSensing
    from qpsafe.robot.robot import Robot
    from qpsafe.sensing.hulls import Obstacle
    from qpsafe.sensing.sensing import DistanceSensing
    from qpsafe.tasks.task import Task


class Stages:
    """Makes and keeps them.

    Args:
        robot: The robot.
        dt: Tick [s].
        known: Known obstacles of the surroundings.
        carried: What tools may carry, by frame.
        max_age: Older readings do not count [s].
        said: Doubts about the geometry that have been said.
    """

    def __init__(
        self, robot: Robot, dt: float, known: Sequence[Obstacle] = (),
        carried: Mapping[str, Sequence[Obstacle]] | None = None, max_age: float = 0.0, said: tuple[str, ...] = (),
    ) -> None:  # fmt: skip
        self._said = said
        self._doubted: Gate | None = None
        self._robot, self._dt = robot, dt
        self._surroundings = tuple(known), carried, max_age
        self._gate: Gate | None = None
        self._sense: Sense | None = None
        self._resolve: Resolve | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy makes its own: what is kept here cuts its memory into views, which copying would tear apart."""
        return Stages, (self._robot, self._dt, *self._surroundings, self._said)

    def sense(
        self, sensing: DistanceSensing | None, field: Any, evasion: Evasion, ranging: RangeSensing | None = None
    ) -> Sense:
        """From measurements to q̇0.

        Args:
            sensing: Distance sensors; None if there are only points.
            field: The danger field.
            evasion: The admittance (16).
            ranging: Sensors of many zones; None if there are none.
        """
        made = self._sense
        if made is None or not (made.parts[0] is sensing and made.parts[1] is field and made.parts[2] is evasion):
            made = self._sense = Sense(self._robot, sensing, field, evasion, ranging)
        return made

    def resolve(self, tasks: Sequence[Task], law: Law, most: Array | None = None) -> Resolve:
        """From references and q̇0 to the command.

        Args:
            tasks: Highest priority first.
            law: The law.
            most: Largest speeds of joints that are to stand (n,) [rad/s], infinite for the others; None for none.
        """
        made = self._resolve
        if made is None or not (made.parts[0] is tasks and made.parts[1] is law):
            made = self._resolve = Resolve(self._robot, tasks, law, self._dt)
        made.most = most
        return made

    def gate(self, rules: VerifiedMotion, limits: JointLimits) -> Gate:
        """What verifies a command before it is sent.

        Args:
            rules: Figures.
            limits: By which the robot brakes.
        """
        made = self._gate
        if made is None or not (made.rules is rules and made.limits is limits):
            from qpsafe.gate.gate import Gate  # not compiled where there is none

            made = self._gate = Gate(self._robot, rules, limits, *self._surroundings)
        return made

    def doubts(self, gate: Gate) -> tuple[str, ...]:
        """Doubts about what a gate measures with, in words; each is said once."""
        if gate is self._doubted:
            return ()
        self._doubted = gate
        new = tuple([words for words in gate.notes() if words not in self._said])
        self._said = (*self._said, *new)
        return new

    def resolve_under(
        self, barrier: DangerBarrier, measured: Array, seen: Seen, resolve: Resolve, given: Any
    ) -> Resolved:
        """The same under a cap on the danger field: a soft level first, then scaled exactly.

        Args:
            barrier: The cap.
            measured: Joint position (n,) [rad].
            seen: Detected points and their danger.
            resolve: The half of the tick.
            given: Commanded state, velocity, the one before, samples, q̇0, activations, limits and soft levels, as
                `resolve` takes them.
        """
        state = self._robot.at(measured)
        commanded, qd, before, samples, qd0, active, limits, soft = given
        level = barrier.level(state, qd, seen.points, seen.danger)
        soft = (*soft, level) if level else soft
        resolved = resolve(commanded, qd, before, samples, qd0, active, limits, soft)
        # exact, as far as the acceleration limits allow
        command = barrier.scale(state, resolved.command, seen.points).factor * resolved.command
        resolved.command = command if resolved.box is None else resolved.box.clip(command)
        check_command(resolved.command, self._dt)
        return resolved

    @cached_property
    def link_parts(self) -> LinkParts:
        """Capsules around the robot's links; those of its wire where its model has no collision geometry."""
        from qpsafe.gate.pack import robot_capsules

        if not body_hulls(self._robot):
            return LinkParts.wire(self._robot)
        capsules = robot_capsules(self._robot)
        return LinkParts(capsules.names, np.repeat(capsules.bodies, 2), capsules.ends, capsules.radii)
