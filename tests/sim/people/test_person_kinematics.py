import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.sim.people.limbs import two_link
from qpsafe.sim.people.person import SEGMENTS, Board, Foot, Person

place = st.floats(-3.0, 3.0)
angle = st.floats(-math.pi, math.pi)
LENGTHS = np.array([s.length for s in SEGMENTS])
RADII = np.array([s.radius for s in SEGMENTS])


def turn_z(a: float) -> np.ndarray:
    return np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1.0]])


def axis_of(quaternion: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternion
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z])


def feet_around(x, y, heading, ahead, lift):
    left, right = Person().standing_feet(x, y, heading)
    dx, dy = ahead * math.cos(heading), ahead * math.sin(heading)
    return left._replace(x=left.x + dx, y=left.y + dy), right._replace(x=right.x - dx, y=right.y - dy, lift=lift)


@given(place, place, angle, st.floats(-0.28, 0.28), st.floats(0.0, 0.06))
def test_bones_never_stretch_and_nothing_sinks_into_the_floor(x, y, heading, ahead, lift):
    person = Person()
    pose = person.pose(x, y, heading, feet_around(x, y, heading, ahead, lift))
    assert np.linalg.norm(pose.ends[:, 1] - pose.ends[:, 0], axis=1) == pytest.approx(LENGTHS, abs=1e-12)
    assert (pose.ends[:, :, 2].min(axis=1) - RADII).min() >= person.floor - 1e-12


@given(place, place, angle, st.floats(-0.28, 0.28))
def test_capsule_poses_say_the_same_as_the_end_points(x, y, heading, ahead):
    pose = Person().pose(x, y, heading, feet_around(x, y, heading, ahead, 0.0))
    assert np.linalg.norm(pose.quaternions, axis=1) == pytest.approx(1.0, abs=1e-12)
    for i, quaternion in enumerate(pose.quaternions):
        half = LENGTHS[i] / 2 * axis_of(quaternion)
        assert pose.positions[i] - half == pytest.approx(pose.ends[i, 0], abs=1e-9)
        assert pose.positions[i] + half == pytest.approx(pose.ends[i, 1], abs=1e-9)


@given(place, place, angle, st.floats(-0.28, 0.28), st.floats(0.0, 0.06))
def test_the_person_moves_as_one_with_its_root(x, y, heading, ahead, lift):
    """Placing somewhere is placing at the origin, turned and shifted: nothing depends on where the world begins."""
    person = Person()
    here = person.pose(0.0, 0.0, 0.0, feet_around(0.0, 0.0, 0.0, ahead, lift))
    there = person.pose(x, y, heading, feet_around(x, y, heading, ahead, lift))
    shift, rotation = np.array([x, y, 0.0]), turn_z(heading)
    assert there.ends == pytest.approx(here.ends @ rotation.T + shift, abs=1e-9)
    assert there.board_position == pytest.approx(rotation @ here.board_position + shift, abs=1e-9)
    assert there.board_face == pytest.approx(rotation @ here.board_face + shift, abs=1e-9)


@given(place, place, angle, st.floats(-0.28, 0.28))
def test_hands_hold_the_edges_of_the_board(x, y, heading, ahead):
    person = Person()
    pose = person.pose(x, y, heading, feet_around(x, y, heading, ahead, 0.0))
    names = [s.name for s in SEGMENTS]
    half = np.array([person.board.thickness, person.board.width, person.board.height]) / 2
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger = pose.ends[names.index(f"{side}_hand"), 1]
        local = turn_z(heading).T @ (finger - pose.board_position)
        gap = np.linalg.norm(np.maximum(np.abs(local) - half, 0.0)) - RADII[names.index(f"{side}_hand")]
        assert gap <= 0.005  # the hand touches the board
        assert sign * local[1] > half[1] - 0.01  # ... at its own edge
        # shoulder, elbow, wrist and hand hang together
        wrist = pose.ends[names.index(f"{side}_hand"), 0]
        assert pose.ends[names.index(f"{side}_forearm"), 0] == pytest.approx(wrist, abs=1e-12)
        elbow = pose.ends[names.index(f"{side}_forearm"), 1]
        assert pose.ends[names.index(f"{side}_upper_arm"), 0] == pytest.approx(elbow, abs=1e-12)


def test_proportions_are_a_persons():
    person = Person(floor=0.0)
    pose = person.pose(0.0, 0.0, 0.0)
    assert len(SEGMENTS) == 17
    assert (pose.ends[:, :, 2].max(axis=1) + RADII).max() == pytest.approx(1.74, abs=0.03)
    assert (pose.ends[:, :, 2].min(axis=1) - RADII).min() == pytest.approx(0.0, abs=1e-12)  # stands on the floor
    knee = pose.ends[[s.name for s in SEGMENTS].index("left_shank"), 1]
    assert knee[0] > 0.0  # knees bend forwards


@given(angle, st.floats(0.2, 0.8), st.floats(0.8, 1.4))
def test_the_boards_face_is_its_reach_ahead(heading, reach, height):
    person = Person(floor=-0.5, board=Board(reach=reach, centre_height=height))
    pose = person.pose(1.0, 2.0, heading)
    forward = np.array([math.cos(heading), math.sin(heading), 0.0])
    assert pose.board_face - [1.0, 2.0, 0.0] == pytest.approx(reach * forward + [0, 0, height - 0.5], abs=1e-12)
    assert pose.board_face - pose.board_position == pytest.approx(0.003 * forward, abs=1e-12)


vector = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)


@given(vector, vector, st.floats(0.1, 1.0), st.floats(0.1, 1.0))
def test_two_link_reaches_what_is_in_reach_and_never_stretches(root, target, upper, lower):
    line = target - root
    bend = np.cross(line, [0.3, -0.5, 0.81])
    if np.linalg.norm(bend) < 1e-3:
        return
    middle, end = two_link(root[None], target[None], np.array([upper]), np.array([lower]), bend[None])
    assert np.linalg.norm(middle[0] - root) == pytest.approx(upper, abs=1e-7)
    assert np.linalg.norm(end[0] - middle[0]) == pytest.approx(lower, abs=1e-7)
    if abs(upper - lower) + 1e-6 < np.linalg.norm(line) < upper + lower:
        assert end[0] == pytest.approx(target, abs=1e-7)
    assert (middle[0] - root) @ bend >= -1e-9


def test_a_trailing_foot_rolls_over_toes_that_stay_where_they_are():
    person, names = Person(floor=0.0), [s.name for s in SEGMENTS]
    toes = []
    for root in np.linspace(0.0, 0.25, 6):  # the body walks on, the left foot stands
        feet = (Foot(0.0, 0.1, 0.0), Foot(root, -0.1, 0.0))
        toes.append(person.pose(root, 0.0, 0.0, feet).ends[names.index("left_foot")])
    toes = np.array(toes)
    assert np.ptp(toes[:, 1], axis=0) == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(toes[:, 0, 2]) >= 0.0).all()
    assert toes[-1, 0, 2] > 0.05  # the heel has left the floor
