"""Clusters of points and the shifts between them, compiled: what `qpsafe.ranging.tracking.tracks` is made of."""

from __future__ import annotations

from math import sqrt

from qpsafe.compiled.compiled import Array, inline
from qpsafe.robot.kinematics import Index

#: Steps of the registration, and of the search for the smallest shift.
_STEPS, _HALVINGS = 3, 5


@inline
def squared(x: float, y: float, z: float, b: Array, j: int) -> float:
    """Square of the distance of (x, y, z) from b[j]."""
    dx, dy, dz = x - b[j, 0], y - b[j, 1], z - b[j, 2]
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
            x, y, z = p[stack[top], 0], p[stack[top], 1], p[stack[top], 2]
            for j in range(count):
                if labels[j] < 0 and squared(x, y, z, p, j) <= reach * reach:
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
        px, py, pz = a[i, 0] - t[0], a[i, 1] - t[1], a[i, 2] - t[2]
        best, k = cap * cap, -1
        for j in range(n):
            d = squared(px, py, pz, b, j)
            if d < best:
                best, k = d, j
        if k >= 0:
            found += 1
            with_one += best
            x, y, z = x + px - b[k, 0], y + py - b[k, 1], z + pz - b[k, 2]
        inside += best
    share = 1.0 / max(found, 1)
    mean[0], mean[1], mean[2] = share * x, share * y, share * z
    return inside / m, with_one / m, found


@inline
def explains(a: Array, m: int, b: Array, n: int, t: Array, sign: float, cap: float, most: float) -> bool:
    """Whether what `explain` tells first of the shift sign·t is no more than `most`; it stops where it is more."""
    x, y, z, left = sign * t[0], sign * t[1], sign * t[2], most * m
    for i in range(m):
        px, py, pz, best = a[i, 0] - x, a[i, 1] - y, a[i, 2] - z, cap * cap
        for j in range(n):
            d = squared(px, py, pz, b, j)
            if d < best:
                best = d
        left -= best
        if not left >= 0.0:
            return False
    return True


@inline
def parent_of(
    a: Array, m: int, p: Array, labels: Index, motions: Array, count: int, clusters: int, dt: float, gate: float,
    ahead: Array, nearest: Array, total: Array,
) -> int:  # fmt: skip
    """Cluster of the image before, moved on by its velocity, that explains points a best; -1 if none does."""
    for l in range(clusters):
        total[l] = 0.0
    for j in range(count):
        for c in range(3):
            ahead[j, c] = p[j, c] + dt * motions[labels[j], c]
    for i in range(m):
        for l in range(clusters):
            nearest[l] = gate * gate
        for j in range(count):
            d = squared(a[i, 0], a[i, 1], a[i, 2], ahead, j)
            if d < nearest[labels[j]]:
                nearest[labels[j]] = d
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
    """The smallest part of the shift sign·t, 0 to 1, that explains points a from b nearly as well as all of it."""
    for c in range(3):
        u[c] = sign * t[c]
    cost, part, found = explain(a, m, b, n, u, cap, mean)
    most = _most(cost, part, found, noise)
    if explains(a, m, b, n, t, 0.0, cap, most):
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if explains(a, m, b, n, t, sign * middle, cap, most):
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@inline
def best_shift(
    a: Array, m: int, b: Array, n: int, guess: Array, noise: float, cap: float, t: Array, u: Array, mean: Array
) -> bool:
    """The shift that explains points a from points b best, left in t; False if none explains half of them.

    Guesses are refined by registration: the given one, and if that does not explain them up to noise, none, and that of
    the centroids. A later one has to be better by more than rounding: by a part of the noise.
    """
    least = cap * cap
    for trial in range(3):
        for c in range(3):
            u[c] = guess[c] if trial == 0 else 0.0
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
        if trial == 0 and cost <= _most(0.0, 0.0, m, noise):
            break
    return least < cap * cap


@inline
def is_there(a: Array, m: int, b: Array, n: int, noise: float, cap: float, u: Array) -> bool:
    """Whether points a are there in points b without any shift, up to noise."""
    return explains(a, m, b, n, u, 0.0, cap, _most(0.0, 0.0, m, noise))
