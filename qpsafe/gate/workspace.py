"""The gate's working memory; nothing in it is kept from call to call."""

from __future__ import annotations

from typing import Any, NamedTuple

from qpsafe.compiled.compiled import inline
from qpsafe.compiled.memory import view
from qpsafe.geometry.pairs import PAIR


class Work(NamedTuple):
    """For n joints, c capsules, s shapes, m pairs of them, p points."""

    memory: Any  # kinematics without a wire
    axes: Any  # of the capsules, in the world (c, 2, 3)
    there: Any  # a configuration (n,)
    speeds: Any  # (n,)
    end: Any  # where a command's way ends (n,)
    brake: Any  # what braking commands (n,)
    trial: Any  # a command between that and the given one (n,)
    away: Any  # distances of axes and points (c p,)
    pair: Any  # see `nearest_pair`
    found: Any  # likewise, and which of the group's pairs it was
    ages: Any  # of the points (p,)
    nowhere: Any  # (0, 3)
    hot: Any  # pairs that have to be looked at (c p,)
    none: Any  # (0,)
    worst: Any  # capsule and point that were approached; how much may still be looked at in this tick (3,)


def lengths(n: int, c: int, s: int, m: int, p: int) -> tuple[int, int]:
    """How many floats and integers that takes.

    Args:
        n: Joints.
        c: Capsules.
        s: Shapes.
        m: Pairs of shapes.
        p: Points, at most.
    """
    return 16 * (n + 1) + 6 * n + 6 * c + 5 * n + c * p + PAIR + 3 * s + m + 8 + p, c * p + 3


@inline
def workspace(floats: Any, integers: Any, n: int, c: int, s: int, m: int, p: int) -> Any:
    """Cut `Work`."""
    a = 16 * (n + 1) + 6 * n
    b = a + 6 * c
    d = b + 5 * n
    e = d + c * p
    length = PAIR + 3 * s + m
    return Work(
        view(floats, 0, (a,)),
        view(floats, a, (c, 2, 3)),
        view(floats, b, (n,)),
        view(floats, b + n, (n,)),
        view(floats, b + 2 * n, (n,)),
        view(floats, b + 3 * n, (n,)),
        view(floats, b + 4 * n, (n,)),
        view(floats, d, (c * p,)),
        view(floats, e, (length,)),
        view(floats, e + length, (8,)),
        view(floats, e + length + 8, (p,)),
        view(floats, 0, (0, 3)),
        view(integers, 0, (c * p,)),
        view(integers, 0, (0,)),
        view(integers, c * p, (3,)),
    )
