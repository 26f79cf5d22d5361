"""Where the robot's joints are in somebody else's model, which may hold more than the robot."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]


class JointMap(NamedTuple):
    """Indices of the robot's joints in a model.

    Attributes:
        q: (n,) in its position vector.
        v: (n,) in its velocity vector.
        nv: Length of its velocity vector.
    """

    q: NDArray[np.intp]
    v: NDArray[np.intp]
    nv: int

    def spread(self, rows: Array) -> Array:
        """Rows over the robot's joints (k, n) as rows over the whole model (k, nv)."""
        if len(self.v) == self.nv and bool(np.all(self.v == np.arange(self.nv))):
            return rows
        result = np.zeros((len(rows), self.nv))
        result[:, self.v] = rows
        return result


def mujoco_joints(model: Any, robot: Robot, prefix: str = "") -> JointMap:
    """The robot's joints in a MuJoCo model, by name.

    Args:
        model: `mujoco.MjModel`.
        robot: The robot.
        prefix: What stands before its joints' names there, as after `MjSpec.attach`.

    Raises:
        ConfigurationError: A joint is missing.
    """
    import mujoco

    ids = []
    for name in robot.joint_names:
        found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, prefix + name)
        if found < 0:
            there = [model.joint(i).name for i in range(model.njnt)]
            raise ConfigurationError("the MuJoCo model", "joint", prefix + name, f"one of {there}")
        ids.append(found)
    return JointMap(model.jnt_qposadr[ids].astype(np.intp), model.jnt_dofadr[ids].astype(np.intp), model.nv)


def pinocchio_joints(model: Any, robot: Robot, prefix: str = "") -> JointMap:
    """The robot's joints in a pinocchio model, by name; arguments as for `mujoco_joints`.

    Args:
        model: pinocchio's.
        robot: Whose joints are looked for.
        prefix: Before their names in the model.

    Raises:
        ConfigurationError: A joint is missing, or is not described by one number (a continuous joint).
    """
    q, v = [], []
    for name in robot.joint_names:
        if not model.existJointName(prefix + name):
            raise ConfigurationError("the pinocchio model", "joint", prefix + name, f"one of {list(model.names)[1:]}")
        joint = model.joints[model.getJointId(prefix + name)]
        if joint.nq != 1:
            raise ConfigurationError("the pinocchio model", prefix + name, joint.shortname(), "a joint of one number")
        q.append(joint.idx_q)
        v.append(joint.idx_v)
    return JointMap(np.array(q, dtype=np.intp), np.array(v, dtype=np.intp), model.nv)
