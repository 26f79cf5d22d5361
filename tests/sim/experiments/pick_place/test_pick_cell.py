"""The third experiment's cell by itself: screws that stand, hang and lie by contact and weld alone."""

import mujoco
import numpy as np
import pytest

import qpsafe
from qpsafe.sim.experiments.pick_place.cell import PROGRAM, TABLE_TOP, Cell, Parts
from qpsafe.sim.experiments.pick_place.gripper import Gripper
from qpsafe.sim.world.known import known_obstacles
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.scene import Scene, build_scene
from qpsafe.tasks.program_file import load_program
from qpsafe.tasks.reach import joints_for

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")
CELL = Cell()
DOWN = np.diag([-1.0, 1.0, -1.0])  # tool straight down


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(ROBOT, furnish=CELL.furnish)


@pytest.fixture(scope="module")
def parts(scene: Scene) -> Parts:
    return Parts.of(scene, CELL.screws)


def plant_at(scene: Scene, position: np.ndarray) -> Plant:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = DOWN, position
    return Plant(scene, q=joints_for(ROBOT, "tcp", pose, ROBOT.home))


def test_screws_stay_in_their_holes(scene: Scene, parts: Parts) -> None:
    plant = Plant(scene)
    plant.advance(2.0)
    assert np.abs(parts.positions(plant.data) - CELL.holes).max() < 5e-4
    assert np.allclose(parts.axes(plant.data), [0.0, 0.0, 1.0], atol=0.02)
    assert (plant.data.tree_asleep[parts.trees] >= 0).all()  # and cost nothing


def test_the_program_visits_the_holes_of_the_cell() -> None:
    """File and layout are written apart: they must mean the same places."""
    program = load_program(PROGRAM, ROBOT)
    grips = [event for event in program.events if event.name == "grip"]
    tips = np.array([program.sample(event.time).pose[:3, 3] for event in grips])
    assert np.allclose(tips, CELL.holes, atol=1e-6)
    drops = [program.sample(event.time).pose[:3, 3] for event in program.events if event.name == "release"]
    assert CELL.in_box(np.array(drops) * [1, 1, 0] + [0, 0, TABLE_TOP + 0.02]).all()


@pytest.mark.parametrize(("off", "held"), [(0.0, True), (1.5e-3, True), (2.6e-3, False), (0.02, False)])
def test_a_screw_is_gripped_only_where_the_tip_touches_it(scene: Scene, parts: Parts, off: float, held: bool) -> None:
    plant = plant_at(scene, CELL.holes[5] + [off, 0.0, 0.0])
    plant.advance(0.3)
    gripper = Gripper(scene, parts)
    assert gripper.grip(plant.data) == (5 if held else None)
    assert list(plant.data.eq_active[parts.welds]) == [k == 5 and held for k in range(CELL.screws)]
    up = joints_for(ROBOT, "tcp", _pose(CELL.holes[5] + [off, 0.0, 0.1]), plant.q)
    start = plant.q
    for share in np.linspace(0.0, 1.0, 200):
        plant.apply(start + share * (up - start), (up - start) / 0.8 * (share < 1.0))
        plant.advance()
    assert (parts.positions(plant.data)[5, 2] > CELL.holes[5, 2] + 0.09) == held


def _pose(position: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = DOWN, position
    return pose


def test_an_oblique_tool_misses(scene: Scene, parts: Parts) -> None:
    pose = _pose(CELL.holes[0])
    tilt = np.deg2rad(6.0)
    pose[:3, :3] = [[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]] @ DOWN
    plant = Plant(scene, q=joints_for(ROBOT, "tcp", pose, ROBOT.home))
    plant.advance(0.1)
    assert Gripper(scene, parts).grip(plant.data) is None


def test_what_is_let_go_falls_however_long_it_hung(scene: Scene, parts: Parts) -> None:
    """A body that hangs still would be put to sleep in the air."""
    plant = plant_at(scene, CELL.holes[2])
    gripper = Gripper(scene, parts)
    assert gripper.grip(plant.data) == 2
    over = joints_for(ROBOT, "tcp", _pose(np.array([0.42, -0.36, 0.5])), ROBOT.home)
    start = plant.q
    for share in np.linspace(0.0, 1.0, 400):
        plant.apply(start + share * (over - start), (over - start) / 1.6 * (share < 1.0))
        plant.advance()
    plant.advance(3.0)
    tip = plant.data.site_xpos[scene.tcp_site]
    assert np.linalg.norm(parts.positions(plant.data)[2] - tip) < 2e-4
    assert gripper.release(plant.data) == 2
    assert gripper.release(plant.data) is None
    plant.advance(1.0)
    assert CELL.in_box(parts.positions(plant.data))[2]
    others = np.delete(parts.positions(plant.data), 2, axis=0)
    assert np.abs(others - np.delete(CELL.holes, 2, axis=0)).max() < 5e-4


def test_the_cell_is_known_but_not_its_screws(scene: Scene) -> None:
    """Screws move: what is known stands still."""
    known = {obstacle.name: obstacle for obstacle in known_obstacles(scene)}
    assert {"left table", "right table", "support", "box left", "floor", "pedestal"} <= set(known)
    assert not any(name.startswith("screw") for name in known)
    vertices = known["support"].vertices
    assert vertices[:, 2].max() == pytest.approx(TABLE_TOP + CELL.support.thickness)
    assert (vertices.min(axis=0)[:2] < CELL.holes.min(axis=0)[:2]).all()


def test_the_robot_pushes_nothing(scene: Scene) -> None:
    """Contacts are for parts and furniture: a run cannot hide a collision of the robot behind a push."""
    model = scene.model
    assert not model.geom_contype[scene.robot_geoms].any()
    assert not model.geom_conaffinity[scene.robot_geoms].any()
    assert not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT
