"""Robots whose files were not written for this simulation: what is added makes them work, and agrees with the robot."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from qpsafe.placement.surface import link_surface
from qpsafe.robot.loader import load_robot
from qpsafe.robot.robot import Robot
from qpsafe.robot.robot_file.spec import Region
from qpsafe.sensing.body import body_hulls
from qpsafe.sim.world.distance import TrueDistances
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.robot_spec import SPARE, torques
from qpsafe.sim.world.scene import ROBOT_COLLISION, build_scene
from qpsafe.sim.world.tool_axis import tool_axis, turned_to

pytestmark = pytest.mark.long


def quiet(path: Path, **more: Any) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(path, **more)


@pytest.mark.parametrize("axes", ["SIX", "SEVEN"])
@pytest.mark.parametrize("shapes", [True, False])
def test_a_urdf_moves_and_weighs_as_the_controller_knows_it(axes: str, shapes: bool, arms: Any, tmp_path: Path) -> None:
    """Every frame, fixed ones included, and the joint-space inertia: against pinocchio's reading of the file."""
    robot = quiet(arms.write_arm(tmp_path, getattr(arms, axes), shapes=shapes))
    scene = build_scene(robot)
    model, rng, work = scene.model, np.random.default_rng(0), robot.model.createData()
    for _ in range(5):
        q = rng.uniform(robot.lower, robot.upper)
        data = scene.make_data(q)
        for frame in robot.frame_names[1:]:
            site = model.site(f"robot/{frame}").id
            pose = robot.pose(frame, q)
            np.testing.assert_allclose(data.site_xpos[site], pose[:3, 3], atol=1e-9)
            np.testing.assert_allclose(data.site_xmat[site].reshape(3, 3), pose[:3, :3], atol=1e-9)
        expected = pin.crba(robot.model, work, q)
        expected = np.triu(expected) + np.triu(expected, 1).T
        for j, v in enumerate(scene.v_addresses):
            unit, column = np.zeros(model.nv), np.zeros(model.nv)
            unit[v] = 1.0
            mujoco.mj_mulM(model, data, column, unit)
            np.testing.assert_allclose(column[scene.v_addresses], expected[:, j], atol=1e-6)


def test_what_it_lacks_is_added_and_said(arms: Any, tmp_path: Path) -> None:
    robot = quiet(arms.write_arm(tmp_path, shapes=False, masses=False, efforts=False))
    scene = build_scene(robot)
    said = "; ".join(scene.said)
    for word in ("no collision geometry", "no mass", "motors for axis_1", "no torque is stated"):
        assert word in said
    moving, holding = torques(robot)
    needed = (moving + holding).max(axis=0)
    np.testing.assert_allclose(scene.model.actuator_ctrlrange[scene.actuators, 1], SPARE * needed, rtol=1e-9)
    plant = Plant(scene)
    plant.advance(0.2)
    assert np.abs(plant.q - robot.home).max() < 1e-6  # it stands against gravity
    assert not plant.saturated
    person, _ = TrueDistances(scene).measure(plant.data)
    assert np.isfinite(person.distance)
    assert {scene.model.geom(g).name.split(" ")[0] for g in scene.robot_geoms} == {"robot/rod"}


def test_stated_torques_are_the_motors_and_nothing_is_made_up(arms: Any, tmp_path: Path) -> None:
    robot = quiet(arms.write_arm(tmp_path))
    scene = build_scene(robot)
    expected = [effort for *_, effort in arms.SIX]
    np.testing.assert_array_equal(scene.model.actuator_ctrlrange[scene.actuators, 1], expected)
    assert scene.said[0].startswith("motors for")
    assert not any(word in line for line in scene.said for word in ("mass", "torque", "geometry"))


def test_the_hulls_of_the_world_are_those_the_controller_filters_by(arms: Any, tmp_path: Path) -> None:
    robot = quiet(arms.write_arm(tmp_path, arms.SEVEN))
    scene = build_scene(robot)
    q = np.random.default_rng(1).uniform(robot.lower, robot.upper)
    data, poses = scene.make_data(q), robot.at(q).body_poses()
    hulls = body_hulls(robot)
    assert len(scene.robot_geoms) == len(hulls)
    for geom, (body, _, vertices) in zip(scene.robot_geoms, hulls, strict=True):
        mesh = scene.model.geom_dataid[geom]
        first, count = scene.model.mesh_vertadr[mesh], scene.model.mesh_vertnum[mesh]
        own = scene.model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        theirs = vertices @ poses[body][:3, :3].T + poses[body][:3, 3]
        np.testing.assert_allclose([own.min(0), own.max(0)], [theirs.min(0), theirs.max(0)], atol=1e-5)


