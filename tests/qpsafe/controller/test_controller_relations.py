"""What must not change the answer, and what must change it in a known way."""

from typing import Any

import numpy as np
import pytest
from amounts import first, some

import qpsafe
from qpsafe.sensing.detection import nearest_link

PLAIN = qpsafe.SensingRules(hold_time=0.0, self_detection=False, velocities=False)  # points tell none
LAWS = {
    "strict": qpsafe.HierarchicalLaw,
    "paper": lambda: qpsafe.HierarchicalLaw("paper"),
    "weighted": qpsafe.WeightedLaw,
    "nullspace": qpsafe.NullspaceLaw,
}


def wandering(robot: Any, ticks: int, count: int = 1, seed: int = 0) -> np.ndarray:
    """Points (ticks, count, 3) that come near the tool and go again, smoothly."""
    rng = np.random.default_rng(seed)
    tip = robot.pose("tcp", robot.home)[:3, 3]
    t = np.linspace(0.0, 2.0 * np.pi, ticks)[:, None, None]
    phase, pace = rng.uniform(0.0, 6.0, (count, 3)), rng.integers(1, 3, (count, 3))
    swing = rng.uniform(0.05, 0.2, (count, 3)) * np.sin(pace * t + phase)
    return tip + [0.9, 0.0, 0.1] + [-0.65, 0.0, 0.0] * np.sin(t) ** 2 + swing


def trajectory(loop: Any, steps: Any) -> list[bytes]:
    """Everything a tick computed, to the bit."""
    found = []
    for points in steps:
        tick = loop.step(points)
        numbers = [tick.reference.q, tick.reference.qd, tick.qd0, tick.vectors, *tick.errors]
        numbers += [np.array([tick.cdf_n, *tick.activations, tick.path_time, tick.reference.seq])]
        found.append(b"".join(np.ascontiguousarray(n).tobytes() for n in numbers) + repr(tick.messages).encode())
    return found


@pytest.mark.parametrize("key", first(2, LAWS))
def test_equal_input_gives_equal_bits_also_after_a_reset(run: Any, irb140: Any, key: str) -> None:
    steps = wandering(irb140, 200, 3)
    one, other = run(LAWS[key]()), run(LAWS[key]())
    first = trajectory(one, steps)
    assert trajectory(other, steps) == first
    assert len(set(first)) == len(first)  # something went on all the time

    one.controller.reset()
    one.q, one.qd, one.count = np.array(irb140.home), np.zeros(irb140.nq), 0
    assert trajectory(one, steps) == first


def test_reset_forgets_held_points(run: Any) -> None:
    loop = run(qpsafe.NullspaceLaw())
    near = np.full(len(loop.controller.spots), np.inf)
    near[-1] = 0.2
    assert loop.step(distances=near).cdf_n > 0.0
    assert loop.step(distances=np.full_like(near, np.inf)).cdf_n > 0.0  # held
    loop.controller.reset()
    loop.count = 0
    assert loop.step(distances=np.full_like(near, np.inf)).cdf_n == 0.0


@pytest.mark.parametrize("key", first(2, LAWS))
def test_the_order_of_points_does_not_matter(run: Any, irb140: Any, key: str) -> None:
    rng = np.random.default_rng(5)
    for points in wandering(irb140, some(10, of=60), 8, seed=2):
        q = irb140.home + rng.uniform(-0.3, 0.3, irb140.nq)
        qd = rng.uniform(-0.3, 0.3, irb140.nq)
        here = run(LAWS[key](), q=q).feed(q, qd, points=points)
        there = run(LAWS[key](), q=q).feed(q, qd, points=points[rng.permutation(8)])
        assert here.cdf_n == there.cdf_n
        assert np.abs(here.qd0 - there.qd0).max() < 1e-12
        assert np.abs(here.reference.qd - there.reference.qd).max() < 1e-12


@pytest.mark.parametrize("key", first(2, LAWS))
def test_the_order_of_points_does_not_matter_over_a_run(run: Any, irb140: Any, key: str) -> None:
    rng = np.random.default_rng(6)
    one, other = run(LAWS[key]()), run(LAWS[key]())
    for points in wandering(irb140, 150, 8, seed=2):
        one.step(points)
        other.step(points[rng.permutation(8)])
    assert one.q == pytest.approx(other.q, abs=1e-9)
    assert np.abs(one.q - irb140.home).max() > 0.03


@pytest.mark.parametrize("copies", [2, 5])
def test_twice_the_same_point_is_twice_the_force_and_the_same_danger(run: Any, irb140: Any, copies: int) -> None:
    point = irb140.pose("tcp", irb140.home)[:3, 3] + [0.4, 0.1, 0.0]
    one, many = run().step([point]), run().step([point] * copies)
    assert many.cdf_n == one.cdf_n
    assert many.qd0 == pytest.approx(copies * one.qd0, rel=1e-13)


