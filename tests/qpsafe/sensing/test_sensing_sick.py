"""The table of docs/reference/sensing.md, line by line, on the sensing alone and in the controller."""

from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.sensing.health import CAPPED, CLEAR, STOPPED
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.sensing.speed_cap import wire_speed

DT, REST, SPOT = 0.004, np.zeros(6), 19
FAST = qpsafe.NullspaceLaw()


class Feed:
    """A sensing of a robot at rest, fed tick by tick with the reading of one spot."""

    def __init__(self, robot: Any, **rules: Any) -> None:
        self.sensing = DistanceSensing(robot, qpsafe.load_spots(robot), DT, SensingRules(**rules))
        self.state, self.wire = robot.at(robot.home), robot.wire(robot.home, REST)
        self.origins, self.directions = self.sensing.spots.rays(self.state)

    def __call__(self, value: float, age: float = 0.0) -> Any:
        distances, ages = np.full(20, np.inf), np.zeros(20)
        distances[SPOT], ages[SPOT] = value, age
        return self.sensing.update(self.state, self.wire, distances, ages)

    def distance(self, seen: Any) -> float:
        """Of the point that counts, from the spot [m]."""
        (point,) = seen.points
        return float(np.linalg.norm(point - self.origins[SPOT]))


SICK = {
    "NaN": (np.nan, 0.0, "not a number"),
    "-inf": (-np.inf, 0.0, "below zero"),
    "negative": (-1e-12, 0.0, "below zero"),
    "stale": (0.5, 0.041, "stale"),
    "of unknown age": (0.5, np.nan, "stale"),
}


@pytest.mark.parametrize("key", SICK)
def test_a_sick_reading_is_named_at_once_held_and_dies_in_5_ticks(irb140: Any, key: str) -> None:
    value, age, words = SICK[key]
    feed = Feed(irb140)
    assert feed.distance(feed(0.5)) == pytest.approx(0.5)
    for tick in range(1, 60):
        seen = feed(value, age)
        assert words in seen.notes[0]
        assert seen.notes[0].endswith(feed.sensing.spots.names[SPOT])
        assert seen.severity == (CAPPED if tick >= 5 else CLEAR)
        assert not seen.too_many
        assert (len(seen.points) == 1) == (tick <= 38)  # 0.15 s
        assert feed.sensing.unseen == (feed.sensing.spots.names[SPOT],)


@pytest.mark.parametrize("gone", [np.nan, np.inf, 0.79])
def test_what_vanishes_comes_nearer_at_1_6_m_per_s(irb140: Any, gone: float) -> None:
    feed = Feed(irb140, hold_time=0.1)
    feed(0.5)
    for tick in range(1, 26):
        assert feed.distance(feed(gone)) == pytest.approx(0.5 - 1.6 * DT * tick, abs=1e-12)
    last = feed(gone)
    if gone == 0.79:  # something farther, confirmed
        assert feed.distance(last) == pytest.approx(0.79)
    else:
        assert len(last.points) == 0


def test_what_vanishes_never_comes_nearer_than_d_min_to_the_wire(irb140: Any) -> None:
    feed = Feed(irb140, hold_time=2.0)
    feed(0.5)
    for _ in range(400):
        (point,) = feed(np.inf).points
        ends = feed.wire.ends - feed.wire.starts
        share = np.linspace(0.0, 1.0, 400)[:, None, None]
        gap = np.linalg.norm(feed.wire.starts + share * ends - point, axis=2).min()
        assert gap >= 0.16 - 1e-6
    assert gap < 0.17


def test_what_leaves_through_the_end_of_the_range_is_held_where_it_was(irb140: Any) -> None:
    feed = Feed(irb140)
    feed(0.79)
    for _ in range(38):
        assert feed.distance(feed(np.inf)) == pytest.approx(0.79)
    assert len(feed(np.inf).points) == 0


def test_nearer_counts_at_once_farther_after_confirmation(irb140: Any) -> None:
    feed = Feed(irb140)
    feed(0.7)
    assert feed.distance(feed(0.2)) == pytest.approx(0.2)  # a spike or a hand: nobody knows, it counts
    for _ in range(30):
        assert feed.distance(feed(0.7)) < 0.21
    assert feed.distance(feed(0.21)) == pytest.approx(0.21)  # there again: no confirmation needed
    for _ in range(39):
        seen = feed(0.7)
    assert feed.distance(seen) == pytest.approx(0.7)
    for d in np.arange(0.7, 0.3, -0.01):
        assert feed.distance(feed(d)) == pytest.approx(d)  # what moves continuously is followed
    for d in np.arange(0.3, 0.7, 0.01):
        assert feed.distance(feed(d)) == pytest.approx(d)


def test_a_single_sample_farther_changes_nothing(irb140: Any) -> None:
    feed = Feed(irb140)
    feed(0.5)
    assert feed.distance(feed(np.inf)) == pytest.approx(0.4936)
    assert feed.distance(feed(0.5)) == pytest.approx(0.5)


def test_beyond_the_range_is_nothing_and_below_it_counts(irb140: Any) -> None:
    for value in (0.8000001, 5.0, 1e300, np.inf):
        seen = Feed(irb140)(value)
        assert len(seen.points) == 0
        assert seen.notes == ()
    for value in (0.0, 0.01, 0.19):
        feed = Feed(irb140)
        assert feed.distance(feed(value)) == pytest.approx(value)


