import mujoco
import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sim.people.choreography import Choreography
from qpsafe.sim.people.person import SEGMENTS
from qpsafe.sim.world.rays import cast
from qpsafe.sim.world.scene import CAMERA, PERSON, ROBOT_COLLISION, build_scene


@pytest.fixture(scope="module")
def robot():
    return load_robot("irb140")


@pytest.fixture(scope="module")
def scene(robot):
    return build_scene(robot)


def test_the_robot_in_the_world_is_the_robot_of_its_file(robot, scene):
    data, rng = scene.make_data(), np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(robot.lower, robot.upper)
        data.qpos[scene.q_addresses] = q
        mujoco.mj_kinematics(scene.model, data)
        assert data.site_xpos[scene.tcp_site] == pytest.approx(robot.pose("tcp", q)[:3, 3], abs=1e-9)
    assert scene.model.nq == scene.model.nv == scene.model.nu == robot.nq
    ranges = scene.model.jnt_range[[scene.model.joint(f"robot/{n}").id for n in robot.joint_names]]
    assert ranges == pytest.approx(np.stack([robot.lower, robot.upper], axis=1), abs=1e-9)


def test_placing_the_person_puts_every_geom_where_the_pose_says(scene):
    data, choreography = scene.make_data(), Choreography(person=scene.person)
    for t in (0.0, 5.0, 10.0, 17.0, 45.0):
        pose = choreography.pose(t)
        scene.place_person(data, pose)
        for i, geom in enumerate(scene.person_geoms):
            half = SEGMENTS[i].length / 2 * data.geom_xmat[geom].reshape(3, 3)[:, 2]
            assert data.geom_xpos[geom] - half == pytest.approx(pose.ends[i, 0], abs=1e-9)
            assert data.geom_xpos[geom] + half == pytest.approx(pose.ends[i, 1], abs=1e-9)
            assert scene.model.geom_size[geom, 0] == SEGMENTS[i].radius
        face = data.geom_xpos[scene.board_geom] + data.geom_xmat[scene.board_geom].reshape(3, 3) @ [
            scene.model.geom_size[scene.board_geom, 0],
            0.0,
            0.0,
        ]
        assert face == pytest.approx(pose.board_face, abs=1e-9)


def test_groups_tell_the_person_from_the_robot(scene):
    model = scene.model
    person = np.append(scene.person_geoms, scene.board_geom)
    assert set(np.flatnonzero(model.geom_group == PERSON)) == set(person)
    assert set(np.flatnonzero(model.geom_group == ROBOT_COLLISION)) == set(scene.robot_geoms)
    assert len(scene.robot_geoms) >= 7
    assert not model.geom_contype[person].any()
    assert not model.geom_conaffinity[person].any()


def test_the_person_stands_on_the_floor_that_is_drawn(robot):
    for pedestal in (0.4, 0.6):
        scene = build_scene(robot, pedestal=pedestal)
        data = scene.make_data()
        scene.place_person(data, scene.person.pose(1.5, 0.5, 2.0))
        lowest = min(scene.person.pose(1.5, 0.5, 2.0).ends[i, :, 2].min() - s.radius for i, s in enumerate(SEGMENTS))
        assert lowest == pytest.approx(data.geom("floor").xpos[2], abs=1e-9)
        assert data.geom("floor").xpos[2] == -pedestal


def test_the_person_touches_nothing_even_where_the_robot_may(robot):
    scene = build_scene(robot, contacts=True)
    data = scene.make_data()
    alone = data.ncon
    scene.place_person(data, scene.person.pose(0.3, 0.0, 0.0))  # in the middle of the robot
    mujoco.mj_forward(scene.model, data)
    assert data.ncon == alone
    person = {*scene.person_geoms, scene.board_geom}
    assert not any(set(pair) & person for pair in data.contact.geom)


def test_contact_forces_balance(robot):
    """Forward dynamics in contact, read backwards: accelerations and forces belong together.

    Guards the solver set-up: MuJoCo 4.0.0 has a fault with sparse constraint Jacobians, the scene sets a dense one.
    """
    scene = build_scene(robot, contacts=True)
    assert scene.model.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE
    data, rng, touching = scene.make_data(), np.random.default_rng(1), 0
    for _ in range(400):
        data.qpos[scene.q_addresses] = rng.uniform(robot.lower, robot.upper)
        data.qvel[:] = rng.normal(size=6)
        data.ctrl[:] = rng.normal(size=6) * 20.0
        mujoco.mj_forward(scene.model, data)
        if data.ncon == 0:
            continue
        touching += 1
        applied = data.qfrc_actuator.copy()
        mujoco.mj_inverse(scene.model, data)
        scale = 1.0 + np.abs(data.qfrc_constraint).max()
        assert np.abs(data.qfrc_inverse - applied).max() < 1e-6 * scale
    assert touching > 20


def test_bad_values_fail_the_run_instead_of_resetting_it(scene):
    assert scene.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET


@pytest.mark.parametrize("name", ["walk in", "medium", "close"])
def test_the_camera_sees_the_robot_past_the_person(scene, name):
    """From every direction the person leaves the tool, the elbow and the shoulder in view."""
    data, choreography = scene.make_data(), Choreography(person=scene.person)
    lens = data.cam_xpos[scene.model.camera(CAMERA).id]
    marks = [data.site_xpos[scene.tcp_site], data.body("robot/link_2").xpos, data.body("robot/link_3").xpos]
    for phase in choreography.phases:
        if phase.name == name:
            scene.place_person(data, choreography.pose(phase.end))
            for mark in marks:
                way = np.linalg.norm(mark - lens)
                assert np.isinf(cast(scene, data, lens[None], (mark - lens)[None], way, groups=(PERSON,))).all(), phase


@pytest.mark.parametrize(
    ("change", "key"),
    [({"timestep": 0.0}, "timestep"), ({"timestep": np.nan}, "timestep"), ({"pedestal": -0.5}, "pedestal")],
)
def test_a_wrong_scene_names_what_is_wrong(robot, change, key):
    with pytest.raises(ConfigurationError) as error:
        build_scene(robot, **change)
    assert error.value.key == key
