"""A check finds what is wrong with a program, and nothing where nothing is: programs made to violate each thing."""

import coal
import numpy as np
import pytest
from amounts import some
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.check.check import check_path
from qpsafe.check.report import to_dict, troubles, words
from qpsafe.errors import ConfigurationError
from qpsafe.geometry.solids import Solids
from qpsafe.sensing.hulls import Obstacle
from qpsafe.sensing.rules import SensingRules
from qpsafe.sim.campaign.trials import station
from qpsafe.sim.experiments.path.experiment import PathExperiment
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment
from qpsafe.sim.world.known import known_obstacles
from qpsafe.tasks.moves import JointMove, JointMoveOfFrame, Line
from qpsafe.tasks.program import Program
from qpsafe.tasks.program_file import load_program
from qpsafe.tasks.timing import Rates
from qpsafe.tasks.trajectory import FixedPose

ROBOT = qpsafe.load_robot("irb140")
HOME = ROBOT.pose("tcp", ROBOT.home)
ANGULAR = Rates(3.0, 30.0, 300.0)


def line(shift, speed=0.25, acceleration=1.0, jerk=10.0):
    """A program of the tool from home to somewhere else, straight."""
    goal = HOME.copy()
    goal[:3, 3] += shift
    return Program([Line(HOME, goal, Rates(speed, acceleration, jerk), ANGULAR)], frame="tcp")


def joint_move(robot, goal, share=0.3):
    """A program of the first tool that is a move of all joints from home."""
    rates = share * robot.max_velocity, share * robot.max_acceleration
    move = JointMove(robot.home, goal, *rates, 10.0 * rates[1])
    frame = robot.tool_frames[0]
    return Program([JointMoveOfFrame(robot, frame, move)], frame=frame)


def wrong(result):
    """Names of what is not as it should be; words and JSON agree."""
    names = [name for name, good in result.kept.items() if good is False]
    assert len(troubles(result)) == len(names)
    assert result.good == (not names) == to_dict(result)["good"]
    assert set(words(result)) == set(result.kept)
    return names


@pytest.mark.slow
def test_bundled_programs_can_be_run_as_they_are_planned():
    for experiment in (PathExperiment(ROBOT), PickPlaceExperiment(ROBOT)):
        result = check_path(ROBOT, experiment.reference, known=known_obstacles(experiment.scene))
        assert wrong(result) == [], words(result)
        assert result.furniture is not None
    result = check_path(ROBOT, load_program(station.__file__.replace("station.py", "line.toml"), ROBOT))
    assert wrong(result) == []


@pytest.mark.parametrize("name", ["irb140", "iiwa14", "irb14000"])
def test_robots_can_keep_their_home_pose(name):
    robot = qpsafe.load_robot(name)
    result = check_path(robot, FixedPose(robot.pose(robot.tool_frames[0], robot.home)))
    assert wrong(result) == []
    assert result.path.q == pytest.approx(robot.home[None])


@pytest.mark.slow
@settings(max_examples=some(2, of=5))
@given(st.integers(0, 10**6))
def test_the_distance_is_coals_and_nothing_between_two_moments_is_nearer(seed):
    """Coal at 400 moments of the program itself finds nothing nearer, and at some moment the same."""
    rng = np.random.default_rng(seed)
    program = line(rng.uniform(-0.12, 0.12, 3))
    tool = program.sample(rng.uniform(0.0, program.duration)).pose[:3, 3]
    size, side = rng.uniform(0.02, 0.2, 3), rng.normal(size=3)
    box = Obstacle.box("box", size, tool + (0.02 + 0.2 * rng.random()) * side / np.linalg.norm(side))
    result = check_path(ROBOT, program, known=[box], dt=0.05)
    gap = result.furniture
    truth = coals_distances(program, box, np.linspace(0.0, program.duration, 400))
    if truth.min() > 0.0:
        assert gap.distance <= truth.min() + 5e-4
        assert gap.distance == pytest.approx(truth.min(), abs=3e-3)  # what the tool moves in a 400th of its way
        nearest = coals_distances(program, box, [gap.time])
        assert gap.distance == pytest.approx(nearest[0], abs=1e-3)  # joints move evenly between two moments here
    else:
        assert gap.distance <= 5e-4
    assert ("furniture" in wrong(result)) == (gap.distance < 0.004)
    assert np.linalg.norm(gap.on_robot - gap.on_other) == pytest.approx(abs(gap.distance), abs=1e-6) or gap.distance < 0


