"""What must not change what counts, and what must change it in a known way."""

import re
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.danger.evasion import link_vectors, virtual_torque
from qpsafe.sensing.rules import SensingRules
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.sensing.velocity import STILL

RULES = SensingRules(self_detection=False)
FIELD = qpsafe.DangerField()
number = st.floats(-1.0, 1.0)
poses = st.lists(st.floats(-1.2, 1.2), min_size=6, max_size=6).map(np.array)
readings = st.lists(st.sampled_from([np.inf]) | st.floats(0.2, 0.8), min_size=20, max_size=20).map(np.array)


def cdf_n(robot: Any, q: np.ndarray, qd: np.ndarray, points: np.ndarray) -> float:
    return float(FIELD.value(points, robot.wire(q, qd)).max(initial=0.0))


def seen(robot: Any, q: np.ndarray, distances: np.ndarray, spots: Any = None, known: Any = ()) -> Any:
    spots = qpsafe.load_spots(robot) if spots is None else spots
    sensing = DistanceSensing(robot, spots, 0.004, RULES, known)
    return sensing.update(robot.at(q), robot.wire(q, np.zeros(6)), distances)


@settings(max_examples=some(8, of=20), deadline=None)
@given(poses, poses, readings, st.floats(-1.5, 1.5))
def test_turning_world_and_robot_together_changes_nothing(
    irb140: Any, q: np.ndarray, qd: np.ndarray, d: np.ndarray, angle: float
) -> None:
    """Joint 1 turns the robot about the vertical as a turned base would."""
    turned = q + angle * np.eye(6)[0]
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    here, there = seen(irb140, q, d), seen(irb140, turned, d)
    assert there.points == pytest.approx(here.points @ R.T, abs=1e-12)
    one, other = cdf_n(irb140, q, qd, here.points), cdf_n(irb140, turned, qd, there.points)
    assert other == pytest.approx(one, rel=1e-9)
    torques = []
    for pose, what in ((q, here), (turned, there)):
        vectors = FIELD.vectors(what.points, irb140.wire(pose, qd))
        torques.append(virtual_torque(irb140.at(pose), link_vectors(vectors, what.links, 6)))
    assert torques[1] == pytest.approx(torques[0], rel=1e-7, abs=1e-7)


@settings(max_examples=some(6, of=15), deadline=None)
@given(poses, readings, st.integers(0, 2**32 - 1))
def test_renumbering_spots_renumbers_points(irb140: Any, q: np.ndarray, d: np.ndarray, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(20)
    spots = qpsafe.load_spots(irb140)
    one, other = seen(irb140, q, d), seen(irb140, q, d[order], spots.subset(order))
    hit = order[np.isfinite(d[order])]
    place = np.cumsum(np.isfinite(d)) - 1
    assert np.array_equal(other.points, one.points[place[hit]])
    assert np.array_equal(other.links, one.links[place[hit]])


MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])
SIGNS = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])


@settings(max_examples=some(8, of=20), deadline=None)
@given(poses, poses, readings)
def test_a_mirrored_robot_sees_a_mirrored_world(irb140: Any, q: np.ndarray, qd: np.ndarray, d: np.ndarray) -> None:
    """Left and right exchanged: joints 1, 4, 6 turn the other way, every spot moves to the other side."""
    spots = qpsafe.load_spots(irb140)
    positions, directions = spots.positions.copy(), spots.directions.copy()
    for i, frame in enumerate(spots.frames):  # the same at every pose, so at zero
        T = np.linalg.inv(irb140.pose(frame, np.zeros(6))) @ MIRROR @ irb140.pose(frame, np.zeros(6))
        positions[i] = (T @ np.append(positions[i], 1.0))[:3]
        directions[i] = T[:3, :3] @ directions[i]
    mirrored = qpsafe.SpotArray(
        spots.names, spots.links, spots.frames, positions, directions, spots.range_min, spots.range_max
    )
    one, other = seen(irb140, q, d), seen(irb140, SIGNS * q, d, mirrored)
    assert other.points == pytest.approx(one.points @ MIRROR[:3, :3], abs=1e-9)
    dangers = cdf_n(irb140, q, qd, one.points), cdf_n(irb140, SIGNS * q, SIGNS * qd, other.points)
    assert dangers[1] == pytest.approx(dangers[0], rel=1e-6)


