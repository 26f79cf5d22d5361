"""What does not count: known obstacles and the robot itself; and what counts all the same."""

from itertools import product
from typing import Any

import coal
import numpy as np
import pytest
from amounts import some
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sensing.body import body_hulls
from qpsafe.sensing.hulls import HullSet, Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing

WORLD = np.eye(4)[None]
REST = np.zeros(6)
number = st.floats(-1.0, 1.0)
vector = st.tuples(number, number, number).map(np.array)


def inside(obstacle: Obstacle, point: np.ndarray, tolerance: float) -> bool:
    hulls = HullSet([(0, obstacle.name, obstacle.vertices)])
    return bool(hulls.find(point[None], np.array([tolerance]), WORLD)[0] == 0)


@settings(max_examples=some(16, of=100), deadline=None)
@given(st.integers(0, 2**32 - 1), vector, st.floats(0.0, 0.1))
def test_a_hull_agrees_with_coal(seed: int, point: np.ndarray, tolerance: float) -> None:
    """Inside is inside; within the tolerance is inside; more than √3 tolerances away from its box is not."""
    corners = np.random.default_rng(seed).uniform(-0.6, 0.6, (12, 3))
    points = coal.StdVec_Vec3s()
    points.extend(list(corners))
    convex = coal.Convex.convexHull(points, True, "")  # the qhull inside coal
    result = coal.DistanceResult()
    there = coal.Transform3s(np.eye(3), point)
    distance = coal.distance(convex, coal.Transform3s(), coal.Sphere(1e-9), there, coal.DistanceRequest(), result)
    assume(abs(distance - tolerance) > 1e-6)
    found = inside(Obstacle("hull", corners), point, tolerance)
    if distance < tolerance:
        assert found
    beyond = np.maximum(np.maximum(corners.min(0) - point, point - corners.max(0)), 0.0)
    if np.linalg.norm(beyond) > np.sqrt(3.0) * tolerance + 1e-9:
        assert not found
    assert inside(Obstacle("hull", corners), point, 0.0) == (distance <= 0.0) or abs(distance) < 1e-6


def test_boxes_meshes_and_vertices_make_the_same_hull(tmp_path: Any) -> None:
    box = Obstacle.box("box", (0.4, 0.2, 0.1), (1.0, 0.0, 0.5))
    by_vertices = Obstacle("box", np.vstack((box.vertices, box.vertices.mean(0))))
    corners = box.vertices
    lines = [f"v {x} {y} {z}" for x, y, z in 1000.0 * corners]
    faces = ["f 1 2 4", "f 1 4 3", "f 5 6 8", "f 5 8 7", "f 1 2 6", "f 1 6 5", "f 3 4 8", "f 3 8 7"]
    path = tmp_path / "box.obj"
    path.write_text("\n".join([*lines, *faces, "f 1 3 7", "f 1 7 5", "f 2 4 8", "f 2 8 6"]) + "\n")
    by_mesh = Obstacle.mesh("box", path, scale=1e-3)
    rng = np.random.default_rng(0)
    points = rng.uniform((0.7, -0.2, 0.4), (1.3, 0.2, 0.6), (300, 3))
    tolerance = np.full(300, 0.01)
    answers = [
        HullSet([(0, "", o.vertices)]).find(points, tolerance, WORLD).tolist() for o in (box, by_vertices, by_mesh)
    ]
    assert answers[0] == answers[1] == answers[2]
    assert 20 < answers[0].count(0) < 280


