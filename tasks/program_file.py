"""A program as a small TOML file that a person can edit; what is wrong in it is named with its line.

frame = "tcp"                     # of the robot; the tool's tip
cycle = true                      # begin again at the end
start = "left"                    # a point; by default where the robot's home pose is

[rates]                           # of all moves; a segment may have its own speed
speed = 0.1                       # m/s, m/s², m/s³, deg/s ...

[points]
left = { position = [0.45, 0.2, 0.5], euler = [180.0, 80.0, 180.0] }   # m; deg about z, y', x''
right = { position = [0.45, -0.2, 0.5] }                               # oriented as at the start
rest = { joints = [0.0, -5.0, 0.0, 0.0, 85.0, 0.0] }                   # deg

[[segment]]
do = "line"                       # line, arc, joint, dwell or event
to = "right"
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qpsafe.errors import ConfigurationError
from qpsafe.tasks.lines import line_of
from qpsafe.tasks.moves import Arc, Dwell, JointMove, JointMoveOfFrame, Line, Move
from qpsafe.tasks.program import Program
from qpsafe.tasks.reach import UnreachableError, follow, joints_for
from qpsafe.tasks.rotation import exp3
from qpsafe.tasks.timing import Rates

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]
_Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Positive = Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=False)]
_Vector = tuple[_Finite, _Finite, _Finite]
_Name = Annotated[str, Field(strict=True, min_length=1)]


class ProgramError(ConfigurationError):
    """A program file is wrong; `where` holds file and line."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Rates(_Table):
    speed: _Positive = 0.25
    acceleration: _Positive = 1.0
    jerk: _Positive = 10.0
    angular_speed: _Positive = 45.0
    angular_acceleration: _Positive = 180.0
    angular_jerk: _Positive = 1800.0
    joints: Annotated[float, Field(strict=True, gt=0.0, le=1.0)] = 0.3  # share of the robot's own limits


class _Point(_Table):
    position: _Vector | None = None
    euler: _Vector | None = None
    joints: list[_Finite] | None = None


class _Line(_Table):
    do: Literal["line"]
    to: _Name
    speed: _Positive | None = None


class _Arc(_Table):
    do: Literal["arc"]
    via: _Name
    to: _Name
    speed: _Positive | None = None


class _Joint(_Table):
    do: Literal["joint"]
    to: _Name


class _Dwell(_Table):
    do: Literal["dwell"]
    time: _Positive


class _Event(_Table):
    do: Literal["event"]
    name: _Name
    dwell: Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=False)] = 0.0


_Segment = Annotated[_Line | _Arc | _Joint | _Dwell | _Event, Field(discriminator="do")]


class _File(_Table):
    frame: _Name = "tcp"
    cycle: Annotated[bool, Field(strict=True)] = False
    start: _Name | None = None
    rates: _Rates = _Rates()
    points: dict[str, _Point] = {}
    segment: Annotated[list[_Segment], Field(min_length=1)]


