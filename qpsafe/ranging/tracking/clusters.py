"""Clusters of points and the shifts between them, compiled: what `qpsafe.ranging.tracking.tracks` is made of."""

from __future__ import annotations

from math import sqrt

from qpsafe.compiled.compiled import Array, inline
from qpsafe.robot.kinematics import Index

#: Steps of the registration, and of the search for the smallest shift.
_STEPS, _HALVINGS = 3, 6


@inline
def squared(a: Array, i: int, b: Array, j: int, x: float, y: float, z: float) -> float:
    """Square of the distance of a[i] from b[j] shifted by (x, y, z)."""
    dx, dy, dz = a[i, 0] - b[j, 0] - x, a[i, 1] - b[j, 1] - y, a[i, 2] - b[j, 2] - z
    return dx * dx + dy * dy + dz * dz


@inline
def join(p: Array, count: int, reach: float, labels: Index, stack: Index) -> int:
    """Clusters of points, any two of which are joined by steps no longer than `reach`; how many there are."""
    for i in range(count):
        labels[i] = -1
    clusters = 0
    for seed in range(count):
        if labels[seed] >= 0:
            continue
        labels[seed], stack[0], top = clusters, seed, 1
        while top > 0:
            top -= 1
            i = stack[top]
            for j in range(count):
                if labels[j] < 0 and squared(p, i, p, j, 0.0, 0.0, 0.0) <= reach * reach:
                    labels[j], stack[top] = clusters, j
                    top += 1
        clusters += 1
    return clusters


@inline
def gather(p: Array, labels: Index, count: int, label: int, out: Array) -> int:
    """Points of one cluster; how many there are."""
    found = 0
    for i in range(count):
        if labels[i] == label:
            for c in range(3):
                out[found, c] = p[i, c]
            found += 1
    return found


@inline
def explain(a: Array, m: int, b: Array, n: int, t: Array, cap: float, mean: Array) -> tuple[float, float, int]:
    """How badly the shift t explains points a from points b: Σ min(d², cap²)/m, d from each point to its nearest.

    Returns:
        That; the part of it by points that have a counterpart (d < cap); how many have. What is left between them and
        their counterparts, on average, is left in `mean`.
    """
    x, y, z, inside, with_one, found = 0.0, 0.0, 0.0, 0.0, 0.0, 0
    for i in range(m):
        best, k = cap * cap, -1
        for j in range(n):
            d = squared(a, i, b, j, t[0], t[1], t[2])
            if d < best:
                best, k = d, j
        if k >= 0:
            found += 1
            with_one += best
            x, y, z = x + a[i, 0] - b[k, 0] - t[0], y + a[i, 1] - b[k, 1] - t[1], z + a[i, 2] - b[k, 2] - t[2]
        inside += best
    share = 1.0 / max(found, 1)
    mean[0], mean[1], mean[2] = share * x, share * y, share * z
    return inside / m, with_one / m, found


@inline
def parent_of(
    a: Array, m: int, p: Array, labels: Index, motions: Array, count: int, clusters: int, dt: float, gate: float,
    nearest: Array, total: Array,
) -> int:  # fmt: skip
    """Cluster of the image before, moved on by its velocity, that explains points a best; -1 if none does."""
    for l in range(clusters):
        total[l] = 0.0
    for i in range(m):
        for l in range(clusters):
            nearest[l] = gate * gate
        for j in range(count):
            l = labels[j]
            d = squared(a, i, p, j, dt * motions[l, 0], dt * motions[l, 1], dt * motions[l, 2])
            nearest[l] = min(nearest[l], d)
        for l in range(clusters):
            total[l] += nearest[l]
    best, least = -1, 0.99 * gate * gate * m
    for l in range(clusters):
        if total[l] < least:
            best, least = l, total[l]
    return best


@inline
def _most(cost: float, part: float, found: int, noise: float) -> float:
    """What explains nearly as well: up to three deviations of the mean of the squares, each `noise` at least."""
    return cost - part + max(part, noise) * (1.0 + 3.0 * sqrt(2.0 / max(found, 1)))


@inline
def certain_part(
    a: Array, m: int, b: Array, n: int, t: Array, sign: float, noise: float, cap: float, u: Array, mean: Array
) -> float:
    """The smallest part of the shift t, 0 to 1, that explains points a from points b nearly as well as all of it."""
    u[0], u[1], u[2] = sign * t[0], sign * t[1], sign * t[2]
    cost, part, found = explain(a, m, b, n, u, cap, mean)
    most = _most(cost, part, found, noise)
    low, high, middle = 0.0, 1.0, 0.0
    for _ in range(_HALVINGS):
        for c in range(3):
            u[c] = sign * middle * t[c]
        if not explain(a, m, b, n, u, cap, mean)[0] <= most:
            low = middle
        elif middle == 0.0:
            return 0.0
        else:
            high = middle
        middle = 0.5 * (low + high)
    return middle


@inline
def best_shift(
    a: Array, m: int, b: Array, n: int, guess: Array, noise: float, cap: float, t: Array, u: Array, mean: Array
) -> bool:
    """The shift that explains points a from points b best, left in t; False if none explains half of them.

    Three guesses are refined by registration: none, the given one, and that of the centroids. A later one has to be
    better by more than rounding: by a part of the noise.
    """
    least = cap * cap
    for trial in range(3):
        for c in range(3):
            u[c] = 0.0 if trial == 0 else guess[c]
            if trial == 2:
                here, there = 0.0, 0.0
                for i in range(m):
                    here += a[i, c]
                for j in range(n):
                    there += b[j, c]
                u[c] = here / m - there / n
        cost, _, found = explain(a, m, b, n, u, cap, mean)
        for _ in range(_STEPS):
            for c in range(3):
                u[c] += mean[c]
            cost, _, found = explain(a, m, b, n, u, cap, mean)
        if cost < least - 0.1 * noise and 2 * found >= m:
            least = cost
            t[0], t[1], t[2] = u[0], u[1], u[2]
    return least < cap * cap


@inline
def is_there(a: Array, m: int, b: Array, n: int, noise: float, cap: float, u: Array, mean: Array) -> bool:
    """Whether points a are there in points b without any shift, up to noise."""
    u[0] = u[1] = u[2] = 0.0
    cost, _, found = explain(a, m, b, n, u, cap, mean)
    return cost <= _most(0.0, 0.0, found, noise)
