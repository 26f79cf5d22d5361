"""The engine's distances against MuJoCo's over encounters, and how they change when the world does."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import qpsafe
from qpsafe.geometry import layout
from qpsafe.sim.engine.distances import Distances
from qpsafe.sim.engine.tracks import PersonTracks
from qpsafe.sim.engine.world import World
from qpsafe.sim.experiments.pick_place.cell import Cell
from qpsafe.sim.world.scene import build_scene

ROBOTS = qpsafe.bundled_robots()
ROBOT = qpsafe.load_robot("irb140")


def by_mujoco(scene, data, geoms, others, enough):
    """Smallest distance of some geoms to others, larger ones than `enough` not looked at."""
    best, radii, kinds = np.inf, scene.model.geom_rbound, scene.model.geom_type
    apart = np.linalg.norm(data.geom_xpos[geoms] - data.geom_xpos[others], axis=1) - radii[geoms] - radii[others]
    for i in np.flatnonzero((apart <= max(enough, 0.0) + 1e-6) | (kinds[others] == mujoco.mjtGeom.mjGEOM_PLANE)):
        best = min(best, mujoco.mj_geomDistance(scene.model, data, geoms[i], others[i], 100.0, np.empty(6)))
    return best


def compare(worlds, name, count, seed):
    """Largest difference of what is apart, how many overlapped in both, how many in one only."""
    robot = qpsafe.load_robot(name)
    scene = build_scene(robot, people=worlds.PEOPLE, furnish=Cell(full=0).furnish)
    world = World.of(scene)
    distances = Distances(world, robot)
    worst, overlaps, unequal = 0.0, 0, 0
    for data, state, tracks in worlds.random_encounters(scene, count, seed):
        poses, (ends, radii, balls, boards, half_sizes) = state.body_poses(), tracks.row(0)
        bodies = ends, radii, balls, boards[:0], half_sizes[:0]
        only_boards = ends[:0], radii[:0], balls[:0], boards, half_sizes
        robot_geoms = world.geoms[world.robot]
        cases = [
            (distances.people(poses, people), *(a.ravel() for a in np.meshgrid(robot_geoms, geoms)))
            for people, geoms in ((bodies, scene.person_geoms), (only_boards, scene.board_geoms))
        ]
        for pairs in (distances.furniture, distances.floors, distances.own):
            cases += [(distances.pairs(poses, pairs), *world.geoms[pairs].T)]
        for found, geoms, others in cases:
            expected = by_mujoco(scene, data, geoms, others, found.distance)
            if min(found.distance, expected) > 0.0:
                worst = max(worst, abs(found.distance - expected))
                assert np.linalg.norm(found.on_robot - found.on_other) == pytest.approx(found.distance, abs=1e-9)
            elif (found.distance < 0.0) == (expected < 0.0):
                overlaps += 1
            else:
                unequal += 1
    return worst, overlaps, unequal


@pytest.mark.parametrize("name", ROBOTS)
def test_distances_are_mujocos_and_so_is_their_sign(worlds, name):
    worst, overlaps, unequal = compare(worlds, name, 15, seed=0)
    assert worst < 1e-8
    assert overlaps > 3
    assert unequal == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_distances_are_mujocos_in_many_encounters(worlds, name):
    worst, overlaps, unequal = compare(worlds, name, 700, seed=1)
    print(name, worst, overlaps, unequal)
    assert worst < 1e-8
    assert unequal == 0


@pytest.fixture(scope="module")
def encounters(worlds):
    scene = build_scene(ROBOT, people=worlds.PEOPLE, furnish=Cell(full=0).furnish)
    world = World.of(scene)
    cases = [(state.body_poses(), tracks) for _, state, tracks in worlds.random_encounters(scene, 25, 5, (0.3, 2.5))]
    return Distances(world, ROBOT), cases


def all_of(distances, poses, row):
    """People, furniture, floor, itself."""
    pairs = (distances.furniture, distances.floors, distances.own)
    return [distances.people(poses, row), *(distances.pairs(poses, some) for some in pairs)]


def test_names_of_what_is_near(encounters):
    """Shape and capsule that are named have the distance that was found, alone."""
    distances, cases = encounters
    boards = 0
    for poses, tracks in cases:
        ends, radii, balls, at, half_sizes = tracks.row(0)
        found = distances.people(poses, tracks.row(0))
        assert found.shape in distances.world.robot
        if found.other < len(radii):
            j = [found.other]
            alone = ends[j], radii[j], balls[[found.other // 17]], at[:0], half_sizes[:0]
        else:
            b, boards = [found.other - len(radii)], boards + 1
            alone = ends[:0], radii[:0], balls[:0], at[b], half_sizes[b]
        one = Distances(distances.world.take([found.shape]), ROBOT)
        assert one.people(poses, alone).distance == found.distance
        own = distances.pairs(poses, distances.own)
        assert [own.shape, own.other] in distances.own.tolist()
    assert 0 < boards < len(cases)


def test_what_is_farther_than_asked_for_is_not_told(encounters):
    distances, cases = encounters
    for poses, tracks in cases:
        calls = [(distances.people, tracks.row(0))]
        calls += [(distances.pairs, some) for some in (distances.furniture, distances.floors, distances.own)]
        for measure, what in calls:
            whole = measure(poses, what)
            near = measure(poses, what, whole.distance + 1e-6)
            assert (near.distance, near.shape, near.other) == (whole.distance, whole.shape, whole.other)
            far = measure(poses, what, whole.distance - 1e-6)
            assert (far.distance, far.shape, far.other) == (np.inf, -1, -1)


def test_moving_everything_changes_nothing(encounters):
    distances, cases = encounters
    rng = np.random.default_rng(0)
    for poses, tracks in cases:
        R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R * np.linalg.det(R), rng.uniform(-3.0, 3.0, 3)
        moved = PersonTracks(
            tracks.ends @ T[:3, :3].T + T[:3, 3],
            tracks.radii,
            T @ tracks.boards,
            tracks.half_sizes,
            0.004,
            tracks.names,
        )
        for one, other in zip(
            all_of(distances, poses, tracks.row(0)), all_of(distances, T @ poses, moved.row(0)), strict=True
        ):
            # of overlapping cores only the sign is certain: the last digits choose among equal shifts
            assert other.distance == pytest.approx(one.distance, abs=1e-10)


def test_the_order_of_shapes_changes_nothing(encounters):
    distances, cases = encounters
    world, rng = distances.world, np.random.default_rng(1)
    order = rng.permutation(len(world.names))
    other = Distances(world.take(order), ROBOT)
    assert {frozenset(order[p].tolist()) for p in other.own} == {frozenset(p.tolist()) for p in distances.own}
    for poses, tracks in cases:
        for a, b in zip(all_of(distances, poses, tracks.row(0)), all_of(other, poses, tracks.row(0)), strict=True):
            assert a.distance == pytest.approx(b.distance, abs=1e-12)


@pytest.mark.parametrize("factor", [1e-3, 7.0, 1e3])
def test_a_world_of_another_size_has_distances_of_that_size(encounters, factor):
    distances, cases = encounters
    world = distances.world
    shapes, planes = world.shapes.copy(), world.planes.copy()
    shapes[:, [3, 7, 11]] *= factor
    shapes[:, layout.SIZE :] *= factor
    planes[:, 3] *= factor
    large = Distances(world, ROBOT)
    large.own = distances.own
    large.world = replace(world, shapes=shapes, planes=planes, vertices=world.vertices * factor)
    for poses, tracks in cases:
        poses, boards = poses.copy(), tracks.boards.copy()
        before = all_of(distances, poses, tracks.row(0))
        poses[:, :3, 3] *= factor
        boards[..., :3, 3] *= factor
        scaled = PersonTracks(
            factor * tracks.ends, factor * tracks.radii, boards, factor * tracks.half_sizes, 0.004, tracks.names
        )
        for one, other in zip(before, all_of(large, poses, scaled.row(0)), strict=True):
            assert other.distance == pytest.approx(factor * one.distance, abs=factor * 1e-10 + 1e-11)


def test_own_pairs_are_apart_at_home_and_not_joined(encounters):
    distances, _ = encounters
    bodies = distances.world.index[:, layout.BODY]
    assert len(distances.own) > 100
    for i, j in bodies[distances.own]:
        assert abs(i - j) > 1  # a chain
    at_home = distances.pairs(ROBOT.at(ROBOT.home).body_poses(), distances.own)
    assert 0.0 < at_home.distance < 0.1
    # folded into itself it is noticed
    q = ROBOT.home.copy()
    q[1], q[2] = ROBOT.upper[1], ROBOT.upper[2]
    rng, overlapping = np.random.default_rng(2), 0
    for _ in range(100):
        q = rng.uniform(ROBOT.lower, ROBOT.upper)
        overlapping += distances.pairs(ROBOT.at(q).body_poses(), distances.own).distance < 0.0
    assert 0 < overlapping < 50


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_poses_that_are_not_finite_give_no_distance(encounters, bad):
    distances, cases = encounters
    poses, row = cases[0][0].copy(), cases[0][1].row(0)
    poses[4, 1, 3] = bad
    for found in all_of(distances, poses, row):
        assert np.isnan(found.distance)
        assert (found.shape, found.other) == (-1, -1)


def test_nobody_is_infinitely_far_away(encounters):
    distances, cases = encounters
    found = distances.people(cases[0][0], PersonTracks.of((), [[]], 0.004).row(0))
    assert (found.distance, found.shape, found.other) == (np.inf, -1, -1)
