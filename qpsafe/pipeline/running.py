"""How a run of a controller begins anew, goes on from elsewhere, and trusts its sensors again."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from qpsafe.danger.activation import Activation, Switching
from qpsafe.errors import QpsafeError
from qpsafe.pipeline.checks import own_evasion
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

    _at_work = False

    def _enter(self) -> Any:
        """Begin a tick; returns the clocks of the path, to set them back.

        Raises:
            QpsafeError: One is being made: it would be integrated twice.
        """
        if self._at_work:
            raise QpsafeError("a tick is being made: `step` was called by one of its own parts, or by another thread")
        return self._recovery.clocks

    def __getstate__(self) -> dict[str, Any]:
        """A copy is in no tick, also one that a part of the controller makes within a tick."""
        return {**self.__dict__, "_at_work": False}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        own_evasion(self, self._evasion)

    def _switching(self, cdf_n: float) -> Switching:
        """Switches (19), (21), activations and regime; of a class of the user's, checked.

        Raises:
            ValueError: They are none.
        """
        found = self._activation.at(cdf_n)
        if type(self._activation).at is Activation.at:
            return found
        falling = all(above >= a for above, a in pairwise((1.0, *found[1], 0.0)))  # false for NaN
        if not (falling and len(found[1]) == len(self._tasks)):
            raise ValueError(f"the activations are {found[1]}, expected 1 >= a_1 >= ... >= 0, one a task")
        return found

    def reset(self) -> None:
        """Start anew: the next valid measurement sets the commanded configuration."""
        self._recovery = Recovery(self._tasks, self._activation.suspend_above, self._dt, self._recovery_rules)
        own_evasion(self, self._evasion).reset()
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