def coals_distances(program, box, times):
    """Smallest distance of all hulls of the robot that move, at some times, by coal."""
    shapes = [(body, convex(vertices)) for body, _, vertices in ROBOT.hulls() if body > 0]
    target, request = convex(box.vertices), coal.DistanceRequest()
    q, found = ROBOT.home, []
    for t in times:
        q = qpsafe.tasks.reach.joints_for(ROBOT, "tcp", program.sample(t).pose, q)
        poses = ROBOT.at(q).body_poses()
        placed = [(coal.Transform3s(poses[body][:3, :3], poses[body][:3, 3]), shape) for body, shape in shapes]
        distances = [
            coal.distance(shape, place, target, coal.Transform3s(), request, coal.DistanceResult())
            for place, shape in placed
        ]
        found.append(min(distances))
    return np.array(found)


def convex(vertices):
    points = coal.StdVec_Vec3s()
    points.extend([np.array(v) for v in vertices])
    return coal.Convex.convexHull(points, False, "Qt")


@settings(max_examples=some(5, of=12))
@given(st.floats(0.05, 0.95), st.floats(0.001, 0.01))
def test_what_is_thin_is_not_stepped_over(share, thickness):
    """A small plate that the needle's tip goes through between two moments 60 mm apart."""
    program = line([0.0, 0.24, 0.0], speed=0.6, acceleration=3.0, jerk=60.0)
    tip = HOME[:3, 3] + [0.0, 0.24 * share, 0.0]
    plate = Obstacle.box("plate", [0.04, thickness, 0.001], tip - np.array([0.0, 0.0, 0.0002]))
    result = check_path(ROBOT, program, known=[plate], dt=0.1)
    assert result.furniture.distance <= 5e-4
    assert "furniture" in wrong(result)


@settings(max_examples=some(2, of=6))
@given(st.floats(0.3, 1.5))
def test_a_table_in_the_way_is_named_with_time_and_place(share):
    """The tool goes down onto a table; how deep it gets is known from the line, and when it is too near."""
    table, down = Obstacle.box("table", [0.3, 0.3, 0.1], HOME[:3, 3] - [0.0, 0.0, 0.15]), 0.1 * share
    result = check_path(ROBOT, line([0.0, 0.0, -down]), known=[table], sensors=False, dt=0.016)
    gap = result.furniture
    assert (gap.shape, gap.joint, gap.other) == ("tool_needle_hull", "joint_6", "table")
    if down < 0.0999:
        assert gap.distance == pytest.approx(0.1 - down, abs=1e-3)
    assert wrong(result) == (["furniture"] if gap.distance < 0.004 else [])
    assert gap.time == pytest.approx(result.duration, abs=0.1)


def test_too_fast_and_too_hard_for_a_joint():
    quick = line([0.0, 0.25, 0.0], speed=3.0, acceleration=40.0, jerk=4000.0)
    hard = line([0.0, 0.25, 0.0], speed=0.3, acceleration=40.0, jerk=40000.0)
    good = line([0.0, 0.25, 0.0], speed=0.3, acceleration=2.0, jerk=20.0)
    slow, fast = (max(j.velocity for j in check_path(ROBOT, program).joints) for program in (good, quick))
    assert slow < 1.0 < fast
    assert max(joint.acceleration for joint in check_path(ROBOT, hard).joints) > 1.0
    assert [wrong(check_path(ROBOT, program)) for program in (quick, hard, good)] == [["joints"], ["joints"], []]


@settings(max_examples=some(2, of=6))
@given(st.floats(-0.3, 0.3))
def test_a_program_up_to_a_joint_limit_touches_it_and_past_it_is_out_of_reach(before):
    goal = ROBOT.home.copy()
    goal[0] = ROBOT.upper[0] - before
    goal[2] -= 0.3
    result = check_path(ROBOT, joint_move(ROBOT, goal), dt=0.016)
    if before < -1e-5:
        assert wrong(result)[:1] == ["reach"]
        assert "joint_1 at a limit" in words(result)["reach"]
        assert result.path.times[-1] < result.duration
    elif before > 2e-4:
        assert result.joints[0].position == pytest.approx(before, abs=1e-5)
        assert wrong(result) == []


