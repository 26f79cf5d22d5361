"""Which robot in somebody's model, and where it stands: found and taken into account, or refused by name."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mink
import mujoco
import numpy as np
import pink
import pinocchio as pin
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.plugins import mink as for_mink
from qpsafe.plugins import pink as for_pink
from qpsafe.plugins.convert import task_velocity
from qpsafe.plugins.joints import mujoco_joints, pinocchio_joints
from qpsafe.plugins.mink_convert import from_mink, to_mink
from qpsafe.plugins.pink_convert import from_pink, to_pink
from qpsafe.tasks.trajectory import FixedJoints

DT, ROBOT = 0.004, qpsafe.load_robot("irb140")
MODEL = mujoco.MjModel.from_xml_path(str(ROBOT.model_path))
MOVERS = ("", '<joint type="hinge" name="mover"/>', '<joint type="slide" name="mover"/>', '<freejoint name="mover"/>')
KINDS = {"hinge": pin.JointModelRZ, "slide": pin.JointModelPX, "ball": pin.JointModelSpherical}
OTHERS = {"hinge": pin.JointModelRevoluteUnaligned, "slide": pin.JointModelPrismaticUnaligned, "ball": pin.JointModelHX}
kinds = st.lists(st.sampled_from(["hinge"] * 8 + ["slide", "ball"]), min_size=6, max_size=6)


@given(kinds, st.sampled_from(MOVERS), st.integers(0, 6))
@settings(max_examples=some(40, 400), deadline=None)
def test_joints_in_mujoco_are_hinges_and_nothing_else_moves_the_robot(joints: list[str], mover: str, at: int) -> None:
    """`mover` moves the body that joint number `at` hangs on; behind the last one it moves nothing of the robot's."""
    at = at if "free" not in mover else 0
    xml, end = "", ""
    for k, kind in enumerate([*joints, ""]):
        if k == at and mover:
            xml, end = f'{xml}<body>{mover}<geom size=".1" mass="1"/>', f"</body>{end}"
        if kind:
            joint = f'<joint type="{kind}" name="{ROBOT.joint_names[k]}"/>'
            xml, end = f'{xml}<body pos="0 0 1">{joint}<geom size=".1" mass="1"/>', f"</body>{end}"
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{xml}{end}</worldbody></mujoco>")
    wrong = [f"joint {name}" for name, kind in zip(ROBOT.joint_names, joints, strict=True) if kind != "hinge"]
    if mover and at < 6:
        wrong.append("mover")
    judge(wrong, lambda: mujoco_joints(model, ROBOT))


@given(kinds, st.sampled_from(["", "hinge", "free"]), st.integers(0, 6), st.sampled_from([KINDS, OTHERS]))
@settings(max_examples=some(40, 400), deadline=None)
def test_joints_in_pinocchio_are_revolute_and_nothing_else_moves_the_robot(
    joints: list[str], mover: str, at: int, types: dict[str, Any]
) -> None:
    model, parent = pin.Model(), 0
    for k, kind in enumerate([*joints, ""]):
        if k == at and mover:
            joint = pin.JointModelRX() if mover == "hinge" else pin.JointModelFreeFlyer()
            parent = model.addJoint(parent, joint, pin.SE3.Identity(), "mover")
        if kind:
            made = types[kind](*([np.array([0.0, 0.6, 0.8])] if types is OTHERS and kind != "ball" else []))
            parent = model.addJoint(parent, made, pin.SE3.Identity(), ROBOT.joint_names[k])
    wrong = [f"joint {name}" for name, kind in zip(ROBOT.joint_names, joints, strict=True) if kind != "hinge"]
    if mover and at < 6:
        wrong.append("mover")
    judge(wrong, lambda: pinocchio_joints(model, ROBOT))


def judge(wrong: list[str], find: Any) -> None:
    """Everything that is wrong is refused, and one of it is named."""
    if not wrong:
        assert len(find().v) == 6
        return
    with pytest.raises(qpsafe.ConfigurationError) as caught:
        find()
    assert any(name in str(caught.value) for name in wrong)


@pytest.mark.parametrize("name", qpsafe.bundled_robots())
def test_bundled_robots_are_found_in_their_own_models(name: str) -> None:
    robot = qpsafe.load_robot(name)
    mujoco_joints(mujoco.MjModel.from_xml_path(str(robot.model_path)), robot)
    pinocchio_joints(robot.model, robot)


def test_a_joint_that_the_robots_file_holds_in_place_may_carry_it(tmp_path: Path) -> None:
    robot, path = arm(tmp_path, hold={"j1": 0.3})
    assert mujoco_joints(mujoco.MjModel.from_xml_path(str(path)), robot).v.tolist() == [1, 2]


