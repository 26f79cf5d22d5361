"""robot.xml of the IRB 140: one tree for two libraries, the published kinematics, a body of the right size."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from qpsafe.robot.loader import load_robot

ROBOT = load_robot("irb140")
FOLDER = ROBOT.folder
MODEL = mujoco.MjModel.from_xml_path(str(ROBOT.model_path))
RANDOM = np.random.default_rng(140).uniform(ROBOT.lower, ROBOT.upper, (100, 6))

# theta offset, d, a, alpha [deg, m], and limits [deg], speeds [deg/s], as published.
DH = [(0, 0.352, 0.07, -90), (-90, 0, 0.36, 0), (0, 0, 0, -90), (0, 0.38, 0, 90), (0, 0, 0, -90), (180, 0.065, 0, 0)]
LIMITS = [(-180, 180, 200), (-90, 110, 200), (-230, 50, 260), (-200, 200, 360), (-115, 115, 360), (-400, 400, 450)]

# Outer extents at the zero pose, base frame [m]; None where the paper does not say.
EXTENTS = {
    "base": [(-0.313, 0.175), (-0.201, 0.201), (0.0, 0.153)],
    "link_1": [(-0.160, 0.192), (-0.176, 0.204), (0.089, 0.452)],
    "link_2": [(-0.029, 0.153), (-0.176, 0.098), (0.284, 0.799)],
    "link_3": [(-0.078, 0.308), (-0.085, 0.085), (0.609, 0.809)],
    "link_4": [(0.309, 0.505), (-0.063, 0.063), (0.656, 0.768)],
    "link_5": [None, (-0.042, 0.042), (0.670, 0.754)],
    "link_6": [(0.486, 0.515), (-0.025, 0.025), (0.687, 0.737)],
}


def at(q) -> mujoco.MjData:
    data = mujoco.MjData(MODEL)
    data.qpos[:] = q
    mujoco.mj_forward(MODEL, data)
    return data


def corners(data: mujoco.MjData, body: str, group: int) -> np.ndarray:
    """World positions of all corners of a body's geoms in a group; every geom of the robot is a mesh."""
    points = []
    for geom in np.flatnonzero((MODEL.geom_bodyid == MODEL.body(body).id) & (MODEL.geom_group == group)):
        mesh = MODEL.geom_dataid[geom]
        assert MODEL.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
        first, count = MODEL.mesh_vertadr[mesh], MODEL.mesh_vertnum[mesh]
        vertices = MODEL.mesh_vert[first : first + count]
        points.append(vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.vstack(points)


def test_mujoco_and_pinocchio_see_the_same_robot() -> None:
    frames = [f"dh{i}" for i in range(7)] + ["flange", "tool0", "tcp"]
    for q in RANDOM:
        data, state = at(q), ROBOT.at(q)
        for frame in frames:
            site = MODEL.site(frame).id
            pose = state.pose(frame)
            np.testing.assert_allclose(pose[:3, 3], data.site_xpos[site], rtol=0, atol=1e-13)
            np.testing.assert_allclose(pose[:3, :3], data.site_xmat[site].reshape(3, 3), rtol=0, atol=1e-13)
            jacobian = np.zeros((6, 6))
            mujoco.mj_jacSite(MODEL, data, jacobian[:3], jacobian[3:], site)
            np.testing.assert_allclose(state.jacobian(frame), jacobian, rtol=0, atol=1e-13)
        # joint-space inertia from MuJoCo's inverse dynamics: M e_j = ID(q, 0, e_j) - ID(q, 0, 0), no API of 4.x needed
        inertia = pin.crba(ROBOT.model, ROBOT.model.createData(), q)
        upper = np.triu(inertia)
        inertia = upper + np.triu(upper, 1).T
        bias = inverse_dynamics(data, np.zeros(6))
        columns = [inverse_dynamics(data, unit) - bias for unit in np.eye(6)]
        np.testing.assert_allclose(np.array(columns), inertia, rtol=0, atol=1e-10)
        gravity = pin.computeGeneralizedGravity(ROBOT.model, ROBOT.model.createData(), q)
        np.testing.assert_allclose(bias, gravity, rtol=0, atol=1e-10)


def inverse_dynamics(data: mujoco.MjData, acceleration: np.ndarray) -> np.ndarray:
    data.qvel[:] = 0.0
    data.qacc[:] = acceleration
    mujoco.mj_fwdPosition(MODEL, data)
    mujoco.mj_fwdVelocity(MODEL, data)
    torque = np.zeros(6)
    mujoco.mj_rne(MODEL, data, 1, torque)
    return torque + MODEL.dof_armature * acceleration  # mj_rne leaves the armature out


def test_forward_kinematics_of_a_public_rapid_program() -> None:
    pose = ROBOT.pose("tool0", np.deg2rad([0, 0, 0, 0, 30, 0]))
    np.testing.assert_allclose(1e3 * pose[:3, 3], [506.2917, 0.0, 679.5], rtol=0, atol=1e-4)
    w, x, y, z = 0.5, 0.0, np.sqrt(3) / 2, 0.0
    np.testing.assert_allclose(pose[:3, :3], pin.Quaternion(w, x, y, z).matrix(), rtol=0, atol=1e-12)


def test_sites_are_the_published_denavit_hartenberg_frames() -> None:
    def turn(axis: str, angle: float) -> np.ndarray:
        pose = np.eye(4)
        c, s = np.cos(angle), np.sin(angle)
        i, j = {"z": (0, 1), "x": (1, 2)}[axis]
        pose[i, i], pose[i, j], pose[j, i], pose[j, j] = c, -s, s, c
        return pose

    def shift(x: float, z: float) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = x, 0.0, z
        return pose

    for q in RANDOM:
        data, pose = at(q), np.eye(4)
        for i, (theta, d, a, alpha) in enumerate(DH):
            step = turn("z", q[i] + np.deg2rad(theta)) @ shift(0, d) @ shift(a, 0) @ turn("x", np.deg2rad(alpha))
            pose = pose @ step
            site = data.site(f"dh{i + 1}")
            np.testing.assert_allclose(site.xpos, pose[:3, 3], rtol=0, atol=1e-12)
            np.testing.assert_allclose(site.xmat.reshape(3, 3), pose[:3, :3], rtol=0, atol=1e-12)


def test_axes_at_the_zero_pose() -> None:
    axes = at(np.zeros(6)).xaxis
    z, y, x = [0, 0, 1], [0, 1, 0], [1, 0, 0]
    np.testing.assert_allclose(axes, [z, y, y, x, y, x], rtol=0, atol=1e-15)


def test_limits_are_the_published_ones() -> None:
    lower, upper, speed = np.deg2rad(LIMITS).T
    np.testing.assert_allclose(ROBOT.lower, lower, rtol=1e-15)
    np.testing.assert_allclose(ROBOT.upper, upper, rtol=1e-15)
    np.testing.assert_allclose(ROBOT.max_velocity, speed, rtol=1e-15)
    np.testing.assert_allclose(MODEL.jnt_range, np.column_stack([lower, upper]), rtol=1e-15)
    assert [MODEL.joint(i).name for i in range(6)] == list(ROBOT.joint_names) == [f"joint_{i}" for i in range(1, 7)]
    assert np.all(MODEL.jnt_limited == 1)


def test_mass_is_the_published_one_and_the_tool_comes_on_top() -> None:
    tool = MODEL.body("tool").mass[0]
    assert tool == pytest.approx(ROBOT.tool.mass)
    assert MODEL.body_mass.sum() == pytest.approx(98.0 + tool)
    assert np.all(MODEL.body_inertia[1:] > 0)


def test_motors_can_hold_and_accelerate_the_arm_everywhere() -> None:
    assert [MODEL.actuator(i).name for i in range(6)] == list(ROBOT.joint_names)
    low, high = MODEL.actuator_ctrlrange.T
    np.testing.assert_array_equal(low, -high)
    np.testing.assert_array_equal(MODEL.jnt_actfrcrange, MODEL.actuator_ctrlrange)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (100, 6))
    for q, sign in zip(RANDOM, signs, strict=True):
        torque = pin.rnea(ROBOT.model, ROBOT.model.createData(), q, np.zeros(6), sign * ROBOT.max_acceleration)
        assert np.all(np.abs(torque) < 0.9 * high)


