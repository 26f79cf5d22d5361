"""The second experiment for any robot: a line through its home pose, as long as the arm is, and how near people come.

The bundled line is the IRB 140's. Another robot's tool goes along y through where home has it, over the same share of
the arm's length (0.4 m at most, so that two passes fit before somebody comes), and turns by the same 20 degrees;
shorter until `qpsafe check` finds nothing wrong with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.check.check import check_path
from qpsafe.check.report import troubles
from qpsafe.errors import ConfigurationError
from qpsafe.sim.experiments.fixed.stage import gaps_beyond, robot_stage
from qpsafe.sim.experiments.shared.home import Arm
from qpsafe.sim.people.choreography import Approach, Choreography
from qpsafe.tasks.program_file import ProgramError, parse_program
from qpsafe.tasks.rotation import euler_zyx, exp3

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot
    from qpsafe.tasks.program import Program

Array = NDArray[np.float64]

LENGTH, ARM = 0.4, 0.945  # of the line, and of the arm that has it, the IRB 140's with its tool [m]
LENGTHS = 0.75 ** np.arange(6)  # shares of that that are tried
SHORTEST = 0.1  # a line that is worth following [m]
TURN = 20.0  # of the tool on the way [deg]
#: Azimuth [deg] and start [s] of each approach: quiet for two passes, then from the front, then from the left.
DIRECTIONS = ((0.0, 9.0), (60.0, 24.0))
PAUSE = 2.0  # at the close distance [s]
TEXT = """# The second experiment's line for this robot: through its home pose, made by qpsafe.

frame = "{frame}"
cycle = true
start = "left"

[rates]
speed = {speed}                # m/s
acceleration = {acceleration}         # m/s^2
jerk = {jerk}                 # m/s^3

[points]                   # m, robot base frame; degrees about z, y', x''
left = {{ position = {left}, euler = {left_euler} }}
right = {{ position = {right}, euler = {right_euler} }}

[[segment]]
do = "line"
to = "right"

[[segment]]
do = "line"
to = "left"
"""


@lru_cache(maxsize=8)
def line_for(robot: Robot, rates: tuple[float, float, float] = (0.1, 0.5, 5.0)) -> str:
    """The text of a program that the robot's (first) tool can follow.

    Args:
        robot: The robot.
        rates: Speed, acceleration and jerk [m/s, m/s², m/s³]; halved until the robot can.

    Raises:
        ConfigurationError: No line of 10 cm or more through its home pose is one; says what is wrong with the last.
    """
    arm, wrong = Arm.of(robot), ""
    whole = LENGTH * min(arm.length / ARM, 1.0)
    for length, slower in product(whole * LENGTHS, (1.0, 0.5)):
        if length < SHORTEST:
            break
        text = _line(robot, arm.tool, length, [slower * rate for rate in rates])
        try:
            check = check_path(robot, parse_program(text, "the line", robot), sensors=False)
            if check.good:
                return text
            wrong = "; ".join(troubles(check))
        except ProgramError as problem:
            wrong = problem.expected
    expected = f"one whose tool can follow a line of {SHORTEST:g} m through its home pose, or a --program ({wrong})"
    raise ConfigurationError("the second experiment", "robot", robot.name, expected)


def _line(robot: Robot, tool: str, length: float, rates: Sequence[float]) -> str:
    pose = robot.pose(tool, robot.home)
    places = {}
    for name, side in (("left", 1.0), ("right", -1.0)):
        turned = exp3(np.array([0.0, 0.0, side * math.radians(TURN / 2)])) @ pose[:3, :3]
        places[name] = _numbers(pose[:3, 3] + [0.0, side * length / 2, 0.0])
        places[f"{name}_euler"] = _numbers(np.degrees(euler_zyx(turned)))
    named = dict(zip(("speed", "acceleration", "jerk"), rates, strict=True))
    return TEXT.format(frame=tool, **places, **named)


def _numbers(values: Array) -> str:
    return "[" + ", ".join(repr(round(float(value), 9) + 0.0) for value in values) + "]"


def walk_for(robot: Robot, program: Program) -> Choreography:
    """How people come: both pauses as far beyond what the arm reaches along the line as in the first experiment."""
    ends = [program.sample(share * program.duration).pose[:3, 3] for share in np.linspace(0.0, 1.0, 9)]
    stage = robot_stage(robot)
    approaches = []
    for azimuth, start in DIRECTIONS:
        medium, close = gaps_beyond(robot, azimuth, ends)
        approaches.append(Approach(math.radians(azimuth), start, medium, close, close_pause=PAUSE))
    home = max(Choreography.home_radius, max(a.medium_distance for a in approaches) + 0.8)
    return Choreography(tuple(approaches), person=stage.choreography.person, home_radius=home)