@pytest.mark.parametrize("find", [mujoco_joints, pinocchio_joints])
@pytest.mark.parametrize("model", [None, 5, "x", ROBOT, mujoco.MjModel, pin.Model])
def test_what_is_no_model_is_named(find: Any, model: Any) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match="model"):
        find(model, ROBOT)


vectors = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)
turns = st.lists(st.floats(-0.4, 0.4), min_size=6, max_size=6).map(np.array)


@given(vectors, vectors, turns, st.sampled_from(["tcp", "dh3", "flange"]))
@settings(max_examples=some(4, 60), deadline=None)
def test_a_robot_that_stands_elsewhere_is_led_to_the_same_place(shift: Any, turn: Any, step: Any, frame: str) -> None:
    quaternion = pin.Quaternion(pin.exp3(turn)).coeffs()[[3, 0, 1, 2]]
    spec = mujoco.MjSpec()
    for prefix, pose in (("a_", ([0.0] * 3, [1.0, 0.0, 0.0, 0.0])), ("b_", (shift, quaternion))):
        place = spec.worldbody.add_frame(pos=pose[0], quat=pose[1])
        spec.attach(mujoco.MjSpec.from_file(str(ROBOT.model_path)), prefix=prefix, frame=place)
    model, goal = spec.compile(), ROBOT.home + step
    sites = [name for name in (ROBOT.model.frames[ROBOT.frame_id(frame)].name, frame) if f"b_{name}" in sites_of(model)]
    assert sites or frame != "tcp"
    if sites:
        q = np.concatenate((ROBOT.home, goal))
        theirs = mink.FrameTask(f"b_{sites[0]}", "site", 1.0, 1.0, gain=0.05)
        theirs.set_target_from_configuration(mink.Configuration(model, q=q))
        check(from_mink(theirs, ROBOT, model, DT, prefix="b_"), goal)
        with pytest.raises(qpsafe.ConfigurationError, match="begin with 'a_'"):
            from_mink(theirs, ROBOT, model, DT, prefix="a_")
    moved, base = pin.Model(ROBOT.model), pin.SE3(pin.exp3(turn), shift)
    moved.jointPlacements[1] = base * moved.jointPlacements[1]
    name = ROBOT.model.frames[ROBOT.frame_id(frame)].name
    theirs = pink.tasks.FrameTask(name, 1.0, 1.0, gain=0.05)
    theirs.set_target_from_configuration(pink.Configuration(moved, moved.createData(), goal))
    check(from_pink(theirs, ROBOT, moved, DT), goal)


def check(task: Any, goal: Any) -> None:
    """The converted task is met where theirs is."""
    value = task.value(ROBOT.at(goal))
    np.testing.assert_allclose(task.error(value, task.trajectory.sample(0.0)), 0.0, atol=1e-7)


def sites_of(model: Any) -> list[str]:
    return [model.site(k).name for k in range(model.nsite)]


def test_a_frame_of_the_same_name_that_moves_otherwise_is_refused() -> None:
    """Another tool of the same name, farther out; the robot's frame of a model in which it hangs on another link."""
    spec = mujoco.MjSpec.from_file(str(ROBOT.model_path))
    spec.site("tcp").pos = np.add(spec.site("tcp").pos, [0.0, 0.0, 0.1])
    model = spec.compile()
    theirs = mink.FrameTask("tcp", "site", 1.0, 1.0, gain=0.05)
    theirs.set_target(mink.SE3.identity())
    with pytest.raises(qpsafe.ConfigurationError, match="moves in the model as tcp"):
        from_mink(theirs, ROBOT, model, DT)
    other = pin.Model(ROBOT.model)
    other.frames[other.getFrameId("tcp")].parentJoint = 3
    theirs = pink.tasks.FrameTask("tcp", 1.0, 1.0, gain=0.05)
    theirs.set_target(pin.SE3.Identity())
    with pytest.raises(qpsafe.ConfigurationError, match="moves in the model as tcp"):
        from_pink(theirs, ROBOT, other, DT)


def arm(folder: Path, **options: Any) -> tuple[Any, Path]:
    """A robot whose first joint turns without end."""
    path, end = folder / "arm.xml", ""
    xml = '<mujoco><compiler angle="radian"/><worldbody><body name="b"><geom size=".1" mass="1"/>'
    for k, joint in enumerate(('axis="0 0 1"', 'axis="0 1 0" range="-2 2"', 'axis="0 1 0" range="-2 2"'), 1):
        xml += f'<body name="l{k}" pos=".4 0 .1"><joint name="j{k}" {joint}/><geom size=".05" mass="1"/>'
        end += "</body>"
    path.write_text(f'{xml}<site name="tcp" pos=".2 0 0"/>{end}</body></worldbody></mujoco>')
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return qpsafe.load_robot(path, **options), path


