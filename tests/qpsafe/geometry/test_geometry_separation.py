"""GJK on every pair of kinds of shapes: proofs of its distances, coal's distances, exact formulas, degenerate shapes.

A distance d with points a, b is proved from both sides: a and b lie on the shapes and are d apart, so it is no more;
and between the planes through a and b, perpendicular to b - a, neither shape has a point, so it is no less. Points and
planes are checked with formulas of the shapes that GJK knows nothing of.
"""

from itertools import product

import coal
import mujoco
import numpy as np
import pytest
from amounts import first
from scipy.spatial import ConvexHull

import qpsafe
from qpsafe.geometry import layout
from qpsafe.sim.engine.distances import Distances
from qpsafe.sim.engine.world import World
from qpsafe.sim.world.scene import build_scene

KINDS = (layout.SPHERE, layout.CAPSULE, layout.ELLIPSOID, layout.CYLINDER, layout.BOX, layout.MESH)
ROBOT = qpsafe.load_robot("irb140")
HOME = ROBOT.at(ROBOT.home).body_poses()


def some_shapes(rng, small, large, spread, each=4):
    """Shapes of every kind, sizes anywhere between `small` and `large`: (scene, data, distances, their numbers)."""

    def furnish(spec):
        for i, kind in product(range(each), KINDS):
            sizes = np.exp(rng.uniform(np.log(small), np.log(large), 3))
            quaternion = rng.normal(size=4)
            looks = {"pos": rng.uniform(-spread, spread, 3), "quat": quaternion / np.linalg.norm(quaternion)}
            if kind == layout.MESH:
                cloud = rng.normal(size=(int(rng.integers(4, 80)), 3)) * sizes / 3.0
                spec.add_mesh(
                    name=f"mesh {i}", uservert=cloud.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
                )
                looks["meshname"] = f"mesh {i}"
            spec.worldbody.add_geom(name=f"a {kind} {i}", type=kind, size=sizes, group=0, **looks)

    scene = build_scene(ROBOT, people=(), furnish=furnish)
    world = World.of(scene)
    numbers = [i for i, name in enumerate(world.names) if name.startswith("a ")]
    return scene, scene.make_data(), Distances(world, ROBOT), numbers


def local(data, geom, p):
    return data.geom_xmat[geom].reshape(3, 3).T @ (p - data.geom_xpos[geom])


def vertices_of(model, geom):
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return model.mesh_vert[first : first + count].astype(float)


def outside(model, data, geom, p):
    """How far a point is beyond the surface of a shape, at least nearly [m]; below 0 inside."""
    x, kind, (a, b, c) = local(data, geom, p), model.geom_type[geom], model.geom_size[geom]
    if kind == layout.SPHERE:
        return np.linalg.norm(x) - a
    if kind == layout.CAPSULE:
        return np.linalg.norm(x - [0.0, 0.0, np.clip(x[2], -b, b)]) - a
    if kind == layout.ELLIPSOID:
        return (np.linalg.norm(x / [a, b, c]) - 1.0) * min(a, b, c)
    if kind == layout.CYLINDER:
        return max(np.hypot(x[0], x[1]) - a, abs(x[2]) - b)
    if kind == layout.BOX:
        return (np.abs(x) - [a, b, c]).max()
    faces = ConvexHull(vertices_of(model, geom)).equations
    return (faces[:, :3] @ x + faces[:, 3]).max()


def farthest(model, data, geom, n):
    """The largest n·x of the points x of a shape."""
    d, kind, (a, b, c) = data.geom_xmat[geom].reshape(3, 3).T @ n, model.geom_type[geom], model.geom_size[geom]
    own = {
        layout.SPHERE: lambda: a,
        layout.CAPSULE: lambda: a + b * abs(d[2]),
        layout.ELLIPSOID: lambda: np.linalg.norm([a * d[0], b * d[1], c * d[2]]),
        layout.CYLINDER: lambda: a * np.hypot(d[0], d[1]) + b * abs(d[2]),
        layout.BOX: lambda: np.abs(d) @ [a, b, c],
        layout.MESH: lambda: (vertices_of(model, geom) @ d).max(),
    }
    return n @ data.geom_xpos[geom] + own[int(kind)]()


SIZES = {
    "as people and robots": (0.03, 0.4, 0.8),
    "thin": (1e-4, 1.0, 1.2),
    "huge": (1.0, 100.0, 150.0),
    "tiny": (1e-5, 1e-3, 2e-3),
}


