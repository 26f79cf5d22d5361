"""The safety controller: one `step` every 4 ms, from distances to joint references."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.danger.activation import Activation, Threshold
from qpsafe.danger.evasion import Evasion, link_vectors, virtual_torque
from qpsafe.danger.field import DangerField, danger_vectors
from qpsafe.errors import ConfigurationError
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.problem import Law, LawProblem, TaskVelocity
from qpsafe.limits import Box, JointLimits
from qpsafe.recovery import Recovery
from qpsafe.reference import JointReference
from qpsafe.sensing.detection import BadInput, as_detection, as_joint_vector
from qpsafe.sensing.hold import PointHold
from qpsafe.sensing.spots import SpotArray, load_spots
from qpsafe.tick import BAD_INPUT, DEGRADED, FAULT, OK, Tick

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.tasks.task import Task

#: Virtual mass [N m s²/rad] and damping [N m s/rad] of every joint, tuned on the first experiment.
DEFAULT_MASS, DEFAULT_DAMPING = 4.0, 20.0


class SafetyController:
    """Danger in, joint references out.

    Args:
        robot: The robot.
        tasks: What it is asked to do, highest priority first.
        law: How tasks and evasion are combined; `HierarchicalLaw()` by default.
        dt: Tick [s]; the IRC5 wants 0.004.
        field: The danger field; the source's weights by default.
        activation: Thresholds of the tasks; the source's for one or two tasks.
        evasion: The admittance (16).
        limits: Joint limits, by default the robot's; None switches them off (to compare laws, never on a robot).
        spots: The distance sensors, needed for `step(q, qd, distances)`; by default the robot's own, if it has any.
        hold_time: How long a point still counts after its spot lost it [s].

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
        hold_time: float = 0.3,
    ) -> None:
        _check(robot, tasks, law, dt)
        self.robot = robot
        self.tasks = tuple(tasks)
        self.law = HierarchicalLaw() if law is None else law
        self.dt = float(dt)
        self.field = DangerField() if field is None else field
        self.activation = _default_activation(self.tasks) if activation is None else activation
        if len(self.activation.thresholds) != len(self.tasks):
            found = len(self.activation.thresholds)
            raise ConfigurationError("SafetyController", "activation", f"{found} thresholds", f"{len(self.tasks)}")
        self.evasion = evasion or Evasion(DEFAULT_MASS, DEFAULT_DAMPING, robot.nq, self.dt)
        own = JointLimits(robot.lower, robot.upper, robot.max_velocity, robot.max_acceleration, self.dt)
        if isinstance(limits, str) and limits != "robot":
            raise ConfigurationError("SafetyController", "limits", limits, '"robot", a JointLimits or None')
        self.limits = own if isinstance(limits, str) else limits
        self._brake_limits = self.limits or own
        self.spots = load_spots(robot) if spots is None else spots
        self._hold = PointHold(hold_time, self.dt)
        self.reset()

    def reset(self) -> None:
        """Start anew: the next valid measurement sets the commanded configuration."""
        self.recovery = Recovery(self.tasks, self.activation.suspend_above, self.dt)
        self.evasion.reset()
        self._hold.reset()
        self._seq = -1
        self._active = False
        self._q = self.robot.home.copy()
        self._qd = np.zeros(self.robot.nq)

    def step(
        self, q: ArrayLike, qd: ArrayLike, distances: ArrayLike | None = None, *, points: ArrayLike | None = None
    ) -> Tick:
        """One tick. Never raises on data: what cannot be used is reported, and the robot brakes and holds.

        Args:
            q: Measured joint position (n,) [rad].
            qd: Measured joint velocity (n,) [rad/s].
            distances: Reading of every spot (k,) [m]; beyond its range, +inf included, it sees nothing. An array (p, 3)
                is taken as `points`.
            points: Detected points (p, 3) instead, world frame [m]; each belongs to the wire link nearest to it.

        Returns:
            The tick, with the joint reference to send.
        """
        start = time.perf_counter()
        self._seq += 1
        try:
            tick = self._step(q, qd, distances, points)
        except BadInput as problem:
            tick = self._brake(BAD_INPUT, str(problem))
        except Exception as error:  # the loop must go on: report, brake, hold
            tick = self._brake(FAULT, f"{type(error).__name__}: {error}")
        tick.solve_time = time.perf_counter() - start
        return tick

    def _step(self, q: ArrayLike, qd: ArrayLike, distances: ArrayLike | None, points: ArrayLike | None) -> Tick:
        q = as_joint_vector("q", q, self.robot.nq)
        qd = as_joint_vector("qd", qd, self.robot.nq)
        if not self._active:  # the commanded configuration starts where the robot is
            self._q, self._qd, self._active = q.copy(), np.zeros(self.robot.nq), True

        # spot distances -> detected points (7)
        measured = self.robot.at(q)
        wire = measured.wire(qd)
        seen = as_detection(measured, wire, self.spots, self._hold, distances, points)

        # danger (1)-(6); its vectors summed per link (8), as virtual torque (14), (15), as evasive velocity (16)
        danger, gradient = self.field.evaluate(seen.points, wire)
        vectors = danger_vectors(danger, gradient)
        if not (np.isfinite(danger).all() and np.isfinite(vectors).all()):
            raise BadInput("the danger of a detected point is not finite: joint values or points are out of all bounds")
        cdf_n = float(danger.max(initial=0.0))  # L∞ norm over the points
        forces = link_vectors(vectors, seen.links, len(self.robot.wire_frames))
        qd0 = self.evasion.step(virtual_torque(measured, forces))

        # activations (19), (21) and references, suspended and recovered (IV-C), by CLIK
        activations = self.activation.activations(cdf_n)
        commanded = self.robot.at(self._q)
        samples = self.recovery.update(cdf_n, commanded.pose, activations)
        tasks = []
        for task, sample in zip(self.tasks, samples, strict=True):
            error = task.error(commanded.pose(task.frame), sample)
            tasks.append(TaskVelocity(task.jacobian(commanded), task.velocity(error, sample)))

        # tasks + q̇0 + activations + limits -> law -> q̇, checked
        box = self.limits.box(self._q, self._qd) if self.limits else None
        bounds = (box.lower, box.upper) if box else (None, None)
        result = self.law.solve(LawProblem(tuple(tasks), qd0, activations, *bounds))
        if not np.isfinite(result.qd).all():
            return self._brake(FAULT, "the law returned a velocity that is not finite")
        status, messages, command = self._inside(result.qd, box)
        if result.status != "solved":
            status, messages = DEGRADED, (*messages, f"law: {result.status}")

        # integrate -> joint reference
        self._advance(command)
        switches = self.activation.switches(cdf_n)
        return Tick(
            reference=self._reference(),
            cdf_n=cdf_n,
            m=switches[0],
            f=switches[1] if len(switches) > 1 else 1.0,
            activations=activations,
            regime=self.activation.regime(cdf_n),
            phase=self.recovery.phase,
            status=status,
            messages=messages,
            qd0=qd0,
            points=seen.points,
            links=seen.links,
            vectors=vectors,
            errors=self._path_errors(commanded),
            path_time=self.recovery.path_time,
            box=box,
            law=result,
            joint_names=self.robot.joint_names,
        )

    def _inside(self, qd: NDArray[np.float64], box: Box | None) -> tuple[str, tuple[str, ...], NDArray[np.float64]]:
        """The law's velocity, clipped to the box where it knew no limits, with status and messages."""
        if box is None:
            return OK, (), qd
        command = box.clip(qd)
        messages = box.notes(self.robot.joint_names)
        excess = np.abs(command - qd)
        if excess.max() > 1e-9:
            names = [name for name, e in zip(self.robot.joint_names, excess, strict=True) if e > 1e-9]
            messages = (*messages, "the law exceeded the limits, clipped: " + ", ".join(names))
        return (DEGRADED if messages else OK), messages, command

    def _brake(self, status: str, message: str) -> Tick:
        """Brake towards standstill within the limits and hold."""
        box = self._brake_limits.box(self._q, self._qd)
        self._advance(box.clip(np.zeros(self.robot.nq)))
        none = (0.0,) * len(self.tasks)
        return Tick(
            reference=self._reference(),
            cdf_n=float("nan"),
            m=0.0,
            f=0.0,
            activations=none,
            regime="unknown",
            phase=self.recovery.phase,
            status=status,
            messages=(message,),
            qd0=self.evasion.velocity,
            path_time=self.recovery.path_time,
            box=box,
            joint_names=self.robot.joint_names,
        )

    def _advance(self, command: NDArray[np.float64]) -> None:
        self._qd = command
        self._q = self._q + command * self.dt

    def _reference(self) -> JointReference:
        return JointReference(self._seq, self._seq * self.dt, self._q.copy(), self._qd.copy(), self._active)

    def _path_errors(self, state: RobotState) -> tuple[NDArray[np.float64], ...]:
        """Errors against the tasks' own trajectories, not against a recovery move."""
        t = self.recovery.path_time
        return tuple(task.error(state.pose(task.frame), task.trajectory.sample(t)) for task in self.tasks)