@pytest.fixture(scope="module")
def endless(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    return arm(tmp_path_factory.mktemp("endless"))


def test_postures_take_the_short_way_there_too(endless: tuple[Any, Path]) -> None:
    robot, path = endless
    assert robot.endless.tolist() == [True, False, False]
    model, rng = mujoco.MjModel.from_xml_path(str(path)), np.random.default_rng(5)
    for joints in (None, [0], [0, 2], [1], [1, 2]):
        for _ in range(some(6, 60)):
            posture, q = (rng.uniform(-1.0, 1.0, 3) * [6.0, 1.9, 1.9] for _ in range(2))
            task: Any = qpsafe.PostureTask(posture)
            if joints is not None:
                task = qpsafe.JointTask(FixedJoints(posture), joints=joints)
            sample = task.trajectory.sample(0.0)
            expected = task.velocity(task.error(task.value(robot.at(q)), sample), sample)
            theirs = to_mink(task, robot, model, DT)
            assert isinstance(theirs, for_mink.ClikTask) == (joints is None or 0 in joints)
            np.testing.assert_allclose(
                task_velocity(theirs, mink.Configuration(model, q=q), DT)[1], expected, atol=1e-9
            )
            theirs = to_pink(task, robot, robot.model, DT)
            assert isinstance(theirs, for_pink.ClikTask)
            at = pink.Configuration(robot.model, robot.model.createData(), q)
            np.testing.assert_allclose(task_velocity(theirs, at, DT).velocity, expected, atol=1e-9)


@pytest.mark.parametrize("kind", ["mink", "pink"])
def test_conversions_name_what_is_wrong(kind: str) -> None:
    model = MODEL if kind == "mink" else pin.Model(ROBOT.model)
    plugin, convert, back = {"mink": (for_mink, from_mink, to_mink), "pink": (for_pink, from_pink, to_pink)}[kind]
    if kind == "mink":
        configuration: Any = mink.Configuration(MODEL, q=ROBOT.home)
        task, target = mink.FrameTask("tcp", "site", 1.0, 1.0, gain=0.05), mink.SE3.identity()
        junk: list[Any] = [mink.KineticEnergyRegularizationTask(1.0)]
        lost = mink.FrameTask("nowhere", "site", 1.0, 1.0, gain=0.05)
    else:
        configuration = pink.Configuration(model, model.createData(), ROBOT.home)
        task, target = pink.tasks.FrameTask("tcp", 1.0, 1.0, gain=0.05), pin.SE3.Identity()
        junk, lost = [], pink.tasks.FrameTask("nowhere", 1.0, 1.0, gain=0.05)
    task.set_target_from_configuration(configuration)
    lost.set_target(target)
    danger, posture = plugin.DangerMonitor(ROBOT, DT), qpsafe.PostureTask(ROBOT.home)
    danger.update(ROBOT.home, np.zeros(6), [])
    released = plugin.ReleasableTask(task, danger)
    wrong: list[tuple[Any, str]] = [
        *((lambda x=x: task_velocity(task, configuration, x), "dt") for x in BAD_TICKS),
        *((lambda x=x: convert(task, ROBOT, model, x), "dt") for x in BAD_TICKS),
        *((lambda x=x: back(posture, ROBOT, model, x), "dt") for x in BAD_TICKS),
        *((lambda x=x: task_velocity(x, configuration, DT), "task") for x in (*junk, *BAD_PARTS, released)),
        *((lambda x=x: convert(x, ROBOT, model, DT), "task") for x in (*junk, *BAD_PARTS, released)),
        *((lambda x=x: back(x, ROBOT, model, DT), "task") for x in (*junk, *BAD_PARTS, task)),
        *((lambda x=x: convert(task, x, model, DT), "robot") for x in BAD_PARTS),
        *((lambda x=x: convert(task, ROBOT, x, DT), "model") for x in BAD_PARTS),
        *((lambda x=x: back(posture, ROBOT, x, DT), "model") for x in BAD_PARTS),
        *((lambda x=x: convert(task, ROBOT, model, DT, x), "prefix") for x in (None, 5)),
        *((lambda x=x: back(posture, ROBOT, model, DT, x), "cost") for x in ("x", None, -1.0, np.nan, [1, 2], True)),
        (lambda: convert(lost, ROBOT, model, DT), "frame"),
    ]
    for call, word in wrong:
        with pytest.raises(qpsafe.ConfigurationError, match=word):
            call()


BAD_TICKS = (0, 0.0, -1.0, np.nan, np.inf, "0.004", None, 1e9, True, [0.004], 1j)
BAD_PARTS = (None, 5, "x", object(), object)
