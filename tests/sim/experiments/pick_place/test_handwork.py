"""What people's hands do with screws, without a robot."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.sim.experiments.pick_place.cell import TABLE_TOP, Cell, Parts
from qpsafe.sim.experiments.pick_place.handwork import Deed, Handwork
from qpsafe.sim.world.plant import Plant
from qpsafe.sim.world.scene import Scene, build_scene

CELL = Cell(carried=2)
FAR = np.array([3.0, 3.0, 0.3])
DT = 0.004


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(qpsafe.load_robot("irb140"), people=(), furnish=CELL.furnish)


class World:
    """A scene with one person, of whom there are only hands."""

    def __init__(self, scene: Scene) -> None:
        self.plant, self.parts = Plant(scene), Parts.of(scene, CELL.screws)
        self.handwork = Handwork(CELL, self.parts, [CELL.carried], DT)
        self.hands = np.array([FAR, FAR + np.array([0.4, 0.0, 0.0])])

    def tick(self, taken: tuple[int, ...] = ()) -> list[Deed]:
        poses: Any = [SimpleNamespace(hands=self.hands.copy())]
        deeds = self.handwork.update(self.plant.data, poses, taken)
        self.plant.advance()
        return deeds

    def go(self, goal: np.ndarray, hand: int = 1, taken: tuple[int, ...] = ()) -> list[Deed]:
        """Move a hand to a goal within a second, and rest there."""
        deeds, start = [], self.hands[hand].copy()
        for share in [*np.linspace(0.0, 1.0, 250), *np.ones(5)]:
            self.hands[hand] = start + share * (goal - start)
            deeds += self.tick(taken)
        return deeds

    def put_in_box(self, screw: int) -> None:
        self.parts.put(self.plant.data, screw, np.array([*CELL.box.centre, TABLE_TOP + 0.06]))
        self.plant.advance(1.0)
        assert CELL.in_box(self.parts.positions(self.plant.data))[screw]


@pytest.fixture
def world(scene: Scene) -> World:
    return World(scene)


IN_BOX = np.array([*CELL.box.centre, TABLE_TOP + 0.07])


def test_a_hand_takes_a_screw_out_of_the_box_and_keeps_it(world: World) -> None:
    world.put_in_box(4)
    assert world.go(IN_BOX) == [Deed("take", 0, 4)]
    assert world.go(FAR) == []
    places = world.parts.positions(world.plant.data)
    assert np.linalg.norm(places[4] - FAR) < 0.1
    others = np.delete(np.arange(CELL.full), 4)
    assert np.abs(places[others] - CELL.holes[others]).max() < 1e-3
    assert world.handwork.held == [[10, 11, 4]]


def test_a_hand_that_stays_takes_one_screw_only(world: World) -> None:
    for screw in (3, 4):
        world.put_in_box(screw)
    assert len(world.go(IN_BOX)) == 1
    assert [deed for _ in range(50) for deed in world.tick()] == []


def test_an_empty_box_has_nothing_to_take(world: World) -> None:
    assert world.go(IN_BOX) == [Deed("nothing", 0, -1)]
    assert world.handwork.held == [[10, 11]]


def test_what_the_gripper_holds_is_not_taken(world: World) -> None:
    world.put_in_box(4)
    assert world.go(IN_BOX, taken=(4,)) == [Deed("nothing", 0, -1)]


def test_a_screw_is_placed_into_the_nearest_empty_hole_and_stands_there(world: World) -> None:
    world.put_in_box(0)
    world.put_in_box(6)
    assert world.go(CELL.holes[0] + [0.01, 0.0, 0.03]) == [Deed("place", 0, 11)]
    assert world.go(CELL.holes[6] + [0.0, 0.0, 0.25]) == []  # too high over it
    assert world.go(CELL.holes[6] + [0.01, 0.01, 0.03]) == [Deed("place", 0, 10)]
    world.go(FAR)
    world.plant.advance(0.5)
    places = world.parts.positions(world.plant.data)
    assert np.abs(places[[11, 10]] - CELL.holes[[0, 6]]).max() < 1e-3
    assert world.handwork.held == [[]]


def test_a_full_support_has_no_place(world: World) -> None:
    assert world.go(CELL.holes[2] + [0.0, 0.0, 0.03]) == [Deed("nothing", 0, -1)]
    assert world.handwork.held == [[10, 11]]


def test_a_hand_that_passes_by_does_nothing(world: World) -> None:
    world.put_in_box(4)
    world.hands[1] = IN_BOX + np.array([0.0, -0.5, 0.2])
    world.tick()
    deeds = []
    for share in np.linspace(0.0, 1.0, 250):  # right through the box, at 1 m/s
        world.hands[1] = IN_BOX + np.array([0.0, share - 0.5, 0.0])
        deeds += world.tick()
    assert deeds == []
