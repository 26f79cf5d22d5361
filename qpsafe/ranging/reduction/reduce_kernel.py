"""From one image to the few points of it that matter, compiled.

    zones --pose at the stamp--> points --self and known rules--> points that count --nearest to each link--> candidates

A dense image says no more than a sparse one of the same surface, so few of its points are kept: for each link of the
wire those that are nearest to it, spread apart, since what lies beside a nearer point is no other danger.
"""

from __future__ import annotations

from math import inf

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, add, entry, inline, readable, row
from qpsafe.ranging.reduction import looking_kernel, nearest_kernel
from qpsafe.ranging.reduction.looking_kernel import (
    DEVIATIONS,
    FARTHEST,
    NEAREST,
    REACH,
    SPREAD,
    TOLERANCE,
    blocked,
    look_around,
    turned,
)
from qpsafe.ranging.reduction.nearest_kernel import keep_nearest, to_link
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index
from qpsafe.sensing import hulls
from qpsafe.sensing.hulls import within

#: What an image shows, see `Told` in `qpsafe.ranging.reduction.reduce`.
VALID, HITS, OWN, KNOWN, EXPECTED, THROUGH, IMPOSSIBLE, SEEN, SPARSE = range(9)
SHOWN = 9

_ints = types.Array(types.int64, 1, "C", readonly=True)
_flags = types.Array(types.boolean, 2, "A", readonly=True)
_two, _three = (types.Array(types.float64, ndim, "C", readonly=True) for ndim in (2, 3))
_out, _outs, _whole = types.float64[::1], types.float64[:, ::1], types.int64[::1]


@entry(
    types.int64(
        readable(1), readable(1), types.Array(types.boolean, 1, "A", readonly=True), _two, readable(1), _two,
        readable(1), _two, _two, _three, _ints, _ints, _two, _two, _outs, _outs, _whole, _outs, types.int64[:, ::1],
        types.int64, types.int64, types.int64, _outs, _outs, _whole,
    ),
    hulls, kinematics, looking_kernel, nearest_kernel,
)  # fmt: skip
def reduce_zones(
    distances: Array,
    sigma: Array,
    valid: Array,
    directions: Array,
    slants: Array,
    pose: Array,
    numbers: Array,
    starts: Array,
    ends: Array,
    poses: Array,
    bodies: Index,
    first: Index,
    planes: Array,
    balls: Array,
    found: Array,
    away: Array,
    zones: Index,
    around: Array,
    among: Index,
    carrier: int,
    each: int,
    stride: int,
    kept: Array,
    sparse: Array,
    shown: Index,
) -> int:
    """Keep the points of an image that matter, (c, 4): place in the world [m], how wrong it may be [m].

    `found` keeps all points that count, as many as `shown[SEEN]` tells.

    Args:
        distances, sigma, valid: Of z zones [m].
        directions, slants: Of the zones in the sensor's frame (z, 3), tangents of half their cones (z,).
        pose: Of the sensor when the image was taken (4, 4).
        numbers: As named above.
        starts, ends: Of the robot's wire now (links, 3).
        poses: Of the robot's bodies when the image was taken (b, 4, 4).
        bodies, first, planes, balls: The robot itself and known obstacles, see `HullSet.tables`.
        found, away, zones, around, among: To work in: (z, 4), (links, z), (z,), and for k known things (k, `AROUND`),
            (2, k).
        carrier: The robot's body that the sensor sits on; -1 for none.
        each: How many points a link keeps.
        stride: Of so many zones one is asked whether it sees through what is known.
        kept: Filled, at least links · each rows.
        sparse: Filled with the places of what is kept, then of others that count, evenly chosen (s, 3); `shown[SPARSE]`
            tells how many these are; s is above links · each.
        shown: Filled with counts of zones (`SHOWN`,).

    Returns:
        c, how many points are kept.
    """  # fmt: skip
    o = (pose[0, 3], pose[1, 3], pose[2, 3])
    links, reach = starts.shape[0], numbers[REACH] * numbers[REACH]
    shown[:] = 0
    n = 0
    count, some = look_around(o, pose, numbers, carrier, poses, bodies, balls, around, among)
    mine, every = among[0, :some], among[1, :count]
    for i in range(distances.shape[0]):
        d = distances[i]
        if not valid[i] or d != d:
            continue
        if not d >= 0.0:
            shown[IMPOSSIBLE] += 1
            continue
        shown[VALID] += 1
        a = turned(pose, row(directions, i))
        wrong = numbers[DEVIATIONS] * sigma[i]
        fat = numbers[TOLERANCE] + wrong
        if i % stride == 0:
            surface = blocked(
                a, slants[i], fat, numbers[FARTHEST], around, mine, every, poses, bodies, first, planes, balls
            )
            if surface < inf:
                shown[EXPECTED] += 1
                if d > surface:
                    shown[THROUGH] += 1
        if d > numbers[FARTHEST]:
            continue
        shown[HITS] += 1
        p = add(o, d, a)
        if d >= numbers[NEAREST]:
            hull = within(p, fat + slants[i] * d, poses, bodies, first, planes, balls)
            if hull >= 0:
                shown[KNOWN if bodies[hull] == 0 else OWN] += 1
                continue
        least = inf
        for k in range(links):
            away[k, n] = to_link(p, starts, ends, k)
            least = min(least, away[k, n])
        if least > reach:
            continue
        found[n, 0], found[n, 1], found[n, 2] = p
        found[n, 3] = wrong + slants[i] * d
        zones[n] = 0
        n += 1
    shown[SEEN] = n
    c = keep_nearest(found, n, away, zones, each, numbers[SPREAD], kept)
    room = sparse.shape[0] - c
    every, count = (n + room - 1) // room, c  # of so many points that count one
    for i in range(c):
        sparse[i, 0], sparse[i, 1], sparse[i, 2] = kept[i, 0], kept[i, 1], kept[i, 2]
    for i in range(n):
        if i % every == 0:
            sparse[count, 0], sparse[count, 1], sparse[count, 2] = found[i, 0], found[i, 1], found[i, 2]
            count += 1
    shown[SPARSE] = count
    return c


