"""Time laws, moves and programs: jerk-limited, continuous, derivatives that fit, pauses that leave no trace."""

import copy
import itertools
import math

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.tasks.moves import Arc, Dwell, JointMove, JointMoveOfFrame, Line, Move
from qpsafe.tasks.program import Event, Program
from qpsafe.tasks.reach import PERIOD, STRIDE, TURN, checked_poses
from qpsafe.tasks.rotation import exp3, log3
from qpsafe.tasks.timing import Rates, TimeLaw

robot = qpsafe.load_robot("irb140")
finite = st.floats(-2.0, 2.0)
LINEAR, ANGULAR = Rates(0.2, 1.0, 8.0), Rates(0.7, 3.0, 25.0)


def pose(x: float, y: float, z: float, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    matrix[:3, :3] = exp3(np.array(turn))
    return matrix


A, B, C = pose(0.4, 0.2, 0.5), pose(0.4, -0.2, 0.5, (0.3, 0.2, -0.4)), pose(0.5, 0.0, 0.6, (0.0, 1.0, 0.0))
JOINTS = JointMove(
    robot.home, robot.home + np.array([0.3, -0.2, 0.1, 0.5, -0.4, 1.0]), *(np.full(6, r) for r in (1, 4, 40))
)
MOVES: dict[str, Move] = {
    "line": Line(A, B, LINEAR, ANGULAR),
    "turn on the spot": Line(A, pose(0.4, 0.2, 0.5, (0.0, 0.0, 2.0)), LINEAR, ANGULAR),
    "line without a turn": Line(A, pose(0.6, 0.2, 0.5), LINEAR, ANGULAR),
    "arc": Arc(A, (0.55, 0.0, 0.55), B, LINEAR, ANGULAR),
    "more than half a circle": Arc(A, (0.8, 0.1, 0.5), pose(0.4, 0.1, 0.5), LINEAR, ANGULAR),
    "joints": JointMoveOfFrame(robot, "tcp", JOINTS),
    "dwell": Dwell(A, 0.7),
}


@given(data=st.data(), n=st.integers(1, 4))
@settings(deadline=None, max_examples=some(10, of=60))
def test_a_time_law_leads_from_any_state_to_rest_within_its_rates(data: st.DataObject, n: int) -> None:
    start, goal, velocity, acceleration = (
        np.array(data.draw(st.lists(finite, min_size=n, max_size=n))) * scale for scale in (1.0, 1.0, 0.4, 1.0)
    )
    law = TimeLaw(start, goal, np.full(n, 1.0), np.full(n, 3.0), np.full(n, 20.0), velocity, acceleration)
    assert law.at(0.0).position == pytest.approx(start)
    assert law.at(0.0).velocity == pytest.approx(velocity)
    just_before = law.at(law.duration * (1 - 1e-12))
    assert just_before.position == pytest.approx(goal, abs=1e-6)
    assert just_before.velocity == pytest.approx(np.zeros(n), abs=1e-6)
    assert (law.at(law.duration).position == goal).all()
    for t in np.append(np.linspace(-0.1, 1.1, 13) * law.duration, law.duration):  # one coordinate alone
        assert law.first(t) == tuple(float(value[0]) for value in law.at(t))
    times = np.linspace(0.0, law.duration, 200)
    states = [law.at(t) for t in times]
    # |v| can pass the bound by v² while the start's acceleration a is taken back: a²/2j = 2²/40
    assert max(np.abs(s.velocity).max() for s in states) <= 1.0 + 0.1 + 1e-6
    assert max(np.abs(s.acceleration).max() for s in states) <= 3.0 + 1e-6
    for before, after, (a, b) in zip(states, states[1:], itertools.pairwise(times), strict=False):
        assert np.abs(after.acceleration - before.acceleration).max() <= 20.0 * (b - a) + 1e-6


@pytest.mark.parametrize("name", MOVES)
def test_a_move_is_at_rest_at_both_ends_and_its_twist_is_the_derivative_of_its_pose(name: str) -> None:
    move, h = MOVES[name], 1e-5
    for t in (0.0, move.duration, move.duration + 1.0):
        assert move.sample(t).twist == pytest.approx(np.zeros(6), abs=1e-12)
    for t in np.linspace(0.03, 0.97, 12) * move.duration:
        before, after = move.sample(t - h).pose, move.sample(t + h).pose
        difference = np.concatenate(((after - before)[:3, 3], log3(after[:3, :3] @ before[:3, :3].T))) / (2 * h)
        assert move.sample(t).twist == pytest.approx(difference, abs=1e-6)


@pytest.mark.parametrize("name", [name for name in MOVES if name not in ("joints", "dwell")])
def test_cartesian_moves_keep_their_rates_and_use_one_of_them_fully(name: str) -> None:
    move = MOVES[name]
    times = np.linspace(0.0, move.duration, 2000)
    twists = np.array([move.sample(t).twist for t in times])
    speed, turn = np.linalg.norm(twists[:, :3], axis=1), np.linalg.norm(twists[:, 3:], axis=1)
    assert speed.max() <= LINEAR.speed + 1e-9
    assert turn.max() <= ANGULAR.speed + 1e-9
    along = np.abs(np.diff(speed)).max() / times[1], np.abs(np.diff(turn)).max() / times[1]
    assert along[0] <= LINEAR.acceleration + 1e-6
    assert along[1] <= ANGULAR.acceleration + 1e-6
    shares = (speed.max() / LINEAR.speed, turn.max() / ANGULAR.speed)
    assert max(*shares, along[0] / LINEAR.acceleration, along[1] / ANGULAR.acceleration) > 0.98


def test_a_line_is_straight_and_turns_by_the_shortest_way() -> None:
    move = MOVES["line"]
    for t in np.linspace(0.0, move.duration, 20):
        p = move.sample(t).pose
        share = (p[1, 3] - 0.2) / -0.4
        assert p[:3, 3] == pytest.approx(A[:3, 3] + share * (B - A)[:3, 3])
        assert log3(p[:3, :3]) == pytest.approx(share * log3(B[:3, :3]), abs=1e-12)
    assert move.sample(0.0).pose == pytest.approx(A, abs=1e-15)
    assert move.sample(move.duration).pose == pytest.approx(B, abs=1e-15)


@pytest.mark.parametrize("seed", range(5))
def test_an_arc_lies_on_the_circle_through_its_points_and_passes_them_in_order(seed: int) -> None:
    """An oracle of its own: points of a random circle at rising angles."""
    rng = np.random.default_rng(seed)
    frame, centre, r = Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3), rng.uniform(0.05, 1.0)
    angles = np.sort(rng.uniform(0.3, 6.0, 2))

    def on(a: float) -> np.ndarray:
        return centre + r * (frame @ [np.cos(a), np.sin(a), 0.0])

    goal = pose(*on(angles[1]))
    move = Arc(pose(*on(0.0)), on(angles[0]), goal, LINEAR, ANGULAR)
    assert move.sample(move.duration).pose[:3, 3] == pytest.approx(goal[:3, 3], abs=1e-7)
    track = np.array([move.sample(t).pose[:3, 3] for t in np.linspace(0.0, move.duration, 400)])
    assert np.linalg.norm(track - centre, axis=1) == pytest.approx(np.full(400, r), rel=1e-7)
    assert np.linalg.norm(np.diff(track, axis=0), axis=1).sum() == pytest.approx(r * angles[1], rel=1e-3)
    assert np.linalg.norm(track - on(angles[0]), axis=1).min() < 0.02 * r * angles[1] + 1e-6


