"""Tasks of mink and pink as qpsafe's and back: the same targets, gains, costs and rows."""

from __future__ import annotations

import mink
import mujoco
import numpy as np
import pink
import pinocchio as pin
import pytest

import qpsafe
from qpsafe.plugins.convert import CostTask, task_velocity
from qpsafe.plugins.joints import mujoco_joints, pinocchio_joints
from qpsafe.plugins.mink_convert import from_mink, to_mink
from qpsafe.plugins.pink_convert import from_pink, to_pink
from qpsafe.tasks.moves import Line
from qpsafe.tasks.trajectory import FixedJoints

DT = 0.004
ROBOT = qpsafe.load_robot("irb140")
MODEL = mujoco.MjModel.from_xml_path(str(ROBOT.model_path))
PIN = pin.Model(ROBOT.model)
Q = ROBOT.home + np.array([0.3, -0.2, 0.1, 0.5, -0.4, 0.2])
HOME = ROBOT.pose("tcp", ROBOT.home)


def at(kind, q=Q):
    return mink.Configuration(MODEL, q=q) if kind == "mink" else pink.Configuration(PIN, PIN.createData(), q)


def convert(kind, task):
    return from_mink(task, ROBOT, MODEL, DT) if kind == "mink" else from_pink(task, ROBOT, PIN, DT)


def back(kind, task, cost=1.0):
    return to_mink(task, ROBOT, MODEL, DT, cost) if kind == "mink" else to_pink(task, ROBOT, PIN, DT, cost)


def frame(kind, target=HOME, position=1.0, orientation=1.0, gain=0.04, **options):
    if kind == "mink":
        task = mink.FrameTask("tcp", "site", position, orientation, gain=gain, **options)
        task.set_target(mink.SE3.from_matrix(target))
    else:
        task = pink.tasks.FrameTask("tcp", position, orientation, gain=gain, **options)
        task.set_target(pin.SE3(target))
    return task


def rows(task, q=Q, t=0.0):
    """J and ẋ of one of qpsafe's tasks."""
    state, sample = ROBOT.at(q), task.trajectory.sample(t)
    return task.jacobian(state), task.velocity(task.error(task.value(state), sample), sample)


KINDS = pytest.mark.parametrize("kind", ["mink", "pink"])


@KINDS
@pytest.mark.parametrize(
    "task",
    [
        qpsafe.PositionTask("tcp", qpsafe.FixedPose(HOME), gain=2.0),
        qpsafe.OrientationTask("tcp", qpsafe.FixedPose(HOME)),
        qpsafe.OrientationTask("tcp", qpsafe.FixedPose(HOME), form="euler"),
        qpsafe.FrameTask("tcp", qpsafe.FixedPose(HOME), rows=(0, 2, 5)),
        qpsafe.RelativeFrameTask("tcp", "dh2", qpsafe.FixedPose(HOME)),
        qpsafe.PositionTask("tcp", Line(HOME, ROBOT.pose("tcp", Q))),
        qpsafe.JointTask(FixedJoints(ROBOT.home), joints=[4, 1]),
        qpsafe.PostureTask(ROBOT.home, gain=3.0),
        CostTask(qpsafe.FrameTask("tcp", qpsafe.FixedPose(HOME)), np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2])),
    ],
    ids=lambda task: task.name,
)
def test_qpsafes_tasks_ask_for_the_same_rows_there(kind, task):
    theirs = back(kind, task, cost=0.7)
    for t in (0.0, 0.8) if hasattr(theirs, "time") else (0.0,):
        if t:
            theirs.time = t
        J, xd = rows(task, t=t)
        found = task_velocity(theirs, at(kind), DT)
        assert sorted_rows(found.jacobian, found.velocity) == sorted_rows(0.7 * J, 0.7 * xd)
    again = convert(kind, theirs)  # and back
    J, xd = rows(task)
    J_2, xd_2 = rows(again)
    assert sorted_rows(J_2, xd_2) == sorted_rows(0.7 * J, 0.7 * xd)
    assert again.gain == pytest.approx(task.gain, rel=1e-12)


def sorted_rows(J, xd):
    """Rows without those of zero cost, in an order of their own."""
    table = np.round(np.column_stack((J, xd)), 8) + 0.0
    return sorted(map(tuple, table[np.any(J != 0.0, axis=1)].tolist()))


@KINDS
def test_postures_become_their_own_kind_and_agree_exactly(kind):
    task = back(kind, qpsafe.PostureTask(ROBOT.home, gain=3.0), cost=0.5)
    assert type(task) is (mink.PostureTask if kind == "mink" else pink.tasks.PostureTask)
    assert task.gain == pytest.approx(3.0 * DT)
    again = convert(kind, task)
    assert isinstance(again, CostTask)
    assert type(again.task) is qpsafe.PostureTask
    np.testing.assert_array_equal(again.cost, 0.5)


