"""Tasks: errors, Jacobians and closed-loop inverse kinematics, checked by one shared finite-difference test."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.rotation import euler_zyx, exp3, log3
from qpsafe.tasks.trajectory import FixedPose, Sample, SmoothMove

robot = qpsafe.load_robot("irb140")
TASKS = [PositionTask, OrientationTask]


def random_pose(rng: np.random.Generator) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
    pose[:3, 3] = rng.normal(size=3)
    return pose


@pytest.mark.parametrize("kind", TASKS)
@pytest.mark.parametrize("seed", range(3))
def test_error_changes_as_the_jacobian_says(kind, seed: int) -> None:
    """With the target at the robot's own pose, d e / dt = -J q̇."""
    rng = np.random.default_rng(seed)
    q, qd, h = rng.uniform(robot.lower, robot.upper), rng.normal(size=6), 1e-6
    target = FixedPose(robot.pose("tcp", q))
    task = kind("tcp", target)
    sample = target.sample(0.0)
    ahead, behind = (task.error(robot.pose("tcp", q + s * h * qd), sample) for s in (1.0, -1.0))
    assert (ahead - behind) / (2 * h) == pytest.approx(-task.jacobian(robot.at(q)) @ qd, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("kind", TASKS)
def test_error_is_zero_exactly_at_the_target(kind) -> None:
    pose = random_pose(np.random.default_rng(0))
    assert kind("tcp", FixedPose(pose)).error(pose, Sample(pose, np.zeros(6))) == pytest.approx(np.zeros(3), abs=1e-15)


@pytest.mark.parametrize(("kind", "gain"), [(PositionTask, 1.0), (OrientationTask, 10.0)])
def test_clik_error_decays_with_its_gain(kind, gain: float) -> None:
    """e(t) = e(0) exp(-K t) when the velocity is followed exactly; the source's gains are the defaults."""
    rng = np.random.default_rng(5)
    goal = random_pose(rng)
    pose = goal.copy()
    pose[:3, :3] = exp3(np.array([0.3, -0.2, 0.5])) @ goal[:3, :3]
    pose[:3, 3] += [0.1, 0.2, -0.3]
    task = kind("tcp", FixedPose(goal))
    sample, dt = task.trajectory.sample(0.0), 1e-4
    first = task.error(pose, sample)
    for _ in range(2000):
        velocity = task.velocity(task.error(pose, sample), sample)
        if kind is PositionTask:
            pose[:3, 3] += velocity * dt
        else:
            pose[:3, :3] = exp3(velocity * dt) @ pose[:3, :3]
    assert task.error(pose, sample) == pytest.approx(first * np.exp(-gain * 0.2), rel=2e-3)


def test_feed_forward_is_added() -> None:
    pose = np.eye(4)
    twist = np.arange(6.0)
    assert PositionTask("tcp", FixedPose(pose)).velocity(np.ones(3), Sample(pose, twist)) == pytest.approx([1, 2, 3])
    assert OrientationTask("tcp", FixedPose(pose)).velocity(np.ones(3), Sample(pose, twist)) == pytest.approx(
        [13, 14, 15]
    )


@pytest.mark.parametrize("seed", range(4))
def test_smooth_move_joins_two_poses_at_rest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, goal = random_pose(rng), random_pose(rng)
    move = SmoothMove(start, goal, speed=0.25, angular_speed=0.8)
    assert move.sample(0.0).pose == pytest.approx(start, abs=1e-12)
    assert move.sample(move.duration).pose == pytest.approx(goal, abs=1e-9)
    assert move.sample(move.duration + 5.0).pose == pytest.approx(goal, abs=1e-9)
    for t in (0.0, move.duration):
        assert move.sample(t).twist == pytest.approx(np.zeros(6), abs=1e-12)
    times = np.linspace(0.0, move.duration, 101)
    twists = np.array([move.sample(t).twist for t in times])
    speed, turn = np.linalg.norm(twists[:, :3], axis=1), np.linalg.norm(twists[:, 3:], axis=1)
    assert speed.max() <= 0.25 + 1e-12
    assert turn.max() <= 0.8 + 1e-12
    assert max(speed.max() / 0.25, turn.max() / 0.8) == pytest.approx(1.0, abs=1e-3)  # no slower than it must be


def test_smooth_move_twist_is_the_derivative_of_its_pose() -> None:
    rng = np.random.default_rng(9)
    move, h = SmoothMove(random_pose(rng), random_pose(rng)), 1e-6
    for t in np.linspace(0.1, 0.9, 5) * move.duration:
        before, after = move.sample(t - h).pose, move.sample(t + h).pose
        twist = np.concatenate(
            ((after[:3, 3] - before[:3, 3]) / (2 * h), log3(after[:3, :3] @ before[:3, :3].T) / (2 * h))
        )
        assert move.sample(t).twist == pytest.approx(twist, abs=1e-6)


def test_euler_angles_build_the_rotation_again() -> None:
    rotations = Rotation.random(50, random_state=1)
    angles = euler_zyx(rotations.as_matrix())
    assert Rotation.from_euler("ZYX", angles).as_matrix() == pytest.approx(rotations.as_matrix(), abs=1e-12)


def test_task_jacobian_is_rows_of_the_robots() -> None:
    state = robot.at(robot.home)
    J = state.jacobian("tcp")
    pose = FixedPose(np.eye(4))
    assert (PositionTask("tcp", pose).jacobian(state) == J[:3]).all()
    assert (OrientationTask("tcp", pose).jacobian(state) == J[3:]).all()


@pytest.mark.parametrize("bad", [np.eye(3), np.zeros((4, 4)), np.diag([1, 1, -1, 1]), np.full((4, 4), np.nan), "home"])
def test_poses_that_are_none_are_refused(bad: object) -> None:
    with pytest.raises(ConfigurationError, match=r"FixedPose: pose"):
        FixedPose(bad)  # type: ignore[arg-type]


@pytest.mark.parametrize("gain", [0.0, -1.0, np.nan, np.inf])
def test_wrong_gains_are_refused(gain: float) -> None:
    with pytest.raises(ConfigurationError, match="gain"):
        PositionTask("tcp", FixedPose(np.eye(4)), gain)


def test_robot_poses_are_accepted_as_targets() -> None:
    for q in np.random.default_rng(2).uniform(robot.lower, robot.upper, (50, 6)):
        FixedPose(pin.SE3(robot.pose("tcp", q)).homogeneous)
