"""Table I of the paper in closed loop: what is kept and what gives way in low, medium and high danger."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from amounts import first, some, thinned

import qpsafe

FRONT, SIDE, ABOVE, BELOW = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8], [0.0, 0.0, -1.0]
PAPER = {"evasion": "paper", "recovery": qpsafe.RecoveryRules.paper()}  # task and evasion balance in high danger
LAWS = {
    "strict": qpsafe.HierarchicalLaw(),
    "paper": qpsafe.HierarchicalLaw("paper"),
    "weighted": qpsafe.WeightedLaw(),
    "nullspace": qpsafe.NullspaceLaw(),
}
#: Every law from the front, the default law from all sides.
SOME = [pytest.param(law, FRONT, id=f"{key}-front") for key, law in LAWS.items()]
SOME += [pytest.param(LAWS["strict"], SIDE, id="strict-side"), pytest.param(LAWS["strict"], ABOVE, id="strict-above")]


def point_of_danger(robot: Any, danger: float, direction: list[float]) -> np.ndarray:
    """The point in this direction from the tool where the robot, at rest at home, has this danger; by bisection."""
    field, wire = qpsafe.DangerField(), robot.wire(robot.home, np.zeros(robot.nq))
    tip, near, far = robot.pose("tcp", robot.home)[:3, 3], 1e-3, 60.0
    for _ in range(100):
        middle = 0.5 * (near + far)
        value = field.value((tip + middle * np.array(direction))[None], wire)[0]
        near, far = (middle, far) if value > danger else (near, middle)
    return tip + near * np.array(direction)


def distance_to_wire(robot: Any, q: np.ndarray, point: np.ndarray) -> float:
    """By sampling, unlike the library."""
    wire = robot.wire(q, np.zeros(robot.nq))
    s = np.linspace(0.0, 1.0, 401)[:, None, None]
    return float(np.linalg.norm(wire.starts + s * (wire.ends - wire.starts) - point, axis=2).min())


def half_sine(danger: float, delta: float, epsilon: float) -> float:
    """(19) and (21), written out here once more."""
    if danger <= delta * (1 - epsilon):
        return 1.0
    if danger >= delta * (1 + epsilon):
        return 0.0
    return 0.5 * (1.0 - math.sin(math.pi * (danger - delta) / (2 * epsilon * delta)))


@pytest.mark.parametrize("direction", [FRONT, SIDE, ABOVE])
@pytest.mark.parametrize(
    ("danger", "regime"),
    [
        (1.0, "low"),
        (5.6, "low"),
        (5.65, "medium"),
        (7.5, "medium"),
        (9.3, "medium"),
        (9.6, "medium"),
        (9.8, "high"),
        (11.5, "high"),
        (13.2, "high"),
        (14.0, "high"),
        (30.0, "high"),
    ],
)
def test_table_1(run: Any, irb140: Any, danger: float, regime: str, direction: list[float]) -> None:
    point = point_of_danger(irb140, danger, direction)
    tick = run().step([point])
    assert tick.cdf_n == pytest.approx(danger, rel=1e-9)
    assert tick.regime == regime
    m, f = half_sine(danger, 11.5, 0.15), half_sine(danger, 7.5, 0.25)
    assert (tick.m, tick.f) == pytest.approx((m, f), abs=1e-7)
    assert tick.activations == pytest.approx((m, m * f), abs=1e-7)
    assert tick.phase == ("suspended" if regime == "high" else "following")
    # one QP in a pure regime, two in a transition
    weights = [weight for weight, _ in tick.residuals]
    assert weights == pytest.approx([w for w in (1 - m, m * (1 - f), m * f) if w > 0], abs=1e-7)
    assert np.linalg.norm(tick.vectors[0]) == pytest.approx(danger, rel=1e-9)
    assert tick.vectors[0] @ direction < 0  # from the obstacle to the robot


def test_the_largest_danger_counts(run: Any, irb140: Any) -> None:
    points = [point_of_danger(irb140, danger, FRONT) for danger in (3.0, 8.0, 2.0)]
    assert run().step(points).cdf_n == pytest.approx(8.0)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_without_detection_the_pose_is_kept(run: Any, law: Any) -> None:
    loop = run(law)
    for _ in range(100):
        tick = loop.step()
    assert loop.q == pytest.approx(loop.robot.home, abs=1e-13)
    assert (tick.regime, tick.phase, tick.m, tick.f, tick.cdf_n) == ("low", "following", 1.0, 1.0, 0.0)
    assert np.linalg.norm(tick.errors[0]) < 1e-12
    assert np.linalg.norm(tick.errors[1]) < 1e-12


@pytest.mark.parametrize(("law", "direction"), SOME)
def test_low_danger_disturbs_neither_task(run: Any, irb140: Any, law: Any, direction: list[float]) -> None:
    loop, point = run(law), point_of_danger(irb140, 5.0, direction)
    for _ in range(150):
        tick = loop.step([point])
        assert tick.regime == "low"
        soft = 1e-3 if isinstance(law, qpsafe.WeightedLaw) else 1e-9  # soft priorities yield by the ratio of weights
        assert np.linalg.norm(tick.errors[0]) < min(soft, 1e-4)
        assert np.linalg.norm(tick.errors[1]) < soft
    assert np.abs(tick.qd0).max() > 0.01  # it wants to evade


@pytest.mark.parametrize(("law", "direction"), thinned(2, SOME))
def test_medium_danger_turns_the_tool_and_leaves_it_where_it_is(
    run: Any, irb140: Any, law: Any, direction: list[float]
) -> None:
    loop, point = run(law), point_of_danger(irb140, 9.6, direction)
    for _ in range(300):
        tick = loop.step([point])
        assert tick.regime == "medium"
        assert tick.phase == "following"
        assert np.linalg.norm(tick.errors[0]) < 2e-3
    soft = isinstance(law, qpsafe.WeightedLaw)  # a weight that falls to 5 % of 1000 still outweighs the evasion
    assert np.linalg.norm(tick.errors[1]) > (0.01 if soft else 0.04)


@pytest.mark.parametrize(
    ("law", "direction"), thinned(2, [*SOME, pytest.param(LAWS["strict"], BELOW, id="strict-below")])
)
def test_high_danger_drives_the_robot_away_and_afterwards_it_comes_back(
    run: Any, irb140: Any, law: Any, direction: list[float]
) -> None:
    loop, point = run(law, **PAPER), point_of_danger(irb140, 15.0, direction)
    stays = distance_to_wire(irb140, irb140.home, point)
    phases = ["following"]
    for _ in range(250):
        tick = loop.step([point])
        assert tick.regime == "high"
        phases.append(tick.phase)
    assert distance_to_wire(irb140, loop.q, point) > stays + 0.03
    assert np.linalg.norm(tick.errors[0]) > 0.05

    back = None
    for k in range(2500):  # 10 s
        tick = loop.step()
        phases.append(tick.phase)
        position, orientation = (np.linalg.norm(error) for error in tick.errors)
        if not (position < 1e-3 and orientation < 1e-2):
            back = None
        elif back is None:
            back = k
        elif k > back + 150 and tick.phase == "following":
            break
    assert back is not None
    assert back < 2500
    assert [phase for before, phase in pairwise(phases) if phase != before] == [
        "suspended",
        "recovering",
        "following",
    ]


@pytest.mark.parametrize("direction", first(1, [FRONT, SIDE, ABOVE]))
def test_by_default_it_gets_out_of_high_danger_and_waits_there(run: Any, irb140: Any, direction: list[float]) -> None:
    """Farther than the paper's balance, which is in high danger; and back as soon as nobody is there for a while."""
    point, gaps = point_of_danger(irb140, 15.0, direction), []
    for parts in (PAPER, {}):
        loop = run(**parts)
        ticks = [loop.step([point]) for _ in range(500)]
        gaps.append(distance_to_wire(irb140, loop.q, point))
        assert {tick.phase for tick in ticks} == {"suspended"}
    assert gaps[1] > gaps[0]
    assert ticks[-1].regime == "medium"
    assert np.abs(ticks[-1].reference.qd).max() < 0.2
    assert np.linalg.norm(ticks[-1].errors[0]) > 0.05  # of the path, not of what holds it
    phases = [loop.step().phase for _ in range(some(1500, of=2500))]
    assert phases[:20] == ["suspended"] * 20
    assert phases[-1] == "following"
    assert np.linalg.norm(loop.step().errors[0]) < 1e-3