def test_other_units_in_the_robots_file_change_nothing(irb140: Any, tmp_path: Any) -> None:
    """The same robot written in millimetres and radians."""
    text = (irb140.folder / "robot.toml").read_text()
    text = text.replace('length = "m"', 'length = "mm"').replace('angle = "deg"', 'angle = "rad"')

    def scaled(factor: float, key: str, text: str) -> str:
        return re.sub(rf"(\b{key} = )(-?[\d.]+)", lambda m: f"{m[1]}{float(m[2]) * factor!r}", text)

    for key in ("theta", "alpha", "lower", "upper", "max_velocity", "max_acceleration"):
        text = scaled(np.pi / 180.0, key, text)
    for key in ("d", "a"):
        text = scaled(1000.0, key, text)
    for key, factor in (("home", np.pi / 180.0), ("offset", 1000.0)):
        text = re.sub(
            rf"({key} = )\[(.*?)\]", lambda m, f=factor: f"{m[1]}{[float(x) * f for x in m[2].split(',')]}", text
        )
    (tmp_path / "robot.toml").write_text(text)
    for name in ("robot.xml", "spots.toml"):
        (tmp_path / name).write_bytes((irb140.folder / name).read_bytes())
    other = qpsafe.load_robot(tmp_path)
    assert other.home == pytest.approx(irb140.home)
    d = np.linspace(0.2, 0.9, 20)
    one, two = seen(irb140, irb140.home, d), seen(other, other.home, d)
    assert two.points == pytest.approx(one.points, abs=1e-12)
    assert cdf_n(other, other.home, 0.1 * SIGNS, two.points) == pytest.approx(
        cdf_n(irb140, irb140.home, 0.1 * SIGNS, one.points), rel=1e-12
    )


@settings(max_examples=some(8, of=40), deadline=None)
@given(poses, poses, readings, st.integers(0, 19), st.floats(0.2, 0.8))
def test_one_more_thing_in_sight_never_lowers_the_danger(
    irb140: Any, q: np.ndarray, qd: np.ndarray, d: np.ndarray, spot: int, nearer: float
) -> None:
    d[spot] = np.inf
    more = d.copy()
    more[spot] = nearer
    one, other = seen(irb140, q, d), seen(irb140, q, more)
    assert len(other.points) == len(one.points) + 1
    assert cdf_n(irb140, q, qd, other.points) >= cdf_n(irb140, q, qd, one.points)


@settings(max_examples=some(10, of=25), deadline=None)
@given(poses, readings)
def test_a_known_obstacle_takes_points_away_and_adds_none(irb140: Any, q: np.ndarray, d: np.ndarray) -> None:
    known = [qpsafe.Obstacle.box("block", (0.8, 0.8, 0.8), (0.7, 0.0, 0.5))]
    every = {point.tobytes() for point in seen(irb140, q, d).points}
    assert {point.tobytes() for point in seen(irb140, q, d, known=known).points} <= every


def test_an_approaching_hand_is_more_dangerous_with_the_velocity_estimate_a_leaving_one_is_not_less(
    irb140: Any,
) -> None:
    q, rest = irb140.home, np.zeros(6)
    spots = qpsafe.load_spots(irb140)
    for speed in (-0.5, 0.5):
        sensing = DistanceSensing(irb140, spots, 0.004, SensingRules(velocities=True))
        for k in range(100):
            d = np.full(20, np.inf)
            d[19] = 0.5 + speed * 0.004 * k
            what = sensing.update(irb140.at(q), irb140.wire(q, rest), d)
        _, directions = spots.rays(irb140.at(q))
        expected = min(speed + STILL, 0.0) * directions[19]
        assert what.velocities[0] == pytest.approx(expected, abs=0.01)
        still, moving = (float(FIELD.value(what.points, irb140.wire(q, rest), v)[0]) for v in (None, what.velocities))
        assert moving > 1.2 * still if speed < 0.0 else moving == pytest.approx(still, abs=1e-9)


