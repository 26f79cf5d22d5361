"""What the kernel of clearance rows works in, and the rows it makes, cut from two blocks."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.compiled.compiled import Array, inline
from qpsafe.compiled.memory import view
from qpsafe.geometry.layout import FLOATS
from qpsafe.geometry.reach import LOOKS
from qpsafe.geometry.separation import WORK

Index = NDArray[np.int64]
MOST = 16  # rows of one tick; of more, those with the least room stay


class Rows(NamedTuple):
    """What a tick's rows are made of, and the rows.

    Attributes:
        ahead: Way of each joint when all brake, after some time, with its sign (LOOKS, n).
        times: How long what a joint adds leads on (n,) [s].
        far: Way of each joint that it can cover at most (n,).
        back: Likewise the other way than it goes now (n,).
        steps: a dt (n,) [rad/s].
        ways: Of any point of each body by each joint, at most (n + 1, n) [m].
        balls: Centres of the bodies' balls in the world (n + 1, 3).
        globes: Likewise of the shapes (g, 3).
        A: (MOST, n).
        high: (MOST,) their upper bounds [m].
        gaps: (MOST,) distances [m].
        which: (MOST,) pairs they belong to.
        marks: (2,) how many rows, and how many pairs overlap.
    """

    ahead: Array
    times: Array
    far: Array
    back: Array
    steps: Array
    ways: Array
    balls: Array
    globes: Array
    pair: Array
    g: Array
    room: Array
    A: Array
    high: Array
    gaps: Array
    which: Index
    marks: Index


def rows_of(floats: Any, integers: Any, n: int, g: int) -> Rows:
    """Cut `Rows` from two blocks.

    Args:
        floats: `sizes_of` says how many.
        integers: The same.
        n: Joints.
        g: Shapes.
    """
    a = (LOOKS + 1) * n
    b = a + 3 * n + (n + 1) * n
    c = b + 3 * (n + 1) + 3 * g
    d = c + 2 * (24 + 12 + WORK + 7) + FLOATS
    e = d + n + MOST
    return Rows(
        view(floats, 0, (LOOKS, n)),
        view(floats, LOOKS * n, (n,)),
        view(floats, a, (n,)),
        view(floats, a + n, (n,)),
        view(floats, a + 2 * n, (n,)),
        view(floats, a + 3 * n, (n + 1, n)),
        view(floats, b, (n + 1, 3)),
        view(floats, b + 3 * (n + 1), (g, 3)),
        view(floats, c, (2 * (24 + 12 + WORK + 7) + FLOATS,)),
        view(floats, d, (n,)),
        view(floats, d + n, (MOST,)),
        view(floats, e, (MOST, n)),
        view(floats, e + MOST * n, (MOST,)),
        view(floats, e + MOST * (n + 1), (MOST,)),
        view(integers, 0, (MOST,)),
        view(integers, MOST, (2,)),
    )


def sizes_of(n: int, g: int) -> tuple[int, int]:
    """How many floats and integers these are, for n joints and g shapes."""
    floats = (LOOKS + 4) * n + (n + 1) * n + 3 * (n + 1) + 3 * g + 2 * (43 + WORK) + FLOATS + n + MOST * (n + 3)
    return floats, MOST + 2


cut_rows = inline(rows_of)
