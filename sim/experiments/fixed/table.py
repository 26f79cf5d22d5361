"""The first experiment on several robots, one row each: regimes in order, limits held, distance gained."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from qpsafe.sim.experiments.shared.report import Report

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


class RobotRow(NamedTuple):
    """What one run of the first experiment shows.

    Attributes:
        robot: Its name.
        joints, links: Numbers of joints and of wire links.
        in_order: Approaches whose regimes came in the order of Table I, and all approaches.
        peak: Largest CDF_n.
        limits_held: Whether no joint passed a limit of position, velocity or acceleration.
        gained: Smallest distance to the board with the controller minus without, of each approach [m].
        returned: Position error 10 s after the last withdrawal [mm], as the report words it; "" in a short run.
        kept: Whether the run kept every promise.
    """

    robot: str
    joints: int
    links: int
    in_order: tuple[int, int]
    peak: float
    limits_held: bool
    gained: tuple[float, ...]
    returned: str
    kept: bool

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self._asdict()


def robot_row(robot: Robot, report: Report) -> RobotRow:
    """The row of one robot's run."""
    order = [check.kept for check in report.checks if check.name.startswith("order of Table I")]
    limits = [check.kept for check in report.checks if check.name.startswith("joint ")]
    returned = [check.measured for check in report.checks if check.name.startswith("position error 10 s")]
    return RobotRow(
        robot=robot.name,
        joints=robot.nq,
        links=len(robot.wire_frames),
        in_order=(sum(order), len(order)),
        peak=max((row.cdf_n for row in report.regimes), default=0.0),
        limits_held=all(limits),
        gained=tuple(row.with_controller - row.without_controller for row in report.approaches),
        returned=returned[0] if returned else "",
        kept=report.kept,
    )
