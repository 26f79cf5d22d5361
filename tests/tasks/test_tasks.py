"""Tasks: errors, Jacobians and closed-loop inverse kinematics, checked by one shared finite-difference test."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from amounts import thinned
from scipy.spatial.transform import Rotation

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.tasks.frame import FrameTask, RelativeFrameTask
from qpsafe.tasks.joint import JointTask, PostureTask
from qpsafe.tasks.orientation import OrientationTask
from qpsafe.tasks.position import PositionTask
from qpsafe.tasks.rotation import euler_zyx, exp3, log3
from qpsafe.tasks.task import PoseTask, Task
from qpsafe.tasks.trajectory import FixedJoints, FixedPose, Sample, Trajectory

robot = qpsafe.load_robot("irb140")


def random_pose(rng: np.random.Generator) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
    pose[:3, 3] = rng.normal(size=3)
    return pose


TASKS: dict[str, Callable[[Trajectory], Task]] = {
    "position": lambda path: PositionTask("tcp", path),
    "orientation": lambda path: OrientationTask("tcp", path),
    "Euler angles": lambda path: OrientationTask("tcp", path, form="euler"),
    "frame": lambda path: FrameTask("tcp", path),
    "rows of a frame": lambda path: FrameTask("tcp", path, rows=(0, 2, 5)),
    "one row": lambda path: FrameTask("dh4", path, rows=(4,)),
    "relative": lambda path: RelativeFrameTask("tcp", "dh2", path),
    "rows of a relative": lambda path: RelativeFrameTask("dh4", "tcp", path, rows=(1, 3, 4)),
    "joint": lambda path: JointTask(path),
    "some joints": lambda path: JointTask(path, joints=(4, 0)),
    "posture": lambda path: PostureTask(path.position),  # type: ignore[attr-defined]
}


def at_rest(name: str, value: np.ndarray) -> Trajectory:
    """A trajectory that stays where a task's value is."""
    return FixedPose(value) if value.shape == (4, 4) else FixedJoints(value)


def make(name: str, q: np.ndarray) -> Task:
    """The task, its reference where the robot is at q."""
    any_path = FixedJoints(q) if "joint" in name or name == "posture" else FixedPose(np.eye(4))
    return TASKS[name](at_rest(name, TASKS[name](any_path).value(robot.at(q))))