def test_with_contacts_on_it_stands_at_home(arms: Any, tmp_path: Path) -> None:
    """Links that overlap where they are joined, or at home, are mounted so."""
    robot = quiet(arms.write_arm(tmp_path))
    scene = build_scene(robot, contacts=True)
    data = scene.make_data()
    names = scene.model.geom_group[data.contact.geom]
    assert not (names == ROBOT_COLLISION).all(axis=1).any()


def test_a_region_of_a_urdf_has_its_link_s_surface(arms: Any, tmp_path: Path) -> None:
    """Frames on fixed joints are found, which MuJoCo's own reader drops."""
    robot = quiet(arms.write_arm(tmp_path))
    region = Region("wrist", 5, "flange", np.full(3, -0.2), np.full(3, 0.2))
    surface = link_surface(robot, region)
    body, place = robot.mounting("flange")
    own = np.vstack([v for owner, _, v in body_hulls(robot) if owner == body])
    inside = (own - place[:3, 3]) @ place[:3, :3]
    corners = surface.skin.reshape(-1, 3)
    np.testing.assert_allclose([corners.min(0), corners.max(0)], [inside.min(0), inside.max(0)], atol=1e-5)


POSITIONED = """<mujoco model="theirs"><compiler angle="radian" autolimits="true"/>
  <worldbody><body name="a"><joint name="j1" axis="0 0 1" range="-2 2"/>
    <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.04"/>
    <body name="b" pos="0.4 0 0"><joint name="j2" axis="0 1 0" range="-2 2"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/><body name="hand" pos="0.3 0 0.1"/>
  </body></body></worldbody>
  <actuator>
    <position name="servo1" joint="j1" kp="500" forcerange="-33 33"/><position name="j2" joint="j2" kp="9"/>
  </actuator>
  <keyframe><key name="home" qpos="0.1 0.2" ctrl="0.1 0.2"/></keyframe>
</mujoco>"""


def test_servos_of_an_mjcf_become_motors(tmp_path: Path) -> None:
    """Their forces are the motors' torques; where none is stated, what motion needs."""
    (tmp_path / "theirs.xml").write_text(POSITIONED)
    robot = quiet(tmp_path / "theirs.xml")
    scene = build_scene(robot)
    assert scene.model.nu == 2
    limits = scene.model.actuator_ctrlrange[scene.actuators, 1]
    assert limits[0] == 33.0
    moving, holding = torques(robot)
    assert limits[1] == pytest.approx(SPARE * (moving + holding).max(axis=0)[1])
    assert any("motors for j1, j2" in line for line in scene.said)
    data = scene.make_data()
    np.testing.assert_allclose(data.site_xpos[scene.tcp_site], robot.pose(robot.tool_frames[0], robot.home)[:3, 3])
    plant = Plant(scene)
    plant.advance(0.1)
    assert np.abs(plant.q - [0.1, 0.2]).max() < 1e-6


def test_bundled_robots_need_nothing() -> None:
    for name in ("irb140", "iiwa14", "irb14000"):
        assert build_scene(load_robot(name), people=()).said == ()


@pytest.mark.parametrize("axes", ["SIX", "SEVEN"])
def test_a_tool_points_out_of_the_flange(axes: str, arms: Any, tmp_path: Path) -> None:
    robot = quiet(arms.write_arm(tmp_path, getattr(arms, axes)))
    (tool,) = robot.tool_frames
    np.testing.assert_allclose(tool_axis(robot, tool), getattr(arms, axes)[-1][2], atol=1e-9)
    scene = build_scene(robot, people=())
    data = scene.make_data()
    out = data.site_xmat[scene.tcp_site].reshape(3, 3)[:, 2]
    np.testing.assert_allclose(out, robot.pose(tool, robot.home)[:3, :3] @ tool_axis(robot, tool), atol=1e-9)


def test_the_smallest_turn_takes_one_direction_to_the_other() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        a, b = rng.normal(size=(2, 3))
        a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        for end in (b, a, -a):
            R = turned_to(a, end)
            np.testing.assert_allclose(R @ a, end, atol=1e-9)
            np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
            assert np.linalg.det(R) == pytest.approx(1.0)
            assert np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1)) == pytest.approx(
                np.arccos(np.clip(a @ end, -1, 1)), abs=1e-6
            )
