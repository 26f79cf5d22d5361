"""Ways round furniture: never through it, never longer than needed, and read from the scene."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.sim.campaign.people.floor_plan import BODY, PEDESTAL, ROUND, FloorPlan, Rectangle
from qpsafe.sim.experiments.pick_place.cell import Cell
from qpsafe.sim.world.scene import build_scene

TABLES = (Rectangle(0.3, 0.68, 0.27, 0.59), Rectangle(0.3, 0.68, -0.59, -0.27))
PLAN = FloorPlan(-0.55, (0.49, 0.0, 0.4), 0.81, obstacles=(PEDESTAL, *TABLES))
place = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
angle = st.floats(-math.pi, math.pi)


def free(x: float, y: float, body: float = BODY) -> bool:
    return not any(r.grown(body - 1e-3).contains(x, y) for r in PLAN.obstacles)


@given(place, place)
def test_a_way_leads_round_everything_and_is_hardly_longer_than_straight_ones_by_turns(start, goal) -> None:
    if not (free(*start) and free(*goal)):
        return
    way = [start, *PLAN.way(start, goal)]
    assert way[-1] == goal
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(way))
    assert length <= math.dist(start, goal) + 4.0 * (0.66 + 1.18 + 2.0 * (BODY + ROUND))  # once round all of it
    if all(free(*(np.array(start) + s * (np.array(goal) - start))) for s in np.linspace(0.0, 1.0, 400)):
        assert length == pytest.approx(math.dist(start, goal), abs=0.02)
    for a, b in itertools.pairwise(way):
        for s in np.linspace(0.0, 1.0, 100):
            x, y = (1.0 - s) * np.array(a) + s * np.array(b)
            assert not any(r.contains(x, y) for r in PLAN.obstacles)


@given(place, place)
def test_the_way_back_is_as_long(start, goal) -> None:
    there, back = ([a, *PLAN.way(a, b)] for a, b in ((start, goal), (goal, start)))
    lengths = [sum(math.dist(a, b) for a, b in itertools.pairwise(way)) for way in (there, back)]
    assert lengths[0] == pytest.approx(lengths[1], abs=1e-9)


@given(place, angle)
def test_out_is_the_first_free_place_in_that_direction(start, direction) -> None:
    x, y = PLAN.out(start, direction)
    assert free(x, y)
    away = math.dist(start, (x, y))
    assert (x, y) == pytest.approx((start[0] + away * math.cos(direction), start[1] + away * math.sin(direction)))
    if free(*start, body=BODY + 2e-3):
        assert away == 0.0
    for s in np.linspace(0.0, 0.999, 20) * away:  # all before it is taken
        assert away < 1e-3 or not free(
            start[0] + s * math.cos(direction), start[1] + s * math.sin(direction), BODY + 2e-3
        )


def test_between_two_tables_people_squeeze_through() -> None:
    for y in (1.5, -1.5):
        way = PLAN.way((0.515, 0.03), (0.5, y))
        assert len(way) > 1


def test_nothing_in_the_way_is_a_straight_way() -> None:
    plan = FloorPlan(-0.5, (0.4, 0.0, 0.4), 0.8, obstacles=())
    assert plan.way((-1.0, 0.0), (1.0, 0.0)) == [(1.0, 0.0)]
    assert plan.out((0.0, 0.0), 1.0) == (0.0, 0.0)


def test_a_plan_is_read_from_the_scene() -> None:
    robot = qpsafe.load_robot("irb140")
    plan = FloorPlan.of(build_scene(robot, furnish=Cell().furnish), (0.49, 0.0, 0.4), 0.81)
    assert plan.floor == -0.55
    for found, wanted in zip(sorted(plan.obstacles), sorted((PEDESTAL, *TABLES)), strict=True):
        assert found == pytest.approx(wanted, abs=1e-9)