def load_program(path: str | Path, robot: Robot) -> Program:
    """Read a program, and check that the robot can follow it from its start to its end.

    Args:
        path: The TOML file.
        robot: Robot that is to follow it.

    Raises:
        ProgramError: Names file, line, key and value of what is wrong: malformed TOML, an unknown key, kind, frame or
            point, a move to where the frame is already, poses out of reach or past a joint limit, joints too fast, a
            cycle that does not close.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise ProgramError(path, "file", str(problem), "a readable TOML file") from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        found = re.search(r"at line (\d+)", str(problem))
        line = found.group(1) if found else str(len(text.splitlines()))
        raise ProgramError(f"{path}:{line}", "file", str(problem), "well-formed TOML") from None
    try:
        file = _File.model_validate(table)
    except ValidationError as problem:
        first = problem.errors()[0]
        keys = [key for key in first["loc"] if not (isinstance(key, str) and key in _KINDS)]
        missing = first["type"] == "missing"
        value = "nothing" if missing else first["input"]
        raise _wrong(path, text, keys, value, first["msg"]) from None
    return _Builder(path, text, file, robot).program()


_KINDS = ("line", "arc", "joint", "dwell", "event")


class _Builder:
    """Turns a checked file into moves, following them with the robot's joints."""

    def __init__(self, path: Path, text: str, file: _File, robot: Robot) -> None:
        self.path, self.text, self.file, self.robot = path, text, file, robot
        if file.frame not in robot.frame_names:
            raise self.wrong(["frame"], file.frame, "one of " + ", ".join(robot.frame_names))
        for name, point in file.points.items():
            if (point.joints is None) == (point.position is None) or (point.joints and point.euler):
                raise self.wrong(["points", name], point.model_dump(exclude_none=True), "either position or joints")
            if point.joints is not None:
                q = np.deg2rad(point.joints)
                good = q.shape == (robot.nq,) and (q >= robot.lower).all() and (q <= robot.upper).all()
                if not good:
                    raise self.wrong(["points", name, "joints"], point.joints, f"{robot.nq} angles inside the limits")
        self.q: Array = robot.home
        self.first: Array = robot.pose(file.frame, self.q)  # gives the orientation of points without one
        if file.start is not None:
            self.q = self.joints(["start"], file.start)
            self.first = robot.pose(file.frame, self.q)

    def program(self) -> Program:
        moves: list[Move] = []
        events: list[tuple[int, str]] = []
        for k, segment in enumerate(self.file.segment):
            if isinstance(segment, _Event):
                events.append((len(moves), segment.name))
                if segment.dwell > 0.0:
                    moves.append(Dwell(self.pose, segment.dwell))
            else:
                moves.append(self.move(k, segment))
        if not moves:
            raise self.wrong(["segment"], "only events", "at least one move or dwell")
        try:
            return Program(moves, events, self.file.cycle)
        except ConfigurationError as problem:
            raise self.wrong(["cycle"], self.file.cycle, f"an end at the start; {problem.expected}") from None

    @property
    def pose(self) -> Array:
        return self.robot.pose(self.file.frame, self.q)

    def move(self, k: int, segment: Any) -> Move:
        if isinstance(segment, _Dwell):
            return Dwell(self.pose, segment.time)
        key, robot, frame = ["segment", k, "to"], self.robot, self.file.frame
        move: Move
        try:
            if isinstance(segment, _Joint):
                goal = self.joints(key, segment.to)
                share = self.file.rates.joints
                speed, acceleration = share * robot.max_velocity, share * robot.max_acceleration
                joints = JointMove(self.q, goal, speed, acceleration, acceleration / 0.1)
                self.q = goal
                return JointMoveOfFrame(robot, frame, joints)
            linear, angular = self.rates(segment.speed)
            if isinstance(segment, _Arc):
                via = self.target(["segment", k, "via"], segment.via)[:3, 3]
                move = Arc(self.pose, via, self.target(key, segment.to), linear, angular)
            else:
                move = Line(self.pose, self.target(key, segment.to), linear, angular)
            self.q = follow(robot, frame, move, self.q)
        except UnreachableError as problem:
            raise self.wrong(key, segment.to, f"a goal that can be reached so: {problem}") from None
        except ProgramError:
            raise
        except ConfigurationError as problem:
            name = "to" if problem.key == "goal" else problem.key
            raise self.wrong(["segment", k, name], getattr(segment, name), problem.expected) from None
        return move

    def rates(self, speed: float | None) -> tuple[Rates, Rates]:
        r = self.file.rates
        turning = np.deg2rad((r.angular_speed, r.angular_acceleration, r.angular_jerk)).tolist()
        return Rates(speed or r.speed, r.acceleration, r.jerk), Rates(*turning)

    def point(self, keys: list, name: str) -> _Point:
        if name not in self.file.points:
            raise self.wrong(keys, name, "one of the points " + ", ".join(self.file.points))
        return self.file.points[name]

    def target(self, keys: list, name: str) -> Array:
        """Pose of a point (4, 4)."""
        point = self.point(keys, name)
        if point.joints is not None:
            return self.robot.pose(self.file.frame, np.deg2rad(point.joints))
        pose = self.first.copy()
        pose[:3, 3] = point.position
        if point.euler is not None:
            z, y, x = (exp3(np.deg2rad(a) * np.eye(3)[i]) for a, i in zip(point.euler, (2, 1, 0), strict=True))
            pose[:3, :3] = z @ y @ x
        return pose

    def joints(self, keys: list, name: str) -> Array:
        """Joint positions of a point (n,), the nearest that can be found."""
        point = self.point(keys, name)
        if point.joints is not None:
            return np.deg2rad(point.joints)
        goal = self.target(keys, name)
        problem: UnreachableError | None = None
        for guess in (self.q, self.robot.home):
            try:
                return joints_for(self.robot, self.file.frame, goal, guess)
            except UnreachableError as found:
                problem = problem or found
        raise self.wrong(keys, name, f"a point that can be reached: {problem}")

    def wrong(self, keys: list, value: object, expected: str) -> ProgramError:
        return _wrong(self.path, self.text, keys, value, expected)


def _wrong(path: Path, text: str, keys: list, value: object, expected: str) -> ProgramError:
    name = ""
    for key in keys:
        name += f"[{key}]" if isinstance(key, int) else f".{key}" if name else str(key)
    return ProgramError(f"{path}:{line_of(text, keys)}", name, value, expected)