@settings(max_examples=some(2, of=4))
@given(st.floats(0.2, 0.8))
def test_a_stretched_wrist_is_singular(bend):
    goal = ROBOT.home.copy()
    goal[4] = -bend  # axes 4 and 6 in line on the way
    result = check_path(ROBOT, joint_move(ROBOT, goal))
    assert "singular" in wrong(result)
    assert result.singular.value < 0.02
    assert {"joint_4", "joint_6"} <= set(result.singular.joints)
    k = int(np.abs(result.path.times - result.singular.time).argmin())
    assert abs(result.path.q[k, 4]) < 0.02


def test_a_robot_that_would_meet_itself():
    found = 0
    for name, goal in {
        "irb140": [0.26, 0.93, 0.68, -0.4, 1.33, -0.4],
        "iiwa14": [-1.02, 1.85, 0.05, -1.99, 0.37, 1.96, 0.34],
    }.items():
        robot = qpsafe.load_robot(name)
        result = check_path(robot, joint_move(robot, np.array(goal)), dt=0.016)
        assert "self" in wrong(result), words(result)
        found += result.own.distance < 0.0
    assert found == 2


@settings(max_examples=some(6, of=15))
@given(st.integers(0, 19), st.floats(0.05, 0.25))
def test_a_spot_that_sees_furniture_nearer_than_d_min_is_named(number, distance):
    """A plate across the axis of a spot: what it reads is known."""
    assume(abs(distance - SensingRules().d_min) > 1e-9)  # there rounding decides
    spots = qpsafe.load_spots(ROBOT)
    origins, directions = spots.rays(ROBOT.at(ROBOT.home))
    pose = np.eye(4)
    pose[:3, 2] = d = directions[number]
    pose[:3, 0] = np.cross(d, np.eye(3)[np.abs(d).argmin()])
    pose[:3, 0] /= np.linalg.norm(pose[:3, 0])
    pose[:3, 1] = np.cross(d, pose[:3, 0])
    pose[:3, 3] = origins[number] + (distance + 0.005) * d
    plate = Obstacle.box("plate", [0.06, 0.06, 0.01], pose=pose)
    result = check_path(ROBOT, FixedPose(HOME), known=[plate])
    seen = {one.spot: one for one in result.sightings}
    d_min = SensingRules().d_min
    assert (spots.names[number] in seen) == (distance < d_min)
    if distance < d_min:
        one = seen[spots.names[number]]
        assert (one.obstacle, one.distance) == ("plate", pytest.approx(distance, abs=1e-9))
        assert "sensors" in wrong(result)
    assert check_path(ROBOT, FixedPose(HOME), known=[plate], sensors=False).kept["sensors"] is None


def test_what_cannot_be_measured_is_not_taken_for_free(tmp_path):
    """A robot without collision geometry: with furniture its program is refused, without it passes."""
    assert Solids.of(ROBOT).names
    bare = tmp_path / "bare.urdf"
    bare.write_text(BARE, encoding="utf-8")
    with pytest.warns(qpsafe.RobotWarning):
        robot = qpsafe.load_robot(bare)
    pose = FixedPose(robot.pose(robot.tool_frames[0], robot.home))
    table = Obstacle.box("table", [0.1, 0.1, 0.1], [3.0, 0.0, 0.0])
    assert check_path(robot, pose).kept["furniture"] is None
    result = check_path(robot, pose, known=[table])
    assert result.kept["furniture"] is False
    assert "no collision geometry" in words(result)["furniture"]


BARE = (
    '<robot name="bare"><link name="l0"/>'
    + "".join(
        f'<link name="l{i}"/><joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/>'
        f'<origin xyz="0.1 0.05 0.2"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" velocity="2" effort="9"/></joint>'
        for i, axis in enumerate(["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"], 1)
    )
    + "</robot>"
)


def test_mistakes_are_named():
    with pytest.raises(ConfigurationError, match="frame"):
        check_path(ROBOT, FixedPose(HOME), frame="hand")
    with pytest.raises(ConfigurationError, match="clearance"):
        check_path(ROBOT, FixedPose(HOME), clearance=float("nan"))
    with pytest.raises(ConfigurationError, match="reference"):
        check_path(ROBOT, HOME)  # type: ignore[arg-type]
