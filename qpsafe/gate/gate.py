"""The gate of one robot: verifies each command before it is sent, and says what it held back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qpsafe.fixed import Fixed
from qpsafe.gate import workspace
from qpsafe.gate.gate_kernel import CAUSE, PERSON_NEAR, POINT, SHARE, SHORT, TOLD, WHO, let_through
from qpsafe.gate.gated import NO_AGES, PASSED, Gated
from qpsafe.gate.pack import bare_links, pack, robot_capsules, surroundings
from qpsafe.gate.rules import VerifiedMotion
from qpsafe.gate.stillness_kernel import hold_still
from qpsafe.robot.own_limits import beyond_own

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from qpsafe.limits import JointLimits
    from qpsafe.robot.robot import Robot
    from qpsafe.robot.state import RobotState
    from qpsafe.sensing.hulls import Obstacle

Array = NDArray[np.float64]


class Gate(Fixed):
    """Verifies the commands of one robot.

    Args:
        robot: The robot.
        rules: Figures.
        limits: Limits by which it brakes; of a class of your own only the numbers count.
        known: Known obstacles of the surroundings.
        carried: What tools may carry, by frame, as for `SafetyController`.
        max_age: Older readings do not count [s].
    """

    fixed = frozenset(("robot", "rules", "limits", "max_age", "solids", "groups", "blocks"))

    def __init__(
        self, robot: Robot, rules: VerifiedMotion, limits: JointLimits, known: Sequence[Obstacle] = (),
        carried: Mapping[str, Sequence[Obstacle]] | None = None, max_age: float = 0.0,
    ) -> None:  # fmt: skip
        self.robot, self.rules, self.limits, self.max_age = robot, rules, limits, max_age
        self.solids, self.groups = surroundings(robot, known, carried)
        self._fixed = len(self.solids.names) - len(known)  # the first known obstacle
        self._told = np.zeros(TOLD)
        self._work: tuple[Array, NDArray[np.int64]] = np.empty(0), np.empty(0, dtype=np.int64)
        self._room = -1
        self._looked: list[Array] = []  # what the last call of `hold` measured
        self.blocks = pack(robot, (rules, limits, max_age), self.solids, self.groups)
        self._known = np.full(len(self.groups) * (1 + robot.nq), np.nan)  # nothing has been measured

    def __call__(
        self, q: Array, qd: Array, command: Array, points: Array, ages: Array, leads: Array = NO_AGES,
        measured: bool = False,
    ) -> Gated:  # fmt: skip
        """Replace a command (n,) [rad/s] by the part of it that can be let through.

        Args:
            q: Commanded position (n,) [rad].
            qd: Commanded velocity (n,) [rad/s].
            command: The next one, inside the box of the limits; changed in place.
            points: Where people were seen (p, 3) [m].
            ages: How old the readings are, of every spot (k,) [s]; none where they have none.
            leads: Of the last e points, which no spot saw: how long before now they were there, at least 0 (e,) [s].
            measured: Whether `hold` was asked about the same arrays just before; if it was not, they are measured.
        """
        if measured:
            known = self._looked
            measured = len(known) > 0 and known[0] is q and known[1] is points
            measured = measured and known[2] is ages and known[3] is leads
        self._looked.clear()
        if len(points) > self._room:
            self._make_room(len(points))
        share = let_through(
            *self.blocks, self._known, *self._work, q, qd, command, points, ages, leads, measured, self._told
        )  # fmt: skip
        return PASSED if share == 1.0 and self._told.item(CAUSE) == 0.0 else self._words()

    def hold(self, state: RobotState, qd: Array, points: Array, ages: Array, leads: Array = NO_AGES) -> Array | None:
        """Largest speeds of joints (n,) [rad/s] that must stand before a link is touched; infinite for the others.

        Args:
            state: Where the robot is commanded to be.
            qd: Its commanded velocity (n,) [rad/s].
            points, ages, leads: As for a command.

        Returns:
            None if no joint is held.
        """
        if len(points) == 0:
            return None
        if len(points) > self._room:
            self._make_room(len(points))
        self._looked[:] = state.q, points, ages, leads
        most = np.empty(len(qd))
        return most if hold_still(*self.blocks, *self._work, state.memory, qd, points, ages, leads, most) else None

    def notes(self) -> tuple[str, ...]:
        """Doubts about the geometry that it measures with, in words."""
        bare, wide = bare_links(self.robot).names, beyond_own(self.limits, self.robot)
        if not bare:
            return wide
        return (f"the model has no collision geometry here: only a line without thickness is kept from people, along "
                f"{', '.join(bare)}", *wide)  # fmt: skip

    @property
    def sizes(self) -> tuple[int, int, int]:
        """How many floats it remembers, how many it works in without points, and how many capsules it has."""
        return len(self._known), self._lengths(0)[0], len(robot_capsules(self.robot).radii)

    def _lengths(self, points: int) -> tuple[int, int]:
        pairs, capsules = sum(len(group.pairs) for group in self.groups), len(robot_capsules(self.robot).radii)
        return workspace.lengths(self.robot.nq, capsules, len(self.solids.index), pairs, points)

    def _make_room(self, points: int) -> None:
        self._room, (floats, integers) = points, self._lengths(points)
        self._work = np.zeros(floats), np.zeros(integers, dtype=np.int64)

    def _words(self) -> Gated:
        told, names = self._told.tolist(), self.solids.names
        share, who, what = told[SHARE], int(told[WHO]), int(told[POINT])
        if told[CAUSE] == PERSON_NEAR:
            return Gated(share, "person", robot_capsules(self.robot).names[who], "", what, told[SHORT])
        starts = np.cumsum([0, *(len(group.pairs) for group in self.groups)])
        a, b = self.groups[who].pairs[max(what - int(starts[who]), 0)]
        cause = "furniture" if b >= self._fixed else "self"
        return Gated(share, cause, names[a], names[b], -1, told[SHORT])
