"""Poses of many times at once are the poses of each time."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.people.anatomy import HEIGHTS, Body
from qpsafe.sim.people.choreography import Choreography
from qpsafe.sim.people.person import Board, Person
from qpsafe.sim.people.posture import Arm, Posture, Postures, Stoop
from qpsafe.sim.stories.file import load_story

STORY = load_story("examples/two_people.toml")
MOVERS = {"choreography": Choreography(), "reaches": STORY.people[0], "puts a board down": STORY.people[1]}


@pytest.mark.parametrize("name", MOVERS)
@given(st.lists(st.floats(-1.0, 30.0), min_size=1, max_size=30))
@settings(max_examples=some(4, of=10), deadline=None)
def test_many_times_at_once_are_each_time_alone_in_any_order(name: str, times: list[float]) -> None:
    mover = MOVERS[name]
    poses = mover.poses_at(np.array(times))
    for k, time in enumerate(times):
        one = mover.pose(time)
        assert np.array_equal(poses[k].ends, one.ends)
        assert np.array_equal(poses.hands[k], one.hands)
        if one.board_position is not None:
            assert np.array_equal(poses[k].board_face, one.board_face)
            assert poses.boards[k, :3, 3] == pytest.approx(one.board_position, abs=1e-15)
            half = 0.5 * mover.person.board.thickness * poses.boards[k, :3, 0]
            assert poses.boards[k, :3, 3] + half == pytest.approx(one.board_face, abs=1e-12)
            w, x, y, z = one.board_quaternion
            assert (x, y) == (0.0, 0.0)
            assert poses.boards[k, :3, 0] == pytest.approx((1 - 2 * z * z, 2 * w * z, 0.0), abs=1e-12)


def test_ticks_are_read_in_any_order() -> None:
    ahead, dt = PosesAhead(STORY.people, 0.004), 0.004
    for tick in (0, 1, 249, 250, 600, 3, 1999):
        for pose, again in zip(ahead(tick), STORY.poses(tick * dt), strict=True):
            assert np.array_equal(pose.ends, again.ends)


def test_one_posture_for_all_times_is_that_posture_each_time() -> None:
    person = Person(-0.4, Board(), Body.of_height(HEIGHTS["women"][0]))
    posture = Posture((Arm(goal=(0.4, 0.2, 1.0), share=0.4, lift=0.1), Arm("edge", "hang", 0.3)), Stoop(0.3, 0.1))
    roots = np.random.default_rng(0).uniform(-2.0, 2.0, (7, 3))
    poses = person.poses(roots, None, Postures.of(posture))
    for k, (x, y, heading) in enumerate(roots):
        assert np.array_equal(poses[k].ends, person.pose(x, y, heading, posture=posture).ends)


def test_tracks_are_the_poses_of_everybody() -> None:
    times = np.arange(0.0, 4.0, 0.02)
    tracks = STORY.track(times)
    assert tracks.dt == pytest.approx(0.02)
    assert tracks.names[:17] == tracks.names[17:]
    assert set(tracks.names) == {
        *("torso", "neck", "head", "pelvis", "shoulders", "thigh", "shank", "foot", "upper_arm", "forearm", "hand")
    }
    boards = [actor.person.board for actor in STORY.people if actor.person.board is not None]
    assert tracks.half_sizes.tolist() == [[0.5 * b.thickness, 0.5 * b.width, 0.5 * b.height] for b in boards]
    for k in (0, 100, 199):
        poses = STORY.poses(times[k])
        assert np.array_equal(tracks.ends[k], np.concatenate([pose.ends for pose in poses]))
        places = [pose.board_position for pose in poses if pose.board_position is not None]
        assert tracks.boards[k, :, :3, 3] == pytest.approx(np.array(places), abs=1e-15)
    radii = [segment.radius for actor in STORY.people for segment in actor.person.body.segments]
    assert tracks.radii.tolist() == radii
