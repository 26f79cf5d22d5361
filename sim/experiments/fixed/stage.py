"""Where the first experiment takes place for each robot: its pedestal, and how near the person comes.

Bundled robots are listed in fixed.toml. Any other robot gets its distances by a rule: in each direction, the board
pauses `MEDIUM_GAP` and then `CLOSE_GAP` beyond what the wire reaches there at home, about what the listed ones have.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.people.choreography import Approach, Choreography
from qpsafe.sim.people.person import Person

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

STAGES = Path(__file__).with_name("fixed.toml")
MEDIUM_GAP, CLOSE_GAP = 0.60, 0.32  # [m]
DIRECTIONS = ((0.0, 3.5), (72.0, 18.5), (-72.0, 36.0))  # azimuth [deg] and start [s] of each approach
PAUSE = 2.5  # the second pause [s]


class RobotStage(NamedTuple):
    """The surroundings of one robot.

    Attributes:
        pedestal: Height of its base above the floor [m].
        choreography: How the person moves.
        listed: Whether its distances were chosen for this very robot.
    """

    pedestal: float
    choreography: Choreography
    listed: bool


def robot_stage(robot: Robot) -> RobotStage:
    """The first experiment's stage for a robot."""
    table = tomllib.loads(STAGES.read_text(encoding="utf-8")).get(robot.name)
    if table is not None:
        pedestal, listed = (
            float(table["pedestal"]),
            [(a["azimuth"], a["start"], a["medium"], a["close"]) for a in table["approaches"]],
        )
    else:
        pedestal, listed = 0.55, [(azimuth, start, *gaps_beyond(robot, azimuth)) for azimuth, start in DIRECTIONS]
    approaches = tuple(
        Approach(math.radians(azimuth), start=start, medium_distance=medium, close_distance=close, close_pause=PAUSE)
        for azimuth, start, medium, close in listed
    )
    home = max(Choreography.home_radius, max(a.medium_distance for a in approaches) + 0.8)
    person = replace(Person(), floor=-pedestal)
    return RobotStage(pedestal, Choreography(approaches, person=person, home_radius=home), table is not None)


def gaps_beyond(robot: Robot, azimuth: float, tips: Sequence[NDArray[np.float64]] = ()) -> tuple[float, float]:
    """Distances of the board at both pauses, by the rule [m].

    Args:
        robot: The robot.
        azimuth: Direction in which people come [deg].
        tips: Where else its tool goes, (3,) each [m].
    """
    wire = robot.wire(robot.home, np.zeros(robot.nq))
    towards = np.array([math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth)), 0.0])
    reach = max(float((np.vstack([wire.starts, wire.ends, *tips]) @ towards).max()), 0.15)
    return reach + MEDIUM_GAP, reach + CLOSE_GAP