@pytest.mark.parametrize("name", TASKS)
@pytest.mark.parametrize("seed", range(3))
def test_error_changes_as_the_jacobian_says(name: str, seed: int) -> None:
    """With the reference at rest where the robot is, d e / dt = -J q̇."""
    rng = np.random.default_rng(seed)
    q, qd, h = rng.uniform(robot.lower, robot.upper), rng.normal(size=6), 1e-6
    task = make(name, q)
    sample = task.trajectory.sample(0.0)
    ahead, behind = (task.error(task.value(robot.at(q + s * h * qd)), sample) for s in (1.0, -1.0))
    J = task.jacobian(robot.at(q))
    assert J.shape == (len(ahead), 6)
    assert (ahead - behind) / (2 * h) == pytest.approx(-J @ qd, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_euler_errors_change_as_the_jacobian_says_at_any_error(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, qd, h = rng.uniform(robot.lower, robot.upper), rng.normal(size=6), 1e-6
    task, sample = TASKS["Euler angles"](FixedPose(np.eye(4))), Sample(random_pose(rng), np.zeros(6))
    ahead, behind = (task.error(robot.pose("tcp", q + s * h * qd), sample) for s in (1.0, -1.0))
    assert (ahead - behind) / (2 * h) == pytest.approx(-task.jacobian(robot.at(q)) @ qd, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("name", TASKS)
def test_error_is_zero_exactly_at_the_reference(name: str) -> None:
    q = robot.home + 0.1
    task = make(name, q)
    error = task.error(task.value(robot.at(q)), task.trajectory.sample(0.0))
    assert error == pytest.approx(np.zeros(len(error)), abs=1e-14)


@pytest.mark.parametrize("name", thinned(2, TASKS))
def test_every_task_alone_is_reached_by_the_controller(name: str) -> None:
    """From a pose nearby, the discrete loop multiplies the error by about 1 - K dt a tick."""
    task = make(name, robot.home)
    controller = qpsafe.SafetyController(robot, [task])
    q, qd = robot.home + np.array([0.02, -0.03, 0.02, 0.03, -0.02, 0.03]), np.zeros(6)
    first = np.linalg.norm(task.error(task.value(robot.at(q)), task.trajectory.sample(0.0)))
    ticks = 300
    for _ in range(ticks):
        tick = controller.step(q, qd, points=[])
        assert tick.status == "ok"
        q, qd = tick.reference.q, tick.reference.qd
    last = np.linalg.norm(tick.errors[0])
    assert last <= 1.2 * first * (1.0 - task.gain * 0.004) ** (ticks - 30) + 1e-9


@pytest.mark.parametrize(("kind", "gain"), [(PositionTask, 1.0), (OrientationTask, 10.0)])
def test_clik_error_decays_with_its_gain(kind, gain: float) -> None:
    """e(t) = e(0) exp(-K t) when the velocity is followed exactly; the paper's gains are the defaults."""
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


def test_a_displaced_reference_is_the_actual_value_and_fades_to_the_reference() -> None:
    rng = np.random.default_rng(3)
    sample, actual = Sample(random_pose(rng), rng.normal(size=6)), random_pose(rng)
    offset = sample.offset(actual)
    assert sample.displaced(offset, np.zeros(6)).pose == pytest.approx(actual, abs=1e-12)
    assert sample.displaced(np.zeros(6), np.zeros(6)).pose == pytest.approx(sample.pose, abs=1e-15)
    assert sample.displaced(np.zeros(6), np.zeros(6)).twist == pytest.approx(sample.twist, abs=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_the_twist_of_a_displaced_moving_reference_is_the_derivative_of_its_pose(seed: int) -> None:
    rng, h = np.random.default_rng(seed), 1e-6
    start, twist, offset, rate = random_pose(rng), *rng.normal(size=(3, 6))

    def at(t: float) -> Sample:
        pose = start.copy()
        pose[:3, 3] += t * twist[:3]
        pose[:3, :3] = exp3(t * twist[3:]) @ start[:3, :3]
        return Sample(pose, twist).displaced(offset + t * rate, rate)

    before, after = at(-h).pose, at(h).pose
    found = np.concatenate(((after - before)[:3, 3], log3(after[:3, :3] @ before[:3, :3].T))) / (2 * h)
    assert at(0.0).twist == pytest.approx(found, abs=1e-8)


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


@pytest.mark.parametrize(
    ("bad", "key"),
    [
        (lambda: FrameTask("tcp", FixedPose(np.eye(4)), rows=(0, 6)), "rows"),
        (lambda: FrameTask("tcp", FixedPose(np.eye(4)), rows=(2, 1)), "rows"),
        (lambda: FrameTask("tcp", FixedPose(np.eye(4)), rows=()), "rows"),
        (lambda: OrientationTask("tcp", FixedPose(np.eye(4)), form="quaternion"), "form"),
        (lambda: JointTask(FixedJoints(np.zeros(6)), joints=(1, 1)), "joints"),
        (lambda: FixedJoints([np.nan] * 6), "position"),
        (lambda: PostureTask([0.0] * 6, gain=-1.0), "gain"),
        (lambda: given(RelativeFrameTask("tcp", "elbow", FixedPose(np.eye(4)))), r"tasks\[0\].base"),
        (lambda: given(RelativeFrameTask("elbow", "tcp", FixedPose(np.eye(4)))), r"tasks\[0\].frame"),
        (lambda: given(JointTask(FixedJoints(np.zeros(6)), joints=(6,))), r"tasks\[0\].joints"),
        (lambda: given(PostureTask(np.zeros(7))), r"tasks\[0\].trajectory"),
        (lambda: given(JointTask(FixedPose(np.eye(4)))), r"tasks\[0\].trajectory"),
    ],
)
def test_tasks_that_cannot_be_are_refused_by_name(bad: Callable[[], object], key: str) -> None:
    with pytest.raises(ConfigurationError, match=key):
        bad()


def given(task: Task) -> qpsafe.SafetyController:
    return qpsafe.SafetyController(robot, [task])


@pytest.mark.parametrize(
    "rows", [(), (6,), (-1,), (0, 9), (0, 10**6), (1, 0), (2, 2), (0.0,), (1.5,), "12", 3, None, [[0]]]
)
@pytest.mark.parametrize("kind", [PositionTask, OrientationTask, FrameTask, "derived"])
def test_rows_that_a_pose_does_not_have_are_refused(kind: Any, rows: Any) -> None:
    """However they are given: compiled code would read beyond the pose, or another row than is meant."""
    body = {"rows": rows, "error": None}
    own = type("Own", (PoseTask if kind == "derived" else kind,), body if kind is not FrameTask else {})
    options = {"rows": rows} if kind is FrameTask else {}
    with pytest.raises(ConfigurationError, match="rows"):
        own("tcp", FixedPose(np.eye(4)), 1.0, **options)
