"""How a run of a controller begins anew, goes on from elsewhere, and trusts its sensors again."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from qpsafe.pipeline.parts import Parts
from qpsafe.recovery.recovery import Recovery
from qpsafe.recovery.stall import StallWatch

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Running(Parts):
    """A `SafetyController` between two ticks."""

    _stall: StallWatch
    _seq: int
    _active: bool
    _q: NDArray[np.float64]

    def reset(self) -> None:
        """Start anew: the next valid measurement sets the commanded configuration."""
        self._recovery = Recovery(self._tasks, self._activation.suspend_above, self._dt, self._recovery_rules)
        self._evasion.reset()
        self._reset_sensors()
        rules = self._recovery_rules
        self._stall = StallWatch(self._robot, self._dt, rules.tolerance, rules.patience)
        self._seq, self._active = -1, False
        self._q = self._robot.home
        self._qd = self._qd_before = np.zeros(self._robot.nq)

    def reseed(self) -> None:
        """Something else has moved or stopped the robot: the next valid measurement sets the commanded configuration.

        The path's clock stays, and the robot is led back to its path as after a suspension.
        """
        self._evasion.reset()
        self._recovery.set_tasks(self._tasks, self._activation.suspend_above, restart=False)
        self._active = False
        self._qd = self._qd_before = np.zeros(self._robot.nq)
