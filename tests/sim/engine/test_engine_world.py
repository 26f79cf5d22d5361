"""The world in flat arrays against the scene it was made of."""

import warnings

import mujoco
import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.geometry import layout
from qpsafe.sim.engine.world import World
from qpsafe.sim.world.scene import build_scene

GRIPPER = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="base" pos="0 0 0.1" euler="0.1 0.2 0.3"><geom type="box" size="0.1 0.1 0.1"/>
    <body name="upper" pos="0 0 0.2"><joint name="j1" axis="0 0.6 0.8" pos="0.1 0 0" range="-2 2" ref="0.2"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.04"/>
      <body name="slide" pos="0.4 0 0" euler="1 0 0"><joint name="j2" type="slide" axis="1 0 0" range="0 0.3"/>
        <geom type="cylinder" size="0.03 0.1" pos="0 0.1 0"/><site name="tcp"/>
        <body name="finger"><joint name="f" type="slide" axis="0 1 0" range="-0.1 0.1"/>
          <geom type="ellipsoid" size="0.01 0.02 0.03" pos="0 0 0.1"/></body>
      </body></body></body></worldbody>
  <actuator><motor joint="j1" name="j1"/><motor joint="j2" name="j2"/></actuator></mujoco>"""


def gripper(folder):
    path = folder / "gripper.xml"
    path.write_text(GRIPPER)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return qpsafe.load_robot(path, hold={"f": 0.05})


def add_things(spec):
    """Two bodies that can move, of two geoms each, and a shelf that cannot."""
    for i in range(2):
        body = spec.worldbody.add_body(name=f"thing {i}", pos=[i, 1.0, 1.0])
        body.add_freejoint()
        for x in (0.0, 0.1):
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.03, 0.04], pos=[x, 0.0, 0.0], mass=0.1)
    shelf = spec.worldbody.add_body(name="shelf", pos=[0.5, 0.5, 0.1], quat=[0.8, 0.0, 0.0, 0.6])
    shelf.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.2, 0.3, 0.04], pos=[0.1, 0.0, 0.0])


@pytest.mark.parametrize("name", first(2, ["gripper", *qpsafe.bundled_robots()]))
def test_shapes_lie_where_mujoco_has_them(name, tmp_path):
    """Wherever the joints are; those that are held move nothing; what can move lies where it is, or is left out."""
    robot = gripper(tmp_path) if name == "gripper" else qpsafe.load_robot(name)
    scene = build_scene(robot, furnish=add_things)
    fixed, world, rng = World.of(scene), World.of(scene, movable=True), np.random.default_rng(0)
    assert len(world.names) - len(fixed.names) == 4
    assert fixed.bodies == robot.nq + 1 == world.bodies - 2
    data = scene.make_data()
    assert bool(robot.held) == (name == "gripper")
    for _ in range(10):
        q = rng.uniform(robot.lower, robot.upper)
        data.qpos[scene.q_addresses] = q
        for joint in np.flatnonzero(scene.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
            data.qpos[scene.model.jnt_qposadr[joint] :][:7] = rng.normal(size=7)
        mujoco.mj_kinematics(scene.model, data)
        for some in (fixed, world):
            poses = some.poses(robot.at(q), data)[some.index[:, layout.BODY]]
            local = np.zeros((len(some.names), 4, 4))
            local[:, :3], local[:, 3, 3] = some.shapes[:, : layout.SIZE].reshape(-1, 3, 4), 1.0
            places = poses @ local
            assert places[:, :3, 3] == pytest.approx(data.geom_xpos[some.geoms], abs=1e-9)
            assert places[:, :3, :3].reshape(-1, 9) == pytest.approx(data.geom_xmat[some.geoms], abs=1e-9)


def test_bounds_hold_the_shapes(worlds):
    """Ball and box around every shape hold points of its surface, which rays find."""
    scene = worlds.scene_of_shapes(7)
    world, data, rng = World.of(scene), scene.make_data(), np.random.default_rng(7)
    poses, touched = world.poses(scene.robot.at(scene.robot.home)), 0
    for g in np.flatnonzero(world.index[:, layout.KIND] != layout.PLANE):
        geom = world.geoms[g]
        T = poses[world.index[g, layout.BODY]]
        row = world.shapes[g]
        centre = T[:3, :3] @ row[layout.BALL : layout.BALL + 3] + T[:3, 3]
        for _ in range(20):
            d = rng.normal(size=3)
            d /= np.linalg.norm(d)
            away = rng.normal(size=3)
            # from outside, across the ball
            o = centre + row[layout.BALL + 3] * (0.7 * away / np.linalg.norm(away) - 3.0 * d)
            t = mujoco.mj_ray(scene.model, data, o, d, None, True, -1, hit := np.zeros(1, np.int32))
            if t < 0.0 or hit[0] != geom:
                continue
            touched, p = touched + 1, o + t * d
            assert np.linalg.norm(p - centre) <= row[layout.BALL + 3] + 1e-7
            local = data.geom_xmat[geom].reshape(3, 3).T @ (p - data.geom_xpos[geom])
            assert (np.abs(local - row[layout.CASE :][:3]) <= row[layout.CASE + 3 :][:3] + 1e-7).all()
    assert touched > 100


@pytest.mark.parametrize("what", ["hills", "sheet"])
def test_what_has_no_place_in_the_world_is_refused_by_name(what):
    def furnish(spec):
        if what == "hills":
            spec.add_hfield(name=what, nrow=2, ncol=2, size=[1, 1, 1, 0.1], userdata=np.zeros(4))
            spec.worldbody.add_geom(name=what, type=1, hfieldname=what)
        else:
            corners, shell = [0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0], mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            spec.add_mesh(name=what, uservert=corners, userface=[0, 1, 2, 1, 3, 2], inertia=shell)
            looks = {"contype": 0, "conaffinity": 0, "group": 0}
            spec.worldbody.add_geom(name=what, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=what, **looks)

    with pytest.raises(ConfigurationError, match=what):
        World.of(build_scene(qpsafe.load_robot("irb140"), furnish=furnish))


def test_its_arrays_are_read_only():
    world = World.of(build_scene(qpsafe.load_robot("irb140")))
    for table in (*world.seen, *world.solid, world.robot, world.furniture, world.floors):
        assert not table.flags.writeable
