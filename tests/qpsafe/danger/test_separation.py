"""Speed and separation monitoring: the speed is the exact inverse of the distance, and a stop keeps it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.danger.separation import Separation
from qpsafe.errors import ConfigurationError

figures = st.builds(
    Separation,
    st.floats(0.2, 20.0),
    person_speed=st.floats(0.0, 3.0),
    reaction_time=st.floats(0.0, 0.5),
    intrusion=st.floats(0.0, 1.0),
    person_error=st.floats(0.0, 0.1),
    robot_error=st.floats(0.0, 0.1),
)


@given(figures, st.floats(1e-3, 5.0))
def test_the_speed_is_the_inverse_of_the_distance(separation: Separation, speed: float) -> None:
    assert float(separation.speed(separation.distance(speed))) == pytest.approx(speed, rel=1e-6, abs=1e-9)


@given(figures, st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=9))
def test_faster_needs_more_room_and_more_room_allows_faster(separation: Separation, values: list[float]) -> None:
    ordered = np.sort(values)
    assert (np.diff(separation.distance(ordered)) >= 0.0).all()
    assert (np.diff(separation.speed(ordered)) >= 0.0).all()
    assert (separation.speed(ordered) >= 0.0).all()


@given(figures, st.floats(0.01, 3.0))
def test_a_robot_that_brakes_at_that_distance_stands_before_the_person_is_there(
    separation: Separation, speed: float
) -> None:
    """Simulated: the robot goes on for T_r, then brakes; the person walks on until it stands."""
    gap = float(separation.distance(speed))
    reaction, braking = separation.reaction_time, speed / separation.deceleration
    robot = speed * reaction + 0.5 * speed * braking
    person = separation.person_speed * (reaction + braking)
    left = gap - robot - person
    kept = separation.intrusion + separation.person_error + separation.robot_error
    assert left == pytest.approx(kept, abs=1e-9)


def test_nothing_known_is_no_speed_and_nobody_there_is_no_limit() -> None:
    separation = Separation(5.0)
    assert separation.speed(math.nan) == 0.0
    assert separation.speed(-1.0) == 0.0
    assert separation.speed(separation.standing) == 0.0
    assert separation.speed(math.inf) == math.inf


@pytest.mark.parametrize("key", ["deceleration", "person_speed", "reaction_time", "intrusion"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf, "fast"])
def test_bad_figures_are_named(key: str, value: object) -> None:
    given = {"deceleration": 5.0} | {key: value}
    with pytest.raises(ConfigurationError, match=key):
        Separation(**given)  # type: ignore[arg-type]


def test_a_robot_that_cannot_brake_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="deceleration"):
        Separation(0.0)


def test_numbers_that_underflow_give_no_speed_below_zero() -> None:
    assert Separation(0.2, person_speed=1e-301, reaction_time=0.0).speed(-1e-301) >= 0.0
    assert Separation(0.2, person_speed=5e-324, reaction_time=0.0, person_error=0.0, robot_error=0.0).speed(0.0) == 0.0