PROGRAM = Program([Line(A, B), Dwell(B, 0.3), Arc(B, (0.6, 0.1, 0.5), A)], [(1, "grip"), (3, "release")], cycle=True)


@given(stops=st.lists(st.tuples(st.integers(1, 80), st.integers(0, 50)), min_size=1, max_size=8))
@settings(deadline=None, max_examples=some(8, of=40))
def test_a_pause_at_any_instant_leaves_no_trace(stops: list[tuple[int, int]]) -> None:
    """With a clock that stands still, the samples after a pause are bit by bit those of the run without."""
    dt, k = 0.02, 0
    for run, pause in stops:
        for _ in range(run):
            k += 1
            straight = PROGRAM.sample(k * dt)
        frozen = [PROGRAM.sample(k * dt) for _ in range(pause)]
        assert all((f.pose == straight.pose).all() and (f.twist == straight.twist).all() for f in frozen)


def test_a_program_joins_its_moves_and_repeats() -> None:
    times = np.arange(0.0, 2.2 * PROGRAM.duration, 0.004)
    samples = [PROGRAM.sample(t) for t in times]
    for before, after in itertools.pairwise(samples):
        assert np.linalg.norm((after.pose - before.pose)[:3, 3]) <= 0.25 * 0.004 + 1e-6
        assert np.linalg.norm((after.twist - before.twist)[:3]) <= 2.0 * 0.004 + 1e-6
    for t in np.linspace(0.1, 0.9, 7) * PROGRAM.duration:
        assert PROGRAM.sample(t + PROGRAM.duration).pose == pytest.approx(PROGRAM.sample(t).pose, abs=1e-9)
    once = Program(PROGRAM.moves)
    assert once.sample(1e9).pose == pytest.approx(A, abs=1e-12)
    assert not once.sample(1e9).twist.any()