@KINDS
def test_a_task_of_theirs_that_came_from_here_is_the_same_object_again(kind):
    task = qpsafe.PositionTask("tcp", qpsafe.FixedPose(HOME))
    assert convert(kind, back(kind, task)) is task


@KINDS
def test_orientations_agree_exactly_where_the_rows_are_square(kind):
    """Jlog3 changes how rows count against each other, not what they ask for together."""
    theirs = task_velocity(frame(kind, position=0.0), at(kind), DT)
    J, xd = rows(convert(kind, frame(kind, position=0.0)))
    assert J.shape == (3, 6)
    qd = np.linalg.pinv(J) @ xd
    np.testing.assert_allclose(theirs.jacobian @ qd, theirs.velocity, atol=1e-12)


@KINDS
def test_poses_agree_up_to_the_product_of_the_errors(kind):
    """Half the way off, a quarter of the difference."""
    difference = []
    for scale in (0.2, 0.1, 0.05):
        target = ROBOT.pose("tcp", Q + scale * np.array([1.0, -0.5, 0.7, 0.9, -0.8, 0.6]))
        theirs = task_velocity(frame(kind, target), at(kind), DT)
        J, xd = rows(convert(kind, frame(kind, target)))
        difference.append(np.abs(np.linalg.solve(J, xd) - np.linalg.solve(*theirs)).max())
    assert difference[0] > 1e-3
    assert difference[1] / difference[0] == pytest.approx(0.25, abs=0.07)
    assert difference[2] / difference[1] == pytest.approx(0.25, abs=0.04)


@KINDS
def test_costs_and_gains_are_carried_over(kind):
    task = convert(kind, frame(kind, position=2.0, orientation=0.5, gain=0.1))
    np.testing.assert_array_equal(task.cost, [2.0, 2.0, 2.0, 0.5, 0.5, 0.5])
    assert task.gain == pytest.approx(0.1 / DT)
    plain = convert(kind, frame(kind, orientation=0.0))
    assert type(plain) is qpsafe.FrameTask  # every row costs 1: nothing around it
    assert plain.rows == (0, 1, 2)


@KINDS
def test_the_controller_takes_converted_tasks(kind):
    """The tool goes where their task says."""
    target = ROBOT.pose("tcp", ROBOT.home + 0.1)
    task = convert(kind, frame(kind, target, orientation=0.5, gain=0.02))
    controller = qpsafe.SafetyController(ROBOT, [task])
    q, qd = ROBOT.home, np.zeros(6)
    for _ in range(400):
        tick = controller.step(q, qd, points=[])
        q, qd = tick.reference.q, tick.reference.qd
    assert tick.status == "ok"
    np.testing.assert_allclose(ROBOT.pose("tcp", q), target, atol=2e-3)


@KINDS
def test_what_has_no_counterpart_is_named(kind):
    cases = [
        (frame(kind, lm_damping=0.1), "lm_damping"),
        (frame(kind, position=0.0, orientation=0.0), "at least one row"),
        (frame(kind, position=[1.0, 2.0, 3.0]), "axes are the frame's"),
        (frame(kind, gain=0.0), "gain"),
    ]
    if kind == "mink":
        cases += [
            (mink.FrameTask("tcp", "site", 1.0, 1.0), "target"),
            (mink.FrameTask("base_plate", "geom", 1.0, 1.0), "target"),
            (mink.DampingTask(MODEL, 1.0), "FrameTask, PostureTask"),
            (mink.PostureTask(MODEL, 1.0), "target"),
        ]
        geom = mink.FrameTask("base_plate", "geom", 1.0, 1.0)
        geom.set_target(mink.SE3.identity())
        cases.append((geom, "frame_type"))
        body = mink.FrameTask("link_6", "body", 1.0, 1.0)
        body.set_target(mink.SE3.identity())
        cases.append((body, "a frame of its file"))
    else:
        cases += [(pink.tasks.FrameTask("tcp", 1.0, 1.0), "target"), (pink.tasks.PostureTask(1.0), "target")]
        cases.append((pink.tasks.JointVelocityTask(1.0), "FrameTask, PostureTask"))
    for task, word in cases:
        with pytest.raises(qpsafe.ConfigurationError, match=word):
            convert(kind, task)


def test_joints_are_found_by_name():
    np.testing.assert_array_equal(mujoco_joints(MODEL, ROBOT).v, range(6))
    np.testing.assert_array_equal(pinocchio_joints(PIN, ROBOT).q, range(6))
    with pytest.raises(qpsafe.ConfigurationError, match="left_joint_1"):
        pinocchio_joints(PIN, ROBOT, "left_")
    continuous = pin.Model()
    for k, name in enumerate(ROBOT.joint_names):
        continuous.addJoint(k, pin.JointModelRUBZ(), pin.SE3.Identity(), name)
    with pytest.raises(qpsafe.ConfigurationError, match="one number"):
        pinocchio_joints(continuous, ROBOT)
