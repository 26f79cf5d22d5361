"""Arms made of what MJCF can say, mixed as the public collections mix it: each loads and equals MuJoCo, or is refused.

Every arm is written from a seed, so that no figure in it is a round one. The oracle is MuJoCo's own compiled model.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from amounts import first, thinned

from qpsafe.errors import RobotFileError
from qpsafe.robot.loader import load_robot
from qpsafe.robot.robot import Robot
from qpsafe.sensing.body import body_hulls

# name -> its features; `mjcf_writer.py` says what each does
LOADED = {
    "plain": "",
    "base with a pose": "root_pose",
    "base with a pose, joints without names": "root_pose unnamed",
    "classes": "classes childclass",
    "classes within classes": "classes nested childclass site_class",
    "degrees, said at the end": "degree late classes",
    "radians, said at the end": "radian late",
    "euler angles of another order": "radian eulerseq euler",
    "euler angles in degrees": "degree euler",
    "axis and angle": "radian axisangle site_class",
    "two axes, z-axis": "xyaxes zaxis",
    "frames around bodies": "frame unnamed root_pose",
    "frames with a class": "frame classes childclass degree",
    "references": "degree ref limited_slides",
    "anchors off the body": "anchor ref",
    "included files": "include classes childclass",
    "included in an included file": "include deep degree late",
    "attached models": "attach root_pose",
    "meshes with a scale": "mesh",
    "mirrored meshes": "mesh mirror classes",
    "keyframes": "key ref degree",
    "two arms": "two_arms root_pose gripper",
    "linear track and SCARA": "rail scara",
    "two joints in a body": "double anchor ref",
    "gripper of two fingers": "gripper root_pose",
    "gripper of closed loops": "loop_gripper unnamed",
    "a joint that is locked": "locked ref",
    "one name for everything": "same_names site_same",
    "objects and mocap targets beside it": "object mocap root_pose",
    "on a free base": "free_base",
    "with a ball joint": "ball unnamed",
    "without ranges": "endless",
    "geoms only, full inertia": "fullinertia fromto replicate",
    "base geoms in the world": "world_geom fromto",
}
REFUSED = {
    "a joint of the chain that follows another": ("coupled", "joint j2", "moves on its own"),
    "a closed loop of the chain": ("loop", "joint j", "moves on its own"),
    "a slide without a range": ("rail endless", "rail.lower", "finite"),
    "no joint that moves": ("only_ball", "joints", "at least one"),
}


def load(path: Path) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(path)


def test_there_are_as_many_kinds_as_promised() -> None:
    assert len(LOADED) >= 27


@pytest.mark.parametrize("kind", thinned(2, LOADED))
@pytest.mark.parametrize("seed", first(1, range(2)))
def test_an_arm_is_what_mujoco_makes_of_it(kind: str, seed: int, tmp_path: Path, mjcf_writer: Any) -> None:
    writer = mjcf_writer(tmp_path, LOADED[kind], seed)
    path = writer.write()
    robot, model = load(path), mujoco.MjModel.from_xml_path(str(path))
    ids = joint_ids(model, robot)
    expected = (model.jnt_type >= 2).sum() - len(robot.held)
    assert robot.nq == expected
    held = {"gripper": "finger", "loop_gripper": "crank pad spring", "locked": "j2"}
    words = [word for feature, words in held.items() if writer.has(feature) for word in words.split()]
    assert bool(robot.held) == bool(words)
    assert all(any(word in name for word in words) for name in robot.held)
    if writer.has("locked"):
        assert robot.held["j2"].value == pytest.approx(model.qpos0[model.joint("j2").qposadr[0]] + 0.2)
    limited = model.jnt_limited[ids].astype(bool)
    np.testing.assert_allclose(robot.lower[limited], model.jnt_range[ids][limited, 0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(robot.upper[limited], model.jnt_range[ids][limited, 1], rtol=0, atol=1e-12)
    assert robot.endless[~limited].all()
    if writer.keys:
        np.testing.assert_allclose(robot.home, [writer.keys[name] for name in robot.joint_names], atol=1e-12)
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)
    for q in (robot.home, *rng.uniform(np.maximum(robot.lower, -7), np.minimum(robot.upper, 7), (4, robot.nq))):
        for name, joint in robot.held.items():
            if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:  # else it is at rest
                data.joint(name).qpos[:] = joint.value
        data.qpos[model.jnt_qposadr[ids]] = q
        mujoco.mj_forward(model, data)
        compare_frames(model, data, robot, q)
        compare_inertia(model, data, robot, q, ids)
        compare_hulls(model, data, robot, q)


def joint_ids(model: mujoco.MjModel, robot: Robot) -> list[int]:
    """The robot's joints in MuJoCo's model: by name, those without one by their body's."""
    ids = []
    for name in robot.joint_names:
        j = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        ids.append(j if j >= 0 else int(model.body_jntadr[model.body(name.removesuffix("_joint")).id]))
    assert len(set(ids)) == len(ids)
    return ids


