"""Clearance as rows of the QP: the robot does not come nearer to furniture, floor, what it carries or itself."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary, ref

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.fixed import Fixed
from qpsafe.geometry.clearance_kernel import clearance_rows
from qpsafe.geometry.clearance_level import ClearanceLevel
from qpsafe.geometry.clearance_work import rows_of, sizes_of
from qpsafe.geometry.measure import pairs_of
from qpsafe.geometry.nearness import blocks_of, tables_of
from qpsafe.geometry.never import never_nearer
from qpsafe.geometry.solids import Solids
from qpsafe.text.words import call, counted

if TYPE_CHECKING:
    from qpsafe.limits import JointLimits
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState

Array = NDArray[np.float64]
MARGIN = 0.004  # the nominal work of the third experiment comes within 8 mm of a plate [m]


class ClearanceLimit(Fixed):
    """Keeps the robot a margin away from known obstacles, from what it carries and from itself.

    A pair of points of two convex shapes at the distance d, with the normal n from one to the other, comes nearer by
    nᵀ J q̇. Its row is nᵀ J q̇ <= the lower of two bounds, with s = d - margin:

        (1)  the exact discrete `stopping_speed` of s at the deceleration Σ_j |nᵀ J|_j a_j
        (2)  nᵀ J q̇_now + W⁻¹(s - w),   w the farthest way along n while all joints brake, W(δ) the most that a speed
             of approach that is higher by δ leads farther, whichever joints add it (see `clearance_bound`)

    (1) says that the pair can be stopped in time when all joints go against the row together. That alone promises
    nothing: a joint near its own limits cannot, and a robot that brakes does not, since each joint then stops at its
    own a_j in its own time. (2) says that it stops in time when it brakes: where w has reached s, nothing may be added.
    With one joint in motion (2) is the stricter one, and that of the joint alone. Both are continuous: rounding never
    decides how fast the robot may go.

    Both see, to second order, that points move on bent ways while joints turn (`qpsafe.geometry.reach.bending`).

    **What is promised**, with n held: whoever obeys the row stays the margin away; and while the speeds of approach
    that he adds come from joints that approach, braking at the limits of all joints never leads nearer, at any of
    eight times until all stand. Braking obeys (2) at the next tick. **What is not**: n turns where edges pass each
    other; speed moved from one joint to another that brakes more slowly counts one tick later; limits of position and
    velocity may keep a joint from going against the row; rows of several pairs may conflict; and a tick has 16 rows at
    most, those with the least room. That is what the gate looks at, along the whole braking motion.

    Rows are soft, directly under the joint limits: a tick always has a solution. What is nearer than the margin is led
    away at 0.05 m/s. Pairs that cannot come nearer than the margin before the joints stand have no row, nor has a row
    that no velocity of the next tick can break. Pairs nearer than 0.05 m have several: of further vertices that lean
    towards the other shape, each with its own distance and normal, so that q̇ does not jump where the nearest point
    does.

    Laws by projections, `NullspaceLaw`, know no inequalities: they ignore these rows too.

    Args:
        robot: The robot.
        solids: It, what it carries and known obstacles.
        margin: How near they may come [m], >= 0; half as near as at home where that is less.

    Raises:
        ConfigurationError: The margin is no such number, or the solids are of another robot.
    """

    fixed = frozenset(("solids", "margin", "blocks", "size"))

    def __init__(self, robot: Robot, solids: Solids, margin: float = MARGIN) -> None:
        if not (isinstance(margin, int | float) and 0.0 <= margin < math.inf):
            raise ConfigurationError("ClearanceLimit", "margin", margin, "a finite distance >= 0 [m]")
        if not isinstance(solids, Solids):
            raise ConfigurationError("ClearanceLimit", "solids", solids, "Solids.of(robot, ...)")
        self.solids, self.margin = solids, float(margin)
        #: For compiled code, see `nearness.tables_of`.
        self.blocks = _blocks_for(solids, robot, self.margin)
        self._pairs = tables_of(*self.blocks).pairs
        #: Joints and shapes.
        self.size = robot.nq, len(solids.names)
        self._memory: tuple[Array, NDArray[np.int64]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """A copy makes memory of its own: views of this one would be torn from it."""
        return {**self.__dict__, "_memory": None, "_rows": None}

    def __repr__(self) -> str:
        words = counted(len(self._pairs), "pair")
        return call(self, words, margin=self.margin)

    def level(self, state: RobotState, qd: Array, limits: JointLimits) -> ClearanceLevel | None:
        """The rows of a tick; None where nothing can come too near.

        Args:
            state: Commanded configuration.
            qd: Commanded velocity (n,) [rad/s].
            limits: Joint limits of the tick.
        """
        if self._memory is None:
            a, b = sizes_of(*self.size)
            self._memory = np.zeros(a), np.zeros(b, dtype=np.int64)
            self._rows = rows_of(*self._memory, *self.size)
        count = clearance_rows(state.memory, qd, limits.table, limits.dt, *self.blocks, *self._memory)
        if count == 0:
            return None
        rows = self._rows
        A, high, gaps = rows.A[:count].copy(), rows.high[:count].copy(), rows.gaps[:count].copy()
        return ClearanceLevel(A, high, gaps, self._pairs[rows.which[:count]], self.solids.names)


_kept: WeakKeyDictionary[Solids, tuple[ref[Robot], float, tuple[Array, NDArray[np.int64]]]] = WeakKeyDictionary()


def _blocks_for(solids: Solids, robot: Robot, margin: float) -> tuple[Array, NDArray[np.int64]]:
    """The blocks of pairs that may come nearer than a margin [m]; the last ones are kept: controllers of a cell share
    its solids.
    """
    if solids in _kept:
        of, at, blocks = _kept[solids]
        if of() is robot and at == margin:
            return blocks
    never = never_nearer(solids, robot, margin)
    own = [pair for pair in map(tuple, solids.own.tolist()) if pair not in never]
    blocks = blocks_of(solids, robot, np.vstack((solids.furniture, pairs_of(own))), margin)
    _kept[solids] = ref(robot), margin, blocks
    return blocks


def checked_clearance(
    clearance: ClearanceLimit | str | None, robot: Robot, solids: Callable[[], Solids]
) -> ClearanceLimit | None:
    """What a `SafetyController` keeps clear by: the default for None, None for "off".

    The default is none either where the robot's collision geometry cannot be read.

    Args:
        clearance: As given.
        robot: Whose.
        solids: Makes the solids of the default.

    Raises:
        ConfigurationError: It is no such limit, or one of a robot with another number of joints.
    """
    if isinstance(clearance, str) and clearance == "off":
        return None
    if clearance is None:
        try:
            return ClearanceLimit(robot, solids())
        except RobotFileError:
            return None
    if not isinstance(clearance, ClearanceLimit):
        raise ConfigurationError("SafetyController", "clearance", clearance, 'a ClearanceLimit or "off"')
    if clearance.size[0] != robot.nq:
        joints = counted(clearance.size[0], "joint")
        raise ConfigurationError("SafetyController", "clearance", f"one for {joints}", f"one for {robot.nq}")
    return clearance
