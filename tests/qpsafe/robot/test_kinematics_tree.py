"""The compiled kinematics against pinocchio: the bundled robot, and random trees of every kind of joint."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.robot.kinematics import forward, jacobian_of, pose_of, tree_of, wire_of

TOLERANCE = {"rtol": 0, "atol": 1e-12}


def random_tree(rng: np.random.Generator, n: int) -> tuple[Any, tuple[int, ...]]:
    """Joints of any kind on any earlier body, one of them the world, with frames on all of them."""
    model = pin.Model()
    for i in range(n):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        kinds = (
            pin.JointModelRX(),
            pin.JointModelRY(),
            pin.JointModelRZ(),
            pin.JointModelRevoluteUnaligned(axis),
            pin.JointModelPX(),
            pin.JointModelPrismaticUnaligned(axis),
        )
        model.addJoint(int(rng.integers(0, i + 1)), kinds[rng.integers(len(kinds))], pin.SE3.Random(), f"joint_{i}")
    frames = [
        model.addFrame(pin.Frame(f"frame_{body}", body, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
        for body in range(n + 1)
    ]
    return model, tuple(int(index) for index in rng.permutation(frames))


def check(model: Any, ends: tuple[int, ...], q: np.ndarray, qd: np.ndarray) -> None:
    """Every pose, Jacobian and end of a wire through all frames, against pinocchio's."""
    data, n, tree = pin.Data(model), model.nq, tree_of(model, ends)
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    memory = np.full(tree.memory, np.nan)
    forward(q, *tree, memory)
    assert np.isfinite(memory).all()
    poses = np.array([placement.homogeneous for placement in data.oMi])
    np.testing.assert_allclose(memory[: poses.size].reshape(poses.shape), poses, **TOLERANCE)

    jacobians = memory[-3 * len(ends) * n :].reshape(len(ends), 3, n)
    places = np.arange(len(ends))
    parts = np.empty((4, len(ends), 3))
    wire_of(memory, len(ends), qd, places, places[::-1], parts)
    for k, index in enumerate(ends):
        frame, pose, J = model.frames[index], np.empty((4, 4)), np.empty((6, n))
        mounting = frame.parentJoint, frame.placement.homogeneous
        pose_of(memory, tree.supports, len(ends), *mounting, pose)
        jacobian_of(memory, tree.supports, len(ends), *mounting, J)
        expected = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED).reshape(6, n)
        np.testing.assert_allclose(pose, data.oMf[index].homogeneous, **TOLERANCE)
        np.testing.assert_allclose(J, expected, **TOLERANCE)
        np.testing.assert_allclose(jacobians[k], expected[:3], **TOLERANCE)
        np.testing.assert_allclose(parts[0, k], data.oMf[index].translation, **TOLERANCE)
        np.testing.assert_allclose(parts[1, -1 - k], parts[0, k], **TOLERANCE)
        np.testing.assert_allclose(parts[2, k], expected[:3] @ qd, **TOLERANCE)
        np.testing.assert_allclose(parts[3, -1 - k], parts[2, k], **TOLERANCE)


@settings(max_examples=some(10, of=60), deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 16))
def test_random_trees(seed: int, n: int) -> None:
    pin.seed(seed % 2**31)
    rng = np.random.default_rng(seed)
    model, ends = random_tree(rng, n)
    check(model, ends, rng.uniform(-4.0, 4.0, n), rng.normal(size=n))


@pytest.mark.parametrize("name", qpsafe.bundled_robots())
def test_bundled_robots(name: str) -> None:
    robot, rng = qpsafe.load_robot(name), np.random.default_rng(0)
    ends = tuple(robot.frame_id(frame) for frame in robot.frame_names)
    for q in (robot.home, np.zeros(robot.nq), *rng.uniform(robot.lower, robot.upper, (some(6, of=20), robot.nq))):
        check(robot.model, ends, q, rng.normal(size=robot.nq))
