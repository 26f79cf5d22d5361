"""A robot of one's own in the simulation, whatever geom groups its author chose, and with joints that are held."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from amounts import first

from qpsafe.robot.loader import load_robot
from qpsafe.robot.robot import Robot
from qpsafe.sim.people.person import Board
from qpsafe.sim.world.clearance import Furniture
from qpsafe.sim.world.distance import TrueDistances
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.robot_spec import shown_groups
from qpsafe.sim.world.scene import ROBOT_COLLISION, SCENERY, build_scene

IRB140 = load_robot("irb140")

ARM = """<mujoco model="own"><compiler angle="radian"/>
  <worldbody>
    <geom type="plane" size="3 3 1"/>
    <body name="base"><geom type="box" size="0.1 0.1 0.1" {looks}/>
      <body name="upper" pos="0 0 0.2"><joint name="j1" axis="0 0 1" range="-2 2"/>
        <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.04" {looks}/>
        <body name="fore" pos="0.4 0 0"><joint name="j2" axis="0 1 0" range="-2 2" ref="0.3"/>
          <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" {looks}/>
          <site name="tcp" pos="0.3 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="j1" joint="j1"/><motor name="j2" joint="j2"/></actuator>
</mujoco>"""


def own(folder: Path, looks: str, **more: object) -> Robot:
    path = folder / "own.xml"
    path.write_text(ARM.format(looks=looks))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(path, **more)


@pytest.mark.parametrize("seed", first(2, range(3)))
def test_groups_of_the_file_do_not_matter(seed: int, tmp_path: Path) -> None:
    """The bundled robot with its groups exchanged at random, geom by geom, is the same robot in the world."""
    rng = np.random.default_rng(seed)
    text = re.sub(r' group="[23]"', "", IRB140.model_path.read_text())  # now all in the default group
    if seed:
        text = re.sub("<geom ", lambda _: f'<geom group="{rng.integers(6)}" ', text)
    (tmp_path / "robot.xml").write_text(text)
    (tmp_path / "robot.toml").write_text((IRB140.folder / "robot.toml").read_text().replace('spots = "spots.toml"', ""))
    scene, right = build_scene(load_robot(tmp_path)), build_scene(IRB140)
    np.testing.assert_array_equal(scene.model.geom_group, right.model.geom_group)
    np.testing.assert_array_equal(scene.robot_geoms, right.robot_geoms)
    data, same = scene.make_data(), right.make_data()
    for one, other in zip(TrueDistances(scene).measure(data), TrueDistances(right).measure(same), strict=True):
        assert one.distance == pytest.approx(other.distance, abs=1e-9)
    assert len(known_obstacles(scene)) == len(known_obstacles(right))


@pytest.mark.parametrize("looks", ["", 'group="1"', 'group="5" contype="0" conaffinity="0"'])
def test_a_robot_without_pictures_of_its_own_is_seen_measured_and_no_furniture(looks: str, tmp_path: Path) -> None:
    scene = build_scene(own(tmp_path, looks), board=Board())
    model = scene.model
    names = [model.body(i).name for i in model.geom_bodyid]
    assert [names[g] for g in scene.robot_geoms] == ["robot/base", "robot/upper", "robot/fore"]
    assert shown_groups(model)[ROBOT_COLLISION]
    furniture = {names[g] for g in [*Furniture(scene).geoms, *np.flatnonzero(model.geom_group == SCENERY)]}
    assert not any(name.startswith("robot/") for name in furniture)
    data = scene.make_data()
    assert np.isfinite(TrueDistances(scene).board(data).distance)
    assert (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE).sum() == 1  # the world's floor


def test_a_held_joint_stays_held_in_the_world(tmp_path: Path) -> None:
    robot = own(tmp_path, "", hold={"j2": -0.7})
    scene = build_scene(robot)
    data = scene.make_data()
    mujoco.mj_kinematics(scene.model, data)
    np.testing.assert_allclose(data.site_xpos[scene.tcp_site], robot.pose("tcp", robot.home)[:3, 3], atol=1e-9)
    for _ in range(500):
        mujoco.mj_step(scene.model, data)
    assert data.joint("robot/j2").qpos[0] == pytest.approx(-0.7, abs=5e-3)
