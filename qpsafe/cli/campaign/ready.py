"""A plan for whatever robot was named: what the robot lacks is chosen, and what it cannot do is left out, all said."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from qpsafe.cli.common import console
from qpsafe.cli.demos.any_robot import any_robot, own_folder
from qpsafe.errors import ConfigurationError

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan


def plan_for_its_robot(where: str, plan: Plan, named: bool) -> Plan:
    """A plan whose robot has all that trials need, in motions that it can do; said on standard error.

    Args:
        where: The command, for errors.
        plan: With whatever robot.
        named: Whether its motions were asked for. Those that a plan has by default are left out where the robot cannot
            do them, since not every arm reaches the tables of pick-and-place.

    Raises:
        ConfigurationError: The robot cannot do what was asked for; before anything is played.
    """
    from qpsafe.robot.loader import bundled_robots, find_robot

    if plan.robot not in bundled_robots():
        ready = any_robot(where, plan.robot, own_folder(plan.robot), console(True), 4, "pick" in plan.motions)
        if (
            find_robot(plan.robot).suffix != ".toml"
            or ready.folder.resolve() != find_robot(plan.robot).parent.resolve()
        ):
            plan = replace(plan, robot=str(ready.folder))  # one was made for it
    from qpsafe.sim.campaign.trials.station import station

    able = []
    for motion in plan.motions:
        try:
            station(plan.robot, motion, cell=plan.cell)
        except ConfigurationError as refused:
            if named or motion == "hold":
                raise
            words = f"left out, since this robot cannot do it: the motion {motion!r} ({refused})"
            console(True).print(words, style="yellow", soft_wrap=True)
        else:
            able.append(motion)
    return replace(plan, motions=tuple(able))
