"""What is known between two images, compiled: points are kept, moved, forgotten, and chosen from.

A point of a sensor's last image counts where it was seen; its velocity is for `qpsafe.ranging.tracking.prediction`. A
point that the next image does not show is lost: it still counts for a while, and meanwhile comes nearer at the walking
speed of ISO 13855, as with spots.
"""

from __future__ import annotations

from math import inf, isfinite, sqrt

from numba import types

from qpsafe.compiled.compiled import Array, add, dot, entry, readable, row
from qpsafe.ranging import ranged
from qpsafe.ranging.ranged import DANGER, GRADIENT
from qpsafe.ranging.reduction import nearest_kernel
from qpsafe.ranging.reduction.nearest_kernel import to_link
from qpsafe.ranging.tracking import prediction
from qpsafe.ranging.tracking.prediction import person_speed
from qpsafe.robot.kinematics import Index

#: Columns of a kept point: place, velocity, how wrong the place may be, when it was seen, when it was lost (inf: not).
PLACE, VELOCITY, WRONG, STAMP, LOST = 0, 3, 6, 7, 8
WIDTH = 9
#: Numbers of `place_all`.
NOW, HOLD, APPROACH, NEAREST, PERSON, AHEAD, ACCELERATION, FASTEST = range(8)

_any, _two = readable(1), readable(2)
_out, _outs, _whole = types.float64[::1], types.float64[:, ::1], types.int64[::1]


@entry(
    types.int64(
        _outs, types.int64, _outs, types.int64, _two, _two, types.float64, types.float64, types.float64
    )
)  # fmt: skip
def renew(
    store: Array, count: int, kept: Array, new: int, velocities: Array, found: Array, stamp: float, hold: float,
    again: float,
) -> int:  # fmt: skip
    """Put an image's points before those of earlier ones; returns how many there are now.

    Args:
        store: Of one sensor (r, WIDTH).
        count: How many points it holds.
        kept: The image's (at least `new` rows, 4), see `reduce_zones`.
        new: How many.
        velocities: Theirs (new, 3) [m/s].
        found: All points of the image that count, kept or not (p, 4).
        stamp: Of the image [s].
        hold: How long lost points still count [s].
        again: An earlier point this near to one of these is the same thing, and not lost [m].
    """
    left = 0
    for i in range(count):  # those that are lost, to the front
        p, lost = (store[i, 0], store[i, 1], store[i, 2]), min(store[i, LOST], stamp)
        gone = stamp - lost > hold
        for j in range(found.shape[0]):
            w = add((found[j, 0], found[j, 1], found[j, 2]), -1.0, p)
            gone = gone or dot(w, w) <= again * again
        if not gone:
            for c in range(WIDTH):
                store[left, c] = store[i, c]
            store[left, LOST] = lost
            left += 1
    left = min(left, store.shape[0] - new)
    for i in range(left - 1, -1, -1):
        for c in range(WIDTH):
            store[new + i, c] = store[i, c]
    for j in range(new):
        for c in range(3):
            store[j, c], store[j, VELOCITY + c] = kept[j, c], velocities[j, c]
        store[j, WRONG], store[j, STAMP], store[j, LOST] = kept[j, 3], stamp, inf
    return new + left