def compare_frames(model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, q: np.ndarray) -> None:
    """Pose and Jacobian of every body and site of the robot, under its own name."""
    state, left_out = robot.at(q), {"world", "cup", "target", "handle"}
    dofs = model.jnt_dofadr[joint_ids(model, robot)]
    sites = {model.site(i).name for i in range(model.nsite)} - left_out
    jacobian = np.zeros((6, model.nv))
    for name in sites:
        index = model.site(name).id
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], index)
        same(state, name, data.site_xpos[index], data.site_xmat[index], jacobian[:, dofs])
    for index in range(1, model.nbody):
        name = model.body(index).name
        if name not in left_out:
            mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], index)
            frame = f"{name} (body)" if name in sites else name
            same(state, frame, data.xpos[index], data.xmat[index], jacobian[:, dofs])


def same(state: object, frame: str, position: np.ndarray, rotation: np.ndarray, jacobian: np.ndarray) -> None:
    np.testing.assert_allclose(state.position(frame), position, rtol=0, atol=1e-9, err_msg=frame)
    np.testing.assert_allclose(state.rotation(frame), rotation.reshape(3, 3), rtol=0, atol=1e-9, err_msg=frame)
    np.testing.assert_allclose(state.jacobian(frame), jacobian, rtol=0, atol=1e-9, err_msg=frame)


def compare_inertia(model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, q: np.ndarray, ids: list[int]) -> None:
    """Mass matrix and gravity of the joints that move."""
    dofs, full = model.jnt_dofadr[ids], np.zeros((model.nv, model.nv))
    for column, unit in zip(full, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    work = robot.model.createData()
    upper = np.triu(pin.crba(robot.model, work, q))
    np.testing.assert_allclose(upper + np.triu(upper, 1).T, full[np.ix_(dofs, dofs)], rtol=1e-9, atol=1e-9)
    gravity = pin.computeGeneralizedGravity(robot.model, work, q)
    np.testing.assert_allclose(gravity, data.qfrc_bias[dofs], rtol=1e-9, atol=1e-9)


def compare_hulls(model: mujoco.MjModel, data: mujoco.MjData, robot: Robot, q: np.ndarray) -> None:
    """Every geom of the robot has a hull of MuJoCo's extents, where MuJoCo has it; round ones are a little larger."""
    owners = {"world", "cup", "target"}
    plane = int(mujoco.mjtGeom.mjGEOM_PLANE)
    names = [model.body(i).name for i in model.geom_bodyid]
    geoms = [
        g for g in range(model.ngeom) if names[g] not in owners or (names[g] == "world" and model.geom_type[g] != plane)
    ]
    hulls, poses = body_hulls(robot), robot.at(q).body_poses()
    assert len(hulls) == len(geoms)
    unmatched = []
    for joint, _, vertices in hulls:
        unmatched.append(vertices @ poses[joint, :3, :3].T + poses[joint, :3, 3])
    for geom in geoms:
        T, box = data.geom_xmat[geom].reshape(3, 3), model.geom_aabb[geom].reshape(2, 3)
        exact = int(model.geom_type[geom]) in (int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_BOX))
        slack = 3e-6 if exact else 0.05 * box[1].max()
        for k, world in enumerate(unmatched):
            local = (world - data.geom_xpos[geom]) @ T
            high, low = local.max(axis=0), local.min(axis=0)
            if np.abs(np.array([(high + low) / 2, (high - low) / 2]) - box).max() <= slack:
                assert exact or ((high - low) / 2 >= box[1] - 1e-6).all()
                del unmatched[k]
                break
        else:
            raise AssertionError(f"no hull where MuJoCo has geom {geom} of {names[geom]}")


@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_controlled_is_refused_by_name(kind: str, tmp_path: Path, mjcf_writer: Any) -> None:
    features, key, expected = REFUSED[kind]
    with pytest.raises(RobotFileError) as caught:
        load(mjcf_writer(tmp_path, features, 0).write())
    assert caught.value.key.startswith(key)
    assert expected in caught.value.expected


def test_a_model_that_is_not_mujoco_s_is_found(
    tmp_path: Path, mjcf_writer: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The comparison on loading is no formality: any body, site, range or inertia that is elsewhere is named."""
    from qpsafe.robot.models import mjcf_build

    path, real = mjcf_writer(tmp_path, "root_pose", 0).write(), mjcf_build.build_model

    def wrong(change: object) -> object:
        def build(*arguments: object) -> object:
            built = real(*arguments)
            change(built)
            return built

        return build

    def range_(built: mjcf_build.Built) -> None:
        built.model.lowerPositionLimit = np.array(built.model.lowerPositionLimit) + 1e-6

    def placement(built: mjcf_build.Built) -> None:
        built.model.jointPlacements[2] = built.model.jointPlacements[2] * pin.SE3(np.eye(3), np.array([0, 0, 1e-7]))

    def site(built: mjcf_build.Built) -> None:
        frame = built.model.frames[max(built.sites.values())]
        frame.placement = frame.placement * pin.SE3(pin.exp3(np.array([1e-7, 0.0, 0.0])), np.zeros(3))

    def inertia(built: mjcf_build.Built) -> None:
        built.model.inertias[2].mass *= 1.0 + 1e-6

    for change, key in ((range_, "range"), (placement, "body"), (site, "site"), (inertia, "inertia")):
        monkeypatch.setattr(mjcf_build, "build_model", wrong(change))
        with pytest.raises(RobotFileError, match="MuJoCo's") as caught:
            load(path)
        assert key in caught.value.key
