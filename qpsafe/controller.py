"""The safety controller: one `step` every 4 ms, from distances to joint references."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.activation import Activation
from qpsafe.danger.evasion import Evasion
from qpsafe.danger.field import DangerField
from qpsafe.danger.separation_limit import SeparationLimit, kept_apart
from qpsafe.errors import in_words
from qpsafe.gate.gated import NO_AGES, PASSED
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.geometry.clearance import ClearanceLimit
from qpsafe.laws.barrier import DangerBarrier
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.problem import Law
from qpsafe.limits import JointLimits
from qpsafe.pipeline.braking import brake, slower
from qpsafe.pipeline.checks import (
    check_tasks,
    checked_activation,
    checked_dt,
    checked_evasion,
    checked_field,
    checked_law,
    checked_recovery,
    checked_robot,
)
from qpsafe.pipeline.resolved import Resolved, judged
from qpsafe.pipeline.running import Running
from qpsafe.pipeline.stages import Stages
from qpsafe.recovery.recovery import RECOVERING, RecoveryRules
from qpsafe.recovery.returns import GentleLimits
from qpsafe.recovery.stall import CALM
from qpsafe.reference import JointReference
from qpsafe.robot.state import RobotState
from qpsafe.sensing.detection import BadInput, as_joint_position, as_joint_velocity
from qpsafe.sensing.health import CLEAR
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.skin.spots import SpotArray
from qpsafe.sensing.speed_cap import slowed
from qpsafe.tasks.task import Task
from qpsafe.tick import BAD_INPUT, DEGRADED, FAULT, OK, Tick

if TYPE_CHECKING:
    from qpsafe.ranging.rules import RangeRules
    from qpsafe.ranging.sensor import RangeImage, RangeSensor
    from qpsafe.robot.robot import Robot

_WAY_LAW = HierarchicalLaw()
_SILENT: tuple[str, ...] = ()


class SafetyController(Running):
    """Danger in, joint references out.

    Args:
        robot: The robot.
        tasks: What it is asked to do, highest priority first.
        law: How tasks and evasion are combined; `HierarchicalLaw()` by default.
        dt: Tick [s]; the IRC5 wants 0.004.
        field: The danger field; the paper's weights by default.
        activation: Thresholds of the tasks; the robot's for one or two tasks (the paper's on the IRB 140).
        evasion: The admittance (16); `Evasion.for_robot` by default, "paper" for M = 4, D = 20.
        limits: Joint limits, by default the robot's; "off" switches them off (to compare laws, never on a robot).
        spots: The distance sensors, needed for `step(q, qd, distances)`; by default the robot's own, if it has any;
            "off" for none.
        range_sensors: Sensors of many zones, on the robot or fixed in space, whose images `step` is given.
        ranging: What of their images counts.
        sensing: What counts as danger, and what sick sensors do.
        known: Known obstacles of the surroundings: points on them are no danger.
        carried: What tools may carry, keyed by the frame it is fixed to, in that frame's axes: part of the robot.
        barrier: A cap on the danger field, beyond the paper; none by default.
        gate: Figures of the last step, which lets only the verified part of a command through; None for the default
            ones, "off" to send commands as they are. Without limits it is off.
        clearance: How near the robot may come to known obstacles, to itself and to what it carries; "off" switches it
            off, and so does `limits="off"`.
        separation: Speed and separation monitoring, above all tasks; none by default.
        recovery: How the robot returns to its path after danger.
        parameters: "robot": what is not given here is as the robot's file states it, else the default; "paper": the
            source's thresholds, and defaults beside them, whatever the file states.

    Raises:
        ConfigurationError: Names the argument that is wrong.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task],
        law: Law | None = None,
        dt: float = 0.004,
        *,
        field: DangerField | None = None,
        activation: Activation | None = None,
        evasion: Evasion | str | None = None,
        limits: JointLimits | str | None = None,
        spots: SpotArray | str | None = None,
        range_sensors: Sequence[RangeSensor] = (),
        ranging: RangeRules | None = None,
        sensing: SensingRules | None = None,
        known: Sequence[Obstacle] = (),
        carried: Mapping[str, Sequence[Obstacle]] | None = None,
        barrier: DangerBarrier | None = None,
        clearance: ClearanceLimit | str | None = None,
        recovery: RecoveryRules | None = None,
        gate: VerifiedMotion | str | None = None,
        separation: SeparationLimit | None = None,
        parameters: str = "robot",
    ) -> None:
        robot = self._robot = checked_robot("SafetyController", robot).with_parameters(parameters)
        self._dt = checked_dt("SafetyController", dt)
        self._labels = check_tasks(robot, tasks, self._dt)
        self._tasks = tuple(tasks)
        self._law = HierarchicalLaw() if law is None else checked_law(law)
        self._field = DangerField() if field is None else checked_field(field)
        self._activation = checked_activation(self._tasks, activation, robot)
        self._evasion = checked_evasion(evasion, robot, self._dt)  # its own since `reset`
        self.limits = limits
        self._set_sensors(spots, sensing, range_sensors, ranging, known, carried)
        self.barrier, self.gate, self.separation = barrier, gate, separation
        self.clearance = "off" if self._limits is None and clearance is None else clearance
        stated = dict(robot.tuned.recovery)
        self._recovery_rules = RecoveryRules(**stated) if recovery is None else checked_recovery(recovery)
        self._gentle = GentleLimits(self._recovery_rules.acceleration)
        self._stages = Stages(robot, self._dt, self._known, self._carried, self._rules.max_age)
        self._stages.sense(self._sensing, self._field, self._evasion, self._ranging)
        self._stages.resolve(self._tasks, self._law)
        _ = self.verifies  # what it measures by is made here
        self.reset()

    def step(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        distances: ArrayLike | None = None,
        *,
        points: ArrayLike | None = None,
        ages: ArrayLike | None = None,
        images: Sequence[RangeImage] | None = None,
        now: float | None = None,
    ) -> Tick:
        """One tick. Never raises on data: what cannot be used is reported, and the robot brakes and holds.

        Args:
            q: Measured joint position (n,) [rad].
            qd: Measured joint velocity (n,) [rad/s].
            distances: Reading of every spot (k,) [m]; beyond its range, +inf included, it sees nothing; NaN, -inf and
                what is below zero are sick. An array (p, 3) is taken as `points`.
            points: Detected points (p, 3) instead, world frame [m]; each belongs to the wire link nearest to it.
            ages: How old the distances are, (k,) or one number [s]; fresh by default. Points have none.
            images: Of `range_sensors`, those that came since the last tick, late and out of step as they are.
            now: Present time on the clock of their stamps [s]; by default this tick's, `dt` times its number from 0.

        Returns:
            The tick, with the joint reference to send.
        """
        start, clocks = time.perf_counter(), self._enter()
        try:
            self._at_work = True
            tick = self._plan(q, qd, distances, points, ages, images, now)
        except BaseException as error:
            self._recovery.clocks = clocks  # the path waits for a robot that cannot go along
            if isinstance(error, BadInput):
                tick = self._brake(BAD_INPUT, in_words(error, kind=False))
            elif isinstance(error, Exception):  # the loop must go on: report, brake, hold
                tick = self._brake(FAULT, in_words(error))
            else:  # somebody ends the program: nothing has moved
                raise
        finally:
            self._at_work = False
        tick.severity, tick.unseen = self._unseen()
        self._advance(tick.reference)
        tick.solve_time = time.perf_counter() - start
        return tick

    def _plan(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        distances: ArrayLike | None,
        points: ArrayLike | None,
        ages: ArrayLike | None,
        images: Sequence[RangeImage] | None,
        now: float | None,
    ) -> Tick:
        """All that may fail, and all that asks parts of the user's making; the command does not advance here."""
        self._receive(images)
        if not self._active:  # the commanded configuration starts where the robot is
            here, _ = as_joint_position(q, self._robot), as_joint_velocity(qd, self._robot)
            self._q, self._active = np.array(here), True
            self._q.flags.writeable = False
            self._qd = self._qd_before = np.zeros(self._robot.nq)
        barrier, separation, recovery = self._barrier, self._separation, self._recovery

        # distances -> detected points (7) -> danger (1)-(6) -> virtual torque (8), (14), (15) -> evasive velocity (16)
        sense = self._stages.sense(self._sensing, self._field, self._evasion, self._ranging)
        seen = sense(q, qd, distances, points, ages, images, self._clock(now), self._person_speed)
        cdf_n, qd0 = seen.cdf_n, seen.qd0

        # activations (19), (21) and references, suspended and recovered (IV-C), by CLIK
        switches, activations, regime = self._switching(cdf_n)
        commanded, stall = RobotState(self._robot, self._q), self._stall
        old = NO_AGES if self._sensing is None else self._sensing.as_ages(ages)
        gate, people, leads = self.verifies, seen.people, seen.leads
        most = gate.hold(commanded, self._qd, people, old, leads) if gate is not None and len(people) else None
        if self._seq % stall.every == 0 or stall.held:
            capped = len(seen.points) > 0 and (barrier is not None or separation is not None)
            explained = seen.capped or not min(activations) >= 1.0 or capped or most is not None
            still = float(np.abs(qd0).max()) < CALM
            watched = self._tasks, self._law, recovery, commanded, self._qd
            stall.watch(self._seq, *watched, explained, still, near=lambda: self._near(commanded))
        samples = recovery.update(cdf_n, commanded, activations)
        tasks, active, law = self._tasks, activations, self._law
        if recovery.way is not None:  # back through the joints
            tasks, active, law = recovery.way.tasks, (min(activations),), _WAY_LAW

        # tasks + q̇0 + activations + limits (+ barrier) -> law -> q̇, checked
        limits, soft = self._limits, (*self._kept_clear(commanded), *self._kept_apart(q, seen, old))
        if recovery.phase == RECOVERING and limits is not None and not soft and most is None:
            limits = self._gentle.choose(limits, self._q, self._qd, self._acceleration)
        resolve = self._stages.resolve(tasks, law, most)
        given = (commanded, self._qd, self._qd_before, samples, qd0, active, limits, soft)
        if barrier is None:
            resolved = resolve(*given)
        else:
            resolved = self._stages.resolve_under(barrier, as_joint_position(q, self._robot), seen, resolve, given)
        command = resolved.command if separation is None else kept_apart(soft, resolved.command, resolved.box)
        if seen.capped:  # a sector is unseen
            command = slowed(command, commanded, self._rules.speed_cap, resolved.box)
        if stall.held:
            command = slower(self._braking, self._qd)
        gated, doubts = PASSED, _SILENT
        if gate is not None:
            command, doubts = command.copy(), self._stages.doubts(gate)
            gated = gate(self._q, self._qd, command, people, old, leads, len(people) > 0)
        messages = () if resolved.fine(limits) else judged(resolved, self._robot.joint_names, command)
        messages = (*stall.messages, *messages, *gated.notes, *seen.notes, *self._units.notes(distances, points))
        status, off_path = DEGRADED if messages else OK, None
        if not recovery.on_path:
            off_path = recovery.errors(commanded, samples)
        messages = (*doubts, *messages)  # doubts about the model are no fault of this tick
        reference, f = self._reference(command), switches[1] if len(switches) > 1 else 1.0
        events, names = recovery.due_events(), self._robot.joint_names
        return Tick(  # its fields in their order: given by name, they take three times as long
            reference, cdf_n, switches[0], f, activations, regime, recovery.phase, status, messages, 0.0,
            qd0, seen.points, seen.links, seen.vectors, seen.near, recovery.path_time, events, recovery.waits_for,
            CLEAR, _SILENT, names, self._labels, gated, resolved, off_path,
        )  # fmt: skip

    def _brake(self, status: str, message: str) -> Tick:
        """Brake towards standstill within the limits and hold."""
        braked = brake(self._braking, self._evasion, (self._q, self._qd, self._acceleration), self._robot)
        return Tick(
            reference=self._reference(braked.command),
            cdf_n=float("nan"),
            m=0.0,
            f=0.0,
            activations=(0.0,) * len(self._tasks),
            regime="unknown",
            phase=self._recovery.phase,
            status=status,
            messages=(message, *braked.messages),
            qd0=braked.qd0,
            path_time=self._recovery.path_time,
            joint_names=self._robot.joint_names,
            resolved=Resolved(braked.command, 0.0, False, braked.box),
        )

    def _reference(self, command: NDArray[np.float64]) -> JointReference:
        """Where a command (n,) [rad/s] leads; its arrays are nobody else's."""
        seq = self._seq + 1
        return JointReference(seq, seq * self._dt, self._q + command * self._dt, command, self._active)

    def _advance(self, reference: JointReference) -> None:
        """Take the step of a tick: the one place that does, after all that could fail."""
        self._seq = reference.seq
        self._qd_before, self._qd = self._qd, reference.qd.copy()
        self._q = reference.q.copy()
        self._q.setflags(write=False)  # tasks of any kind will see it
        self._recovery.pass_events()