def _default_activation(tasks: tuple[Task, ...]) -> Activation:
    """The source's thresholds: (18) for one task, (22) for two."""
    if len(tasks) == 1:
        return Activation((Threshold(11.5, 0.15),))
    if len(tasks) == 2:
        return Activation()
    raise ConfigurationError(
        "SafetyController", "activation", None, f"an Activation with {len(tasks)} thresholds for as many tasks"
    )


def _check(robot: Robot, tasks: Sequence[Task], law: Law | None, dt: float) -> None:
    """Refuse a configuration that cannot work, by name."""
    from qpsafe.tasks.task import Task

    if not hasattr(robot, "wire_frames"):
        raise ConfigurationError("SafetyController", "robot", robot, "a Robot, e.g. qpsafe.load_robot('irb140')")
    if not tasks:
        raise ConfigurationError("SafetyController", "tasks", tasks, "at least one task")
    if not (isinstance(dt, int | float) and np.isfinite(dt) and dt > 0.0):
        raise ConfigurationError("SafetyController", "dt", dt, "a finite time > 0 [s]")
    if law is not None and not callable(getattr(law, "solve", None)):
        raise ConfigurationError("SafetyController", "law", law, "a law with solve(problem), e.g. HierarchicalLaw()")
    for k, task in enumerate(tasks):
        if not isinstance(task, Task):
            raise ConfigurationError("SafetyController", f"tasks[{k}]", task, "a Task, e.g. PositionTask")
        if task.frame not in robot.frame_names:
            expected = "one of " + ", ".join(robot.frame_names)
            raise ConfigurationError("SafetyController", f"tasks[{k}].frame", task.frame, expected)
        if not task.gain * dt < 1.0:
            expected = f"less than 1/dt = {1.0 / dt:g} for a stable loop"
            raise ConfigurationError("SafetyController", f"tasks[{k}].gain", task.gain, expected)