def test_stuck_is_the_same_value_while_the_robot_moves(irb140: Any) -> None:
    sensing = DistanceSensing(irb140, qpsafe.load_spots(irb140), DT)
    rng = np.random.default_rng(0)
    origin = None
    for tick in range(200):
        q = irb140.home.copy()
        q[0] += 0.0006 * tick
        state = irb140.at(q)
        distances = 0.5 + rng.normal(0.0, 1e-3, 20)
        distances[SPOT] = 0.6
        point = sensing.spots.points(state, distances)[SPOT]
        origin = point if origin is None else origin
        seen = sensing.update(state, state.wire(REST), distances)
        due = tick + 1 >= 25 and np.linalg.norm(point - origin) >= 0.02
        dead = sensing.unseen == (sensing.spots.names[SPOT],)
        assert dead == due or abs(np.linalg.norm(point - origin) - 0.02) < 1e-9
    assert "dead (stuck)" in seen.notes[0]
    still = Feed(irb140)
    for _ in range(200):
        assert still(0.5).notes == ()  # a robot at rest before something at rest


def dead(count: int) -> np.ndarray:
    return np.where(np.arange(20) < count, np.nan, np.inf)


def test_severity_only_rises_until_acknowledged(irb140: Any, run: Any) -> None:
    loop = run(FAST)
    healthy = dead(0)
    for readings, ticks, severity in (
        (healthy, 3, CLEAR),
        (dead(1), 4, CLEAR),  # not dead yet
        (healthy, 2, CLEAR),
        (dead(1), 5, CAPPED),
        (healthy, 9, CAPPED),
        (dead(4), 9, CAPPED),
        (dead(5), 5, STOPPED),
        (dead(1), 9, STOPPED),
        (healthy, 9, STOPPED),
    ):
        for _ in range(ticks):
            tick = loop.feed(loop.q, loop.qd, readings)
        assert tick.severity == severity
        if severity == STOPPED:
            assert tick.status == "bad_input"
            assert not tick.reference.qd.any()
    loop.controller.acknowledge()
    tick = loop.feed(loop.q, loop.qd, healthy)
    assert (tick.severity, tick.status, tick.unseen) == (CLEAR, "ok", ())
    for _ in range(9):
        loop.feed(loop.q, loop.qd, dead(2))
    loop.controller.acknowledge()  # still sick: acknowledging does not heal
    assert loop.feed(loop.q, loop.qd, dead(2)).severity == CAPPED


def test_too_many_at_once_stop_at_once(run: Any) -> None:
    loop = run(FAST)
    loop.stir(20)
    tick = loop.settle(90, loop.q, loop.qd, dead(20))
    assert tick.severity == STOPPED
    assert len(tick.unseen) == 20


def test_a_dead_spot_caps_the_speed_and_the_evasion_too(run: Any, irb140: Any) -> None:
    loop = run(FAST)
    near = irb140.pose("tcp", irb140.home)[:3, 3] + [0.1, 0.02, 0.05]
    for _ in range(40):
        loop.step([near])
    assert wire_speed(loop.qd, irb140.at(loop.q)) > 0.3
    distances = np.full(20, np.inf)
    distances[0] = np.nan
    for tick in range(120):
        distances[SPOT] = 0.25 + 1e-4 * tick
        loop.feed(loop.q, loop.qd, distances)
        if tick >= 95:
            assert wire_speed(loop.qd, irb140.at(loop.q)) <= 0.25 * 1.001  # at the pose it starts from, exactly


readings = st.lists(
    st.lists(
        st.sampled_from([np.nan, -np.inf, np.inf, -1.0, 0.0, 0.1, 0.3, 0.5, 0.79, 0.9, 1e300]), min_size=20, max_size=20
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=some(6, of=15), deadline=None)
@given(readings, st.booleans())
def test_whatever_is_read_the_tick_answers(run: Any, series: list[list[float]], velocities: bool) -> None:
    """Every point that counts is finite, every sick spot is named, and the command respects the limits (watched)."""
    loop = run(FAST, sensing=SensingRules(velocities=velocities))
    names = loop.controller.spots.names
    worst = 0
    for row in series:
        tick = loop.feed(loop.q, loop.qd, row)
        sick = {name for name, value in zip(names, row, strict=True) if not value >= 0.0}
        assert sick <= set(tick.unseen)
        assert np.isfinite(tick.points).all()
        assert tick.status == ("ok" if not tick.unseen and not tick.messages else tick.status)
        if len(sick) > 4:
            assert tick.status == "bad_input"
        level = (CLEAR, CAPPED, STOPPED).index(tick.severity)
        assert level >= worst
        worst = level


@pytest.mark.parametrize("ages", [np.zeros(19), "old", np.zeros((20, 1)), [None] * 20])
def test_ages_that_are_none_are_reported(run: Any, ages: Any) -> None:
    loop = run(FAST)
    tick = loop.feed(loop.q, loop.qd, dead(0), ages=ages)
    assert tick.status == "bad_input"
    assert "ages" in tick.messages[0]


def test_one_age_is_that_of_all(run: Any) -> None:
    loop = run(FAST)
    assert loop.feed(loop.q, loop.qd, dead(0), ages=0.04).status == "ok"
    tick = loop.feed(loop.q, loop.qd, dead(0), ages=0.05)
    assert tick.status == "bad_input"
    assert "stale" in tick.messages[0]


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf, None, "0.3", True])
@pytest.mark.parametrize("key", ["d_min", "hold_time", "speed_cap", "dead_share", "max_age", "approach_speed"])
def test_a_rule_that_is_none_is_named(key: str, value: Any) -> None:
    with pytest.raises(qpsafe.ConfigurationError) as caught:
        SensingRules(**{key: value})
    assert caught.value.key == key
