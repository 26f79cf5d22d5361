import coal
import mujoco
import numpy as np
import pytest

from qpsafe.robot.loader import load_robot
from qpsafe.sim.world.distance import TrueDistances
from qpsafe.sim.world.scene import build_scene

SCENE = build_scene(load_robot("irb140"))
TRUE = TrueDistances(SCENE)


def random_states(count, seed):
    """Robot anywhere, person anywhere near it: apart and overlapping."""
    rng, data = np.random.default_rng(seed), SCENE.make_data()
    for _ in range(count):
        data.qpos[SCENE.q_addresses] = rng.uniform(SCENE.robot.lower, SCENE.robot.upper)
        azimuth, radius = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 2.2)
        place = radius * np.cos(azimuth), radius * np.sin(azimuth), azimuth + np.pi + rng.normal() * 0.5
        SCENE.place_person(data, SCENE.person.pose(*place))
        yield data


def coal_shape(geom):
    """The same convex shape in coal."""
    model, kind = SCENE.model, mujoco.mjtGeom
    size, this = model.geom_size[geom], model.geom_type[geom]
    if this == kind.mjGEOM_BOX:
        return coal.Box(*(2 * size))
    if this == kind.mjGEOM_CAPSULE:
        return coal.Capsule(size[0], 2 * size[1])
    if this == kind.mjGEOM_CYLINDER:
        return coal.Cylinder(size[0], 2 * size[1])
    if this == kind.mjGEOM_SPHERE:
        return coal.Sphere(size[0])
    assert this == kind.mjGEOM_MESH
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = coal.StdVec_Vec3s()
    for vertex in model.mesh_vert[first : first + count]:
        vertices.append(vertex.astype(float))
    return coal.Convex.convexHull(vertices, False, "")


def coal_distance(data, shapes, others):
    request = coal.DistanceRequest()
    request.gjk_tolerance, request.gjk_max_iterations = 1e-10, 1000

    def placed(geom):
        return coal.Transform3s(data.geom_xmat[geom].reshape(3, 3).copy(), data.geom_xpos[geom].copy())

    return min(
        coal.distance(shapes[a], placed(a), shapes[b], placed(b), request, coal.DistanceResult())
        for a in SCENE.robot_geoms
        for b in others
    )


@pytest.mark.parametrize("measure", [TRUE.board, TRUE.person])
def test_agrees_with_another_library_wherever_they_are_apart(measure):
    others = [SCENE.board_geom] if measure == TRUE.board else list(SCENE.person_geoms)
    shapes = {geom: coal_shape(geom) for geom in [*SCENE.robot_geoms, *others]}
    apart = overlapping = 0
    for data in random_states(40, seed=3):
        wanted, got = coal_distance(data, shapes, others), measure(data)
        if wanted > 1e-6:
            apart += 1
            assert got.distance == pytest.approx(wanted, abs=1e-6)
            assert np.linalg.norm(got.on_robot - got.on_other) == pytest.approx(got.distance, abs=1e-6)
        else:
            overlapping += 1
            assert got.distance <= 1e-6
    assert apart > 10
    assert overlapping > 3


@pytest.mark.parametrize("measure", [TRUE.board, TRUE.person])
def test_skipping_pairs_loses_nothing(measure):
    others = [SCENE.board_geom] if measure == TRUE.board else SCENE.person_geoms
    for data in random_states(60, seed=4):
        everything = min(
            mujoco.mj_geomDistance(SCENE.model, data, a, b, 100.0, None) for a in SCENE.robot_geoms for b in others
        )
        found = measure(data).distance
        assert found == pytest.approx(everything, abs=1e-8) if everything > 0.0 else found < 0.0


def test_stepping_back_from_the_robot_adds_what_was_stepped():
    """Along the face's normal, with the same part of the robot nearest: distances differ by the step exactly."""
    data = SCENE.make_data()
    SCENE.place_person(data, SCENE.person.pose(1.3, 0.0, np.pi))
    near = TRUE.board(data)
    for step in (0.1, 0.37, 0.8):
        SCENE.place_person(data, SCENE.person.pose(1.3 + step, 0.0, np.pi))
        far = TRUE.board(data)
        assert far.distance == pytest.approx(near.distance + step, abs=1e-9)
        assert far.on_robot[0] == pytest.approx(near.on_robot[0], abs=1e-9)
        assert far.on_other[0] == pytest.approx(1.3 + step - SCENE.person.board.reach, abs=1e-9)


def test_a_board_through_the_arm_is_negative():
    data = SCENE.make_data()
    SCENE.place_person(data, SCENE.person.pose(0.72, 0.0, np.pi))  # face at x = 0.3
    assert TRUE.board(data).distance < 0.0


def test_a_body_in_the_robot_is_negative():
    data = SCENE.make_data()
    SCENE.place_person(data, SCENE.person.pose(0.25, 0.0, 0.0))
    assert TRUE.person(data).distance < 0.0
