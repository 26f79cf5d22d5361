"""Friction of the evasion: rest where nobody comes, the paper's filter where somebody does, one form in both ways."""

from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.evasion import RESTING, STANDING, Evasion
from qpsafe.danger.thresholds import robot_thresholds
from qpsafe.errors import ConfigurationError

DT = 0.004
ROBOTS = ("irb140", "iiwa14", "irb14000")

pushes = st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3).map(np.array)
positive = st.lists(st.floats(0.5, 20.0), min_size=3, max_size=3).map(np.array)
frictions = st.lists(st.floats(0.0, 30.0), min_size=3, max_size=3).map(np.array)


@given(mass=positive, damping=positive, friction=frictions, sigma=pushes)
@settings(deadline=None, max_examples=some(20, of=200))
def test_the_steady_speed_is_what_friction_leaves(mass: Any, damping: Any, friction: Any, sigma: Any) -> None:
    """M q̈ + D q̇ + c sgn(q̇) = σ at rest or in a steady motion: |q̇| = max(|σ| - c, 0)/D; rest is exact."""
    evasion = Evasion(mass, damping, 3, 0.1, friction)
    for _ in range(round(40.0 * float((mass / damping).max()) / 0.1) + 2):
        qd0 = evasion.step(sigma, 0.0)
    wanted = np.sign(sigma) * np.maximum(np.abs(sigma) - friction, 0.0) / damping
    assert qd0 == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    assert (qd0[np.abs(sigma) < friction] == 0.0).all()


@given(mass=positive, damping=positive, friction=frictions, sigmas=st.lists(pushes, min_size=1, max_size=20))
@settings(deadline=None, max_examples=some(20, of=200))
def test_it_is_the_differential_equation(mass: Any, damping: Any, friction: Any, sigmas: list) -> None:
    """Against fine implicit steps of M q̈ + D q̇ + c sgn(q̇) = σ, which are known in closed form."""
    n, fine = 50, DT / 50
    evasion, x = Evasion(mass, damping, 3, DT, friction), np.zeros(3)
    for sigma in sigmas:
        for _ in range(n):  # (M/h + D) x⁺ + c sgn(x⁺) = σ + M x/h
            drive = sigma + mass * x / fine
            x = np.sign(drive) * np.maximum(np.abs(drive) - friction, 0.0) / (mass / fine + damping)
        got = evasion.step(sigma, 0.0)
        # a tick's friction acts at its end: by one tick of it, and of what a change of sign leaves, they may differ
        assert np.abs(got - x).max() <= 1.01 * (2.0 * friction * DT / mass).max() + 2e-2 * np.abs(x).max() + 1e-9


@given(mass=positive, damping=positive, friction=frictions, sigma=pushes, coming=st.floats(0.0, 2.0))
@settings(deadline=None, max_examples=some(20, of=200))
def test_who_comes_is_evaded_by_no_less(mass: Any, damping: Any, friction: Any, sigma: Any, coming: float) -> None:
    """Speeds lie between those with all friction and with none; from STANDING on, or unknown, they are the paper's."""
    plain = Evasion(mass, damping, 3, DT)
    some_, all_ = (Evasion(mass, damping, 3, DT, friction) for _ in range(2))
    for k in range(30):
        free, held, rubbed = plain.step(sigma), all_.step(sigma, 0.0), some_.step(sigma, coming)
        assert (np.abs(held) <= np.abs(rubbed)).all()
        assert (np.abs(rubbed) <= np.abs(free)).all()
        if coming >= STANDING:
            assert (rubbed == free).all(), k
    assert (Evasion(mass, damping, 3, DT, friction).step(sigma) == Evasion(mass, damping, 3, DT).step(sigma)).all()


@pytest.mark.parametrize(
    "friction", [-1.0, np.nan, np.inf, "much", [1.0, 2.0], np.ones((3, 3)), True, None, [1, 1, -1]]
)
def test_what_is_no_friction_is_named(friction: Any) -> None:
    with pytest.raises(ConfigurationError, match="friction"):
        Evasion(1.0, 1.0, 3, DT, friction)


@pytest.mark.parametrize("coming", [-0.1, np.nan, "fast", None, True])
def test_what_is_no_speed_is_named_and_forgotten(coming: Any) -> None:
    evasion = Evasion(1.0, 1.0, 3, DT, 1.0)
    with pytest.raises(ConfigurationError, match="coming"):
        evasion.step(np.ones(3), coming)
    assert (evasion.velocity == 0.0).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_half_the_danger_at_rest_turns_nothing(name: str) -> None:
    """The rule: one point of danger RESTING Δ(1-ε), on any link, from any side; more of it turns some joint."""
    from qpsafe.danger.evasion import virtual_torque

    robot = qpsafe.load_robot(name)
    high, links, rng = robot_thresholds(robot)[0].start, len(robot.wire_frames), np.random.default_rng(3)
    moved = False
    for q in (
        robot.home,
        *rng.uniform(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi), (10, robot.nq)),
    ):
        for link in range(links):
            force = rng.normal(size=3)
            forces = np.zeros((links, 3))
            forces[link] = RESTING * high * force / np.linalg.norm(force)
            torque = virtual_torque(robot.at(q), forces)
            evasion = Evasion.for_robot(robot, DT)
            assert (
                np.abs(torque) <= 1.1 * evasion.friction + 1e-9
            ).all()  # levers are looked for in some configurations
            moved |= bool(evasion.step(4.0 * torque, 0.0).any())
    assert moved


class Asked(Evasion):
    """Evaded by being asked, stage by stage."""


@pytest.mark.parametrize("velocities", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_both_ways_rub_alike(seed: int, velocities: bool) -> None:
    """The compiled tick and the one that asks an evasion of another class, in random readings and points."""
    robot, rng = qpsafe.load_robot("irb140"), np.random.default_rng(seed)
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    own = Evasion.for_robot(robot, DT)
    friction = own.friction * (1.0, 5.0, 0.2)[seed]
    tasks = [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
    sensing = qpsafe.SensingRules(velocities=velocities)
    evasions = [kind(own.mass, own.damping, robot.nq, DT, friction) for kind in (Evasion, Asked)]
    made = [qpsafe.SafetyController(robot, tasks, evasion=evasion, sensing=sensing) for evasion in evasions]
    q, qd = robot.home, np.zeros(robot.nq)
    distances, rested, points = np.full(20, np.inf), 0, None
    for k in range(480):
        if k % 80 == 0:  # what is new counts as coming for 25 ticks
            distances = np.where(rng.uniform(size=20) < 0.2, rng.uniform(0.2, 0.7, 20), np.inf)
            points = rng.uniform(-0.6, 0.6, (2, 3)) if k % 240 == 160 else None
        distances = distances - (k // 160 % 2) * 0.5 * DT  # stands, comes, stands
        told = {"distances": np.maximum(distances, 0.1)} if points is None else {"points": points}
        ticks = [controller.step(q, qd, **told) for controller in made]
        a, b = (tick.qd0 for tick in ticks)
        assert a == pytest.approx(b, rel=1e-9, abs=1e-12)
        rested += not a.any() and ticks[0].cdf_n > 0.0
        q, qd = ticks[0].reference.q, ticks[0].reference.qd
    assert not velocities or seed == 2 or rested > 0
