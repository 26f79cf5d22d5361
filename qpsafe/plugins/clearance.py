"""What keeps a robot clear of furniture and itself in a loop of mink or pink: rows G Δq <= h."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.geometry.clearance import ClearanceLimit
from qpsafe.geometry.clearance_level import ClearanceLevel
from qpsafe.geometry.solids import Solids
from qpsafe.hqp.solve import solve_hierarchy
from qpsafe.limits import JointLimits
from qpsafe.plugins.checks import checked_danger, checked_prefix, same_tick, updated
from qpsafe.plugins.monitor import DangerMonitor
from qpsafe.plugins.rows import OnRobot
from qpsafe.sensing.hulls import Obstacle

Array = NDArray[np.float64]
Carried = Mapping[str, Sequence[Obstacle]]


class ClearanceRows(OnRobot):
    """nᵀ J q̇ <= what can be stopped in time, of pairs of points that could come too near, times dt.

    The rows of `qpsafe.geometry.clearance.ClearanceLimit`, at the configuration that `solve_ik` has, with the velocity
    and the joint limits of the monitor. There they are soft; here they may not make a call fail, so where they cannot
    be met within the monitor's box h is widened to what comes nearest to that, as the soft level would.
    """

    danger: DangerMonitor
    clearance: ClearanceLimit

    def set_up(
        self, danger: DangerMonitor, known: Sequence[Obstacle], carried: Carried | None, margin: float, prefix: str
    ) -> None:
        """Check and keep the arguments of the constructor.

        Args:
            danger: What knows the robot's state and limits.
            known: Obstacles, in the robot's own world frame.
            carried: What tools carry, by frame.
            margin: How near the robot may come [m].
            prefix: What stands before the joints' names in the model.
        """
        self.danger, self.prefix = checked_danger("ClearanceLimit", danger), checked_prefix("ClearanceLimit", prefix)
        self.robot = danger.robot
        self.clearance = ClearanceLimit(danger.robot, Solids.of(danger.robot, known, carried), margin)
        self._own = JointLimits.of(danger.robot, danger.dt)

    def level(self, configuration: Any, dt: float) -> tuple[ClearanceLevel, Array] | None:
        """Rows on q̇ (n,) and their widened bounds (rows,) [m/s]; None where nothing can come too near."""
        danger = same_tick(updated(self.danger), dt, "ClearanceLimit")
        state = self.at(configuration)
        limits = self._own if isinstance(danger.limits, str) else danger.limits
        level = self.clearance.level(state, danger.qd, limits)
        if level is None:
            return None
        box = limits.box(state.q, danger.qd) if danger.box is None else danger.box
        best = solve_hierarchy([level], box.lower, box.upper).qd
        return level, np.maximum(level.upper, level.A @ best)

    def rows(self, configuration: Any, dt: float) -> tuple[Array, Array] | None:
        """(G, h) with G Δq <= h; None where nothing can come too near."""
        found = self.level(configuration, dt)
        return None if found is None else (self.joints(configuration).spread(found[0].A), found[1] * dt)
