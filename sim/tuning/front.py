"""The Pareto front of two objectives, and the point of it that is chosen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from qpsafe.errors import ConfigurationError

#: What a preference gives the two objectives: (harm, work lost).
PREFERENCES = {"safety": (0.8, 0.2), "balanced": (0.5, 0.5), "work": (0.2, 0.8)}


class Objectives(NamedTuple):
    """Two numbers to be small.

    Attributes:
        harm: See `qpsafe.sim.tuning.objectives`.
        lost: [s].
    """

    harm: float
    lost: float

    def dominates(self, other: Objectives) -> bool:
        """Whether it is nowhere worse, and somewhere better."""
        return self.harm <= other.harm and self.lost <= other.lost and self != other


def front(points: Sequence[Objectives]) -> list[int]:
    """Numbers of the points that none dominates, from little harm to little work lost; of equal ones the first."""
    order = sorted(range(len(points)), key=lambda k: (*points[k], k))
    found: list[int] = []
    for k in order:
        if not found or points[k].lost < points[found[-1]].lost:
            found.append(k)
    return found


def ranks(points: Sequence[Objectives]) -> list[int]:
    """For each point by how many it is dominated."""
    return [sum(other.dominates(mine) for other in points) for mine in points]


def knee(points: Sequence[Objectives], start: Objectives, prefer: str = "balanced") -> int:
    """Number of the point of a front that is chosen.

    Both objectives are taken as shares of the way between their smallest and largest values on the front, so units do
    not count. Chosen is the point whose larger weighted share is smallest. "balanced" looks among the points that are
    better than the present values in both, if there are any: nobody has to pay for those.

    Args:
        points: A front, at least one point.
        start: The present values.
        prefer: A key of `PREFERENCES`.

    Raises:
        ConfigurationError: There is no such preference.
    """
    if prefer not in PREFERENCES:
        raise ConfigurationError("knee", "prefer", prefer, "one of " + ", ".join(PREFERENCES))
    among = list(range(len(points)))
    if prefer == "balanced":
        among = [k for k in among if points[k].dominates(start)] or among
    weights = PREFERENCES[prefer]
    lows = [min(points[k][axis] for k in among) for axis in range(2)]
    widths = [max(points[k][axis] for k in among) - lows[axis] for axis in range(2)]

    def cost(k: int) -> tuple[Any, ...]:
        shares = [
            weight * (points[k][axis] - lows[axis]) / widths[axis] if widths[axis] > 0.0 else 0.0
            for axis, weight in enumerate(weights)
        ]
        return max(shares), sum(shares), k

    return min(among, key=cost)