@pytest.mark.parametrize("sizes", first(2, SIZES))
def test_distances_are_proved_from_both_sides(sizes):
    small, large, spread = SIZES[sizes]
    scene, data, distances, numbers = some_shapes(np.random.default_rng(1), small, large, spread)
    model, proved = scene.model, set()
    tolerance = 1e-10 * max(spread, 0.1)
    for i, j in product(numbers, numbers):
        if i == j:
            continue
        found = distances.pairs(HOME, np.array([[i, j]]))
        if found.distance <= 0.0:
            continue
        g, h = distances.world.geoms[[i, j]]
        assert outside(model, data, g, found.on_robot) < tolerance
        assert outside(model, data, h, found.on_other) < tolerance
        between = found.on_other - found.on_robot
        assert np.linalg.norm(between) == pytest.approx(found.distance, abs=tolerance)
        n = between / np.linalg.norm(between)
        assert -farthest(model, data, h, -n) - farthest(model, data, g, n) > found.distance - 2.0 * tolerance
        proved.add(frozenset((model.geom_type[g], model.geom_type[h])))
    assert len(proved) == 21


def coal_shape(model, geom):
    """The same shape in coal."""
    kind, (a, b, c) = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == layout.MESH:
        points = coal.StdVec_Vec3s()
        points.extend(list(vertices_of(model, geom)))
        return coal.Convex.convexHull(points, False, "")
    return {
        layout.SPHERE: lambda: coal.Sphere(a),
        layout.CAPSULE: lambda: coal.Capsule(a, 2.0 * b),
        layout.ELLIPSOID: lambda: coal.Ellipsoid(a, b, c),
        layout.CYLINDER: lambda: coal.Cylinder(a, 2.0 * b),
        layout.BOX: lambda: coal.Box(2.0 * a, 2.0 * b, 2.0 * c),
    }[kind]()


@pytest.mark.parametrize("seed", [0, 1])
def test_coal_and_mujoco_find_the_same(seed):
    """Apart: the same distance, within what coal reaches with round shapes; overlapping: all three say so."""
    scene, data, distances, numbers = some_shapes(np.random.default_rng(seed), 0.002, 0.5, 0.3)
    model, request = scene.model, coal.DistanceRequest()
    request.gjk_tolerance, request.gjk_max_iterations = 1e-12, 10000
    shapes = {i: coal_shape(model, distances.world.geoms[i]) for i in numbers}
    apart = overlapping = 0
    for i, j in product(numbers, numbers):
        if i >= j:
            continue
        g, h = distances.world.geoms[[i, j]]
        places = [coal.Transform3s(data.geom_xmat[k].reshape(3, 3).copy(), data.geom_xpos[k].copy()) for k in (g, h)]
        by_coal = coal.distance(shapes[i], places[0], shapes[j], places[1], request, coal.DistanceResult())
        by_mujoco = mujoco.mj_geomDistance(model, data, g, h, 100.0, np.empty(6))
        found = distances.pairs(HOME, np.array([[i, j]])).distance
        swapped = distances.pairs(HOME, np.array([[j, i]])).distance
        if found > 0.0:
            apart += 1
            assert found == pytest.approx(by_coal, abs=1e-6)
            assert found == pytest.approx(by_mujoco, abs=1e-8)
            assert found == pytest.approx(swapped, abs=1e-11)
        else:
            overlapping += 1
            assert (by_coal < 1e-9, by_mujoco < 1e-9, swapped <= 1e-12) == (True, True, True)
    assert apart > 50
    assert overlapping > 15


def test_depths_part_the_shapes():
    """What overlaps by d touches when it is moved apart by d along the line of the two points, and not before."""
    scene, _, distances, numbers = some_shapes(np.random.default_rng(3), 0.02, 0.4, 0.25)
    model = scene.model
    shallow = deep = 0
    for i, j in product(numbers, numbers):
        found = distances.pairs(HOME, np.array([[i, j]]))
        if i == j or found.distance >= -1e-6:
            continue
        n = found.on_robot - found.on_other
        assert np.linalg.norm(n) == pytest.approx(-found.distance, abs=1e-9)
        g, h = distances.world.geoms[[i, j]]
        moved = scene.make_data()
        moved.geom_xpos[h] -= found.distance * n / np.linalg.norm(n)
        # the planes through both points part the shapes then
        n = n / np.linalg.norm(n)
        assert -farthest(model, moved, h, -n) - farthest(model, moved, g, n) > -1e-9
        margins = distances.world.shapes[[i, j], layout.MARGIN].sum()
        shallow, deep = shallow + (found.distance > -margins), deep + (found.distance <= -margins)
    assert shallow > 10
    assert deep > 10


