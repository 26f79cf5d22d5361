"""Robots of a batch do not know of each other, nor of threads; and no data make a batch raise."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import qpsafe
from qpsafe.errors import ConfigurationError

N = 24


@pytest.fixture(scope="module")
def controller() -> Any:
    robot = qpsafe.load_robot("irb140")
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    return qpsafe.SafetyController(robot, [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)])


def run(batch: Any, ticks: int, seed: int = 0, spoil: dict[int, Any] | None = None) -> list[np.ndarray]:
    """q, q̇, danger of all robots, tick by tick; some robots' joints are spoilt."""
    rng, n = np.random.default_rng(seed), batch.n
    q, qd, found = np.tile(batch.robot.home, (n, 1)), np.zeros((n, batch.robot.nq)), []
    for k in range(ticks):
        distances = 0.5 + 0.3 * np.cos(0.05 * k + np.arange(n))[:, None] + rng.normal(0.0, 1e-3, (n, 20))
        measured = q.copy()
        for r, value in (spoil or {}).items():
            measured[r], distances[r] = value, value
        tick = batch.step(measured, qd, distances)
        q, qd = tick.q, tick.qd
        found.append(np.c_[q, qd, tick.qd0, tick.cdf_n, tick.errors, tick.status, tick.phase])
    return found


def test_threads_change_nothing(controller: Any) -> None:
    one, two, five = (run(qpsafe.BatchController(controller, N, threads=k), 60) for k in (1, 2, 5))
    assert all(a.tobytes() == b.tobytes() == c.tobytes() for a, b, c in zip(one, two, five, strict=True))


def test_a_robot_with_bad_data_leaves_the_others_alone(controller: Any) -> None:
    spoil = {3: np.nan, 7: np.inf, 11: 1e30, 20: -np.inf}
    good = [r for r in range(N) if r not in spoil]
    clean, spoilt = (run(qpsafe.BatchController(controller, N), 60, spoil=bad) for bad in ({}, spoil))
    for a, b in zip(clean, spoilt, strict=True):
        assert a[good].tobytes() == b[good].tobytes()
        assert np.isfinite(b[:, :12]).all()
        assert (b[list(spoil), -2] == 2).all()


def test_a_robot_does_not_know_its_place(controller: Any) -> None:
    """The same told to other robots, the same comes of it."""
    batch, order = qpsafe.BatchController(controller, N), np.random.default_rng(1).permutation(N)
    q, qd = np.tile(batch.robot.home, (N, 1)), np.zeros((N, 6))
    tip = batch.robot.pose("tcp", batch.robot.home)[:3, 3]
    points = tip + np.random.default_rng(2).uniform(-0.4, 0.4, (N, 3, 3))
    first = batch.step(q, qd, points=points)
    batch.reset()
    again = batch.step(q, qd, points=points[order])
    assert first.q[order].tobytes() == again.q.tobytes()
    assert first.cdf_n[order].tobytes() == again.cdf_n.tobytes()


def test_points_as_lists_and_with_rows_of_nan_are_the_same(controller: Any) -> None:
    rng = np.random.default_rng(3)
    padded = rng.uniform(-1.0, 1.0, (N, 4, 3))
    padded[rng.random((N, 4)) < 0.7] = np.nan
    lists = [row[~np.isnan(row).all(axis=1)] for row in padded]
    assert min(map(len, lists)) == 0
    q, qd = np.tile(controller.robot.home, (N, 1)), np.zeros((N, 6))
    ticks = [qpsafe.BatchController(controller, N).step(q, qd, points=points) for points in (padded, lists)]
    assert ticks[0].q.tobytes() == ticks[1].q.tobytes()
    assert ticks[0].cdf_n.tobytes() == ticks[1].cdf_n.tobytes()
    assert (ticks[0].cdf_n > 0.0).sum() == sum(len(row) > 0 for row in lists)


numbers = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-3.0, 3.0)


@settings(max_examples=some(8, of=40), deadline=None)
@given(arrays.arrays(float, (4, 6), elements=numbers), arrays.arrays(float, (4, 20), elements=numbers), st.booleans())
def test_no_data_raise_or_lead_beyond_the_limits(controller: Any, q: np.ndarray, seen: np.ndarray, aged: bool) -> None:
    batch, robot = qpsafe.BatchController(controller, 4), controller.robot
    last = np.zeros((4, 6))
    home = np.tile(robot.home, (4, 1))
    for measured in (home, q, home, q):
        tick = batch.step(measured, last, seen, ages=seen if aged else None)
        assert np.isfinite(tick.q).all()
        assert (np.abs(tick.qd - last) <= robot.max_acceleration * 0.004 + 1e-9).all()
        assert (np.abs(tick.qd) <= robot.max_velocity + 1e-9).all()
        last = tick.qd
        assert all(bool(tick.words(r)) == bool(tick.status[r]) for r in range(4))


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"distances": np.zeros((4, 19))},
        {"distances": "far"},
        {"distances": np.full((4, 20), np.inf), "points": [[]] * 4},
        {"distances": np.full((4, 20), np.inf), "ages": np.zeros(7)},
        {"points": [[]] * 3},
        {"points": np.zeros((4, 2, 2))},
        {"points": [[]] * 4, "ages": 0.0},
    ],
    ids=str,
)
def test_shapes_that_do_not_fit_make_all_robots_brake_and_say_why(controller: Any, told: dict[str, Any]) -> None:
    batch = qpsafe.BatchController(controller, 4)
    tick = batch.step(np.tile(batch.robot.home, (4, 1)), np.zeros((4, 6)), **told)
    assert (tick.status == 2).all()
    assert tick.active.all()  # joints were measured
    assert all(len(tick.words(r)) == 1 for r in range(4))
    assert (tick.q == batch.robot.home).all()
    wrong = batch.step(np.zeros((4, 5)), np.zeros((4, 6)), points=[[]] * 4)
    assert (wrong.status == 2).all()


