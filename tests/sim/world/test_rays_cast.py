import math

import numpy as np
import pytest
from amounts import some
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from qpsafe.robot.loader import load_robot
from qpsafe.sim.people.person import SEGMENTS
from qpsafe.sim.world.rays import cast
from qpsafe.sim.world.scene import PERSON, build_scene

SCENE = build_scene(load_robot("irb140"))
DATA = SCENE.make_data()


def ray_box(origin, direction, half):
    """First crossing of a box's surface, by slabs; box frame."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = np.stack([(-half - origin) / direction, (half - origin) / direction])
    near, far = t.min(axis=0).max(), t.max(axis=0).min()
    if not near <= far or far < 0.0:
        return math.inf
    return near if near >= 0.0 else far


def ray_capsule(origin, direction, a, b, radius):
    """First crossing of a capsule's surface: side wall and two balls; origin outside."""
    hits = []
    axis = (b - a) / np.linalg.norm(b - a)
    across, offset = direction - (direction @ axis) * axis, (origin - a) - ((origin - a) @ axis) * axis
    p, q, c = across @ across, 2 * across @ offset, offset @ offset - radius**2
    if p > 1e-14 and q * q - 4 * p * c >= 0.0:
        t = (-q - math.sqrt(q * q - 4 * p * c)) / (2 * p)
        if t >= 0.0 and 0.0 <= (origin + t * direction - a) @ axis <= np.linalg.norm(b - a):
            hits.append(t)
    for centre in (a, b):
        w = origin - centre
        d = (w @ direction) ** 2 - (w @ w - radius**2)
        if d >= 0.0 and -w @ direction - math.sqrt(d) >= 0.0:
            hits.append(-w @ direction - math.sqrt(d))
    return min(hits, default=math.inf)


def expected(pose, origin, direction, cutoff):
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    to_board = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    half = SCENE.model.geom_size[SCENE.board_geom]
    hits = [ray_box(to_board @ (origin - pose.board_position), to_board @ direction, half)]
    hits += [ray_capsule(origin, direction, *pose.ends[i], seg.radius) for i, seg in enumerate(SEGMENTS)]
    return min(hits) if min(hits) <= cutoff else math.inf


def outside(pose, point):
    """Farther than 1 mm from everything."""
    for (a, b), segment in zip(pose.ends, SEGMENTS, strict=True):
        share = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        if np.linalg.norm(point - a - share * (b - a)) < segment.radius + 1e-3:
            return False
    return True


coordinate = st.floats(-2.0, 2.0)
point = st.tuples(coordinate, coordinate, st.floats(-0.5, 1.4)).map(np.array)


@settings(max_examples=some(42, of=250))
@given(coordinate, coordinate, st.floats(-math.pi, math.pi), point, point, st.floats(0.05, 6.0))
def test_rays_agree_with_geometry(x, y, heading, origin, target, cutoff):
    pose = SCENE.person.pose(x, y, heading)
    direction = target + np.array([x, y, 0.0]) - origin  # most of them towards the person
    assume(np.linalg.norm(direction) > 1e-2)
    assume(outside(pose, origin))
    direction /= np.linalg.norm(direction)
    SCENE.place_person(DATA, pose)
    got = cast(SCENE, DATA, origin[None], direction[None], cutoff, groups=(PERSON,))[0]
    wanted = expected(pose, origin, direction, cutoff)
    if math.isinf(wanted) != math.isinf(got):  # grazing or at the very cutoff: either answer is right
        nudge = np.array([3e-7, -2e-7, 1e-7])
        nearby = [
            expected(pose, origin, direction + sign * nudge, cutoff * (1 + reach))
            for sign in (1, -1)
            for reach in (1e-6, -1e-6)
        ]
        assert len({math.isinf(distance) for distance in nearby}) == 2
    else:
        assert got == pytest.approx(wanted, abs=1e-6)


def test_the_board_ahead_is_seen_at_its_distance_and_not_beyond_the_cutoff():
    SCENE.place_person(DATA, SCENE.person.pose(1.42, 0.0, math.pi))  # face at x = 1
    origins, ahead = np.tile([0.3, 0.0, 0.6], (3, 1)), np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0]])
    assert cast(SCENE, DATA, origins, ahead, 0.8, groups=(PERSON,)) == pytest.approx([0.7, np.inf, np.inf], abs=1e-12)
    assert np.isinf(cast(SCENE, DATA, origins, ahead, 0.699, groups=(PERSON,))).all()


def test_robot_floor_and_pedestal_are_seen_unless_left_out():
    SCENE.place_person(DATA, SCENE.person.pose(1.42, 0.0, math.pi))
    behind = np.array([[-1.0, 0.0, 0.45]])  # the robot's body stands between here and the board
    ahead, down = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, -1.0]])
    assert cast(SCENE, DATA, behind, ahead, 5.0, groups=(PERSON,)) == pytest.approx([2.0], abs=1e-12)
    (robot,) = cast(SCENE, DATA, behind, ahead, 5.0)
    assert 0.7 < robot < 1.2
    assert cast(SCENE, DATA, behind, down, 5.0) == pytest.approx([0.45 + SCENE.pedestal], abs=1e-12)
    assert cast(SCENE, DATA, behind * [0.3, 1.0, 1.0], down, 5.0) < 0.45 + 0.021  # the pedestal's top
    assert np.isinf(cast(SCENE, DATA, behind, down, 5.0, groups=(PERSON,))).all()


def test_the_length_of_a_direction_does_not_matter():
    SCENE.place_person(DATA, SCENE.person.pose(1.42, 0.0, math.pi))
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(30, 3)) * 0.2 + [1.0, 0.0, 0.0]
    origins = np.tile([0.2, 0.0, 0.6], (30, 1))
    one = cast(SCENE, DATA, origins, directions, 3.0)
    other = cast(SCENE, DATA, origins, directions * rng.uniform(0.01, 50.0, (30, 1)), 3.0)
    assert np.isfinite(one).sum() > 5
    assert one == pytest.approx(other, abs=1e-12)


def test_a_ray_that_is_none_is_unknown_and_spoils_no_other():
    SCENE.place_person(DATA, SCENE.person.pose(1.42, 0.0, math.pi))
    origins = np.tile([0.3, 0.0, 0.6], (4, 1))
    directions = np.tile([1.0, 0.0, 0.0], (4, 1))
    origins[0, 1], directions[1, 2], directions[2] = np.nan, np.inf, 0.0
    got = cast(SCENE, DATA, origins, directions, 0.8, groups=(PERSON,))
    assert np.isnan(got[:3]).all()
    assert got[3] == pytest.approx(0.7)


def test_no_rays_no_distances():
    assert cast(SCENE, DATA, np.empty((0, 3)), np.empty((0, 3)), 1.0).shape == (0,)