@pytest.mark.parametrize("law", first(2, LAWS.values()), ids=LAWS)
def test_regimes_and_phases_follow_each_other_as_drawn(run: Any, law: Any) -> None:
    """An obstacle comes at 0.8 m/s, waits, and leaves: levels of danger are passed one by one, there and back."""
    loop = run(law, **PAPER)
    tip = loop.robot.pose("tcp", loop.robot.home)[:3, 3]
    regimes, phases, path_time = ["low"], ["following"], 0.0
    gaps = np.concatenate(
        (np.linspace(1.0, 0.2, 250), np.full(100, 0.2), np.linspace(0.2, 1.0, 250), np.full(1500, 1.0))
    )
    for k, gap in enumerate(gaps):
        tick = loop.step(tip[None] + gap * np.array(FRONT))
        regimes.append(tick.regime)
        phases.append(tick.phase)
        waits = tick.phase != "following" or phases[-2] != "following"
        assert 0.0 <= tick.path_time - path_time <= (0.0 if waits else 0.004 + 1e-12)
        path_time = tick.path_time
        if k > 650 and tick.phase == "following":
            break
    assert set(pairwise(regimes)) <= {
        ("low", "low"),
        ("low", "medium"),
        ("medium", "low"),
        ("medium", "medium"),
        ("medium", "high"),
        ("high", "medium"),
        ("high", "high"),
    }
    assert set(regimes) == {"low", "medium", "high"}
    assert regimes[-1] == "low"
    assert set(pairwise(phases)) - {(phase, phase) for phase in phases} <= {
        ("following", "suspended"),
        ("suspended", "recovering"),
        ("recovering", "suspended"),
        ("recovering", "following"),
    }
    assert phases[-1] == "following"
    for regime, phase in zip(regimes, phases, strict=True):
        assert (regime == "high") == (phase == "suspended")
