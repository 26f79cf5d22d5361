"""Nearest points body by body: those of single shapes, and speeds of approach that are rates of the distance."""

from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.geometry.layout import BODY
from qpsafe.sim.engine.bodies import Bodies
from qpsafe.sim.engine.distances import Distances
from qpsafe.sim.engine.world import World
from qpsafe.sim.world.scene import build_scene

FAR = 3.0


@pytest.fixture(scope="module", params=["irb140", "irb14000"])
def made(request: pytest.FixtureRequest) -> Any:
    robot = qpsafe.load_robot(request.param)
    world = World.of(build_scene(robot, people=()))
    return robot, world, Bodies(world, robot)


def random_state(robot: Any, rng: np.random.Generator) -> tuple[Any, np.ndarray]:
    q = robot.home + rng.uniform(-0.4, 0.4, robot.nq)
    return robot.at(q), q


def test_the_nearest_body_is_as_near_as_the_robot(made: Any) -> None:
    robot, world, bodies = made
    rng, measure = np.random.default_rng(0), Distances(world, robot)
    for _ in range(15):
        state, _ = random_state(robot, rng)
        point = rng.uniform([-0.9, -0.9, -0.2], [0.9, 0.9, 1.2])
        near = bodies.to_points(state, point[None], FAR)
        ball = np.append(point, 0.0)[None]
        people = (np.tile(point, (1, 2, 1)), np.zeros(1), ball, np.empty((0, 4, 4)), np.empty((0, 3)))
        whole = measure.people(state.body_poses(), people)
        if world.index[whole.shape, BODY] > 0:  # the base, which does not move, is no body here
            assert near.distance.min() == whole.distance
            assert near.body[near.distance.argmin()] == world.index[whole.shape, BODY]
        assert (near.distance >= whole.distance - 1e-12).all()


def test_many_points_are_what_each_alone_is(made: Any) -> None:
    robot, _, bodies = made
    rng = np.random.default_rng(1)
    state, _ = random_state(robot, rng)
    points = rng.uniform(-0.9, 0.9, (5, 3))
    together = bodies.to_points(state, points, FAR)
    alone = [bodies.to_points(state, point[None], FAR) for point in points]
    for key in together._fields:
        assert np.array_equal(getattr(together, key), np.concatenate([getattr(one, key) for one in alone]))
    assert len(bodies.to_points(state, np.empty((0, 3)), FAR).distance) == 0


def test_the_speed_of_approach_is_the_rate_of_the_distance(made: Any) -> None:
    """Of a point that stands still: d' = -nᵀ J q̇, whatever pair of points is the nearest one next."""
    robot, _, bodies = made
    rng, h = np.random.default_rng(2), 1e-6
    for _ in range(10):
        _, q = random_state(robot, rng)
        qd, points = rng.normal(size=robot.nq), rng.uniform([-0.9, -0.9, -0.2], [0.9, 0.9, 1.2], (3, 3))
        here = bodies.to_points(robot.at(q), points, FAR)
        before, after = (bodies.to_points(robot.at(q + s * h * qd), points, FAR) for s in (-1.0, 1.0))
        outside = here.distance > 0.01
        rate = (after.distance - before.distance) / (2.0 * h)
        smooth = np.abs(after.distance + before.distance - 2.0 * here.distance) < 1e-10  # no corner in between
        assert smooth.mean() > 0.5
        assert rate[smooth & outside] == pytest.approx(-(here.rows @ qd)[smooth & outside], abs=1e-3)