@inline
def edges(i: int, rows: int, columns: int, down: int, across: int) -> tuple[int, int, int, int]:
    """First row of tile i of down x across and the one after its last, then its columns likewise."""
    v, u = i // across, i % across
    return v * rows // down, (v + 1) * rows // down, u * columns // across, (u + 1) * columns // across


@entry(types.void(readable(2), _flags, types.int64, types.int64, types.int64, _out, types.boolean[::1]))
def tile(distances: Array, valid: Array, down: int, across: int, support: int, nearest: Array, known: Array) -> None:
    """The nearest surface in each tile of a dense image: what `support` pixels see as near as that.

    Fewer pixels are noise, or edges that mix what is before them with what is behind; only what reads less than nothing
    is never that.

    Args:
        distances: Of the pixels (rows, columns) [m].
        valid: Likewise.
        down, across: How many tiles share the rows, and the columns.
        support: How many, from 1 to 4; no more than tiles are high or wide, or what one row or column sees is lost.
        nearest: Filled, one a tile, row by row [m]; inf where nothing is in sight.
        known: Filled: whether at least `support` pixels of the tile are valid.
    """
    rows, columns = distances.shape
    for i in range(down * across):
        top, bottom, left, right = edges(i, rows, columns, down, across)
        a, b, c, e, count = inf, inf, inf, inf, 0
        for y in range(top, bottom):
            for x in range(left, right):
                d = distances[y, x]
                if valid[y, x] and d == d:
                    count += 1
                    if d < e:  # sorted into the four smallest
                        e = d
                        if e < c:
                            c, e = e, c
                        if c < b:
                            b, c = c, b
                        if b < a:
                            a, b = b, a
        nearest[i] = a if support == 1 or a < 0.0 else b if support == 2 else c if support == 3 else e
        known[i] = count >= support or a < 0.0


@entry(types.void(readable(2), _flags, readable(2), types.int64, types.int64, readable(1), _out))
def tile_sigma(
    distances: Array, valid: Array, sigma: Array, down: int, across: int, nearest: Array, spread: Array
) -> None:
    """How uncertain the surface in each tile is: as much as the worst of the pixels that are as near as it.

    Args:
        distances, valid, sigma: Of the pixels (rows, columns) [m].
        down, across: How many tiles share the rows, and the columns.
        nearest: Of the tiles, see `tile`.
        spread: Filled, one a tile [m].
    """
    rows, columns = distances.shape
    for i in range(down * across):
        (top, bottom, left, right), worst = edges(i, rows, columns, down, across), 0.0
        for y in range(top, bottom):
            for x in range(left, right):
                if valid[y, x] and distances[y, x] <= nearest[i]:  # false for NaN
                    worst = max(worst, sigma[y, x])
        spread[i] = worst


def farthest_zone(size: int) -> int:
    """So that at most about a thousand zones of an image are asked whether they see through what is known."""
    return max(1, int(np.ceil(size / 1000)))
