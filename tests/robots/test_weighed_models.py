"""Masses of robots whose files state some, all or none: the mass matrix is that of the simulation, never singular."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.robot.models.mujoco_spec import mujoco_model, weighed_model
from qpsafe.robot.robot import Robot

RODS = (
    '<collision><origin xyz="0 0 {half}"/><geometry><cylinder radius="0.05" length="{length}"/></geometry></collision>'
)
MASS = (
    '<inertial><origin xyz="0.01 0.02 0.1" rpy="0.3 0 0"/><mass value="{mass}"/>'
    '<inertia ixx="0.03" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>'
)


def arm(folder: Path, masses: list[float], shapes: list[bool]) -> Robot:
    """A chain of joints of three axes in turn; a mass of 0 is not stated."""
    links, joints = '<link name="base"/>', ""
    for i, (mass, shaped) in enumerate(zip(masses, shapes, strict=True), 1):
        rod = RODS.format(half=0.1, length=0.2) if shaped else ""
        links += f'<link name="l{i}">{MASS.format(mass=mass) if mass else ""}{rod}</link>'
        axis, parent = ("0 0 1", "0 1 0", "1 0 0")[i % 3], "base" if i == 1 else f"l{i - 1}"
        joints += (
            f'<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
            f'<origin xyz="0 0 0.25" rpy="{0.2 * i} 0 {-0.1 * i}"/><axis xyz="{axis}"/>'
            '<limit lower="-2" upper="2" velocity="2" effort="0"/></joint>'
        )
    file = folder / "arm.urdf"
    file.write_text(f'<robot name="arm">{links}{joints}</robot>', encoding="utf-8")
    with pytest.warns(qpsafe.RobotWarning):
        return qpsafe.load_robot(file)


def mass_matrices(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By pinocchio, of the weighed model, and by MuJoCo, of what is simulated."""
    weighed, model = weighed_model(robot), mujoco_model(robot)
    upper, data = np.triu(pin.crba(weighed, pin.Data(weighed), q)), mujoco.MjData(model)
    theirs = np.zeros((model.nv, model.nv))
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, theirs)
    return upper + np.triu(upper, 1).T, theirs


@settings(max_examples=some(10, of=25), deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from([0.0, 0.3, 5.0]), st.booleans()), min_size=1, max_size=7), st.integers(0, 2**31)
)
def test_every_mass_matrix_is_that_of_the_simulation_and_regular(
    tmp_path_factory: pytest.TempPathFactory, parts: list[tuple[float, bool]], seed: int
) -> None:
    robot = arm(tmp_path_factory.mktemp("arm"), [mass for mass, _ in parts], [shaped for _, shaped in parts])
    q = np.random.default_rng(seed).uniform(robot.lower, robot.upper)
    mine, theirs = mass_matrices(robot, q)
    np.testing.assert_allclose(mine, theirs, rtol=1e-6, atol=1e-6 * np.abs(theirs).max())
    assert np.linalg.eigvalsh(mine)[0] > 0.0
    if all(mass for mass, _ in parts):
        assert weighed_model(robot) is robot.model


@pytest.mark.parametrize("name", ["irb140", "iiwa14", "irb14000"])
def test_a_robot_whose_file_states_all_keeps_its_own_model(name: str) -> None:
    robot = qpsafe.load_robot(name)
    assert weighed_model(robot) is robot.model


def test_a_blow_of_an_arm_without_masses_has_a_finite_energy(tmp_path: Path) -> None:
    from qpsafe.sim.campaign.trials.harm import effective_mass

    robot = arm(tmp_path, [0.0] * 6, [True] * 6)
    q = 0.3 * np.ones(6)
    found = [effective_mass(robot, q, robot.jacobian("l6", q)[:3], axis) for axis in np.eye(3)]
    assert all(0.0 < mass < 1e3 for mass in found)
    assert not re.search("nan|inf", str(found))
