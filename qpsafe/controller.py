"""The safety controller: one `step` every 4 ms, from distances to joint references."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.checks import check_arguments, check_parts, checked_activation, checked_spots
from qpsafe.danger.activation import Activation
from qpsafe.danger.barrier import DangerBarrier
from qpsafe.danger.evasion import Evasion
from qpsafe.danger.field import DangerField
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.nullspace import NullspaceLaw
from qpsafe.laws.problem import Law
from qpsafe.laws.weighted import WeightedLaw
from qpsafe.limits import JointLimits
from qpsafe.quick import Quick
from qpsafe.recovery import RECOVERING, Recovery, RecoveryRules
from qpsafe.reference import JointReference
from qpsafe.resolve import Resolved, judged, resolve
from qpsafe.returns import GentleLimits
from qpsafe.robot.state import RobotState
from qpsafe.sense import Sensed, sense
from qpsafe.sensing.detection import BadInput, as_joint_position, as_joint_velocity
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.sensing.spots import SpotArray, load_spots
from qpsafe.speed_cap import slowed
from qpsafe.stall import StallWatch
from qpsafe.tick import BAD_INPUT, DEGRADED, FAULT, OK, Tick

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.tasks.task import Task

#: Virtual mass [N m s²/rad] and damping [N m s/rad] of every joint, tuned on the first experiment.
DEFAULT_MASS, DEFAULT_DAMPING = 4.0, 20.0
_CALM = 0.01  # [rad/s] evasive velocity that does not explain motion
_BUNDLED = (HierarchicalLaw, NullspaceLaw, WeightedLaw)  # an own law may keep from what nobody else knows
_WAY_LAW = HierarchicalLaw()


class SafetyController:
    """Danger in, joint references out.

    Args:
        robot: The robot.
        tasks: What it is asked to do, highest priority first.
        law: How tasks and evasion are combined; `HierarchicalLaw()` by default.
        dt: Tick [s]; the IRC5 wants 0.004.
        field: The danger field; the source's weights by default.
        activation: Thresholds of the tasks; the robot's for one or two tasks (the source's on the IRB 140).
        evasion: The admittance (16).
        limits: Joint limits, by default the robot's; None switches them off (to compare laws, never on a robot).
        spots: The distance sensors, needed for `step(q, qd, distances)`; by default the robot's own, if it has any.
        sensing: What counts as danger, and what sick sensors do.
        known: Known obstacles of the surroundings: points on them are no danger.
        carried: What tools may carry, by the frame it is fixed to and in its axes: seen as part of the robot.
        barrier: A cap on the danger field, beyond the source; none by default.
        recovery: How the robot returns to its path after danger.

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
        evasion: Evasion | None = None,
        limits: JointLimits | str | None = "robot",
        spots: SpotArray | None = None,
        sensing: SensingRules | None = None,
        known: Sequence[Obstacle] = (),
        carried: Mapping[str, Sequence[Obstacle]] | None = None,
        barrier: DangerBarrier | None = None,
        recovery: RecoveryRules | None = None,
    ) -> None:
        check_arguments(robot, tasks, law, dt)
        check_parts(robot, dt, field, activation, evasion, limits)
        self.robot = robot
        self.tasks = tuple(tasks)
        self.law = HierarchicalLaw() if law is None else law
        self.dt = float(dt)
        self.field = DangerField() if field is None else field
        self.activation = checked_activation(self.tasks, activation, robot)
        self.evasion = evasion or Evasion(DEFAULT_MASS, DEFAULT_DAMPING, robot.nq, self.dt)
        own = JointLimits(robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, self.dt)
        self.limits = own if isinstance(limits, str) else limits
        self._brake_limits = self.limits or own
        self.spots = load_spots(robot) if spots is None else checked_spots(spots, robot)
        self.rules = SensingRules() if sensing is None else sensing
        self.sensing = DistanceSensing(robot, self.spots, self.dt, self.rules, known, carried) if self.spots else None
        self.barrier = barrier
        self.recovery_rules = RecoveryRules() if recovery is None else recovery
        self._quick, self._gentle = Quick(robot), GentleLimits(self.recovery_rules.acceleration)
        self.reset()

    def reset(self) -> None:
        """Start anew: the next valid measurement sets the commanded configuration."""
        self.recovery = Recovery(self.tasks, self.activation.suspend_above, self.dt, self.recovery_rules)
        self.evasion.reset()
        if self.sensing is not None:
            self.sensing.reset()
        self._stall = StallWatch(self.robot, self.dt, self.recovery_rules.tolerance, self.recovery_rules.patience)
        self._seq = -1
        self._active = False
        self._q = self.robot.home.copy()
        self._qd = self._qd_before = np.zeros(self.robot.nq)

    def reseed(self) -> None:
        """Something else has moved or stopped the robot: the next valid measurement sets the commanded configuration.

        The path's clock stays, and the robot is led back to its path as after a suspension.
        """
        self.evasion.reset()
        self.recovery.set_tasks(self.tasks, self.activation.suspend_above, restart=False)
        self._active = False
        self._qd = self._qd_before = np.zeros(self.robot.nq)

    def acknowledge(self) -> None:
        """A person has seen to the sensors: those that work again are trusted again, a stop they caused is lifted."""
        if self.sensing is not None:
            self.sensing.acknowledge()

    def set_tasks(self, tasks: Sequence[Task], activation: Activation | None = None, *, restart: bool = False) -> None:
        """Redefine or reorder the tasks, from the next tick on; the command goes on inside the limits.

        Where the robot is not on the new tasks' trajectories, it is led there as after a suspension.

        Args:
            tasks: What it is asked to do now, highest priority first.
            activation: Their thresholds; by default the present ones if the number of tasks stays.
            restart: Whether the trajectories' clock, and their events, start from zero; else it goes on.

        Raises:
            ConfigurationError: Names the argument that is wrong; the tasks are then as they were.
        """
        check_arguments(self.robot, tasks, self.law, self.dt)
        check_parts(self.robot, self.dt, None, activation, None, None)
        if activation is None and len(tasks) == len(self.tasks):
            activation = self.activation
        activation = checked_activation(tuple(tasks), activation, self.robot)
        self.tasks, self.activation = tuple(tasks), activation
        self.recovery.set_tasks(self.tasks, activation.suspend_above, restart)

    def pause(self) -> None:
        """Bring the path's clock to rest within `recovery_rules.ramp`; danger is evaded as ever."""
        self.recovery.paused = True

    def resume(self) -> None:
        """Let the path's clock run again."""
        self.recovery.paused = False

    def step(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        distances: ArrayLike | None = None,
        *,
        points: ArrayLike | None = None,
        ages: ArrayLike | None = None,
    ) -> Tick:
        """One tick. Never raises on data: what cannot be used is reported, and the robot brakes and holds.

        Args:
            q: Measured joint position (n,) [rad].
            qd: Measured joint velocity (n,) [rad/s].
            distances: Reading of every spot (k,) [m]; beyond its range, +inf included, it sees nothing; NaN, -inf and
                what is below zero are sick. An array (p, 3) is taken as `points`.
            points: Detected points (p, 3) instead, world frame [m]; each belongs to the wire link nearest to it.
            ages: How old the distances are, (k,) or one number [s]; fresh by default.

        Returns:
            The tick, with the joint reference to send.
        """
        start = time.perf_counter()
        self._seq += 1
        clocks = self.recovery.clocks
        try:
            tick = self._step(q, qd, distances, points, ages)
        except BadInput as problem:
            tick = self._brake(BAD_INPUT, str(problem))
        except Exception as error:  # the loop must go on: report, brake, hold; the path waits for the robot
            self.recovery.clocks = clocks
            tick = self._brake(FAULT, f"{type(error).__name__}: {error}")
        if self.sensing is not None:
            tick.severity, tick.unseen = self.sensing.health.severity, self.sensing.unseen
        tick.solve_time = time.perf_counter() - start
        return tick

    def _step(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        distances: ArrayLike | None,
        points: ArrayLike | None,
        ages: ArrayLike | None,
    ) -> Tick:
        if not self._active:  # the commanded configuration starts where the robot is
            here, _ = as_joint_position(q, self.robot), as_joint_velocity(qd, self.robot)
            self._q, self._active = np.array(here), True
            self._q.flags.writeable = False
            self._qd = self._qd_before = np.zeros(self.robot.nq)

        # distances -> detected points (7) -> danger (1)-(6) -> virtual torque (8), (14), (15) -> evasive velocity (16)
        parts = self.sensing, self.field, self.evasion
        seen = None if self.barrier else self._quick.sensed(q, qd, distances, points, ages, *parts)
        if seen is None:
            seen = sense(self.robot, q, qd, distances, points, ages, *parts)
        cdf_n, qd0 = seen.cdf_n, seen.qd0

        # activations (19), (21) and references, suspended and recovered (IV-C), by CLIK
        switches, activations, regime = self.activation.at(cdf_n)
        commanded = RobotState(self.robot, self._q)
        stall = self._stall
        if self._seq % stall.every == 0 or stall.held:
            self._look(seen, commanded, activations)
        samples = self.recovery.update(cdf_n, commanded, activations)
        tasks, active, law, way = self.tasks, activations, self.law, self.recovery.way
        if way is not None:  # back through the joints
            tasks, active, law = way.tasks, (min(activations),), _WAY_LAW

        # tasks + q̇0 + activations + limits (+ barrier) -> law -> q̇, checked
        limits, qdd = self.limits, (self._qd - self._qd_before) / self.dt
        if self.recovery.phase == RECOVERING and limits:
            limits = self._gentle.choose(limits, self._q, self._qd, qdd)
        resolver = None if self.barrier or way else self._quick.resolver(tasks, law, limits)
        resolved = None if resolver is None else resolver(commanded, self._qd, samples, qd0, activations)
        if resolved is None:
            box = limits.box(self._q, self._qd, qdd) if limits else None
            barrier = self.barrier and self.barrier.level(seen.measured, self._qd, seen.points, seen.danger)
            soft = (barrier,) if barrier else ()
            resolved = resolve(commanded, tasks, samples, qd0, active, law, box, soft, self.dt)
        command, usual = resolved.command, resolved.excess <= 1e-9 and resolved.solved
        messages = () if usual else judged(resolved, self.robot.joint_names)
        if self.barrier:  # exact, as far as the acceleration limits allow
            command = self.barrier.scale(seen.measured, command, seen.points).factor * command
            command = box.clip(command) if box else command
        if seen.capped:  # a sector is unseen
            command = slowed(command, commanded, self.rules.speed_cap, resolved.box)

        if stall.held:
            command = self._braked()

        # integrate -> joint reference, now that nothing of the user's can fail any more
        path_time = self.recovery.path_time
        off_path = None if self.recovery.on_path else partial(_errors, self.tasks, commanded, path_time)
        messages = (*stall.messages, *messages, *seen.notes)
        return Tick(
            reference=self._advance(command),
            cdf_n=cdf_n,
            m=switches[0],
            f=switches[1] if len(switches) > 1 else 1.0,
            activations=activations,
            regime=regime,
            phase=self.recovery.phase,
            status=DEGRADED if messages else OK,
            messages=messages,
            qd0=qd0,
            points=seen.points,
            links=seen.links,
            vectors=seen.vectors,
            path_time=path_time,
            events=self.recovery.take_events(),
            waits_for=self.recovery.waits_for,
            joint_names=self.robot.joint_names,
            resolved=resolved,
            off_path=off_path,
        )

    def _brake(self, status: str, message: str) -> Tick:
        """Brake towards standstill within the limits and hold."""
        box = self._brake_limits.box(self._q, self._qd)
        slower = self._braked()
        qd0 = self.evasion.step(np.zeros(self.robot.nq)).copy()  # no danger is known: what was known fades
        none = (0.0,) * len(self.tasks)
        return Tick(
            reference=self._advance(slower),
            cdf_n=float("nan"),
            m=0.0,
            f=0.0,
            activations=none,
            regime="unknown",
            phase=self.recovery.phase,
            status=status,
            messages=(message,),
            qd0=qd0,
            path_time=self.recovery.path_time,
            joint_names=self.robot.joint_names,
            resolved=Resolved(slower, 0.0, False, box, None, ()),
        )

    def _braked(self) -> NDArray[np.float64]:
        """The last command, braked as hard as allowed: inside the box, whose speeds can all be braked."""
        most = self._brake_limits.max_acceleration * self.dt
        return self._qd - np.clip(self._qd, -most, most)

    def _look(self, seen: Sensed, commanded: RobotState, activations: tuple[float, ...]) -> None:
        """See whether the robot does not get on, with nothing to explain it; lead it back another way if need be."""
        stall, recovery = self._stall, self.recovery
        explained = seen.capped or not min(activations) >= 1.0 or (self.barrier and len(seen.points) > 0)
        explained = explained or recovery.way is not None
        if explained and stall.held:
            stall.clear()
        if self._seq % stall.every == 0:
            bundled = isinstance(self.law, _BUNDLED)
            calm = bundled and float(np.abs(seen.qd0).max()) < _CALM
            stall.look(self.tasks, commanded, self._qd, recovery.path_time, explained, calm)
            if stall.stalled and stall.met is not None and bundled and recovery.lead(stall.met):
                stall.clear()

    def _advance(self, command: NDArray[np.float64]) -> JointReference:
        """Integrate; the reference's arrays are nobody else's."""
        self._qd_before, self._qd = self._qd, command.copy()
        self._q = self._q + command * self.dt
        self._q.flags.writeable = False  # tasks of any kind will see it
        return JointReference(self._seq, self._seq * self.dt, self._q.copy(), command, self._active)


def _errors(tasks: Sequence[Task], state: RobotState, time: float) -> tuple[NDArray[np.float64], ...]:
    """Errors against the tasks' own trajectories, not against the way back to them."""
    return tuple(task.error(task.value(state), task.trajectory.sample(time)) for task in tasks)
