"""The robot as a part of a MuJoCo world, whatever its author had in mind: groups, motors, the tool, what may touch.

What is added is said: a file that was written for this simulation needs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.robot.models.mjcf import held_positions
from qpsafe.robot.models.mujoco_spec import mujoco_spec
from qpsafe.sim.world.tool_axis import tool_axis, turned_to

if TYPE_CHECKING:
    from qpsafe.robot.robot import Robot

Array = NDArray[np.float64]

ROBOT_VISUAL, ROBOT_COLLISION = 2, 3  # geometry groups
TOOL = "tcp"  # site at the tip of the (first) tool, its z axis pointing out of it
UNSTATED = 1e6  # readers write huge numbers, or zero, for "no limit" [N m]
SPARE = 2.0  # motors whose torque nobody states have so much more than the robot's accelerations need


def robot_spec(robot: Robot) -> tuple[Any, tuple[str, ...]]:
    """The robot's model as a `mujoco.MjSpec` that this simulation can use, and what was added for that, in words.

    What collides is in group 3, the rest in group 2; where nothing collides, everything is in group 3. Planes that
    belong to the file's world are left out: a world has its own floor.

    Raises:
        ValueError: MuJoCo cannot read the file.
    """
    spec, said = mujoco_spec(robot)
    for geom in list(spec.worldbody.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
            spec.delete(geom)
    paired = {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}
    geoms = list(spec.geoms)
    solid = [bool(geom.contype or geom.conaffinity or (geom.name and geom.name in paired)) for geom in geoms]
    for geom, collides in zip(geoms, solid if any(solid) else [True] * len(geoms), strict=True):
        geom.group = ROBOT_COLLISION if collides else ROBOT_VISUAL
    references = {joint.name: float(joint.ref) for joint in spec.joints}
    for name, joint in robot.held.items():
        if name in references:
            value = joint.value - references[name] * (
                1.0 if joint.sliding or not spec.compiler.degree else np.pi / 180.0
            )
            lock = spec.add_equality(name=f"{name} held", type=mujoco.mjtEq.mjEQ_JOINT, name1=name)
            lock.data[:5] = value, 0.0, 0.0, 0.0, 0.0
    joints = {joint.name for joint in spec.joints}
    if joints.issuperset(robot.joint_names):  # else the scene says which is missing
        said += [*_add_motors(spec, robot), *_add_tool(spec, robot), *_add_excludes(spec, robot)]
    return spec, tuple(said)


def _add_motors(spec: Any, robot: Robot) -> list[str]:
    """Motors of gear 1 in N m, named as the joints; others of the same joints go."""
    missing = [name for name in robot.joint_names if not _is_motor(spec, name)]
    if not missing:
        return []
    forces: dict[str, float] = {}
    wanted = set(missing)
    for other in list(spec.actuators):
        if other.name in wanted or (other.trntype == mujoco.mjtTrn.mjTRN_JOINT and other.target in wanted):
            if other.forcelimited and other.target in wanted:
                forces[other.target] = float(np.abs(other.forcerange).max())
            spec.delete(other)
    for key in list(spec.keys):  # they are as long as there were actuators
        spec.delete(key)
    efforts = dict(zip(robot.joint_names, np.ravel(robot.model.effortLimit).tolist(), strict=True))
    limits = {name: efforts[name] if 0.0 < efforts[name] < UNSTATED else forces.get(name, 0.0) for name in missing}
    chosen = [name for name in missing if not limits[name] > 0.0]
    if chosen:
        needed = dict(zip(robot.joint_names, SPARE * np.add(*torques(robot, spec)).max(axis=0), strict=True))
        limits |= {name: needed[name] for name in chosen}
    for name in missing:
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        motor.ctrllimited, motor.ctrlrange = mujoco.mjtLimited.mjLIMITED_TRUE, [-limits[name], limits[name]]
    said = [f"motors for {', '.join(missing)}"]
    if chosen:
        amounts = ", ".join(f"{limits[name]:.3g}" for name in chosen)
        said.append(
            f"no torque is stated for {', '.join(chosen)}: {amounts} N m, {SPARE:g} times what its motion needs"
        )
    return said


def _is_motor(spec: Any, name: str) -> bool:
    motor = spec.actuator(name)
    return (
        motor is not None
        and motor.trntype == mujoco.mjtTrn.mjTRN_JOINT
        and motor.target == name
        and motor.biastype == mujoco.mjtBias.mjBIAS_NONE
    )


def torques(robot: Robot, spec: Any = None, postures: int = 200) -> tuple[Array, Array]:
    """Torques in postures at random, (k, n) each [N m]: that accelerate it as fast as it may, and that hold it.

    Args:
        robot: The robot.
        spec: Its model, if that is at hand.
        postures: How many.
    """
    model = (mujoco_spec(robot)[0] if spec is None else spec).compile()
    data = mujoco.MjData(model)
    v = np.array([model.joint(name).dofadr[0] for name in robot.joint_names])
    rng, unit, column = np.random.default_rng(0), np.zeros(model.nv), np.zeros(model.nv)
    moving, holding = np.zeros((2, postures, robot.nq))
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    for k, q in enumerate(rng.uniform(np.minimum(low, high), np.maximum(low, high), (postures, robot.nq))):
        _stand(model, data, robot, q)
        for j in range(robot.nq):  # columns of M(q)
            unit[:] = 0.0
            unit[v[j]] = robot.max_acceleration[j]
            mujoco.mj_mulM(model, data, column, unit)
            moving[k] += np.abs(column[v])
        holding[k] = np.abs(data.qfrc_bias[v])
    return moving, holding


def _stand(model: Any, data: Any, robot: Robot, q: Array) -> None:
    """Put the robot of its own model at rest at q."""
    addresses, values = held_positions(model, robot.held)
    data.qpos[addresses] = values
    for name, value in zip(robot.joint_names, q, strict=True):
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)


def _add_tool(spec: Any, robot: Robot) -> list[str]:
    if spec.site(TOOL) is not None or not robot.tool_frames:
        return []
    frame = robot.tool_frames[0]
    model = spec.compile()
    data = mujoco.MjData(model)
    _stand(model, data, robot, robot.home)
    pose, axis = robot.pose(frame, robot.home), tool_axis(robot, frame)
    turn = pose[:3, :3] @ turned_to(np.array([0.0, 0.0, 1.0]), axis)
    joint = robot.joint_names[robot.mounting(frame)[0] - 1]
    body = int(model.joint(joint).bodyid[0])
    own, quaternion = data.xmat[body].reshape(3, 3), np.empty(4)
    mujoco.mju_mat2Quat(quaternion, (own.T @ turn).ravel())
    spec.body(model.body(body).name).add_site(
        name=TOOL, pos=own.T @ (pose[:3, 3] - data.xpos[body]), quat=quaternion, group=5
    )
    return []


def _add_excludes(spec: Any, robot: Robot) -> list[str]:
    """What touches at home is mounted so, or drawn so: it may."""
    model = spec.compile()
    data = mujoco.MjData(model)
    _stand(model, data, robot, robot.home)
    names = [model.body(i).name for i in range(model.nbody)]
    touching = {tuple(sorted(pair)) for pair in model.geom_bodyid[data.contact.geom].tolist()}
    pairs = [(names[a], names[b]) for a, b in sorted(touching) if a != b and names[a] and names[b]]
    for one, other in pairs:
        spec.add_exclude(bodyname1=one, bodyname2=other)
    if not pairs:
        return []
    return ["bodies that touch at home may: " + ", ".join(map(" and ".join, pairs))]


def shown_groups(model: Any) -> NDArray[np.uint8]:
    """Which groups a picture shows: what collides only where there is nothing to be looked at, (6,)."""
    return np.array([1, 1, 1, not (model.geom_group == ROBOT_VISUAL).any(), 0, 0], dtype=np.uint8)
