"""Ticks of many robots, one after the other; other threads run meanwhile."""

from __future__ import annotations

from numba import types

from qpsafe.batch import tick_kernel
from qpsafe.batch.code import NOTHING, POINTS
from qpsafe.batch.tick_kernel import BLOCKS, tick_compiled
from qpsafe.compiled.compiled import Array, entry, readable
from qpsafe.robot.kinematics import Index


@entry(
    types.void(
        *BLOCKS[0],
        types.float64[:, ::1], types.int64[:, ::1], types.boolean[:, :, ::1], *BLOCKS[2],
        readable(2), readable(2), readable(2), readable(2), readable(2), BLOCKS[0][1], types.int64, types.int64,
        types.int64,
    ),
    tick_kernel, *tick_kernel.USES,
    nogil=True,
)  # fmt: skip
def step_rows(
    floats: Array, integers: Index, f: Array, i: Index,
    own: Array, whole: Index, spots: Array, work: Array, work_whole: Index,
    q: Array, qd: Array, distances: Array, ages: Array, points: Array, starts: Index, how: int,
    first: int, stop: int,
) -> None:  # fmt: skip
    """Step the robots first to stop - 1.

    Args:
        floats, integers, f, i: What all share.
        own, whole, spots: What each remembers, a row a robot.
        work, work_whole: The thread's own.
        q, qd: Measured (n, joints).
        distances, ages: (n, k), or (1, 0) where points are given.
        points, starts: Of all robots, one after the other (p, 3), and where each robot's begin (n + 1,).
        how: `DISTANCES`, `POINTS` or `NOTHING`.
        first, stop: Which robots.
    """
    for r in range(first, stop):
        row = r if how != POINTS and how != NOTHING else 0
        tick_compiled(
            floats, integers, f, i, own[r], whole[r], spots[r], work, work_whole, q[r], qd[r], distances[row],
            ages[row], points[starts[r] : starts[r + 1]], how,
        )  # fmt: skip