@pytest.mark.parametrize(
    "make",
    [
        lambda: Obstacle("flat", [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]),
        lambda: Obstacle("few", [[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        lambda: Obstacle("nan", np.full((8, 3), np.nan)),
        lambda: Obstacle.box("size", (1.0, 0.0, 1.0)),
        lambda: Obstacle.box("pose", (1.0, 1.0, 1.0), pose=np.eye(3)),
        lambda: Obstacle.mesh("file", "no such file.stl"),
    ],
)
def test_an_obstacle_that_is_none_is_named(make: Any) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match="obstacle"):
        make()


@settings(max_examples=some(10, of=25), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_points_on_the_robot_are_the_robot(irb140: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    hulls = body_hulls(irb140)
    poses = irb140.at(rng.uniform(irb140.lower, irb140.upper)).body_poses()
    points = []
    for body, _, corners in hulls:  # on the hulls, between some of their vertices
        shares = rng.dirichlet(np.ones(4), 3)
        picked = np.array([corners[rng.integers(len(corners), size=4)] for _ in range(3)])
        points.append(np.einsum("ps,psk->pk", shares, picked) @ poses[body, :3, :3].T + poses[body, :3, 3])
    found = HullSet(hulls).find(np.vstack(points), np.full(3 * len(hulls), 1e-9), poses)
    assert (found >= 0).all()
    far = poses[:, :3, 3].mean(0) + np.array([3.0, 0.0, 0.0])
    assert HullSet(hulls).find(far[None], np.array([0.1]), poses).tolist() == [-1]


def sensing(robot: Any, known: Any = (), **rules: Any) -> DistanceSensing:
    return DistanceSensing(robot, qpsafe.load_spots(robot), 0.004, SensingRules(**rules), known)


def read(sensing: DistanceSensing, robot: Any, spot: int, distance: float) -> Any:
    """What counts when one spot reads something at the home pose."""
    distances = np.full(20, np.inf)
    distances[spot] = distance
    return sensing.update(robot.at(robot.home), robot.wire(robot.home, REST), distances)


def table_before(robot: Any, spot: int, distance: float) -> Obstacle:
    """A thin plate across the ray of a spot, its near face at `distance`."""
    origins, directions = qpsafe.load_spots(robot).rays(robot.at(robot.home))
    z = directions[spot]
    x = np.cross(z, [0.3, 0.4, 0.5])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack((x, np.cross(z, x), z), axis=1)
    pose[:3, 3] = origins[spot] + (distance + 0.02) * z
    return Obstacle.box("table", (1.0, 1.0, 0.04), pose=pose)


@pytest.mark.parametrize("spot", range(20))
def test_a_hand_in_front_of_a_known_table_counts(irb140: Any, spot: int) -> None:
    """The filter takes points out, never rays: the table does not, the hand before it does, at once and alone."""
    known = [table_before(irb140, spot, 0.6)]
    filtered = sensing(irb140, known, self_detection=False)
    for distance in (0.6, 0.61, 0.59):  # the table, as noisy as the tolerance allows
        assert len(read(filtered, irb140, spot, distance).points) == 0
    hand = 0.6 - 0.02 - 0.6 * np.tan(np.deg2rad(3.0)) - 0.005
    for distance in (hand, 0.5, 0.3, 0.17):
        seen = read(sensing(irb140, known, self_detection=False), irb140, spot, distance)
        assert len(seen.points) == 1
        assert seen.links.tolist() == [qpsafe.load_spots(irb140).links[spot]]
    assert len(read(filtered, irb140, spot, 0.4).points) == 1  # also after the table was seen


@pytest.mark.parametrize("spot", [0, 7, 19])
def test_nearer_than_d_min_a_known_table_counts_too(irb140: Any, spot: int) -> None:
    known = [table_before(irb140, spot, 0.1)]
    assert len(read(sensing(irb140, known), irb140, spot, 0.1).points) == 1
    assert len(read(sensing(irb140, known, d_min=0.05), irb140, spot, 0.1).points) == 0


def test_the_robot_itself_does_not_count_and_what_is_before_it_does(irb140: Any) -> None:
    """The arm bent so far back that a spot of the upper arm looks at the base or the turntable."""
    rng = np.random.default_rng(0)
    spots = qpsafe.load_spots(irb140)
    hulls = HullSet(body_hulls(irb140))
    found = 0
    for _ in range(200):
        state = irb140.at(rng.uniform(irb140.lower, irb140.upper))
        origins, directions = spots.rays(state)
        for d in np.arange(0.22, 0.6, 0.02):
            points = origins + d * directions
            own = hulls.find(points, np.zeros(20), state.body_poses()) >= 0
            if not own.any():
                continue
            k = int(np.flatnonzero(own)[0])
            distances = np.full(20, np.inf)
            distances[k] = d
            wire = state.wire(REST)
            blind = sensing(irb140, self_detection=False).update(state, wire, distances)
            assert len(blind.points) == 1
            assert len(sensing(irb140).update(state, wire, distances).points) == 0
            found += 1
            break
        if found > 8:
            break
    assert found > 8


def test_what_a_tool_carries_is_part_of_the_robot(irb140: Any, by_hand: Any) -> None:
    """A spot that looks at a workpiece in the gripper sees danger, unless it has been told of it; it moves along."""
    robot, spots = irb140, by_hand  # of these none looks at the robot itself in these poses
    for q, spot in product((robot.home, robot.home + 0.3), range(len(spots))):
        state = robot.at(q)
        tip, (origins, axes) = state.pose("tcp"), spots.rays(state)
        distances = np.full(len(spots), np.inf)
        distances[spot] = 0.4
        seen = origins[spot] + 0.4 * axes[spot]
        thing = Obstacle.box("part", (0.1, 0.1, 0.1), tip[:3, :3].T @ (seen - tip[:3, 3]))
        counts = []
        for carried in (None, {"tcp": [thing]}):
            sensing = DistanceSensing(robot, spots, 0.004, carried=carried)
            counts.append(len(sensing.update(state, state.wire(REST), distances).points))
        assert counts == [1, 0]


@pytest.mark.parametrize("carried", [{"hand": [Obstacle.box("part", (0.1, 0.1, 0.1))]}, {"tcp": ["part"]}])
def test_what_cannot_be_carried_is_refused(carried: Any) -> None:
    robot = qpsafe.load_robot("irb140")
    task = qpsafe.PositionTask("tcp", qpsafe.FixedPose(robot.pose("tcp", robot.home)))
    with pytest.raises(qpsafe.ConfigurationError, match="carried"):
        qpsafe.SafetyController(robot, [task], carried=carried)
