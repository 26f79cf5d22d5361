"""What every bundled robot must be: one model for two libraries, hulls that cover what is seen, motors that suffice."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import qpsafe
from qpsafe.robot.loader import bundled_robots, load_robot
from qpsafe.sensing.body import body_hulls

pytestmark = pytest.mark.parametrize("name", bundled_robots())


@cache
def loaded(name: str) -> tuple[Any, Any, np.ndarray]:
    """Robot, MuJoCo model, and random configurations."""
    robot = load_robot(name)
    model = mujoco.MjModel.from_xml_path(str(robot.model_path))
    return robot, model, np.random.default_rng(7).uniform(robot.lower, robot.upper, (20, robot.nq))


def at(name: str, q: np.ndarray) -> Any:
    model = loaded(name)[1]
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    return data


def vertices(model: Any, geom: int) -> np.ndarray:
    assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
    mesh = model.geom_dataid[geom]
    return model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]


def test_mujoco_and_pinocchio_see_the_same_robot(name: str) -> None:
    robot, model, configurations = loaded(name)
    assert [model.joint(i).name for i in range(model.njnt)] == list(robot.joint_names)
    assert robot.model.nbodies == robot.nq + 1  # no tree was left out
    for q in configurations:
        data, state = at(name, q), robot.at(q)
        for frame in robot.frame_names:
            target = robot.model.frames[robot.frame_id(frame)].name
            index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, target)
            jacobian = np.zeros((6, robot.nq))
            if index >= 0:
                position, rotation = data.site_xpos[index], data.site_xmat[index]
                mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], index)
            else:
                index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, target)
                position, rotation = data.xpos[index], data.xmat[index]
                mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], index)
            np.testing.assert_allclose(state.position(frame), position, rtol=0, atol=1e-12)
            np.testing.assert_allclose(state.rotation(frame), rotation.reshape(3, 3), rtol=0, atol=1e-12)
            np.testing.assert_allclose(state.jacobian(frame), jacobian, rtol=0, atol=1e-12)


def test_the_same_files_in_another_folder_are_the_same_robot(name: str, tmp_path: Path) -> None:
    """There MuJoCo compiles the MJCF; the bundled robots are read without it."""
    robot, _, configurations = loaded(name)
    copied = load_robot(shutil.copytree(robot.folder, tmp_path / name))
    assert copied.notes == robot.notes == ()
    for key in ("joint_names", "frame_names", "wire_frames", "tool_frames"):
        assert getattr(copied, key) == getattr(robot, key)
    for key in ("lower", "upper", "max_velocity", "max_acceleration", "home"):
        np.testing.assert_array_equal(getattr(copied, key), getattr(robot, key))
    for q in configurations[:5]:
        state, other = robot.at(q), copied.at(q)
        for frame in robot.frame_names:
            np.testing.assert_allclose(other.pose(frame), state.pose(frame), rtol=0, atol=1e-12)
            np.testing.assert_allclose(other.jacobian(frame), state.jacobian(frame), rtol=0, atol=1e-12)
    for (joint, what, points), (other_joint, other_what, own) in zip(
        body_hulls(robot), body_hulls(copied), strict=True
    ):
        assert (joint, what) == (other_joint, other_what)
        np.testing.assert_allclose(own.min(axis=0), points.min(axis=0), rtol=0, atol=1e-9)
        np.testing.assert_allclose(own.max(axis=0), points.max(axis=0), rtol=0, atol=1e-9)


def test_inertia_and_gravity_are_the_same_too(name: str) -> None:
    robot, model, configurations = loaded(name)
    work = robot.model.createData()
    for q in configurations[:5]:
        data = at(name, q)
        inertia = np.zeros((robot.nq, robot.nq))
        for column, unit in zip(inertia, np.eye(robot.nq), strict=True):
            mujoco.mj_mulM(model, data, column, unit)
        upper = np.triu(pin.crba(robot.model, work, q))
        np.testing.assert_allclose(inertia, upper + np.triu(upper, 1).T, rtol=0, atol=1e-10)
        gravity = pin.computeGeneralizedGravity(robot.model, work, q)
        np.testing.assert_allclose(data.qfrc_bias, gravity, rtol=0, atol=1e-10)


def test_motors_can_hold_and_accelerate_the_arm_everywhere(name: str) -> None:
    robot, model, configurations = loaded(name)
    assert [model.actuator(i).name for i in range(model.nu)] == list(robot.joint_names)
    low, high = model.actuator_ctrlrange.T
    np.testing.assert_array_equal(low, -high)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], configurations.shape)
    for q, sign in zip(configurations, signs, strict=True):
        torque = pin.rnea(robot.model, robot.model.createData(), q, np.zeros(robot.nq), sign * robot.max_acceleration)
        assert np.all(np.abs(torque) < 0.9 * high)


def test_what_is_seen_never_collides_and_what_collides_covers_it(name: str) -> None:
    _, model, _ = loaded(name)
    seen, solid = model.geom_group == 2, model.geom_group == 3
    assert np.all(seen | solid)
    assert not np.any(model.geom_contype[seen] | model.geom_conaffinity[seen])
    assert np.all(model.geom_contype[solid] & model.geom_conaffinity[solid])
    data = at(name, np.zeros(model.nq))
    for body in range(1, model.nbody):
        own = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body]
        if not own:
            continue
        world = {g: vertices(model, g) @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g] for g in own}
        loose = np.vstack([world[g] for g in own if seen[g]])
        inside = np.zeros(len(loose), dtype=bool)
        for g in own:
            if solid[g]:
                planes = ConvexHull(world[g]).equations
                inside |= np.all(loose @ planes[:, :3].T + planes[:, 3] <= 0.012, axis=1)
        assert inside.all(), f"{model.body(body).name}: {(~inside).sum()} corners stick out, e.g. {loose[~inside][:3]}"


def test_nothing_touches_at_home(name: str) -> None:
    robot, _, _ = loaded(name)
    assert at(name, robot.home).ncon == 0


def test_home_is_inside_the_limits_and_far_from_singular(name: str) -> None:
    robot, _, _ = loaded(name)
    margin = np.minimum(robot.home - robot.lower, robot.upper - robot.home)
    assert margin.min() > np.deg2rad(20)
    jacobian = np.vstack([robot.jacobian(frame, robot.home) for frame in robot.tool_frames])  # of all tools at once
    assert np.linalg.svd(jacobian, compute_uv=False)[-1] > 0.1


def test_spots_sit_on_the_skin_and_look_outwards(name: str) -> None:
    """A ray from each spot meets nothing of its own body, and the robot is at most 30 mm behind it."""
    robot, model, _ = loaded(name)
    spots = qpsafe.load_spots(robot)
    assert len(spots) >= 20
    data = at(name, robot.home)
    seen = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
    seen[3] = 1
    origins, directions = spots.rays(robot.at(robot.home))
    for spot, frame, origin, direction in zip(spots.names, spots.frames, origins, directions, strict=True):
        target = robot.model.frames[robot.frame_id(frame)].name
        body = model.site_bodyid[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, target)]
        geom = np.zeros(1, dtype=np.int32)
        start = origin + 1e-3 * direction
        mujoco.mj_ray(model, data, start, direction, seen, 1, -1, geom)
        assert geom[0] < 0 or model.geom_bodyid[geom[0]] != body, spot
        depth = mujoco.mj_ray(model, data, start, -direction, seen, 1, -1, geom)
        assert 0.0 <= depth < 0.03, (spot, depth)


def test_body_script_and_committed_model_agree(name: str) -> None:
    robot, _, _ = loaded(name)
    path = robot.folder / "build_body.py"
    spec = importlib.util.spec_from_file_location(f"{name}_build_body", path)
    script = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = script
    spec.loader.exec_module(script)
    committed = robot.model_path.read_text(encoding="utf-8")
    assert script.build(committed) == committed
