"""The flat tables of a robot and its surroundings: coal's distances, and which pairs are measured at all."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pytest

import qpsafe
from qpsafe.geometry.layout import BODY, VERTEX, VERTICES
from qpsafe.geometry.measure import nearest_of, pairs_of
from qpsafe.geometry.solids import Solids
from qpsafe.sensing.body import body_hulls, fixed_to
from qpsafe.sensing.hulls import Obstacle

FRAMES = {"irb140": "tcp", "irb14000": "tcp_l", "iiwa14": "tcp"}


def surroundings(rng: np.random.Generator) -> list[Obstacle]:
    """A floor, a turned box and a cloud of points."""
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = np.linalg.qr(rng.normal(size=(3, 3)))[0], (0.3, -0.3, 0.6)
    floor = Obstacle.box("floor", (6.0, 6.0, 0.5), (0.0, 0.0, -0.25))
    cloud = Obstacle("cloud", rng.normal((-0.3, 0.3, 0.6), 0.15, (40, 3)))
    return [floor, Obstacle.box("box", (0.2, 0.3, 0.4), pose=turned), cloud]


def convex(points: Any) -> Any:
    vertices = coal.StdVec_Vec3s()
    vertices.extend(list(np.asarray(points, dtype=float)))
    return coal.Convex.convexHull(vertices, False, "")


@pytest.mark.parametrize("name", qpsafe.bundled_robots())
def test_distances_of_hulls_are_coals(name: str) -> None:
    """Both sides made from the same hulls, by two programs; each pair that may be measured, at random poses."""
    rng, robot = np.random.default_rng(0), qpsafe.load_robot(name)
    known, thing = surroundings(rng), Obstacle.box("part", (0.1, 0.05, 0.2), (0.0, 0.0, 0.12))
    frame = FRAMES[name] if FRAMES[name] in robot.frame_names else robot.frame_names[-1]
    solids = Solids.of(robot, known, {frame: [thing]})
    placed = [*body_hulls(robot), fixed_to(robot, frame, thing), *((0, k.name, k.vertices) for k in known)]
    assert solids.names == tuple(name for _, name, _ in placed)
    shapes, request = [convex(vertices) for *_, vertices in placed], coal.DistanceRequest()
    request.gjk_tolerance, request.gjk_max_iterations = 1e-12, 10000
    pairs, apart, overlapping = np.vstack((solids.furniture, solids.own)), 0, 0
    for _ in range(8):
        poses = robot.at(rng.uniform(robot.lower, robot.upper)).body_poses()
        places = [coal.Transform3s(poses[b, :3, :3].copy(), poses[b, :3, 3].copy()) for b, *_ in placed]
        for i, j in rng.permutation(pairs)[:120].tolist():
            theirs = coal.distance(shapes[i], places[i], shapes[j], places[j], request, coal.DistanceResult())
            ours = nearest_of(solids.solid, poses, pairs_of([(i, j)]))
            if ours.distance > 0.0:
                assert ours.distance == pytest.approx(theirs, abs=1e-7)
                apart += 1
            else:
                assert theirs < 1e-9
                overlapping += 1
    assert apart > 500
    assert overlapping > 0


@pytest.mark.parametrize("name", qpsafe.bundled_robots())
def test_pairs_are_what_can_meet(name: str) -> None:
    """Nothing against itself, its neighbours or what it is mounted on; the base moves nowhere."""
    robot = qpsafe.load_robot(name)
    base = min(points[:, 2].min() for body, _, points in body_hulls(robot) if body == 0)
    first = next((body, points) for body, _, points in body_hulls(robot) if body == 1)
    pose = robot.at(robot.home).body_poses()[1]
    inside = (pose[:3, :3] @ first[1].mean(axis=0)) + pose[:3, 3]
    stand = Obstacle.box("stand", (0.3, 0.3, 0.2), (0.0, 0.0, base - 0.1))
    solids = Solids.of(robot, [stand, Obstacle.box("ring", (0.02, 0.02, 0.02), inside)])
    bodies, parents = solids.index[:, BODY], [0, *robot.tree.parents.tolist()]
    assert (bodies[solids.robot] > 0).all()
    ring = solids.names.index("ring")
    joined = [i for i in solids.robot.tolist() if [i, ring] not in solids.furniture.tolist()]
    assert joined
    assert all(nearest_of(solids.solid, robot.at(robot.home).body_poses(), pairs_of([(i, ring)])).distance <= 0.0
               for i in joined)  # fmt: skip
    for i, j in solids.own.tolist():
        a, b = bodies[i], bodies[j]
        assert a != b
        assert parents[a] != b
        assert parents[b] != a
    home = robot.at(robot.home).body_poses()
    assert nearest_of(solids.solid, home, solids.own).distance > 0.0
    assert nearest_of(solids.solid, home, solids.furniture).distance > 0.0


def test_tables_are_read_only_and_whole() -> None:
    robot = qpsafe.load_robot("irb140")
    solids = Solids.of(robot, surroundings(np.random.default_rng(1)))
    for array in (*solids.solid, solids.robot, solids.furniture, solids.own):
        assert not array.flags.writeable
        assert array.flags.c_contiguous
    ends = solids.index[:, VERTEX] + solids.index[:, VERTICES]
    assert ends[-1] == len(solids.vertices)
    assert (solids.index[1:, VERTEX] == ends[:-1]).all()
    nothing = Solids.of(robot, ())
    assert nothing.furniture.shape == (0, 2)
    assert len(nothing.own) == len(solids.own)