@pytest.mark.parametrize("body", EXTENTS)
def test_outer_extents_are_the_real_arm_s_within_10_mm(body: str) -> None:
    points = corners(at(np.zeros(6)), body, group=2)
    for axis, expected in enumerate(EXTENTS[body]):
        if expected is not None:
            found = points[:, axis].min(), points[:, axis].max()
            np.testing.assert_allclose(found, expected, rtol=0, atol=0.010, err_msg=f"{body} {'xyz'[axis]}")


def test_lower_arm_stands_beside_the_elbow() -> None:
    points = corners(at(np.zeros(6)), "link_2", group=2)
    upper = points[points[:, 2] > 0.5]
    np.testing.assert_allclose([upper[:, 1].min(), upper[:, 1].max()], [-0.176, -0.065], rtol=0, atol=0.010)


def test_the_needle_ends_in_the_tool_centre_point() -> None:
    data = at(RANDOM[0])
    points = corners(data, "tool", group=2)
    distance = np.linalg.norm(points - data.site("tcp").xpos, axis=1)
    assert distance.min() < 5e-4
    along = (points - data.site("tcp").xpos) @ data.site("tcp").xmat.reshape(3, 3)[:, 2]
    assert along.max() < 1e-4


def test_what_is_seen_never_collides_and_what_collides_covers_it() -> None:
    seen, solid = MODEL.geom_group == 2, MODEL.geom_group == 3
    assert np.all(seen | solid)
    assert not np.any(MODEL.geom_contype[seen] | MODEL.geom_conaffinity[seen])
    assert np.all(MODEL.geom_contype[solid] & MODEL.geom_conaffinity[solid])
    data = at(np.zeros(6))
    for body in [*EXTENTS, "tool"]:
        loose = corners(data, body, group=2)
        inside = np.zeros(len(loose), dtype=bool)
        for geom in np.flatnonzero(solid & (MODEL.geom_bodyid == MODEL.body(body).id)):
            inside |= within_hull(data, geom, loose, margin=0.010)
        assert inside.all(), f"{body}: {(~inside).sum()} corners stick out, e.g. {loose[~inside][:3]}"