def test_bad_points_of_one_robot_are_its_own(controller: Any) -> None:
    batch = qpsafe.BatchController(controller, 3)
    home, rest = np.tile(batch.robot.home, (3, 1)), np.zeros((3, 6))
    tick = batch.step(home, rest, points=[[[1.0, 2.0]], [], [[np.inf, 0.0, 0.0]]])
    assert tick.status.tolist() == [2, 0, 2]


class MyLaw(qpsafe.HierarchicalLaw):
    """Of another making."""


@pytest.mark.parametrize(
    "options",
    [
        {"law": MyLaw()},
        {"law": qpsafe.WeightedLaw(solver="daqp")},
        {"barrier": qpsafe.DangerBarrier(30.0)},
        {"limits": "off"},
    ],
    ids=lambda options: "-".join(options),
)
def test_other_parts_work_the_general_way_and_say_so(controller: Any, options: dict[str, Any]) -> None:
    other = qpsafe.SafetyController(controller.robot, controller.tasks, **options)
    batch, alone = qpsafe.BatchController(other, 3), copy.copy(other)
    assert not batch.compiled
    assert batch.why
    home, rest = np.tile(batch.robot.home, (3, 1)), np.zeros((3, 6))
    tip = batch.robot.pose("tcp", batch.robot.home)[:3, 3]
    near = (tip + np.array([0.3, 0.0, 0.0]))[None]
    tick, one = batch.step(home, rest, points=[near] * 3), alone.step(home[0], rest[0], points=near)
    for r in range(3):
        assert tick.q[r].tobytes() == one.reference.q.tobytes()
        assert tick.cdf_n[r] == one.cdf_n
    for act in (batch.pause, batch.resume, batch.reseed, batch.acknowledge, batch.reset):
        act([0, 2])


def test_a_posture_is_said_to_be_why_ticks_are_not_compiled(controller: Any) -> None:
    tasks = [*controller.tasks, qpsafe.PostureTask(controller.robot.home)]
    thresholds = (qpsafe.Threshold(11.5, 0.15), qpsafe.Threshold(7.5, 0.25), qpsafe.Threshold(7.5, 0.25))
    other = qpsafe.SafetyController(controller.robot, tasks, activation=qpsafe.Activation(thresholds))
    assert "posture" in qpsafe.BatchController(other, 2).why


def test_a_copy_and_one_from_a_pickle_go_on_as_the_batch_does(controller: Any) -> None:
    batch = qpsafe.BatchController(controller, N)
    run(batch, 20)
    others = copy.deepcopy(batch), pickle.loads(pickle.dumps(batch))
    runs = [run(one, 20, seed=1) for one in (batch, *others)]
    for a, b, c in zip(*runs, strict=True):
        assert a.tobytes() == b.tobytes() == c.tobytes()


@pytest.mark.parametrize(
    ("key", "value"),
    [("n", 0), ("n", 2.5), ("threads", 0), ("horizon", 0.0), ("horizon", np.nan), ("controller", "irb140")],
)
def test_mistakes_are_named(controller: Any, key: str, value: Any) -> None:
    arguments = {"controller": controller, "n": 2, key: value}
    with pytest.raises(ConfigurationError) as error:
        qpsafe.BatchController(**arguments)
    assert error.value.key == key


@pytest.mark.parametrize("mask", [[0.5], [7], [-1], [True], "all"])
def test_masks_that_are_none_are_named(controller: Any, mask: Any) -> None:
    with pytest.raises(ConfigurationError, match="mask"):
        qpsafe.BatchController(controller, 2).reset(mask)


def test_a_controller_that_sees_by_images_is_refused(controller: Any) -> None:
    """A batch takes none: its robots went on, and saw nothing."""
    sensors = qpsafe.load_range_sensors(controller.robot)
    with pytest.raises(ConfigurationError, match="range_sensors"):
        qpsafe.BatchController(qpsafe.SafetyController(controller.robot, controller.tasks, range_sensors=sensors), 2)
