import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.sim.people.choreography import FIRST_EXPERIMENT, Approach, Choreography
from qpsafe.sim.people.glide import Track
from qpsafe.sim.people.person import SEGMENTS

NOMINAL = Choreography()
DT = 0.004
TIMES = np.arange(0.0, NOMINAL.duration, DT)


def root_and_board(choreography, times):
    """x, y of root and of the board's centre, and heading: (time, 5)."""
    x, y, heading = choreography.root(times)
    reach = choreography.person.board.reach
    return np.stack([x, y, x + reach * np.cos(heading), y + reach * np.sin(heading), heading], axis=1)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_position_and_velocity_are_continuous_and_bounded(seed):
    path = root_and_board(NOMINAL.varied(seed), TIMES)
    velocity = np.diff(path, axis=0) / DT
    speeds = np.hypot(velocity[:, [0, 2]], velocity[:, [1, 3]])
    assert speeds.max() <= 1.0
    acceleration = np.diff(velocity, axis=0) / DT
    assert np.abs(acceleration[:, :4]).max() < 4.0  # m/s^2; a jump of 0.05 m/s in the velocity would show as 12
    assert np.abs(acceleration[:, 4]).max() < 6.0  # rad/s^2


def test_every_part_of_the_person_moves_without_jumps():
    ends = NOMINAL.poses_at(TIMES).ends
    speeds = np.linalg.norm(np.diff(ends, axis=0), axis=3).max(axis=(0, 2)) / DT
    for segment, speed in zip(SEGMENTS, speeds, strict=True):
        # a swinging leg is faster than the body it carries
        assert speed < (4.2 if segment.name.endswith(("foot", "shank", "thigh")) else 1.3), segment.name


@pytest.mark.parametrize("seed", first(2, range(6)))
def test_the_pauses_are_where_the_approaches_say(seed):
    choreography = NOMINAL.varied(seed)
    for phase in choreography.phases:
        if phase.name not in ("medium", "close"):
            continue
        approach = choreography.approaches[phase.approach]
        wanted = approach.medium_distance if phase.name == "medium" else approach.close_distance
        pause = approach.medium_pause if phase.name == "medium" else approach.close_pause
        assert phase.end - phase.start == pytest.approx(pause)
        for t in np.linspace(phase.start, phase.end, 5):
            face = choreography.pose(t).board_face
            assert math.hypot(face[0], face[1]) == pytest.approx(wanted, abs=1e-9)
            assert math.atan2(face[1], face[0]) == pytest.approx(approach.azimuth, abs=1e-9)
            assert choreography.board_distance(t) == pytest.approx(wanted, abs=1e-9)
            # the board faces the robot: its normal points at the base axis
            assert math.remainder(choreography.pose(t).heading - approach.azimuth - math.pi, 2 * math.pi) == (
                pytest.approx(0.0, abs=1e-9)
            )


