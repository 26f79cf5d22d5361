"""Motion of clusters of points between images, compiled: see `qpsafe.ranging.tracking.tracks`."""

from __future__ import annotations

from math import isfinite, sqrt

from numba import types

from qpsafe.compiled.compiled import Array, entry, inline, readable
from qpsafe.compiled.memory import view
from qpsafe.ranging.tracking import clusters as clusters_module
from qpsafe.ranging.tracking.clusters import best_shift, certain_part, gather, is_there, join, parent_of, squared
from qpsafe.robot.kinematics import Index

#: Images that are remembered.
IMAGES = 16
#: Which number is which.
REACH, WINDOW, FASTEST, STILL, SLOPE = range(5)
#: Longer ago than so many windows is forgotten.
_LONGEST = 3.0


@inline
def _others(points: Array, here: Array, number: Array, count: int, reach: float, velocities: Array) -> None:
    """What is beyond the most points that are looked at moves as its neighbour among those does."""
    if count == 0 or count < here.shape[0]:
        return
    for i in range(int(number[count - 1]) + 1, points.shape[0]):
        best, k = reach * reach, -1
        for j in range(count):
            d = squared(points[i, 0], points[i, 1], points[i, 2], here, j)
            if d < best:
                best, k = d, j
        for c in range(3):
            velocities[i, c] = velocities[int(number[k]), c] if k >= 0 else 0.0


def sizes(most: int) -> tuple[int, int]:
    """How many floats and whole numbers `track` remembers images of so many points in."""
    return (10 * most + 1) * IMAGES + 18 * most, 2 * IMAGES * (most + 1) + most


_floats, _whole = types.float64, types.int64