def test_events_are_counted_through_the_cycles() -> None:
    times = PROGRAM.moves[0].duration, PROGRAM.duration
    assert PROGRAM.event(0) == Event(times[0], "grip")
    assert PROGRAM.event(1) == Event(times[1], "release")
    assert PROGRAM.event(4) == Event(times[0] + 2 * PROGRAM.duration, "grip")
    once = Program(PROGRAM.moves, [(0, "open")])
    assert once.event(0) == Event(0.0, "open")
    assert once.event(1) is None
    assert Program(PROGRAM.moves).event(0) is None


def test_moves_can_be_copied_in_mid_run() -> None:
    again = copy.deepcopy(PROGRAM)
    assert (again.sample(1.3).pose == PROGRAM.sample(1.3).pose).all()


@pytest.mark.parametrize(
    ("bad", "key"),
    [
        (lambda: Line(A, A), "Line: goal"),
        (lambda: Line(A, np.zeros((4, 4))), "Line: goal"),
        (lambda: Arc(A, A[:3, 3], B), "Arc: via"),
        (lambda: Arc(A, (0.4, 0.0, 0.5), B), "Arc: via"),
        (lambda: Dwell(A, -1.0), "Dwell: duration"),
        (lambda: Dwell(A, float("nan")), "Dwell: duration"),
        (lambda: Rates(0.0, 1.0, 1.0), "Rates: speed"),
        (lambda: Rates(1.0, 1.0, float("inf")), "Rates: jerk"),
        (lambda: TimeLaw([0.0], [1.0], [0.0], [1.0], [1.0]), "TimeLaw: speed"),
        (lambda: TimeLaw([0.0], [1.0, 2.0], [1.0], [1.0], [1.0]), "TimeLaw: goal"),
        (lambda: TimeLaw([np.nan], [1.0], [1.0], [1.0], [1.0]), "TimeLaw: start"),
        (lambda: Program([]), "Program: moves"),
        (lambda: Program([Line(A, B), Line(A, B)]), r"moves\[1\]"),
        (lambda: Program([Line(A, B)], cycle=True), r"moves\[0\]"),
        (lambda: Program([Line(A, B)], [(2, "grip")]), r"events\[0\]"),
    ],
)
def test_moves_that_cannot_be_are_refused_by_name(bad: object, key: str) -> None:
    with pytest.raises(ConfigurationError, match=key):
        bad()  # type: ignore[operator]


anything = st.floats(-300.0, 300.0).map(lambda x: 10.0**x) | st.floats(1e-3, 1e3)


@settings(max_examples=some(25, of=150))
@given(st.floats(1e-6, 1e3), anything, anything, anything)  # ruckig's own precision is 1e-8
def test_any_motion_arrives_or_is_refused_by_name(
    length: float, speed: float, acceleration: float, jerk: float
) -> None:
    """However large, small or far apart the rates are; ruckig's own errors never come out."""
    try:
        law = TimeLaw([0.0], [length], [speed], [acceleration], [jerk])
    except qpsafe.ConfigurationError as error:
        assert error.key in ("goal", "speed", "acceleration", "jerk")  # noqa: PT017
        return
    assert 0.0 < law.duration < math.inf
    assert law.at(law.duration).position == pytest.approx([length])
    assert law.at(math.nextafter(law.duration, 0.0)).position == pytest.approx([length], rel=1e-6, abs=2e-8)
    for share in (0.1, 0.3, 0.5, 0.7, 0.9):
        motion = law.at(share * law.duration)
        assert abs(motion.velocity[0]) <= speed * (1.0 + 1e-6)
        assert abs(motion.acceleration[0]) <= acceleration * (1.0 + 1e-6)


rates = st.builds(Rates, *[st.floats(1e-4, 1e2)] * 3)


@settings(max_examples=some(10, of=60))
@given(rates, rates, st.floats(0.0, 1.0), st.floats(0.01, 3.0))
def test_a_path_is_checked_densely_and_no_more_often_than_its_way_needs(
    linear: Rates, angular: Rates, length: float, angle: float
) -> None:
    """Between two checked poses lie 20 ms, or at most 5 mm and 0.016 rad; a slower motion needs no more of them."""
    goal = np.eye(4)
    goal[:3, :3], goal[0, 3] = exp3(np.array([0.0, 0.0, angle])), length
    line = Line(np.eye(4), goal, linear, angular)
    count = checked_poses(line)
    assert count <= 2.0 * max(length / STRIDE, angle / TURN) + 1.0
    if line.duration / count > PERIOD * (1.0 + 1e-9):
        u = [line.law.at(line.duration * k / count).position[0] for k in range(count + 1)]
        assert max(np.diff(u)) * length <= STRIDE * (1.0 + 1e-6)
        assert max(np.diff(u)) * angle <= TURN * (1.0 + 1e-6)
