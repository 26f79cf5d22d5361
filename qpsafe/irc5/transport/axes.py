"""Which joints of a robot EGM calls `joints`, at most six, and which `externalJoints`: a seventh axis, a positioner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.text.given import parts, whole
from qpsafe.text.words import counted

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

#: Joints of a mechanical unit that EGM sends as `joints`.
INNER = 6


@dataclass(frozen=True, eq=False)
class Axes:
    """How the joints of a robot are spread over EGM's two lists.

    Args:
        n: Number of joints.
        external: Places of those in `externalJoints`, in the controller's order; by default all from the seventh on.
        linear: Places of those that slide: in mm on the wire, where the others are in degrees.

    Attributes:
        inner: Places of those in `joints`, in the robot's order, (up to 6,).
        outer: Places of those in `externalJoints` (k,).
        to_wire: Degrees in a radian, or mm in a metre (n,).
        from_wire: The inverse (n,).

    Raises:
        ConfigurationError: The number of joints is none, a place is no joint or there twice, or more than six joints
            are left.
    """

    n: int
    external: Sequence[int] | None = None
    linear: Sequence[int] = ()
    inner: NDArray[np.intp] = field(init=False)
    outer: NDArray[np.intp] = field(init=False)
    to_wire: Array = field(init=False)
    from_wire: Array = field(init=False)

    def __post_init__(self) -> None:
        whole("Axes", "n", self.n, "a number of joints, 0 to 255", 0, 255)
        outer = list(range(INNER, self.n)) if self.external is None else self._places("external")
        inner = [place for place in range(self.n) if place not in outer]
        if len(inner) > INNER:
            expected = f"at least {self.n - INNER} of {counted(self.n, 'joint')}: EGM has six places for the others"
            raise ConfigurationError("Axes", "external", self.external, expected)
        object.__setattr__(self, "inner", np.array(inner, dtype=np.intp))
        object.__setattr__(self, "outer", np.array(outer, dtype=np.intp))
        slides = np.isin(np.arange(self.n), self._places("linear"))
        object.__setattr__(self, "to_wire", np.where(slides, 1e3, 180.0 / np.pi))
        object.__setattr__(self, "from_wire", np.where(slides, 1e-3, np.pi / 180.0))

    def _places(self, key: str) -> list[int]:
        given, expected = getattr(self, key), f"different places from 0 to {self.n - 1}"
        found = [whole("Axes", key, place, expected, 0, self.n - 1) for place in parts("Axes", key, given, expected)]
        if len(set(found)) != len(found):
            raise ConfigurationError("Axes", key, given, expected)
        return found

    def write(self, message: Any, values: Array) -> None:
        """Into a message with both lists; (n,) in the wire's units."""
        if len(self.outer):
            message.joints.joints.extend(values[self.inner].tolist())
            message.externalJoints.joints.extend(values[self.outer].tolist())
        else:
            message.joints.joints.extend(values.tolist())


@lru_cache
def axes_of(n: int) -> Axes:
    """The usual ones of a robot with n joints."""
    return Axes(n)


def axes_of_robot(robot: Robot) -> Axes:
    """Those of a robot: what its robot.toml says of EGM, else the usual ones; sliding joints as its model has them.

    Raises:
        ConfigurationError: As `Axes`.
    """
    slides = [place for place in range(robot.nq) if robot.model.joints[place + 1].shortname().startswith("JointModelP")]
    external = robot.external_joints
    return Axes(robot.nq, None if external is None else [robot.joint_names.index(name) for name in external], slides)
