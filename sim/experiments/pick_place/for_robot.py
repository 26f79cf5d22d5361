"""The third experiment for any robot: tables, support and box where its arm reaches them, and the people beside them.

The bundled cell is the IRB 140's. For another robot that cannot work in it, it is moved as a whole: sideways and ahead
in proportion to the arm's length, its tables to a height at which the arm works well; the robot's pedestal is as high
as it takes for the tables to stay at the height of people's hands. Of the layouts whose every hole can be reached, the
one farthest from singular poses and limits with which `qpsafe check` finds nothing wrong is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.check.check import CLEARANCE, check_path
from qpsafe.check.report import troubles
from qpsafe.errors import ConfigurationError
from qpsafe.sensing.body import body_hulls
from qpsafe.sim.experiments.pick_place.cell import PROGRAM, TABLE_TOP, Box, Cell, Screw, Support, Table
from qpsafe.sim.experiments.shared.home import Arm, quality
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.scene import build_scene
from qpsafe.sim.world.tool_axis import tool_axis, turned_to
from qpsafe.tasks.program_file import ProgramError, parse_program
from qpsafe.tasks.reach import UnreachableError, joints_for
from qpsafe.tasks.rotation import euler_zyx, exp3

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

ROBOT = "irb140"  # whose cell is the bundled one
ARM, SHOULDER = 0.945, 0.352  # its length with the tool, and the height of its shoulder [m]
HANDS = 0.88  # height of the tables above the floor [m]
SCALES = (1.0, 0.9, 0.8, 0.7, 1.1)  # of the layout, beside the arm's
DROPS = (0.0, -0.15, -0.3, 0.1)  # of the tables, beside their height below the IRB 140's shoulder, in arm lengths
YAWS = np.radians((180.0, 0.0, 90.0, -90.0))  # of the tool about the vertical
#: Speed, acceleration and jerk of the moves that are not slow, as the bundled program has them, and for slower joints.
RATES = ((0.45, 1.5, 12.0), (0.25, 0.6, 5.0))
TRIED = 4  # layouts that are checked as a whole


class Work(NamedTuple):
    """What a robot does in the third experiment.

    Attributes:
        cell: Where things stand.
        program: Text of the program.
        pedestal: Height of the robot's base above the floor [m].
        robot: Whose it is.
    """

    cell: Cell
    program: str
    pedestal: float
    robot: str

    @property
    def sentence(self) -> str:
        """The layout in words."""
        (x, y), top = self.cell.support.centre, self.cell.top
        return (
            f"tables {top:.2f} m above the base of {self.robot}, support and box {x:.2f} m ahead and {y:.2f} m aside, "
            f"on a pedestal of {self.pedestal:.2f} m"
        )


class _Found(NamedTuple):
    """What was found for a robot.

    Attributes:
        work: With all its sensors; None where there is none.
        in_the_way: Sensors that are all that is wrong with another layout; none if there is no such layout.
        refused: Why there is no work.
    """

    work: Work | None
    in_the_way: frozenset[str] = frozenset()
    refused: ConfigurationError | None = None


def work_for(robot: Robot) -> Work:
    """The cell and the program that suit a robot.

    Raises:
        ConfigurationError: None was found; says what is wrong with the best.
    """
    found = _searched(robot)
    if found.work is None:
        assert found.refused is not None
        why = found.refused
        raise ConfigurationError(why.where, why.key, why.value, why.expected)
    return found.work


def in_the_way(robot: Robot) -> frozenset[str]:
    """Names of the sensors without which there is work for a robot: they would take what stands there for danger.

    Args:
        robot: One whose sensors may be put elsewhere.

    Returns:
        None of them where there is work with all, or where they are not what is wrong.
    """
    found = _searched(robot)
    return frozenset() if found.work is not None else found.in_the_way


@lru_cache(maxsize=8)
def _searched(robot: Robot) -> _Found:
    """Look for work, once: every layout is checked with the sensors, whether it is theirs or not what is wrong."""
    usual = Work(Cell(), PROGRAM.read_text(encoding="utf-8"), HANDS - TABLE_TOP, robot.name)
    if robot.name == ROBOT:
        return _Found(usual)
    named, wrong = frozenset[str](), "no hole of the support and the box were both in reach, tool down"
    try:
        for work in _layouts(robot, usual):
            trouble, seen = _wrong(robot, work)
            if not trouble:
                return _Found(work)
            named = named or seen
            wrong = wrong if work is usual else trouble
    except ConfigurationError as refused:  # it is found out once
        return _Found(None, named, refused)
    expected = f"one that reaches support and box of some layout, tool down, or people and a --program for it ({wrong})"
    return _Found(None, named, ConfigurationError("the third experiment", "robot", robot.name, expected))


def _layouts(robot: Robot, usual: Work) -> Iterator[Work]:
    """What may suit a robot: the bundled cell, then others, the best first.

    Args:
        robot: The robot.
        usual: The bundled work.

    Raises:
        ConfigurationError: No layout can suit its tool.
    """
    yield usual
    arm = Arm.of(robot)
    axis = tool_axis(robot, arm.tool)
    _check_tip(robot, arm.tool, axis)
    down = turned_to(axis, np.array([0.0, 0.0, -1.0]))
    found = []
    for scale, drop in product(SCALES, DROPS):
        top = float(arm.shoulder[2]) + TABLE_TOP - SHOULDER + drop * arm.length
        if not 0.1 < HANDS - top <= 1.8:
            continue
        cell = _cell(scale * arm.length / ARM, top)
        for yaw in YAWS:
            turn = exp3(np.array([0.0, 0.0, yaw])) @ down
            worth = _worth(robot, arm, cell, turn)
            if worth > 0.0:
                found.append((worth, cell, turn))
    found.sort(key=lambda item: -item[0])
    for (_, cell, turn), rates in product(found[:TRIED], RATES):
        yield Work(cell, _program(arm.tool, cell, turn, rates), HANDS - cell.top, robot.name)


def _check_tip(robot: Robot, tool: str, axis: Array) -> None:
    """Whether the tip leads: what reaches beyond it strikes the plate that screws stand in.

    Raises:
        ConfigurationError: It does not; names what is in its way.
    """
    body, place = robot.mounting(tool)
    ahead = place[:3, :3] @ axis
    beyond = [
        (float(((v - place[:3, 3]) @ ahead).max()), name) for owner, name, v in body_hulls(robot) if owner == body
    ]
    most, name = max(beyond, default=(0.0, ""))
    room = Screw.HEAD - CLEARANCE
    if most > room:
        found = f"{robot.name}: {name} reaches {1e3 * most:.1f} mm beyond {tool}"
        expected = f"a tool whose tip leads, by all but {1e3 * room:.0f} mm: screws stand out no farther"
        raise ConfigurationError("the third experiment", "robot", found, expected)


def _wrong(robot: Robot, work: Work) -> tuple[str, frozenset[str]]:
    """What is wrong with work, in words, nothing if it can be done; and the sensors, if nothing but these is wrong."""
    try:
        program = parse_program(work.program, f"the work chosen for {robot.name}", robot)
    except ProgramError as problem:
        return problem.expected, frozenset()
    scene = build_scene(robot, pedestal=HANDS - work.cell.top, people=(), furnish=work.cell.furnish)
    check = check_path(robot, program, known=known_obstacles(scene))
    seen = () if troubles(check._replace(sightings=None)) else check.sightings or ()
    return "; ".join(troubles(check)), frozenset(sighting.spot for sighting in seen)


def _cell(scale: float, top: float) -> Cell:
    """The bundled cell, its pieces as large as they are and moved apart."""
    x, y = Support().centre[0] * scale, Support().centre[1] * scale
    aside, ahead = 0.03, 0.05  # of the tables' middles, from support and box
    tables = (Table("left table", (x + ahead, y + aside)), Table("right table", (x + ahead, -y - aside)))
    return Cell(Support((x, y)), Box((x, -y)), tables, top=top)


def _points(cell: Cell) -> dict[str, Array]:
    """Where the tool goes, by the names of the bundled program."""
    (x, _), (bx, by), top = cell.support.centre, cell.box.centre, cell.top
    named = {"over box": np.array([bx, by + 0.01, top + 0.17]), "front": np.array([x + 0.08, 0.0, top + 0.21])}
    # the farther row of the support is the second one
    rows = cell.holes.reshape(cell.support.rows, cell.support.columns, 3)
    return named | {f"hole_{k}": hole for k, hole in enumerate(rows.reshape(-1, 3), 1)}


def _worth(robot: Robot, arm: Arm, cell: Cell, turn: Array) -> float:
    """The least `quality` over the corners of the work, reached one from the other; 0 if one cannot be."""
    points = _points(cell)
    lifted = np.array([0.0, 0.0, 0.12])
    holes = [points[f"hole_{k}"] for k in (1, 5, 10, 6)]
    way = [points["over box"], points["front"], *(p for hole in holes for p in (hole + lifted, hole))]
    q, worst, pose = robot.home, np.inf, np.eye(4)
    pose[:3, :3] = turn
    for place in way:
        pose[:3, 3] = place
        try:
            q = joints_for(robot, arm.tool, pose, q, steps=60)
        except UnreachableError:
            return 0.0
        worst = min(worst, quality(robot, arm, q))
    return float(worst)


def _program(tool: str, cell: Cell, turn: Array, rates: tuple[float, ...]) -> str:
    """The bundled program with another frame, other points and other rates."""
    text = PROGRAM.read_text(encoding="utf-8")
    head, rest = text.split("[points]", 1)
    tail = rest[rest.index("[vary]") :]
    head = head.replace('frame = "tcp"', f'frame = "{tool}"')
    for key, usual, rate in zip(("speed", "acceleration", "jerk"), RATES[0], rates, strict=True):
        head = head.replace(f"{key} = {usual!r}", f"{key} = {rate!r}")
    euler = _numbers(np.degrees(euler_zyx(turn)))
    lines = ["[points]"]
    for name, place in _points(cell).items():
        oriented = f", euler = {euler}" if name == "over box" else ""
        lines.append(f'"{name}" = {{ position = {_numbers(place)}{oriented} }}')
    return head + "\n".join(lines) + "\n\n" + tail


def _numbers(values: Array) -> str:
    return "[" + ", ".join(repr(round(float(value), 9) + 0.0) for value in values) + "]"
