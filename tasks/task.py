"""A task: what it controls, the trajectory that should follow, and its closed-loop inverse kinematics (CLIK)."""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.fixed import Fixed
from qpsafe.tasks.clik import Clik, pose_clik
from qpsafe.tasks.trajectory import Sample, Trajectory
from qpsafe.text.given import number
from qpsafe.text.words import call

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState


class Misfit(NamedTuple):
    """What a robot cannot do for a task: the argument, its value, and what would fit."""

    key: str
    value: object
    expected: str


class Task(Fixed, ABC):
    """Something the robot is asked to do, at one priority.

    A task controls a value x(q): a pose or joint positions. Its error e(x, x_d) and its Jacobian J belong together:
    with the reference at rest where the robot is, ė = -J q̇. CLIK (section IV-B.4) asks for J q̇ = ẋ_d + K e, closed on
    the commanded configuration.

    Args:
        trajectory: Where the value should be.
        gain: K [1/s]; 0 < K dt < 1 for a stable discrete loop.

    Raises:
        ConfigurationError: The gain is not a positive finite number, or the trajectory is none.
    """

    fixed = frozenset(("trajectory", "gain", "name", "frames", "essential"))
    #: Name shown in reports.
    name: str = "task"
    #: Frames the value is made of.
    frames: tuple[str, ...] = ()
    #: Whether a path waits, at its events and after a suspension, until this task is met.
    essential: bool = True

    def __init__(self, trajectory: Trajectory, gain: float) -> None:
        self.gain = number(type(self).__name__, "gain", gain, "a finite number > 0 [1/s]", above=0.0)
        if isinstance(trajectory, type) or not callable(getattr(trajectory, "sample", None)):
            expected = "a Trajectory, i.e. something with sample(t), e.g. FixedPose(pose)"
            raise ConfigurationError(type(self).__name__, "trajectory", trajectory, expected)
        self.trajectory = trajectory

    def __repr__(self) -> str:
        return call(self, *self.frames, self.trajectory, gain=self.gain)

    @property
    def label(self) -> str:
        """Its name and frames, as reports show them: ``position of tcp``."""
        return " of ".join((self.name, " in ".join(self.frames))) if self.frames else self.name

    @abstractmethod
    def value(self, state: RobotState) -> NDArray[np.float64]:
        """What the task controls, x: a pose (4, 4) or joint positions (n,)."""

    @abstractmethod
    def error(self, value: NDArray[np.float64], sample: Any) -> NDArray[np.float64]:
        """Error e (rows,) of a value against a sample of the trajectory; zero when the task is met."""

    def offset(self, value: NDArray[np.float64], sample: Any) -> NDArray[np.float64]:
        """How far a value is from a sample of the trajectory: what `sample.displaced` would have to move it by."""
        return sample.offset(value)

    @abstractmethod
    def jacobian(self, state: RobotState) -> NDArray[np.float64]:
        """Task Jacobian J (rows, n)."""

    @abstractmethod
    def velocity(self, error: NDArray[np.float64], sample: Any) -> NDArray[np.float64]:
        """CLIK velocity ẋ_d + K e, (rows,)."""

    def clik(self, state: RobotState, sample: Any) -> Clik:
        """Jacobian, CLIK velocity and error at a configuration.

        Built-in tasks compute them in one compiled call; a class derived from them that redefines one of the methods
        above comes back to this.
        """
        error = self.error(self.value(state), sample)
        return Clik(self.jacobian(state), self.velocity(error, sample), error)

    def __init_subclass__(cls) -> None:
        own = vars(cls)
        if "clik" not in own and any(key in own for key in ("value", "error", "jacobian", "velocity")):
            cls.clik = Task.clik  # type: ignore[method-assign]

    def settle(self) -> None:
        """Fix what the class says of the task: a controller that has it keeps its label."""
        for key in ("name", "frames", "essential"):
            self.__dict__.setdefault(key, getattr(self, key))

    def misfit(self, robot: Robot) -> Misfit | None:
        """Why `robot` cannot do this task, None if it can."""
        for frame in self.frames:
            if not (isinstance(frame, str) and frame in robot.frame_names):
                return Misfit("frame", frame, "one of " + ", ".join(robot.frame_names))
        return None


class PoseTask(Task):
    """A task on the pose of one frame.

    Args:
        frame: Frame of the robot that is to follow the trajectory.
        trajectory: Where it should be.
        gain: K [1/s].

    Raises:
        ConfigurationError: A bad gain, or `rows` that are none.
    """

    #: Rows of the geometric Jacobian that the task uses, of 0 to 5 in increasing order, linear before angular.
    rows: tuple[int, ...]

    fixed = Task.fixed | {"frame", "rows"}

    def __init__(self, frame: str, trajectory: Trajectory, gain: float) -> None:
        super().__init__(trajectory, gain)
        self.frame = frame
        self.__dict__.setdefault("frames", (frame,))
        self.__dict__["rows"] = self._checked_rows()  # compiled code does not look whether there is such a row
        first, last = self.rows[0], self.rows[-1]
        self._numbers = np.array(self.rows, dtype=np.int64)
        contiguous = self.rows == tuple(range(first, last + 1))
        self._rows = slice(first, last + 1) if contiguous else list(self.rows)  # a slice is the quicker one

    def _checked_rows(self) -> tuple[int, ...]:
        given = getattr(self, "rows", None)
        try:
            rows = tuple(sorted({operator.index(row) for row in given}))  # type: ignore[union-attr]
            good = rows == tuple(given) and len(rows) > 0 and 0 <= rows[0] <= rows[-1] < 6  # type: ignore[arg-type]
        except Exception:  # whatever a stranger's methods raise
            good = False
        if not good:
            raise ConfigurationError(type(self).__name__, "rows", given, "some of 0 to 5, in increasing order")
        return rows

    def value(self, state: RobotState) -> NDArray[np.float64]:
        """Pose of the frame (4, 4), world frame [m]."""
        return state.pose(self.frame)

    def jacobian(self, state: RobotState) -> NDArray[np.float64]:
        """Rows of the geometric Jacobian (rows, n), world axes."""
        return state.jacobian(self.frame)[self._rows]

    def velocity(self, error: NDArray[np.float64], sample: Sample) -> NDArray[np.float64]:
        """CLIK velocity ẋ_d + K e, (rows,)."""
        return sample.twist[self._rows] + self.gain * error

    @property
    def plain(self) -> bool:
        """Whether the task is what compiled code takes it for: e = rows of (x_d - x, log(R_d Rᵀ)) of one frame."""
        return type(self).clik is PoseTask.compiled_clik

    def compiled_clik(self, state: RobotState, sample: Sample) -> Clik:
        """`clik` in one compiled call, for e = rows of (x_d - x, log(R_d Rᵀ))."""
        quick = pose_clik(state, self.frame, self._numbers, self.gain, sample)
        return Task.clik(self, state, sample) if quick is None else quick