@pytest.mark.parametrize("seed", first(2, range(12)))
def test_between_approaches_the_board_is_far_away_and_the_last_withdrawal_is_early_enough(seed):
    choreography = NOMINAL.varied(seed)
    assert choreography.clear_time <= (49.0 if seed == 0 else choreography.duration - 10.0)
    for t in np.arange(0.0, choreography.duration, 0.05):
        if not any(start <= t <= end for start, end in choreography.windows):
            assert choreography.board_distance(t) > 1.65
            assert math.hypot(*choreography.root(t)[:2]) == pytest.approx(choreography.home_radius, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_phases_follow_each_other_without_gaps(seed):
    phases = NOMINAL.varied(seed).phases
    assert phases[0].start == 0.0
    assert phases[-1].end >= NOMINAL.duration
    assert all(a.end == b.start for a, b in itertools.pairwise(phases))
    order = [p.name for p in phases if p.approach >= 0]
    assert order == ["walk in", "medium", "step closer", "close", "withdraw"] * 3


def test_nobody_sinks_into_the_floor():
    radii = np.array([s.radius for s in SEGMENTS])
    lowest = (NOMINAL.poses_at(TIMES[::5]).ends[..., 2].min(axis=2) - radii).min()
    assert lowest >= NOMINAL.person.floor - 1e-9


@settings(max_examples=some(8, of=40))
@given(st.floats(0.0, 60.0))
def test_board_distance_is_the_horizontal_distance_to_the_face(t):
    pose = NOMINAL.pose(t)
    aside = np.array([-math.sin(pose.heading), math.cos(pose.heading)])
    along = np.linspace(-0.5, 0.5, 4001)[:, None] * NOMINAL.person.board.width
    sampled = np.linalg.norm(pose.board_face[:2] + along * aside, axis=1).min()
    assert NOMINAL.board_distance(t) == pytest.approx(sampled, abs=1e-6)


def test_variation_is_small_seeded_and_absent_for_seed_zero():
    assert NOMINAL.varied(0) is NOMINAL
    one, again, other = NOMINAL.varied(7), NOMINAL.varied(7), NOMINAL.varied(8)
    assert one.approaches == again.approaches
    assert one.approaches != other.approaches
    for t in np.linspace(0.0, 60.0, 50):
        assert (one.pose(t).ends == again.pose(t).ends).all()
    for a, b in zip(one.approaches, NOMINAL.approaches, strict=True):
        assert a != b
        assert abs(a.medium_distance - b.medium_distance) <= 0.03
        assert abs(a.close_distance - b.close_distance) <= 0.02
        assert abs(a.azimuth - b.azimuth) <= math.radians(3.0)
        assert abs(a.start - b.start) <= 0.3


def test_an_approach_that_comes_too_early_begins_when_the_person_is_there():
    hasty = replace(NOMINAL, approaches=tuple(replace(a, start=1.0) for a in FIRST_EXPERIMENT))
    path = root_and_board(hasty, TIMES)
    assert (np.hypot(*np.diff(path[:, :2], axis=0).T) / DT).max() <= 1.0
    assert all(end <= start for (_, end), (start, _) in itertools.pairwise(hasty.windows))


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"home_radius": math.nan}, "home_radius"),
        ({"round_speed": 0.0}, "round_speed"),
        ({"ramp": -1.0}, "ramp"),
        ({"max_speed": 0.5}, "max_speed"),
        ({"approaches": ()}, "approaches"),
        ({"approaches": (Approach(0.0, 1.0, 0.8, 0.9),)}, "approaches[0].close_distance"),
        ({"approaches": (Approach(0.0, 1.0, 5.0, 0.9),)}, "approaches[0].medium_distance"),
        ({"approaches": (Approach(9.0, 1.0, 1.0, 0.9),)}, "approaches[0].azimuth"),
        ({"approaches": (Approach(0.0, 1.0, 1.0, 0.9, close_pause=-1.0),)}, "approaches[0].close_pause"),
        ({"approaches": (Approach(0.0, math.inf, 1.0, 0.9),)}, "approaches[0].start"),
    ],
)
def test_a_wrong_choreography_names_what_is_wrong(change, key):
    with pytest.raises(ConfigurationError) as error:
        Choreography(**change)
    assert error.value.key == key


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.1, 1.0), st.floats(0.1, 1.0), st.floats(0.0, 1.0))
def test_a_glide_is_monotone_ends_at_its_goal_and_keeps_its_speed(a, b, speed, ramp, start):
    track = Track(a)
    end = track.glide(start, b, speed, ramp)
    times = np.linspace(start, end, 400)
    values = track(times)
    step = (end - start) / 399
    assert track(start) == pytest.approx(a, abs=1e-12)
    assert track(start - 0.1) == a
    assert track(end) == pytest.approx(b, abs=1e-12)
    assert track(end + 1.0) == b
    assert (np.sign(b - a) * np.diff(values) >= -1e-12).all()
    velocity = np.diff(values) / step
    assert np.abs(velocity).max() <= speed * (1 + 1e-9)
    # its slope never exceeds that of the cosine ramps, so the velocity has no jumps, at the ends neither
    jumps = np.diff(np.concatenate([[0.0], velocity, [0.0]]))
    assert np.abs(jumps).max() <= speed * math.pi / (2 * ramp) * step * (1 + 1e-6) + 1e-12