def test_distances_and_the_points_they_mean_give_the_same_command(run: Any, irb140: Any) -> None:
    """Only spots whose point is nearest to their own link, since a bare point counts for the link nearest to it."""
    rng = np.random.default_rng(3)
    compared = 0
    for _ in range(40):
        q = irb140.home + rng.uniform(-0.5, 0.5, irb140.nq)
        qd = rng.uniform(-0.3, 0.3, irb140.nq)
        spots = qpsafe.load_spots(irb140)
        distances = rng.uniform(0.2, 0.8, len(spots))
        points = spots.points(irb140.at(q), distances)
        own = nearest_link(points, irb140.wire(q, qd)) == spots.links
        distances[~own] = np.inf
        compared += int(own.sum())
        for law in (qpsafe.HierarchicalLaw(), qpsafe.NullspaceLaw()):
            by_distance = run(law, q=q, sensing=PLAIN).feed(q, qd, distances)
            by_point = run(law, q=q, sensing=PLAIN).feed(q, qd, points=points[own])
            assert np.array_equal(by_distance.points, by_point.points)
            assert np.array_equal(by_distance.links, by_point.links)
            assert np.array_equal(by_distance.reference.qd, by_point.reference.qd)
            assert by_distance.cdf_n == by_point.cdf_n
    assert compared > 200


def test_without_limits_the_paper_law_is_the_law_of_the_source(run: Any, irb140: Any) -> None:
    """Eqs. (18), (22) by pseudoinverses against QPs, over whole closed loops through all regimes."""
    regimes = set()
    for seed in range(3):
        qp = run(qpsafe.HierarchicalLaw("paper"), limits="off")
        source = run(qpsafe.NullspaceLaw(), limits="off")
        for points in wandering(irb140, 300, 2, seed):
            tick = qp.step(points)
            regimes.add((tick.regime, tick.phase, tick.m in (0.0, 1.0), tick.f in (0.0, 1.0)))
            source.step(points)
            assert np.abs(qp.q - source.q).max() < 1e-6
        assert np.abs(qp.q - irb140.home).max() < 3.0
    assert {regime for regime, *_ in regimes} == {"low", "medium", "high"}
    assert ("high", "suspended", False, True) in regimes  # transitions too
    assert ("medium", "following", True, False) in regimes


def test_limits_out_of_reach_change_nothing(run: Any, irb140: Any) -> None:
    wide = qpsafe.JointLimits(irb140.lower - 9.0, irb140.upper + 9.0, np.full(6, 1e3), np.full(6, 1e6))
    bounded, free = run(qpsafe.HierarchicalLaw("paper"), limits=wide), run(qpsafe.NullspaceLaw(), limits="off")
    for points in wandering(irb140, 200, 2, 1):
        tick = bounded.controller.step(bounded.q, bounded.qd, points=points)
        bounded.q, bounded.qd = tick.reference.q, tick.reference.qd
        free.step(points)
        assert np.abs(bounded.q - free.q).max() < 1e-6
        assert tick.binding == ()


def rotated(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("key", first(2, LAWS))
def test_turning_the_world_about_the_first_axis_turns_the_motion(run: Any, irb140: Any, key: str) -> None:
    """Joint 1 is vertical: home, goal and obstacle turned by an angle give the same joint velocities."""
    angle = 0.7
    turn = np.eye(4)
    turn[:3, :3] = rotated(angle)
    goal = qpsafe.FixedPose(turn @ irb140.pose("tcp", irb140.home))
    tasks = [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
    start = irb140.home + angle * np.eye(6)[0]
    straight, turned = run(LAWS[key]()), run(LAWS[key](), q=start, tasks=tasks)
    fastest = 0.0
    for points in wandering(irb140, 120, 2, 4):
        here, there = straight.step(points), turned.step(points @ turn[:3, :3].T)
        assert abs(there.cdf_n - here.cdf_n) < 1e-9 * here.cdf_n
        assert np.abs(there.reference.qd - here.reference.qd).max() < 1e-7
        fastest = max(fastest, np.abs(straight.qd).max())
    assert fastest > 0.1


@pytest.mark.parametrize("key", first(2, LAWS))
def test_a_mirrored_world_gives_mirrored_motion(run: Any, irb140: Any, key: str) -> None:
    """The IRB 140's wire and limits are their own mirror image in the plane y = 0: joints 1, 4 and 6 change sign."""
    mirror = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
    assert np.array_equal(mirror * irb140.home, irb140.home)
    right, left = run(LAWS[key]()), run(LAWS[key]())
    fastest = 0.0
    for points in wandering(irb140, 120, 2, 6):
        here, there = right.step(points), left.step(points * [1.0, -1.0, 1.0])
        assert abs(there.cdf_n - here.cdf_n) < 1e-9 * here.cdf_n
        assert np.abs(there.reference.qd - mirror * here.reference.qd).max() < 1e-7
        fastest = max(fastest, np.abs(right.qd[0]))
    assert fastest > 0.01
