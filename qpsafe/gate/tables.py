"""What the gate knows of a robot and its surroundings, in two blocks, and how they are cut into arrays."""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

from qpsafe.compiled.compiled import inline
from qpsafe.compiled.memory import view

#: Sizes at the beginning of the block of integers: joints, capsules, groups of pairs, pairs, shapes, vertices of
#: hulls, edges, faces.
JOINTS, CAPSULES, GROUPS, PAIRS, SHAPES, VERTICES, EDGES, FACES = range(8)
HEADER = 8
#: `Tables.numbers`: tick; R(0) without age; person's speed; approach; margin; farthest distance that is
#: measured; the oldest reading that counts; for how long people may step aside; how fast a link
#: must be able to get away, or else stand.
DT, NEAR, PERSON, APPROACH, MARGIN, FARTHEST, MAX_AGE, SIDESTEP, ESCAPE = range(9)
NUMBERS = 9


class Tables(NamedTuple):
    """Of n joints, c capsules, g groups of pairs of shapes that must not touch."""

    numbers: Any
    acceleration: Any  # (n,) [rad/s²]
    swift: Any  # speeds that joints have a moment after rest (n,) [rad/s]
    placements: Any  # kinematics, see `Tree`: (n, 4, 4)
    axes: Any  # (n, 6)
    supports: Any  # (n + 1, n)
    ends: Any  # of the capsules, in their bodies (c, 2, 3) [m]
    radii: Any  # (c,) [m]
    levers: Any  # of the capsules (c, n)
    group_levers: Any  # (g, n)
    shapes: Any  # solids, see `qpsafe.geometry`
    vertices: Any
    planes: Any
    parents: Any  # (n,)
    bodies: Any  # of the capsules (c,)
    group_starts: Any  # first pair of each group (g + 1,)
    pairs: Any  # (m, 2)
    index: Any
    starts: Any
    neighbours: Any


def shapes_of(sizes: Any) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]:
    """Shapes of the arrays of floats and of integers, in their order."""
    n, c, g, m, s, v, e, f = (int(size) for size in sizes[:HEADER])
    floats = (
        (NUMBERS,), (n,), (n,), (n, 4, 4), (n, 6), (n + 1, n), (c, 2, 3), (c,), (c, n), (g, n), (s, 26), (v, 3), (f, 4),
    )  # fmt: skip
    return floats, ((n,), (c,), (g + 1,), (m, 2), (s, 10), (v + 1,), (e,))


def lengths(sizes: Any) -> tuple[int, int]:
    """How many floats and integers these are, the header of the integers included."""
    floats, integers = shapes_of(sizes)
    return sum(map(prod, floats)), HEADER + sum(map(prod, integers))


@inline
def tables(floats: Any, integers: Any) -> Any:
    """Cut `Tables`."""
    n, c, g, m = integers[JOINTS], integers[CAPSULES], integers[GROUPS], integers[PAIRS]
    s, v, e, f = integers[SHAPES], integers[VERTICES], integers[EDGES], integers[FACES]
    a = NUMBERS + 2 * n
    b = a + 16 * n + 6 * n + (n + 1) * n
    d = b + 7 * c + c * n
    h = d + g * n
    i = HEADER + n + c + g + 1
    j = i + 2 * m + 10 * s
    return Tables(
        view(floats, 0, (NUMBERS,)),
        view(floats, NUMBERS, (n,)),
        view(floats, NUMBERS + n, (n,)),
        view(floats, a, (n, 4, 4)),
        view(floats, a + 16 * n, (n, 6)),
        view(floats, a + 22 * n, (n + 1, n)),
        view(floats, b, (c, 2, 3)),
        view(floats, b + 6 * c, (c,)),
        view(floats, b + 7 * c, (c, n)),
        view(floats, d, (g, n)),
        view(floats, h, (s, 26)),
        view(floats, h + 26 * s, (v, 3)),
        view(floats, h + 26 * s + 3 * v, (f, 4)),
        view(integers, HEADER, (n,)),
        view(integers, HEADER + n, (c,)),
        view(integers, HEADER + n + c, (g + 1,)),
        view(integers, i, (m, 2)),
        view(integers, i + 2 * m, (s, 10)),
        view(integers, j, (v + 1,)),
        view(integers, j + v + 1, (e,)),
    )
