"""One tick of all readings, compiled: from distances to the points that count, spot by spot."""

from __future__ import annotations

import numpy as np
from numba import types

from qpsafe.compiled.compiled import Array, add, entry, readable
from qpsafe.compiled.memory import view
from qpsafe.robot import kinematics
from qpsafe.robot.kinematics import Index
from qpsafe.sensing import health, hold, hulls, velocity
from qpsafe.sensing.health import HEALTHY, judge
from qpsafe.sensing.hold import believe
from qpsafe.sensing.hulls import within
from qpsafe.sensing.skin import spots
from qpsafe.sensing.skin.spots import ray_of
from qpsafe.sensing.velocity import approach

_floats, _rows = types.Array(types.float64, 1, "C", readonly=True), types.Array(types.float64, 2, "C", readonly=True)
_ints, _out, _outs = types.Array(types.int64, 1, "C", readonly=True), types.float64[::1], types.float64[:, ::1]

USES = (kinematics, health, hold, hulls, spots, velocity)


@entry(
    types.UniTuple(types.int64, 3)(
        readable(1), readable(1), _floats, _rows, _rows,
        _ints, _ints, types.Array(types.float64, 3, "C", readonly=True), _rows,
        _ints, _ints, _rows, _rows, _floats, _ints,
        types.int64[:, ::1], _outs, types.boolean[::1], _outs, types.int64[::1], _outs,
        _outs, types.int64[::1], _outs,
    ),
    *USES,
)  # fmt: skip
def take_readings(
    distances: Array,
    ages: Array,
    memory: Array,
    starts: Array,
    ends: Array,
    bodies: Index,
    links: Index,
    rays: Array,
    ranges: Array,
    hull_bodies: Index,
    first: Index,
    planes: Array,
    balls: Array,
    numbers: Array,
    ticks: Index,
    counts: Index,
    seen: Array,
    dead: Array,
    held: Array,
    age: Index,
    track: Array,
    points: Array,
    point_links: Index,
    velocities: Array,
) -> tuple[int, int, int]:
    """Take the readings of k spots at one configuration of a robot.

    Args:
        distances, ages: Readings [m] and their ages [s], (k,).
        memory: The robot's kinematics, see `kinematics.forward`.
        starts, ends: Of its wire, (links, 3) [m].
        bodies, links, rays: Of each spot its body, its wire link, its ray in the body, (k,), (k,), (k, 4, 2).
        ranges: Of each spot range_max and the tangent of half its cone, (k, 2).
        hull_bodies, first, planes, balls: Known obstacles and the robot itself, see `HullSet.tables`.
        numbers, ticks: Of the rules, as unpacked below.
        counts, seen, dead: Memory of `SpotHealth`.
        held, age: Memory of `PointHold`.
        track: Memory of `ApproachVelocity`.
        points, point_links, velocities: Filled with what counts, (k, 3), (k,), (k, 3).

    Returns:
        How many points count; how many spots are dead; how many are dead or unusable.
    """  # fmt: skip
    dt, d_min, tolerance, max_age, motion = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    step, jump, alpha, beta, fastest = numbers[5], numbers[6], numbers[7], numbers[8], numbers[9]
    least, growth = -numbers[10], dt + numbers[10]
    stuck_ticks, dead_ticks, hold_ticks, moving = ticks[0], ticks[1], ticks[2], ticks[3]
    n = (memory.shape[0] - 16) // 16  # enough for the poses of the bodies, which come first
    poses = view(memory, 0, (n + 1, 4, 4))
    count, dying, out = 0, 0, 0
    for i in range(distances.shape[0]):
        d = distances[i]
        origin, direction = ray_of(poses[bodies[i]], rays[i])
        code = judge(
            i, d, ages[i], origin, direction, ranges[i, 0], max_age, least, growth, motion, stuck_ticks, dead_ticks,
            counts, seen, dead,
        )  # fmt: skip
        usable = code == HEALTHY
        dying += dead[i]
        out += dead[i] or not usable

        # (7), for what is usable and within range; known obstacles and the robot itself do not count, but for what is
        # nearer than d_min
        hit = usable and d <= ranges[i, 0]
        reach = d if hit else 0.0
        p = add(origin, reach, direction)
        fat = tolerance + ranges[i, 1] * reach
        new = hit and (reach < d_min or within(p, fat, poses, hull_bodies, first, planes, balls) < 0)

        # what was seen and is lost still counts for a while
        reading = (reach if hit else np.inf) if usable else np.nan
        known = held[i, 0] < np.inf
        present = believe(
            i, reading, new, p, origin, starts, ends, ranges[i, 0], hold_ticks, step, jump, d_min, held, age
        )
        speed = 0.0
        if moving:
            fresh = present and age[i] == 0
            speed = approach(i, reading, fresh, known, origin, direction, dt, alpha, beta, fastest, track)
        if present:
            for c in range(3):
                points[count, c], velocities[count, c] = held[i, 1 + c], speed * direction[c]
            point_links[count] = links[i]
            count += 1
    return count, dying, out
