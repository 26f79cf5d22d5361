"""The compiled calls that fit what a controller is made of; its parts may be exchanged at any time."""

from __future__ import annotations

from operator import is_not
from typing import TYPE_CHECKING, Any

from numpy import ndarray

from qpsafe.resolve import Resolver
from qpsafe.sense import QuickSense, Sensed
from qpsafe.sense_points import QuickPoints

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot


class Quick:
    """Makes the compiled calls at first, and again when somebody exchanged a part.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._made: dict[Any, tuple[tuple[Any, ...], Any]] = {}

    def sensed(
        self, q: Any, qd: Any, distances: Any, points: Any, ages: Any, sensing: Any, field: Any, evasion: Any
    ) -> Sensed | None:
        """Measurements to q̇0, where all of it is of the built-in kind and nothing is unusual; as `qpsafe.sense.sense`.

        Raises:
            BadInput: What cannot be used.
        """
        if points is None and type(distances) is ndarray and distances.ndim == 2:
            points, distances = distances, None
        if points is None:
            by_distances = self._get(QuickSense, (sensing, field, evasion))
            return None if by_distances is None else by_distances(q, qd, distances, ages)
        by_points = self._get(QuickPoints, (field, evasion)) if distances is None else None
        return None if by_points is None else by_points(q, qd, points)

    def resolver(self, tasks: Any, law: Any, limits: Any) -> Resolver | None:
        """Tasks, limits and law, where all of it is of the built-in kind."""
        call: Resolver | None = self._get(Resolver, (tasks, law, limits))
        return call

    def _get(self, kind: Any, parts: tuple[Any, ...]) -> Any:
        made = self._made.get(kind)
        if made is None or any(map(is_not, made[0], parts)):
            fits = kind.fits(*parts)
            made = self._made[kind] = (parts, kind(self._robot, *parts) if fits else None)
        return made[1]