def test_capsules_are_as_far_apart_as_their_axes_less_their_radii():
    """Depth of overlap included, as long as the axes do not meet; against the minimum over a fine grid, refined."""
    scene, data, distances, numbers = some_shapes(np.random.default_rng(4), 0.02, 0.5, 0.5, each=10)
    model, geoms = scene.model, distances.world.geoms
    capsules = [i for i in numbers if model.geom_type[geoms[i]] == layout.CAPSULE]
    negative = 0
    for i, j in product(capsules, capsules):
        if i >= j:
            continue
        (p, u), (q, v) = (
            (data.geom_xpos[g], data.geom_xmat[g].reshape(3, 3)[:, 2] * model.geom_size[g, 1]) for g in geoms[[i, j]]
        )
        expected = segment_distance(p, u, q, v) - model.geom_size[geoms[[i, j]], 0].sum()
        found = distances.pairs(HOME, np.array([[i, j]]))
        assert found.distance == pytest.approx(expected, abs=1e-12)
        negative += expected < 0.0
    assert negative > 3


def segment_distance(p, u, q, v):
    """Of the segments p + s u and q + t v, s and t in [-1, 1]: inside, or with one of the four ends."""
    best = np.inf
    for s, t in ((None, -1.0), (None, 1.0), (-1.0, None), (1.0, None), (None, None)):
        if s is None and t is None:
            (s, t), *_ = np.linalg.lstsq(np.stack((u, -v), axis=1), q - p, rcond=None)
            if max(abs(s), abs(t)) > 1.0:
                continue
        elif s is None:
            s = np.clip((q + t * v - p) @ u / (u @ u), -1.0, 1.0)
        else:
            t = np.clip((p + s * u - q) @ v / (v @ v), -1.0, 1.0)
        best = min(best, np.linalg.norm(p + s * u - q - t * v))
    return best


def degenerate(first, second):
    """Distance of two shapes given as (kind, sizes, position) on one world."""

    def furnish(spec):
        for name, (kind, size, place) in zip("ab", (first, second), strict=True):
            spec.worldbody.add_geom(name=f"a {name}", type=kind, size=size, pos=place, group=0)

    world = World.of(build_scene(ROBOT, people=(), furnish=furnish))
    i, j = (world.names.index(f"a {name}") for name in "ab")
    return Distances(world, ROBOT).pairs(HOME, np.array([[i, j]]))


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ((layout.SPHERE, [0.1, 0, 0], [0, 0, 1]), (layout.SPHERE, [0.2, 0, 0], [0, 0, 1]), -0.3),  # one centre
        ((layout.BOX, [0.1, 0.2, 0.3], [0, 0, 1]), (layout.BOX, [0.1, 0.2, 0.3], [0, 0, 1]), -0.2),  # the same box
        ((layout.BOX, [0.1, 0.1, 0.1], [0, 0, 1]), (layout.BOX, [0.1, 0.1, 0.1], [0.2, 0, 1]), 0.0),  # touching
        ((layout.BOX, [0.1, 0.1, 0.1], [0, 0, 1]), (layout.BOX, [0.1, 0.1, 0.1], [0.2, 0.2, 1.2]), 0.0),  # at a corner
        ((layout.BOX, [1.0, 1.0, 1e-9], [0, 0, 1]), (layout.BOX, [1.0, 1.0, 1e-9], [0, 0, 1.25]), 0.25 - 2e-9),
        ((layout.CYLINDER, [1e-9, 1.0, 0], [0, 0, 1]), (layout.CAPSULE, [0.1, 1.0, 0], [0.5, 0, 1]), 0.4 - 1e-9),
        ((layout.CYLINDER, [0.2, 0.5, 0], [0, 0, 1]), (layout.CYLINDER, [0.2, 0.5, 0], [0, 0, 2.5]), 0.5),
        ((layout.CYLINDER, [0.2, 0.5, 0], [0, 0, 1]), (layout.CYLINDER, [0.2, 0.5, 0], [0, 0, 1.5]), -0.4),
        ((layout.CYLINDER, [0.25, 0.5, 0], [0, 0, 1]), (layout.BOX, [0.25, 0.25, 0.5], [0.25, 0, 1]), -0.25),
        ((layout.ELLIPSOID, [0.1, 10.0, 1e-3], [0, 0, 1]), (layout.SPHERE, [0.1, 0, 0], [0, 0, 2]), 0.9 - 1e-3),
        ((layout.SPHERE, [1e-9, 0, 0], [0, 0, 1]), (layout.BOX, [1e3, 1e3, 1e3], [0, 0, 1002]), 1.0 - 1e-9),
        ((layout.SPHERE, [0.1, 0, 0], [0, 0, 1]), (layout.PLANE, [0, 0, 1], [0, 0, 0.5]), 0.4),
        ((layout.ELLIPSOID, [0.1, 0.2, 0.3], [0, 0, 1]), (layout.PLANE, [0, 0, 1], [0, 0, 0.9]), -0.2),
    ],
)
def test_degenerate_shapes_have_distances_too(first, second, expected):
    found = degenerate(first, second)
    assert found.distance == pytest.approx(expected, abs=1e-9)
    assert np.isfinite(found.on_robot).all()
    assert np.isfinite(found.on_other).all()
