"""Where the robot's joints are in somebody else's model, which may hold more than the robot."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.robot.robot import Robot
from qpsafe.text.given import of_kind

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
        ConfigurationError: A joint is missing or of another kind, or another joint moves the robot's base or links.
    """
    import mujoco

    where = "the MuJoCo model"
    of_kind(where, "model", model, mujoco.MjModel)
    names = [model.joint(i).name for i in range(model.njnt)]
    ids = _by_name(where, names, robot, prefix)
    kinds = {int(mujoco.mjtJoint.mjJNT_HINGE): "hinge", int(mujoco.mjtJoint.mjJNT_SLIDE): "slide"}
    for i, slides in zip(ids, robot.sliding, strict=True):
        _check_kind(where, names[i], kinds.get(int(model.jnt_type[i]), "of several numbers"), _MUJOCO[bool(slides)])
    movers: set[int] = set()
    for i in ids:
        body = int(model.jnt_bodyid[i])
        while body:  # up to the world
            first = int(model.body_jntadr[body])
            movers.update(range(first, first + int(model.body_jntnum[body])))
            body = int(model.body_parentid[body])
    _check_movers(where, [names[i] for i in sorted(movers.difference(ids))], robot, prefix)
    return JointMap(model.jnt_qposadr[ids].astype(np.intp), model.jnt_dofadr[ids].astype(np.intp), model.nv)


def pinocchio_joints(model: Any, robot: Robot, prefix: str = "") -> JointMap:
    """The robot's joints in a pinocchio model, by name; arguments and errors as for `mujoco_joints`.

    A continuous joint, which is not described by one number there, is of another kind.

    Args:
        model: pinocchio's.
        robot: Whose joints are looked for.
        prefix: Before their names in the model.
    """
    import pinocchio as pin

    where = "the pinocchio model"
    of_kind(where, "model", model, pin.Model)
    names = list(model.names)
    ids = _by_name(where, names, robot, prefix)
    for i, slides in zip(ids, robot.sliding, strict=True):
        kind = model.joints[i].shortname().removeprefix("JointModel")
        # RX, RevoluteUnaligned; PX, PrismaticUnaligned
        found = {"R": "revolute", "P": "prismatic"}.get(kind[0], kind) if model.joints[i].nq == 1 else kind
        _check_kind(where, names[i], found, f"{_PINOCCHIO[bool(slides)]}, a joint of one number")
    movers = {int(j) for i in ids for j in model.supports[i] if j}
    _check_movers(where, [names[i] for i in sorted(movers.difference(ids))], robot, prefix)
    joints = [model.joints[i] for i in ids]
    q, v = ([getattr(joint, key) for joint in joints] for key in ("idx_q", "idx_v"))
    return JointMap(np.array(q, dtype=np.intp), np.array(v, dtype=np.intp), model.nv)


#: What joints that turn and that slide are called.
_MUJOCO, _PINOCCHIO = ("hinge", "slide"), ("revolute", "prismatic")


def _by_name(where: str, names: list[str], robot: Robot, prefix: str) -> list[int]:
    """Numbers of the robot's joints among the names of a model's."""
    for name in robot.joint_names:
        if prefix + name not in names:
            raise ConfigurationError(where, "joint", prefix + name, f"one of {names}")
    return [names.index(prefix + name) for name in robot.joint_names]


def _check_kind(where: str, name: str, found: str, expected: str) -> None:
    """Refuse a joint that moves otherwise than the robot's of this name."""
    if found != expected.partition(",")[0]:
        raise ConfigurationError(where, f"joint {name}", found, f"{expected}, as the robot's")


def _check_movers(where: str, names: list[str], robot: Robot, prefix: str) -> None:
    """Refuse other joints on the way from the world to the robot's, but those that its file holds in place."""
    others = [name for name in names if name.removeprefix(prefix) not in robot.held]
    if others:
        expected = "none: qpsafe's robot stands still in its world, and only its own joints move its links"
        raise ConfigurationError(where, "joints that move the robot", others, expected)