@entry(
    types.UniTuple(types.int64, 2)(
        types.float64[:, :, ::1], _whole, _whole, _any, _any, _two, _two, _outs, _whole, _outs, _whole, _outs, _out,
        _out,
    ),
    nearest_kernel, prediction, *prediction.USES,
)  # fmt: skip
def place_all(
    store: Array, counts: Index, carriers: Index, patience: Array, numbers: Array, starts: Array, ends: Array,
    points: Array, links: Index, velocities: Array, sensors: Index, seen: Array, ages: Array, leads: Array,
) -> tuple[int, int]:  # fmt: skip
    """Where all kept points count now; those that are too old are forgotten.

    Args:
        store: Of all sensors (s, r, WIDTH).
        counts: How many points each holds (s,).
        carriers: The link that a sensor's points act on (s,); -1: the nearest.
        patience: How old a point of the last image may be before it counts as lost (s,) [s].
        numbers: Present time, hold time [s], speed of lost points [m/s], how near to the wire they come [m], how fast
            people come [m/s], how far the gate looks ahead [s], how fast people become faster [m/s²], how fast they
            become at most [m/s].
        starts, ends: Of the robot's wire (links, 3).
        points, links, velocities, sensors: Filled: where a point counts at rest (s r, 3), its link, its velocity when
            it was seen (s r, 3), its sensor (s r,).
        seen, ages, leads: Filled: where it was seen (s r, 3), how long ago, and for how long before now somebody as
            fast as `PERSON` would have had to come from there to be as far as this one may be (s r,) [s].

    Returns:
        How many points count; of how many of these a velocity is known.
    """  # fmt: skip
    now, total, moving = numbers[NOW], 0, 0
    for s in range(store.shape[0]):
        left = 0
        for i in range(counts[s]):
            lost = min(store[s, i, LOST], store[s, i, STAMP] + patience[s])
            if now - lost > numbers[HOLD]:
                continue
            for c in range(WIDTH):
                store[s, left, c] = store[s, i, c]
            v = (store[s, left, 3], store[s, left, 4], store[s, left, 5])
            p, age = (store[s, left, 0], store[s, left, 1], store[s, left, 2]), max(now - store[s, left, STAMP], 0.0)
            link, least = 0, inf
            for k in range(starts.shape[0]):
                # links share their ends, so that several may be as near: the first one counts, whatever rounding says
                away = to_link(p, starts, ends, k)
                if away < (1.0 - 1e-9) * least:
                    link, least = k, away
            if carriers[s] >= 0:
                link = carriers[s]
            for c in range(3):
                seen[total, c], velocities[total, c] = p[c], v[c]
            if now > lost:
                d, w = add(row(ends, link), -1.0, row(starts, link)), add(p, -1.0, row(starts, link))
                l = min(max(dot(w, d) / max(dot(d, d), 1e-300), 0.0), 1.0)
                way = add(add(row(starts, link), l, d), -1.0, p)
                length = sqrt(dot(way, way))
                step = min(numbers[APPROACH] * (now - lost), length - numbers[NEAREST])
                if step > 0.0:
                    p = add(p, step / length, way)
            for c in range(3):
                points[total, c] = p[c]
            usual = numbers[PERSON]
            fast = person_speed(v, usual, numbers[ACCELERATION], age + numbers[AHEAD], numbers[FASTEST]) - usual
            beyond = store[s, left, WRONG] + fast * (age + numbers[AHEAD])
            ages[total], leads[total] = age, age + beyond / max(usual, 1e-9)
            links[total], sensors[total] = link, s
            moving += v[0] != 0.0 or v[1] != 0.0 or v[2] != 0.0
            left, total = left + 1, total + 1
        counts[s] = left
    return total, moving


@entry(
    types.int64(
        _two, _whole, _two, _whole, _any, _two, types.int64, types.float64, _whole, types.int64[:, :, ::1], _outs,
        _whole,
    ),
    ranged,
)  # fmt: skip
def choose(
    points: Array, links: Index, velocities: Array, sensors: Index, danger: Array, gradient: Array, most: int,
    apart: float, marks: Index, used: Index, chosen: Array, chosen_links: Index,
) -> int:  # fmt: skip
    """Choose the points that count in eq. (8): of each link and sensor the most dangerous ones, and nothing twice.

    A sensor that sees what was chosen already has had its say, so that one more sensor that sees the same changes
    nothing.

    Args:
        points, links, velocities, sensors: Of p points, see `place_all`.
        danger, gradient: CDF there (p,), and its gradient (p, 3).
        most: How many of each link and sensor.
        apart: Points of one link that are as near to each other as that are one thing [m].
        marks: To work in (p,).
        used: To work in (2, s, links): how often a sensor was heard for a link, and by which choice last.
        chosen, chosen_links: Filled, in falling order of danger (p, COLUMNS), see `Ranged`, (p,).

    Returns:
        How many were chosen; -1 if a danger is not finite: it would never be the largest.
    """  # fmt: skip
    count, total = points.shape[0], 0
    used[:] = 0
    for i in range(count):
        marks[i] = 0
        if not isfinite(danger[i]):
            return -1
    while True:
        best = -1
        for i in range(count):
            if marks[i] == 0 and used[0, sensors[i], links[i]] < most and (best < 0 or danger[i] > danger[best]):
                best = i
        if best < 0:
            return total
        link, b = links[best], row(points, best)
        chosen_links[total], chosen[total, DANGER] = link, danger[best]
        for c in range(3):
            chosen[total, ranged.PLACE + c], chosen[total, ranged.VELOCITY + c] = points[best, c], velocities[best, c]
            chosen[total, GRADIENT + c] = gradient[best, c]
        total += 1
        for i in range(count):
            w = add(row(points, i), -1.0, b)
            if i == best or (marks[i] == 0 and links[i] == link and dot(w, w) <= apart * apart):
                marks[i], who = 1, sensors[i]
                if used[1, who, link] != total:
                    used[0, who, link], used[1, who, link] = used[0, who, link] + 1, total


@entry(types.int64(types.float64[:, :, ::1], _whole, types.int64, types.float64, types.int64[:, ::1]))
def lost_before(store: Array, counts: Index, who: int, stamp: float, found: Index) -> int:
    """Fill `found` (n, 2) with sensor and row of the points that others than `who` have lost, seen before `stamp`.

    Returns:
        n.
    """
    count = 0
    for s in range(store.shape[0]):
        for i in range(counts[s] if s != who else 0):
            if store[s, i, LOST] < inf and store[s, i, STAMP] < stamp:
                found[count, 0], found[count, 1] = s, i
                count += 1
    return count