def within_hull(data: mujoco.MjData, geom: int, points: np.ndarray, margin: float) -> np.ndarray:
    """Which points lie in the hull of a mesh geom or at most `margin` outside each of its faces."""
    from scipy.spatial import ConvexHull

    mesh = MODEL.geom_dataid[geom]
    first, count = MODEL.mesh_vertadr[mesh], MODEL.mesh_vertnum[mesh]
    planes = ConvexHull(MODEL.mesh_vert[first : first + count]).equations
    local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
    return np.all(local @ planes[:, :3].T + planes[:, 3] <= margin, axis=1)


def test_moving_one_joint_over_its_whole_range_touches_nothing() -> None:
    assert at(ROBOT.home).ncon == 0
    for joint in range(6):
        for value in np.linspace(ROBOT.lower[joint], ROBOT.upper[joint], 19):
            q = np.zeros(6)
            q[joint] = value
            assert at(q).ncon == 0, f"joint_{joint + 1} at {np.rad2deg(value):.0f} deg"


def test_the_arm_collides_with_its_own_base_when_folded_into_it() -> None:
    assert at(np.deg2rad([0, 110, 50, 0, 0, 0])).ncon > 0


def test_home_is_far_from_singular() -> None:
    jacobian = ROBOT.jacobian("tcp", ROBOT.home)
    assert np.linalg.svd(jacobian, compute_uv=False)[-1] > 0.1
    assert abs(ROBOT.home[4]) > np.deg2rad(30)


def test_body_script_and_committed_model_agree() -> None:
    script = load_script(FOLDER / "build_body.py")
    committed = ROBOT.model_path.read_text(encoding="utf-8")
    assert script.build(committed) == committed
    zero = at(np.zeros(6))
    for body, origin in script.ORIGIN.items():
        if body != "tool":  # drawn in its own frame
            np.testing.assert_allclose(zero.body(body).xpos, origin, rtol=0, atol=1e-12)


def load_script(path: Path):
    spec = importlib.util.spec_from_file_location(f"irb140_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
