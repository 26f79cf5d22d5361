"""How hands go, reaching while walking, and stumbling: no faster than said, where they are to be, nothing torn."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.sim.people.paces import COSINE, minimum_jerk, paced, peak
from qpsafe.sim.people.person import SEGMENTS
from qpsafe.sim.stories.file import StoryError, parse_story
from qpsafe.sim.stories.story import Actor

DT = 0.004
POINT = (0.4, 0.1, 0.6)


def actor(*steps: str, start: str = "[3.0, 0.0]") -> Actor:
    text = f'[[person]]\nname = "A"\nstart = {start}\nheading = 180.0\n'
    return parse_story(text + "".join(f"[[person.step]]\n{step}\n" for step in steps)).people[0]


def walk(speed: float = 1.4, more: str = "") -> str:
    return f'do = "walk"\nto = [0.85, 0.1]\nspeed = {speed!r}\n{more}'


def reach(more: str = "", speed: float = 1.5) -> str:
    return f'do = "reach"\narm = "left"\nto = {list(POINT)}\nspeed = {speed!r}\n{more}'


def speeds(of: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(of, axis=0), axis=-1) / DT


@given(st.sampled_from([COSINE, 0.0, 0.3, 1.0]))
def test_every_pace_goes_from_rest_to_rest_and_keeps_its_peak(late: float) -> None:
    u = np.linspace(-0.2, 1.2, 14001)
    share = paced(u, np.array(late))
    rate = np.diff(share) / np.diff(u)
    assert (share[u <= 0.0] == 0.0).all()
    assert share[u >= 1.0] == pytest.approx(1.0, abs=1e-12)
    assert rate.min() >= -1e-9
    assert 0.97 * peak(late) < rate.max() <= peak(late) * (1.0 + 1e-9)
    assert np.abs(np.diff(rate)).max() < 0.01  # the velocity has no jumps


def test_a_minimum_jerk_has_less_jerk_than_its_neighbours_and_a_late_one_peaks_late() -> None:
    u = np.linspace(0.0, 1.0, 2001)

    def cost(share: np.ndarray) -> float:
        return float((np.diff(share, n=3) ** 2).sum())

    best = minimum_jerk(u)
    rest_to_rest = u**3 * (1.0 - u) ** 3  # three derivatives' worth of zeros at both ends
    for bump in (1.0, -1.0):
        assert cost(best) < cost(best + bump * rest_to_rest * (u - 0.3))
        assert cost(best) < cost(best + bump * rest_to_rest)
    assert u[np.argmax(np.diff(best))] == pytest.approx(0.5, abs=1e-3)
    assert u[np.argmax(np.diff(minimum_jerk(u, 1.0)))] == pytest.approx(0.6, abs=1e-3)


@pytest.mark.parametrize("late", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("speed", [0.4, 2.0])
def test_minimum_jerk_hands_are_no_faster_than_said(late: float, speed: float) -> None:
    more = f'profile = "minimum-jerk"\nlate = {late!r}'
    person = actor(reach(more, speed), f'do = "retract"\nspeed = {speed!r}\n{more}', start="[0.85, 0.1]")
    hands = person.poses_at(np.arange(0.0, person.end + 0.5, DT)).hands
    assert 0.8 * speed < speeds(hands).max() <= speed
    middle = person.poses_at(np.array([person.steps[0].end, person.steps[0].end + 0.0])).hands[0, 0]
    assert middle == pytest.approx(POINT, abs=1e-3)


def test_the_later_the_peak_the_later_the_hand_is_fastest() -> None:
    def when(late: float) -> float:
        person = actor(reach(f'profile = "minimum-jerk"\nlate = {late!r}'), start="[0.85, 0.1]")
        fast = speeds(person.poses_at(np.arange(0.0, person.end, DT)).hands[:, 0])
        return float(np.argmax(fast)) / len(fast)

    assert when(0.0) + 0.04 < when(0.5) < when(1.0) - 0.01


def hanging(person: Actor, times: np.ndarray) -> np.ndarray:
    """Hands of the same walker if both arms just hang: speeds (T - 1, 2)."""
    roots = np.stack(person.course(times), axis=-1)
    return speeds(person.person.poses(roots, person._footsteps.at(times)).hands)


@pytest.mark.parametrize("early", [0.3, 0.8, 1.5])
def test_a_hand_that_sets_out_early_moves_while_walking_and_is_there_as_soon_and_no_faster(early: float) -> None:
    later, sooner = actor(walk(), reach()), actor(walk(), reach(f"early = {early!r}"))
    step = sooner.steps[1]
    assert step.end < later.steps[1].end
    times = np.arange(0.0, sooner.end + 1.0, DT)
    hands = sooner.poses_at(times).hands
    for k in np.flatnonzero(times >= step.end):
        assert hands[k, 0] == pytest.approx(POINT, abs=1e-3)
    setting_out = times[:-1] < sooner.steps[0].end - early - DT
    free = hanging(sooner, times)
    assert speeds(hands)[setting_out] == pytest.approx(free[setting_out], abs=1e-9)
    assert np.abs(speeds(hands) - free)[~setting_out].max() > 0.3  # it does leave
    assert (speeds(hands)[:, 0] <= 1.5 + np.maximum.accumulate(free[::-1].max(axis=1))[::-1]).all()


STUMBLE = 'do = "stumble"\nlean = 45.0\nspeed = 1.6\nearly = 0.8'


def test_who_stumbles_throws_the_hands_ahead_keeps_all_bones_and_stands_again() -> None:
    person = actor(walk(1.6, "stop = 0.5"), STUMBLE, 'do = "wait"\ntime = 1.0')
    times = np.arange(0.0, person.end, DT)
    poses = person.poses_at(times)
    wanted = np.array([segment.length for segment in person.person.body.segments])
    assert np.linalg.norm(poses.ends[:, :, 1] - poses.ends[:, :, 0], axis=-1) == pytest.approx(
        np.broadcast_to(wanted, poses.ends.shape[:2]), abs=1e-9
    )
    ahead = -(poses.hands[..., 0] - np.array(person.course(times))[0, :, None])  # they walk along -x
    assert ahead.max() > 0.55
    assert ahead[-1].max() < 0.15
    shoulders = poses.ends[:, 4, :, 2].mean(axis=1)
    assert shoulders.min() < shoulders[0] - 0.25
    assert shoulders[-1] == pytest.approx(shoulders[0], abs=1e-3)
    assert poses.ends[..., 2].min() >= person.person.floor
    assert (speeds(poses.hands).max(axis=1) <= 1.6 + hanging(person, times).max()).all()
    jolt = np.linalg.norm(np.diff(poses.ends, n=2, axis=0), axis=-1) / DT
    assert jolt.max() < 1.0  # nothing jumps


def test_a_stumble_begins_before_the_walk_has_ended() -> None:
    person = actor(walk(1.6, "stop = 0.5"), STUMBLE)
    heights = person.poses_at(np.arange(0.0, person.end, DT)).ends[:, [i.name for i in SEGMENTS].index("head"), 1, 2]
    lowest = np.argmin(heights) * DT
    assert heights[round(person.steps[0].end / DT)] < heights[0] - 0.03
    assert lowest < person.steps[1].end


@pytest.mark.parametrize("stop", [0.3, 0.6, 2.5])
def test_a_walk_that_stops_in_another_time_is_no_faster_and_arrives(stop: float) -> None:
    person, plain = (actor(walk(2.2, more), start="[7.0, 0.0]") for more in (f"stop = {stop}", ""))
    times = np.arange(0.0, person.end + 0.1, DT)
    x, y, _ = person.course(times)
    speed = np.hypot(np.diff(x), np.diff(y)) / DT
    assert speed.max() <= 2.2 * (1.0 + 1e-9)
    assert (x[-1], y[-1]) == pytest.approx((0.85, 0.1), abs=1e-9)
    assert person.end - plain.end == pytest.approx(0.5 * (stop - 0.5 - 0.5 * 2.2), abs=1e-9)
    braking = times[:-1][speed > 0.99 * speed.max()].max()
    assert person.end - braking == pytest.approx(stop, rel=0.25)


@given(st.floats(0.2, 5.0), st.floats(0.2, 5.0), st.lists(st.floats(-4.0, 4.0), min_size=2, max_size=6))
def test_no_mixture_of_times_makes_a_walk_faster_than_said(ease: float, stop: float, ys: list[float]) -> None:
    to = [[2.0 - 0.4 * k, y] for k, y in enumerate(ys)]
    person = actor(f'do = "walk"\nto = {to}\nspeed = 1.5\nease = {ease!r}\nstop = {stop!r}')
    x, y, _ = person.course(np.arange(0.0, person.end + 0.1, 0.01))
    assert (np.hypot(np.diff(x), np.diff(y)) / 0.01).max() <= 1.5 * (1.0 + 1e-6)


@pytest.mark.parametrize("height", [1.5, 1.75, 1.9])
def test_people_hurry_at_two_and_a_half_metres_a_second_on_their_own_feet(height: float) -> None:
    text = f'[[person]]\nname = "A"\nstart = [5.0, 0.0]\nheading = 180.0\nheight = {height!r}\n'
    person = parse_story(text + '[[person.step]]\ndo = "walk"\nto = [-3.0, 0.0]\nspeed = 2.5').people[0]
    times = np.arange(0.0, person.end + 0.5, DT)
    ends = person.poses_at(times).ends
    assert person.course.speed(0.5 * person.end) == pytest.approx(2.5, abs=1e-9)
    for leg in (5, 11):  # shank and foot hang together at the ankle: the legs are long enough
        ankle, heel, toe = ends[:, leg + 1, 0], ends[:, leg + 2, 0], ends[:, leg + 2, 1]
        assert np.ptp(np.linalg.norm(ankle - heel, axis=1)) < 1e-9
        assert np.ptp(np.linalg.norm(ankle - toe, axis=1)) < 1e-9


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ([reach(), STUMBLE], r"both hands free"),
        ([reach('late = 2.0\nprofile = "minimum-jerk"')], r"late"),
        ([reach('profile = "fast"')], r"profile"),
        ([STUMBLE.replace("45.0", "80.0")], r"lean"),
        ([walk(2.6)], r"speed"),
    ],
)
def test_what_is_wrong_is_named(steps: list[str], message: str) -> None:
    with pytest.raises(StoryError, match=message):
        actor(*steps, start="[0.9, 0.1]" if "reach" in steps[0] else "[3.0, 0.0]")