def test_the_robots_own_motion_is_no_approach(irb140: Any, by_hand: Any) -> None:
    """A spot that turns past a standing wall, square to it, sees it come nearer; the wall does not move."""
    sensing = DistanceSensing(irb140, by_hand, 0.004, SensingRules(velocities=True))
    wall = 1.1  # x [m]
    for k in range(150):
        q = irb140.home + 0.3 * 0.004 * k * np.array([0.0, 1.0, -1.0, 0.0, 0.0, 0.0])  # forwards, level
        state = irb140.at(q)
        origins, directions = sensing.spots.rays(state)
        d = np.full(20, np.inf)
        d[19] = (wall - origins[19, 0]) / directions[19, 0]
        seen_now = sensing.update(state, state.wire(np.zeros(6)), d)
    assert d[19] < 0.62
    assert np.linalg.norm(seen_now.velocities[0]) < 0.02


@pytest.mark.parametrize("slope", [-0.9, -0.4, 0.4, 0.9])
@pytest.mark.parametrize("turn", [-0.6, 0.6])
def test_a_slope_that_a_ray_sweeps_over_does_not_come(irb140: Any, by_hand: Any, slope: float, turn: float) -> None:
    """The base turns, and with it the ray over a standing wall that is not square to it: not an approach, ever."""
    sensing, found = DistanceSensing(irb140, by_hand, 0.004, SensingRules(velocities=True)), 0
    for k in range(150):
        q = irb140.home + turn * 0.004 * (k - 75) * np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        state = irb140.at(q)
        origins, directions = sensing.spots.rays(state)
        d, (x, y, _), (dx, dy, _) = np.full(20, np.inf), origins[19], directions[19]
        d[19] = (1.1 + slope * y - x) / (dx - slope * dy)  # x = 1.1 + slope y
        what = sensing.update(state, state.wire(np.zeros(6)), d)
        if len(what.points):
            found += 1
            assert np.isfinite(what.velocities).all()  # from the first sight on
            if abs(slope + dy / dx) < 0.9 * abs(1.0 - slope * dy / dx):  # up to 45° against the ray
                assert not what.velocities.any()
    assert found > 50


ROTATION = "[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]"
SPOT = '[[spot]]\nname = "a"\nlink = 6\nposition = [0.0, 0.2, 0.0]\n'


def load(robot: Any, folder: Any, text: str) -> Any:
    path = folder / "spots.toml"
    path.write_text('sensor = "Any"\nrange_min = 0.2\nrange_max = 0.8\nfield_of_view = 6.0\n' + text)
    return qpsafe.SpotArray.load(path, robot)


def test_rotation_default_frame_and_own_ranges(irb140: Any, tmp_path: Any) -> None:
    own = f"rotation = {ROTATION}\nrange_max = 1.5\nfield_of_view = 10.0\n"
    spots = load(irb140, tmp_path, SPOT + own + SPOT.replace('"a"', '"b"') + "direction = [0.0, 1.0, 0.0]\n")
    assert spots.frames == ("dh6", "dh6")
    assert spots.directions == pytest.approx(np.array([[0.0, 1.0, 0.0]] * 2))  # z of the rotation
    assert spots.range_max.tolist() == [1.5, 0.8]
    assert np.rad2deg(spots.field_of_view) == pytest.approx([10.0, 6.0])


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (SPOT + "rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]\n", "rotation"),
        (SPOT + "rotation = [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n", "rotation"),
        (SPOT + f"rotation = {ROTATION}\ndirection = [0.0, 1.0, 0.0]\n", "direction"),
        (SPOT + f"rotation = {ROTATION}\nfield_of_view = 91.0\n", "field_of_view"),
        (SPOT + f"rotation = {ROTATION}\nrange_min = 0.9\n", "range_min"),
        ((SPOT + f"rotation = {ROTATION}\n") * 2, "name"),
        (SPOT.replace("0.2, 0.0", "0.0, -0.01") + f"rotation = {ROTATION}\n", "position"),
        (SPOT.replace("link = 6", "link = 7") + f"rotation = {ROTATION}\n", "link"),
    ],
)
def test_mistakes_in_a_spot_are_named(irb140: Any, tmp_path: Any, text: str, key: str) -> None:
    with pytest.raises(qpsafe.RobotFileError) as caught:
        load(irb140, tmp_path, text)
    assert key in caught.value.key
    if key == "position":
        assert "inside" in caught.value.expected
