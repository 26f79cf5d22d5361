"""Moves of a frame from one pose to another, at rest at both ends: lines, arcs, dwells, joint moves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.tasks.rotation import exp3, log3
from qpsafe.tasks.timing import Rates, TimeLaw
from qpsafe.tasks.trajectory import JointSample, Sample, checked_pose, checked_vector
from qpsafe.text.given import number, one_of
from qpsafe.text.words import call, counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

LINEAR = Rates(0.25, 1.0, 10.0)
ANGULAR = Rates(0.8, 3.0, 30.0)
SMALL = 1e-9  # m or rad: not a move


class Move(Protocol):
    """A reference pose from time 0 to `duration`, at rest at both ends."""

    duration: float

    def sample(self, t: float) -> Sample:
        """Reference at time t [s], at rest at the goal from `duration` on."""
        ...


class Line(Fixed):
    """Straight line, the orientation turning by the shortest way; one jerk-limited time law for both.

    Args:
        start, goal: Poses (4, 4).
        linear: Rates of the origin [m].
        angular: Rates of the orientation [rad].

    Raises:
        ConfigurationError: A pose is none, or start and goal are the same.
    """

    fixed = frozenset(("start", "goal", "law", "duration", "length", "angle"))

    def __init__(self, start: ArrayLike, goal: ArrayLike, linear: Rates = LINEAR, angular: Rates = ANGULAR) -> None:
        name = type(self).__name__
        for key, rates in (("linear", linear), ("angular", angular)):
            if not isinstance(rates, Rates):
                raise ConfigurationError(name, key, rates, "Rates(speed, acceleration, jerk)")
        self.start, self.goal = checked_pose(name, "start", start), checked_pose(name, "goal", goal)
        self._turn = log3(self.goal[:3, :3] @ self.start[:3, :3].T)
        self._turns = bool(self._turn.any())
        self._pose = self.start.copy()
        self._pose[3] = 0.0, 0.0, 0.0, 1.0  # to the last bit
        self._shift = self.goal[:3, 3] - self.start[:3, 3]
        #: Length of the path [m], and the angle by which the orientation turns [rad].
        self.length, self.angle = self._length(), float(np.linalg.norm(self._turn))
        if not SMALL < max(self.length, self.angle) < math.inf:
            expected = "a pose to move to, at a finite distance from the start"
            raise ConfigurationError(name, "goal", self.goal[:3, 3].tolist(), expected)
        sizes = (self._admissible(linear), self.length), (angular, self.angle)
        shares = [r.over(size) for r, size in sizes if size > SMALL]
        tightest = shares[0] if len(shares) == 1 else shares[0].both(shares[1])
        #: Time law of the share u of the way, from 0 to 1.
        self.law = TimeLaw([0.0], [1.0], [tightest.speed], [tightest.acceleration], [tightest.jerk])
        self.duration = self.law.duration

    def __repr__(self) -> str:
        return call(self, self.start[:3, 3], self.goal[:3, 3], duration=self.duration)

    def sample(self, t: float) -> Sample:
        """Reference at time t [s]."""
        u, du, _ = self.law.first(t)
        pose, twist = self._pose.copy(), np.empty(6)
        if self._turns:
            pose[:3, :3] = exp3(u * self._turn) @ self.start[:3, :3]
        pose[:3, 3], twist[:3] = self._place(u)
        twist[3:] = self._turn
        twist *= du
        return Sample(pose, twist)

    def _length(self) -> float:
        return float(np.linalg.norm(self._shift))

    def _admissible(self, linear: Rates) -> Rates:
        return linear

    def _place(self, u: float) -> tuple[Array, Array]:
        """Origin at the share u of the way, and its derivative with respect to u, (3,) each."""
        return self.start[:3, 3] + u * self._shift, self._shift


class Arc(Line):
    """Arc of a circle through a third point, the orientation turning by the shortest way.

    Args:
        start, goal: Poses (4, 4).
        via: Point on the way (3,) [m].
        linear: Rates along the arc [m]; the speed also keeps v²/r below the acceleration.
        angular: Rates of the orientation [rad].

    Raises:
        ConfigurationError: The three points lie on a line, or as for `Line`.
    """

    fixed = Line.fixed | {"centre", "radius"}

    def __init__(
        self,
        start: ArrayLike,
        via: ArrayLike,
        goal: ArrayLike,
        linear: Rates = LINEAR,
        angular: Rates = ANGULAR,
    ) -> None:
        a, c = checked_pose("Arc", "start", start)[:3, 3], checked_pose("Arc", "goal", goal)[:3, 3]
        b = checked_vector("Arc", "via", via, 3)
        # circumcentre of a, b, c
        u, v = b - a, c - a
        normal = np.cross(u, v)
        area = float(normal @ normal)
        if not area > 1e-6 * float(u @ u) * float(v @ v) or not area > 1e-18:
            raise ConfigurationError("Arc", "via", b.tolist(), "a point off the line from start to goal")
        self.centre = a + np.cross(float(u @ u) * v - float(v @ v) * u, normal) / (2.0 * area)
        self._arm = a - self.centre
        self.radius = float(np.linalg.norm(self._arm))
        self._side = np.cross(normal / math.sqrt(area), self._arm)
        x, y = float((c - self.centre) @ self._arm), float((c - self.centre) @ self._side)
        self._angle = math.atan2(y, x) % (2 * math.pi)
        super().__init__(start, goal, linear, angular)

    def _length(self) -> float:
        return self.radius * self._angle

    def _admissible(self, linear: Rates) -> Rates:
        speed = min(linear.speed, math.sqrt(linear.acceleration * self.radius))
        return Rates(speed, linear.acceleration, linear.jerk)

    def _place(self, u: float) -> tuple[Array, Array]:
        # r = c + a cos φ + b sin φ with φ = u Φ, b across a in the plane of the circle
        c, s = math.cos(u * self._angle), math.sin(u * self._angle)
        return self.centre + c * self._arm + s * self._side, self._angle * (c * self._side - s * self._arm)


class Dwell(Fixed):
    """Stay.

    Args:
        pose: (4, 4).
        duration: [s].
    """

    fixed = frozenset(("pose", "duration"))

    def __init__(self, pose: ArrayLike, duration: float) -> None:
        self.duration = number("Dwell", "duration", duration, "a finite time >= 0 [s]", 0.0)
        self.pose = checked_pose("Dwell", "pose", pose)

    def __repr__(self) -> str:
        return call(self, self.pose[:3, 3], duration=self.duration)

    def sample(self, t: float) -> Sample:
        """The pose, at rest."""
        return Sample(self.pose, np.zeros(6))


class JointMove(Fixed):
    """Joints from any state to rest at a goal, all arriving together: a trajectory for a `JointTask`.

    Args:
        start, goal: (n,) [rad].
        speed, acceleration, jerk: Largest ones (n,) [rad/s ...].
        velocity, start_acceleration: At the start (n,); zero by default.
    """

    fixed = frozenset(("law", "duration"))

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
        self.law = TimeLaw(start, goal, speed, acceleration, jerk, velocity, start_acceleration)
        self.duration = self.law.duration

    def __repr__(self) -> str:
        return call(self, *(self.law.at(t).position for t in (0.0, self.duration)), duration=self.duration)

    def sample(self, t: float) -> JointSample:
        """Joint positions and velocities at time t [s]."""
        motion = self.law.at(t)
        return JointSample(motion.position, motion.velocity)


class JointMoveOfFrame(Fixed):
    """A joint move as the pose of a frame, so that position and orientation tasks can follow it.

    Args:
        robot: The robot.
        frame: Frame whose pose is given.
        move: Of the robot's joints.

    Raises:
        ConfigurationError: The robot has no such frame, or other joints.
    """

    fixed = frozenset(("robot", "frame", "move", "duration"))

    def __init__(self, robot: Robot, frame: str, move: JointMove) -> None:
        name = type(self).__name__
        if not hasattr(robot, "frame_names"):
            raise ConfigurationError(name, "robot", robot, "a Robot, e.g. qpsafe.load_robot('irb140')")
        one_of(name, "frame", frame, tuple(robot.frame_names))
        expected = f"a JointMove of {counted(robot.nq, 'joint')}"
        sample = move.sample(0.0) if callable(getattr(move, "sample", None)) and not isinstance(move, type) else None
        if not isinstance(sample, JointSample) or sample.position.shape != (robot.nq,):
            raise ConfigurationError(name, "move", move, expected)
        self.duration = number(name, "move", getattr(move, "duration", None), expected, 0.0)
        self.robot, self.frame, self.move = robot, frame, move

    def __repr__(self) -> str:
        return call(self, self.frame, self.move)

    def sample(self, t: float) -> Sample:
        """Pose and twist J q̇ of the frame at time t [s]."""
        position, velocity = self.move.sample(t)
        state = self.robot.at(position)
        return Sample(state.pose(self.frame), state.jacobian(self.frame) @ velocity)
