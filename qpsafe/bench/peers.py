"""The same job by mink and pink, to compare times with: one 6D frame task, posture, position and velocity limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from qpsafe.bench.clock import Row
from qpsafe.robot.loader import load_robot

MINK = "mink.solve_ik + daqp: frame, posture, limits"
PINK = "pink.solve_ik + daqp: frame, posture, limits"


def mink_row() -> Row:
    """`mink.solve_ik` with daqp on the IRB 140, at a moving target; the configuration is updated in each call."""
    import mink
    import mujoco

    robot = load_robot("irb140")
    model = mujoco.MjModel.from_xml_path(str(robot.model_path))
    configuration = mink.Configuration(model, q=robot.home.copy())
    frame = mink.FrameTask("tcp", "site", position_cost=1.0, orientation_cost=0.1)
    posture = mink.PostureTask(model, cost=1e-2)
    posture.set_target(robot.home)
    speeds = dict(zip(robot.joint_names, robot.max_velocity, strict=True))
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
    targets = [mink.SE3.from_matrix(pose) for pose in _targets(robot)]

    def tick(k: int) -> None:
        frame.set_target(targets[k % len(targets)])
        qd = mink.solve_ik(configuration, [frame, posture], 0.004, "daqp", limits=limits)
        configuration.integrate_inplace(qd, 0.004)

    return Row(tick)


def pink_row() -> Row | None:
    """`pink.solve_ik` with daqp on the same job; None where the extra "bench" is not installed."""
    try:
        import pink
    except ImportError:
        return None
    import pinocchio as pin

    robot = load_robot("irb140")
    model = pin.Model(robot.model)
    model.velocityLimit = robot.max_velocity.copy()
    data = model.createData()
    configuration = pink.Configuration(model, data, robot.home.copy())
    frame = pink.tasks.FrameTask("tcp", position_cost=1.0, orientation_cost=0.1)
    posture = pink.tasks.PostureTask(cost=1e-2)
    posture.set_target(robot.home)
    targets = [pin.SE3(pose) for pose in _targets(robot)]

    def tick(k: int) -> None:
        frame.set_target(targets[k % len(targets)])
        qd = pink.solve_ik(configuration, [frame, posture], 0.004, solver="daqp")
        configuration.integrate_inplace(qd, 0.004)

    return Row(tick)


def _targets(robot: Any) -> list[Any]:
    """A slow circle of 5 cm around the home pose of the tool, one pose per 4 ms, 5 s a turn."""
    poses = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 1250, endpoint=False):
        pose = robot.pose("tcp", robot.home)
        pose[:3, 3] += 0.05 * np.array([np.cos(angle), np.sin(angle), 0.0])
        poses.append(pose)
    return poses
