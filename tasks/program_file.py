"""A program as a small TOML file that a person can edit; what is wrong in it is named with its line.

frame = "tcp"                     # of the robot; by default the tip of its (first) tool
cycle = true                      # begin again at the end
start = "left"                    # a point; by default where the robot's home pose is

[rates]                           # of all moves; a segment may have its own speed
speed = 0.1                       # m/s, m/s², m/s³, deg/s ...

[points]
left = { position = [0.45, 0.2, 0.5], euler = [180.0, 80.0, 180.0] }   # m; deg about z, y', x''
right = { position = [0.45, -0.2, 0.5] }                               # oriented as at the start
rest = { joints = [0.0, -5.0, 0.0, 0.0, 85.0, 0.0] }                   # deg

[vary]                            # the segments run once with each of these, one after the other
part = ["left", "right"]

[[segment]]
do = "line"                       # line, arc, joint, dwell or event
to = "part"
above = 0.1                       # m; 0 by default
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.tasks.moves import Arc, Dwell, JointMove, JointMoveOfFrame, Line, Move
from qpsafe.tasks.program import Program
from qpsafe.tasks.program_tables import ArcSegment, DwellSegment, EventSegment, JointSegment, Point, ProgramFile
from qpsafe.tasks.reach import UnreachableError, checked_poses, follow, joints_for
from qpsafe.tasks.rotation import exp3
from qpsafe.tasks.timing import Rates
from qpsafe.text.toml_text import TomlText
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]


class ProgramError(ConfigurationError):
    """A program file is wrong; `where` holds file and line."""


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
    text = TomlText.read(Path(path), ProgramError)
    return _program(text.text, text.path, robot)


def parse_program(text: str, name: str, robot: Robot) -> Program:
    """A program from its text; see `load_program`.

    Args:
        text: TOML.
        name: Of where it is from, for errors.
        robot: Robot that is to follow it.
    """
    return _program(text, name, robot)


@lru_cache(maxsize=8)
def _program(said: str, path: str | Path, robot: Robot) -> Program:
    """What a file says, for a robot. Neither it nor a program ever changes: the last ones are not followed again."""
    text = TomlText(said, path, ProgramError)
    return _Builder(text, text.checked(ProgramFile, lambda before, key: key not in _KINDS), robot).program()


_KINDS = ("line", "arc", "joint", "dwell", "event")
#: Poses along all moves: some ten seconds of checking.
MOST_CHECKS = 20_000


class _Builder:
    """Turns a checked file into moves, following them with the robot's joints."""

    def __init__(self, text: TomlText, file: ProgramFile, robot: Robot) -> None:
        self.wrong, self.file, self.robot = text.wrong, file, robot
        self.frame = robot.tool_frames[0] if file.frame is None else file.frame
        self.checks = 0  # so far, of poses along the moves
        if self.frame not in robot.frame_names:
            expected = f"one of {', '.join(robot.frame_names)}; without this key {robot.tool_frames[0]!r} is meant"
            raise self.wrong(["frame"], file.frame, expected)
        for name, point in file.points.items():
            if (point.joints is None) == (point.position is None) or (point.joints and point.euler):
                raise self.wrong(["points", name], point.model_dump(exclude_none=True), "either position or joints")
            if point.joints is not None:
                q = self.si(point.joints)
                good = q.shape == (robot.nq,) and (q >= robot.lower).all() and (q <= robot.upper).all()
                if not good:
                    raise self.wrong(
                        ["points", name, "joints"], point.joints, f"{robot.nq} positions inside the limits"
                    )
        self.round = 0  # of the segments, counted through what varies
        for name, choices in file.vary.items():
            if name in file.points:
                raise self.wrong(["vary", name], name, "a name that no point has")
            for choice in choices:
                if choice not in file.points:
                    raise self.wrong(["vary", name], choice, "points, of " + ", ".join(file.points))
        self.q: Array = robot.home
        self.first: Array = robot.pose(self.frame, self.q)  # gives the orientation of points without one
        if file.start is not None:
            self.q = self.joints(["start"], file.start)
            here = self.pose_of(["start"], file.start)
            self.first = robot.pose(self.frame, self.q)
            if file.points[self.chosen(file.start)].euler is not None:
                self.first[:3, :3] = here[:3, :3]
            self.first[:3, 3] = here[:3, 3]
        self.pose: Array = self.first  # where the frame is: as the points say, the joints only come near it

    def program(self) -> Program:
        moves: list[Move] = []
        events: list[tuple[int, str]] = []
        self.count(self.rounds * len(self.file.segment))
        for number in range(self.rounds):
            self.round = number
            for k, segment in enumerate(self.file.segment):
                if isinstance(segment, EventSegment):
                    events.append((len(moves), segment.name))
                    if segment.dwell > 0.0:
                        moves.append(Dwell(self.pose, segment.dwell))
                else:
                    moves.append(self.move(k, segment))
                    self.pose = moves[-1].sample(moves[-1].duration).pose
        if not moves:
            raise self.wrong(["segment"], "only events", "at least one move or dwell")
        try:
            return Program(moves, events, self.file.cycle, self.frame)
        except ConfigurationError as problem:
            raise self.wrong(["cycle"], self.file.cycle, f"an end at the start; {problem.expected}") from None

    def move(self, k: int, segment: Any) -> Move:
        if isinstance(segment, DwellSegment):
            return Dwell(self.pose, segment.time)
        key: list[str | int] = ["segment", k, "to"]
        robot, frame = self.robot, self.frame
        move: Line
        try:
            if isinstance(segment, JointSegment):
                goal = robot.nearest(self.joints(key, segment.to), self.q)
                share = self.file.rates.joints
                speed, acceleration = share * robot.max_velocity, share * robot.max_acceleration
                joints = JointMove(self.q, goal, speed, acceleration, acceleration / 0.1)
                self.q = goal
                return JointMoveOfFrame(robot, frame, joints)
            linear, angular = self.rates(segment.speed)
            if isinstance(segment, ArcSegment):
                via = self.target(["segment", k, "via"], segment.via)[:3, 3]
                move = Arc(self.pose, via, self.target(key, segment.to, segment.above), linear, angular)
            else:
                move = Line(self.pose, self.target(key, segment.to, segment.above), linear, angular)
            self.count(checked_poses(move))
            self.q = follow(robot, frame, move, self.q)
        except UnreachableError as problem:
            raise self.wrong(key, self.chosen(segment.to), f"a goal that can be reached so: {problem}") from None
        except ProgramError:
            raise
        except ConfigurationError as problem:  # of the move: its via, or where it goes with these rates
            name = problem.key if problem.key == "via" else "to"
            raise self.wrong(["segment", k, name], getattr(segment, name), problem.expected) from None
        return move

    @property
    def rounds(self) -> int:
        """How often the segments run before what varies begins anew."""
        return math.lcm(*(len(choices) for choices in self.file.vary.values()))

    def count(self, poses: int) -> None:
        """Give up where a program is so long that to follow it takes minutes."""
        self.checks += poses
        if self.checks > MOST_CHECKS:
            found = f"{counted(len(self.file.segment), 'segment')} in {counted(self.rounds, 'round')}"
            expected = f"a program with at most {MOST_CHECKS} poses to check; run it in parts, each from its own file"
            raise self.wrong(["segment"], found, expected)

    def rates(self, speed: float | None) -> tuple[Rates, Rates]:
        r = self.file.rates
        turning = np.deg2rad((r.angular_speed, r.angular_acceleration, r.angular_jerk)).tolist()
        return Rates(speed or r.speed, r.acceleration, r.jerk), Rates(*turning)

    def chosen(self, name: str) -> str:
        """The point a name stands for in this round."""
        choices = self.file.vary.get(name)
        return name if choices is None else choices[self.round % len(choices)]

    def point(self, keys: list, name: str) -> Point:
        name = self.chosen(name)
        if name not in self.file.points:
            raise self.wrong(keys, name, "one of the points " + ", ".join((*self.file.points, *self.file.vary)))
        return self.file.points[name]

    def target(self, keys: list, name: str, above: float = 0.0) -> Array:
        """Pose of a point, or that far above it (4, 4)."""
        pose = self.pose_of(keys, name)
        pose[2, 3] += above
        return pose

    def pose_of(self, keys: list, name: str) -> Array:
        point = self.point(keys, name)
        if point.joints is not None:
            return self.robot.pose(self.frame, self.si(point.joints)).copy()
        pose = self.first.copy()
        pose[:3, 3] = point.position
        if point.euler is not None:
            z, y, x = (exp3(np.deg2rad(a) * np.eye(3)[i]) for a, i in zip(point.euler, (2, 1, 0), strict=True))
            pose[:3, :3] = z @ y @ x
        return pose

    def si(self, joints: list[float]) -> Array:
        """Joint positions of the file, deg, or m where a joint slides, in SI units."""
        figures = np.array(joints)
        slides = self.robot.sliding if figures.shape == (self.robot.nq,) else False
        return np.where(slides, figures, np.deg2rad(figures))

    def joints(self, keys: list, name: str) -> Array:
        """Joint positions of a point (n,), the nearest that can be found."""
        point = self.point(keys, name)
        if point.joints is not None:
            return self.si(point.joints)
        goal = self.target(keys, name)
        problem: UnreachableError | None = None
        for guess in (self.q, self.robot.home):
            try:
                return joints_for(self.robot, self.frame, goal, guess)
            except UnreachableError as found:
                problem = problem or found
        raise self.wrong(keys, name, f"a point that can be reached: {problem}")