@entry(
    _whole(
        readable(2), readable(1), readable(1), _floats, readable(1), _whole, _whole, _whole,
        _floats[::1], _whole[::1], _floats[:, ::1],
    ),
    clusters_module,
)  # fmt: skip
def track(
    points: Array, sigma: Array, sweep: Array, stamp: float, numbers: Array, most: int, slot: int, filled: int,
    memory: Array, marks: Index, velocities: Array,
) -> int:  # fmt: skip
    """Fill velocities (p, 3) of the points of an image, and remember it.

    Args:
        points, sigma, sweep, stamp: Of the image, (p, 3), (p,), (p,); one number in place of p where all are alike.
        numbers: See above.
        most: n, of how many points images are remembered.
        slot, filled: Where the image is remembered; how many before it are.
        memory, marks: Of the remembered images, zeros at first, as many as `sizes` tells.
        velocities: (p, 3) [m/s], zero where none is known.

    Returns:
        How many clusters there are.
    """  # fmt: skip
    images, n = IMAGES, most
    # points; velocity, sweep and certain velocity of each cluster; stamps; to work in
    places, motions = view(memory, 0, (images, n, 3)), view(memory, 3 * images * n, (images, n, 7))
    stamps, free = view(memory, 10 * images * n, (images,)), (10 * n + 1) * images
    work, seen = view(memory, free, (2, n, 3)), view(memory, free + 6 * n, (2 * n, 3))
    vectors = view(memory, free + 12 * n, (6, n))
    # cluster of each point, and parent of each cluster; how many points and clusters; to work in
    names, counts = view(marks, 0, (images, 2, n)), view(marks, 2 * images * n, (images, 2))
    stack = view(marks, 2 * images * (n + 1), (n,))
    reach, window, fastest = numbers[REACH], numbers[WINDOW], numbers[FASTEST]
    here, labels, count = places[slot], names[slot, 0], 0
    number = vectors[5]  # of each remembered point in the image
    for i in range(points.shape[0]):
        velocities[i, 0] = velocities[i, 1] = velocities[i, 2] = 0.0
        if count < most and isfinite(points[i, 0] + points[i, 1] + points[i, 2]):
            for c in range(3):
                here[count, c] = points[i, c]
            number[count] = i
            count += 1
    clusters = join(here, count, reach, labels, stack)
    counts[slot, 0], counts[slot, 1], stamps[slot] = count, clusters, stamp
    before = (slot - 1) % images
    dt = stamp - stamps[before]
    recent = filled > 0 and dt <= _LONGEST * window
    t, u, mean, guess = vectors[0], vectors[1], vectors[2], motions[slot]
    for cluster in range(clusters):
        m, swept, noise = gather(here, labels, count, cluster, work[0]), 0.0, 0.0
        for i in range(count):
            if labels[i] == cluster:
                k = int(number[i])
                one = sigma[min(k, sigma.shape[0] - 1)]
                swept, noise = max(swept, sweep[min(k, sweep.shape[0] - 1)]), noise + 2.0 * one * one / m
        parent = -1
        if recent:
            parent = parent_of(
                work[0], m, places[before], names[before, 0], motions[before], counts[before, 0], counts[before, 1],
                dt, reach + fastest * dt, seen, vectors[3], vectors[4],
            )  # fmt: skip
        names[slot, 1, cluster] = parent
        for c in range(7):
            motions[slot, cluster, c] = swept if c == 3 else 0.0
        if parent < 0:
            continue
        for c in range(3):  # until it is known better
            motions[slot, cluster, c] = motions[before, parent, c]
        # back along the parents, to what was seen a window ago or longer
        old, l, back, age = before, parent, 1, dt
        swept = max(swept, motions[old, l, 3])
        while (back < 2 or age < window) and back < filled and names[old, 1, l] >= 0:
            older = (old - 1) % images
            if not stamp - stamps[older] <= _LONGEST * window:
                break
            old, l, back, age = older, names[old, 1, l], back + 1, stamp - stamps[older]
            swept = max(swept, motions[old, l, 3])
        if back < 2 or age < 0.5 * window:
            continue
        n, then = gather(places[old], names[old, 0], counts[old, 0], l, work[1]), 0
        for image in range(1 + (back < filled)):  # a zone that failed once is there in the image before
            for i in range(counts[old - image, 0]):
                for c in range(3):
                    seen[then, c] = places[old - image, i, c]
                then += 1
        for c in range(3):
            guess[cluster, c] = age * motions[before, parent, c]
        # at rest is what was there before, and also what has all of what was there before and more
        certain = 0.0
        if (
            not is_there(work[0], m, seen, then, noise, reach, u)
            and not is_there(work[1], n, here, count, noise, reach, u)
            and best_shift(work[0], m, work[1], n, guess[cluster], noise, reach, t, u, mean)
        ):
            certain = min(
                certain_part(work[0], m, seen, then, t, 1.0, noise, reach, u, mean),
                certain_part(work[1], n, here, count, t, -1.0, noise, reach, u, mean),
            )
        speed = sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]) / age if certain > 0.0 else 0.0
        confirmed = 0.0  # by the image before: what was certain then, along this velocity
        for c in range(3):
            motions[slot, cluster, c] = t[c] / age if certain > 0.0 else 0.0
            confirmed += motions[before, parent, 4 + c] * motions[slot, cluster, c]
        if not certain > 0.0:
            continue
        for c in range(3):
            motions[slot, cluster, 4 + c] = certain * motions[slot, cluster, c]
        left = min(certain * speed, confirmed / speed) - numbers[STILL] - numbers[SLOPE] * swept
        left = min(left, fastest)
        if left > 0.0:  # NaN fails
            for i in range(count):
                if labels[i] == cluster:
                    for c in range(3):
                        velocities[int(number[i]), c] = left * motions[slot, cluster, c] / speed
    _others(points, here, number, count, reach, velocities)
    return clusters


@entry(types.void(readable(2), readable(2), readable(2), _floats, _floats[::1]))
def swept(points: Array, before: Array, now: Array, dt: float, aside: Array) -> None:
    """Fill `aside` (p,), see `qpsafe.ranging.tracking.tracks.sweep`."""
    parallax = 0.0
    for c in range(3):
        parallax += (now[c, 3] - before[c, 3]) ** 2
    parallax = sqrt(parallax)
    for i in range(points.shape[0]):
        length, along, square = 0.0, 0.0, 0.0
        for c in range(3):
            length += (points[i, c] - now[c, 3]) ** 2
        length = sqrt(length)
        for c in range(3):
            place = before[c, 3]  # on the same ray, then
            for r in range(3):
                own = 0.0
                for k in range(3):
                    own += now[k, r] * (points[i, k] - now[k, 3])
                place += before[c, r] * own
            moved = points[i, c] - place
            square += moved * moved
            along += moved * (points[i, c] - now[c, 3]) / length if length > 0.0 else 0.0
        aside[i] = (sqrt(max(square - along * along, 0.0)) + parallax) / dt
