"""placo's part of docs/peers.py, for a Python that has placo and no qpsafe: JSON in, JSON out."""

from __future__ import annotations

import json
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np


def urdf_of(robot: Any) -> str:
    """A URDF with joints, limits and the tool's tip of a robot; links without mass would be refused, so all have some.

    Args:
        robot: A qpsafe robot whose joints form a chain.
    """
    import pinocchio as pin

    def origin(placement: Any) -> str:
        return (
            f'<origin xyz="{numbers(placement.translation)}" rpy="{numbers(pin.rpy.matrixToRpy(placement.rotation))}"/>'
        )

    def numbers(values: Any) -> str:
        return " ".join(f"{value:.12g}" for value in values)

    inertia = (
        '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    model = robot.model
    parts = ['<robot name="arm">'] + [f'<link name="link{i}">{inertia}</link>' for i in range(model.njoints)]
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for i in range(1, model.njoints):
        axis = data.oMi[i].rotation.T @ data.J[3:, i - 1]
        names = ("lower", "upper", "velocity")
        values = (robot.lower[i - 1], robot.upper[i - 1], robot.max_velocity[i - 1])
        limit = " ".join(f'{name}="{value:.12g}"' for name, value in zip(names, values, strict=True))
        parts += [
            f'<joint name="joint{i}" type="revolute">{origin(model.jointPlacements[i])}',
            f'<parent link="link{model.parents[i]}"/><child link="link{i}"/>',
            f'<axis xyz="{numbers(axis)}"/><limit {limit} effort="1000"/></joint>',
        ]
    tip = model.frames[model.getFrameId("tcp")]
    parts += [
        f'<link name="tcp"/><joint name="tip" type="fixed">{origin(tip.placement)}',
        f'<parent link="link{model.njoints - 1}"/><child link="tcp"/></joint></robot>',
    ]
    return "\n".join(parts)


class Placo:
    """A frame task under placo's limits of position and velocity."""

    def __init__(self, folder: str, q: Any, target: Any) -> None:
        import placo

        self.robot = placo.RobotWrapper(folder, placo.Flags.ignore_collisions)
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.solver.dt = DT
        self.solver.enable_joint_limits(True)
        self.solver.enable_velocity_limits(True)
        self.task = self.solver.add_frame_task("tcp", np.array(target))
        self.task.configure("tcp", "soft", 1.0, 1.0)
        self.solver.add_regularization_task(1e-6)

    def step(self, q: Any, qd: Any, target: Any) -> Any:
        """Joint velocity for a measured position."""
        for i, value in enumerate(q, 1):
            self.robot.set_joint(f"joint{i}", value)
        self.robot.update_kinematics()
        self.task.T_world_frame = np.array(target)
        return np.array(self.solver.solve(False))[6:] / DT


if __name__ == "__main__":
    from peers import DT, troubles

    given = json.load(sys.stdin)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "robot.urdf").write_text(given["urdf"], encoding="utf-8")
        found = troubles(lambda q, pose: Placo(folder + "/", q, pose), given)
    print(json.JSONEncoder(allow_nan=False).encode({"version": version("placo"), **found}))
