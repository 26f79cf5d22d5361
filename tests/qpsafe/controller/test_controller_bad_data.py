"""Bad data never raises: it is reported by name, the robot brakes within its limits, holds, and goes on afterwards."""

import re
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from amounts import some, thinned
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import qpsafe

N, SPOTS = 6, 20
FAST = qpsafe.NullspaceLaw()  # the fastest law: here the law does not matter
CLEAR = np.full(SPOTS, np.inf)
USED = ("ok", "degraded")  # degraded: the law knew no limits and was clipped


class Raises:
    """Not what it looks like."""

    def __array__(self, *args: Any, **kwargs: Any) -> np.ndarray:
        raise RuntimeError("broken sensor driver")


def changed(size: int, value: Any) -> np.ndarray:
    """Good values but for one."""
    array = np.full(size, 0.3)
    array[2] = value
    return array


def wrong_for(size: int) -> dict[str, Any]:
    """What can never be `size` numbers."""
    good = np.full(size, 0.3)
    cycle: list[Any] = []
    cycle.append(cycle)
    return {
        "NaN": changed(size, np.nan),
        "all NaN": np.full(size, np.nan),
        "-inf": changed(size, -np.inf),
        "one too few": good[1:],
        "one too many": np.full(size + 1, 0.3),
        "a row": good[None, :],
        "a column": good[:, None],
        "a number": 0.3,
        "empty": [],
        "empty rows": np.zeros((0, size)),
        "text": "0.3",
        "list of text": ["0.3"] * size,
        "array of text": np.array(["0.3"] * size),
        "bytes": b"0.3",
        "object": object(),
        "objects": [object()] * size,
        "fractions": [Fraction(1, 3)] * size,
        "a None inside": [0.3] * (size - 1) + [None],
        "dict": dict.fromkeys(range(size), 0.3),
        "set": {0.3},
        "generator": (0.3 for _ in range(size)),
        "ragged": [[0.3], [0.3, 0.3]],
        "cycle": cycle,
        "complex list": [0.3 + 0j] * size,
        "complex array": good + 0j,
        "bool": np.ones(size, dtype=bool),
        "dates": np.array(["2020-01-01"] * size, dtype="datetime64[D]"),
        "records": np.zeros(size, dtype=[("value", float)]),
        "masked": np.ma.array(good, mask=[i == 2 for i in range(size)]),
        "all masked": np.ma.masked_all(size),
        "huge whole number": [10**400] * size,
        "raises": Raises(),
        "a class": np.ndarray,
        "a function": len,
    }


JOINTS = {
    **wrong_for(N),
    "+inf": changed(N, np.inf),
    "None": None,
    "1e300": changed(N, 1e300),
    "-1e300": changed(N, -1e300),
    "largest float": np.full(N, np.finfo(float).max),
    "long double": np.full(N, np.finfo(np.longdouble).max),
    "degrees": np.array([180.0, 60.0, 45.0, 180.0, 90.0, 360.0]),
}
SICK = {  # one spot, which is not enough to stop
    "NaN": changed(SPOTS, np.nan),
    "-inf": changed(SPOTS, -np.inf),
    "below zero": changed(SPOTS, -1e-9),
    "-1e300": changed(SPOTS, -1e300),
}
ALL_SICK = {
    "all NaN": np.full(SPOTS, np.nan),
    "all below zero": np.full(SPOTS, -0.5),
    "five of twenty NaN": np.where(np.arange(SPOTS) % 4 == 0, np.nan, np.inf),
}
DISTANCES = {
    **{key: value for key, value in wrong_for(SPOTS).items() if key not in SICK | ALL_SICK},
    "joint values": np.zeros(N),
    "planar points": np.zeros((4, 2)),
}
POINTS = {
    key: value for key, value in wrong_for(3).items() if key not in ("empty", "empty rows", "a row", "one too few")
} | {
    "planar": np.zeros((4, 2)),
    "homogeneous": np.ones((4, 4)),
    "a point that is NaN": [[0.5, 0.0, 0.5], [0.5, np.nan, 0.5]],
    "a point at infinity": [[0.5, 0.0, np.inf]],
    "three-dimensional": np.zeros((1, 2, 3)),
    "no coordinates": [[]],
    "largest float": np.full((2, 3), -np.finfo(float).max),
}


SHAPE_OR_KIND = "shape|not finite|too far outside|not an array|masked"


def cases() -> list[Any]:
    found = []
    for argument, table, words in (
        ("q", JOINTS, SHAPE_OR_KIND),
        ("qd", JOINTS, SHAPE_OR_KIND),
        ("distances", DISTANCES, SHAPE_OR_KIND),
        ("distances", ALL_SICK, "of 20 spots are out of order"),
        ("points", POINTS, SHAPE_OR_KIND),
    ):
        found += [pytest.param(argument, value, words, id=f"{argument}: {key}") for key, value in table.items()]
    found += [
        pytest.param("both", None, "both distances and points", id="both"),
        pytest.param("neither", None, "neither distances nor points", id="neither"),
    ]
    return found


def arguments(argument: str, value: Any, q: np.ndarray, qd: np.ndarray) -> dict[str, Any]:
    """Arguments of `step` of which one is wrong."""
    data: dict[str, Any] = {"q": q, "qd": qd}
    if argument == "both":
        return data | {"distances": CLEAR, "points": np.zeros((0, 3))}
    if argument == "neither":
        return data
    return data | ({} if argument in ("distances", "points") else {"distances": CLEAR}) | {argument: value}


@pytest.mark.parametrize(("argument", "value", "words"), thinned(2, cases()))
def test_reported_braked_held_and_resumed(run: Any, argument: str, value: Any, words: str) -> None:
    loop = run(FAST)
    loop.stir(12)
    moving = arguments(argument, value, loop.q, loop.qd)
    q, qd = moving.pop("q"), moving.pop("qd")
    tick = loop.settle(18, q, qd, **moving)

    assert tick.status == "bad_input"
    (message,) = tick.messages
    prefix = argument if argument not in ("both", "neither") and "out of order" not in words else ""
    # a point so far away that squares overflow is found by its danger
    far = argument == "points" and "danger of a detected point is not finite" in message
    assert far or re.match(rf"^{prefix}\b.*({words})", message), message
    assert message in str(tick)
    assert tick.regime == "unknown"
    assert np.isnan(tick.cdf_n)
    assert tick.law is None

    resumed = loop.step()  # good data again: limits are watched by `loop`
    assert resumed.status in USED
    assert resumed.regime == "low"
    for _ in range(6):
        loop.step()
    assert np.abs(loop.qd).max() > 0.0  # it moves: back to where the point drove it from


@pytest.mark.parametrize(("argument", "value", "words"), thinned(2, cases()))
def test_reported_in_the_very_first_tick(run: Any, argument: str, value: Any, words: str) -> None:
    loop = run(FAST)
    measured = loop.robot.home + 0.1
    data = arguments(argument, value, measured, np.zeros(N))
    for _ in range(2):
        tick = loop.controller.step(**data)
        assert tick.status == "bad_input"
        # q is the one that tells where the robot is
        assert tick.reference.active == (argument not in ("q", "qd"))
        expected = measured if tick.reference.active else loop.robot.home
        assert np.array_equal(tick.reference.q, expected)
        assert not tick.reference.qd.any()
    tick = loop.controller.step(measured, np.zeros(N), CLEAR)
    assert tick.status in USED
    assert tick.reference.active
    most = loop.robot.max_acceleration * loop.controller.dt
    assert (np.abs(tick.reference.qd) <= most + 1e-9).all()
    assert tick.reference.q == pytest.approx(measured + tick.reference.qd * loop.controller.dt, abs=1e-15)


HOME, REST = [0.0, 0.2, 0.2, 0.0, 1.0, 0.0], [0.0] * N
UNUSUAL = {
    "lists": (HOME, REST, list(CLEAR)),
    "tuples": (tuple(HOME), tuple(REST), tuple(CLEAR)),
    "whole numbers": (np.zeros(N, dtype=np.int8), np.zeros(N, dtype=np.uint64), np.full(SPOTS, 3, dtype=np.int16)),
    "half precision": tuple(np.array(v, dtype=np.float16) for v in (HOME, REST, CLEAR)),
    "single precision": tuple(np.array(v, dtype=np.float32) for v in (HOME, REST, CLEAR)),
    "long double": tuple(np.array(v, dtype=np.longdouble) for v in (HOME, REST, CLEAR)),
    "big endian": tuple(np.array(v, dtype=">f8") for v in (HOME, REST, CLEAR)),
    "every other one": tuple(np.repeat(v, 2)[::2] for v in (HOME, REST, CLEAR)),
    "backwards": tuple(np.array(v[::-1])[::-1] for v in (HOME, REST, CLEAR)),
    "column of a matrix": tuple(np.tile(v, (3, 1)).T[:, 1] for v in (HOME, REST, CLEAR)),
    "masked, nothing hidden": tuple(np.ma.array(v) for v in (HOME, REST, CLEAR)),
    "far distances": (HOME, REST, np.full(SPOTS, 1e300)),
    "minus zero": (HOME, [-0.0] * N, CLEAR),
    "points in place of distances": (HOME, REST, np.array([[5.0, 0.0, 0.5]])),
    "no points in place of distances": (HOME, REST, np.zeros((0, 3))),
    "points by column": (HOME, REST, np.asfortranarray([[5.0, 0.0, 0.5], [6.0, 0.0, 0.5]])),
    "whole-numbered points": (HOME, REST, [[5, 0, 1]]),
    "a far point": (HOME, REST, [[1e100, 0.0, 0.0]]),
}


@pytest.mark.parametrize("key", UNUSUAL)
def test_numbers_are_numbers_however_they_are_kept(run: Any, key: str) -> None:
    q, qd, distances = UNUSUAL[key]
    plain = [np.array(value, dtype=float) for value in (q, qd, distances)]
    before = [np.array(value, copy=True) for value in (q, qd, distances)]
    odd, even = run(FAST, q=plain[0]), run(FAST, q=plain[0])
    tick = odd.feed(q, qd, distances)
    assert tick.status in USED, tick
    assert np.array_equal(tick.reference.qd, even.feed(*plain).reference.qd)
    for value, old in zip((q, qd, distances), before, strict=True):
        assert np.array_equal(value, old)  # the caller's data are left alone


def test_an_empty_list_of_points_says_nothing_is_in_sight(run: Any) -> None:
    tick = run(FAST).step(points=[])
    assert (tick.status, tick.cdf_n, tick.points.shape) == ("ok", 0.0, (0, 3))


@pytest.mark.parametrize("size", [1e7, 1e20, 1e155, 1e200, 1e300])
def test_a_point_out_of_this_world_is_no_danger_or_reported(run: Any, size: float) -> None:
    tick = run(FAST).step([[size, -size, size]])
    assert tick.status == "bad_input" or tick.cdf_n < 1e-5


def test_the_message_names_joint_and_spot(run: Any, irb140: Any) -> None:
    loop = run(FAST)
    wrong = loop.q.copy()
    wrong[1] = 99.0
    assert "joint_2 = 99" in loop.feed(wrong, loop.qd, CLEAR).messages[0]
    distances = CLEAR.copy()
    distances[4], distances[7] = -0.5, np.nan
    messages = loop.feed(loop.q, loop.qd, distances).messages
    names = qpsafe.load_spots(irb140).names
    assert any("below zero" in message and message.endswith(names[4]) for message in messages)
    assert any("not a number" in message and message.endswith(names[7]) for message in messages)
    assert "number 1" in loop.feed(loop.q, loop.qd, points=[[0, 0, 2], [0, 0, np.inf]]).messages[0]


@pytest.mark.parametrize("key", SICK)
def test_one_sick_spot_is_named_and_does_not_stop_the_robot(run: Any, irb140: Any, key: str) -> None:
    loop = run(FAST)
    loop.stir(12)
    distances = np.full(SPOTS, np.inf)
    distances[2] = SICK[key][2]
    for _ in range(40):  # watched
        tick = loop.feed(loop.q, loop.qd, distances)
        assert tick.status == "degraded"
        assert tick.unseen == (qpsafe.load_spots(irb140).names[2],)
        assert np.isfinite(tick.cdf_n)
    assert tick.severity == "capped"
    assert np.abs(loop.qd).max() > 0.0


def test_a_robot_without_spots_says_so(run: Any, irb140: Any) -> None:
    bare = irb140.with_spots(None)
    tasks = run(FAST).tasks
    controller = qpsafe.SafetyController(bare, tasks)
    assert controller.spots is None
    assert controller.step(bare.home, np.zeros(N), points=[]).status == "ok"
    assert controller.step(bare.home, np.zeros(N), CLEAR).messages == (
        "distances are given but the robot has no spots",
    )


def test_a_glitch_does_not_linger(run: Any) -> None:
    """What a bad tick left behind in filter, hold and clocks fades: an hour's outage weighs no more than the pose."""
    glitched, clean = run(FAST), run(FAST)
    for loop in (glitched, clean):
        loop.stir(20)
    assert np.abs(glitched.controller.evasion.velocity).max() > 0.1
    glitched.settle(1500, np.full(N, np.nan), REST, CLEAR)
    assert np.abs(glitched.controller.evasion.velocity).max() < 1e-9
    path_time = glitched.controller.recovery.path_time
    assert path_time == clean.controller.recovery.path_time  # the path waited


def test_overflow_is_kept_out_of_the_filter(run: Any) -> None:
    """A field with next to no floor: each danger is finite, their sum is not."""
    loop = run(FAST, field=qpsafe.DangerField(floor=1e-300))
    on_the_wire = np.tile(loop.robot.wire(loop.q, loop.qd).ends[4], (12, 1))
    for _ in range(3):
        tick = loop.step(on_the_wire)
        assert tick.status in ("bad_input", "fault", "ok", "degraded")
        assert np.isfinite(loop.controller.evasion.velocity).all()
    for _ in range(30):
        loop.step()  # watched


numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)
shapes = st.sampled_from([(N,), (SPOTS,), (1, 3), (4, 3), (0, 3), (), (0,), (N, 1), (3, N)])
dtypes = st.sampled_from([np.float64, np.float32, np.int32, np.complex128, np.bool_, "U3", object])
arrays = dtypes.flatmap(lambda dtype: hnp.arrays(dtype, shapes) if dtype is not object else st.none())
plausible = hnp.arrays(np.float64, (N,), elements=st.floats(-4.0, 4.0))
anything = st.one_of(
    arrays,
    plausible,
    hnp.arrays(np.float64, (N,), elements=numbers),
    hnp.arrays(np.float64, (SPOTS,), elements=numbers),
    hnp.arrays(np.float64, (SPOTS,), elements=st.floats(0.0, 1.0)),
    hnp.arrays(np.float64, (2, 3), elements=numbers),
    hnp.arrays(np.float64, (5, 3), elements=st.floats(-1.0, 1.0)),
    st.recursive(st.none() | st.text(max_size=2) | numbers | st.integers(), lambda x: st.lists(x, max_size=6)),
)


@settings(max_examples=some(10, of=60), deadline=None)
@given(st.lists(st.tuples(anything, anything, anything, st.none() | anything), min_size=1, max_size=6), st.booleans())
def test_anything_at_all(run: Any, data: list[tuple[Any, Any, Any, Any]], stirred: bool) -> None:
    loop = run(FAST)
    if stirred:
        loop.stir(12)
    for q, qd, distances, points in data:
        tick = loop.feed(q, qd, distances, points=points)
        assert tick.messages or tick.status == "ok"
        assert str(tick)
        loop.feed(loop.q, loop.qd, distances, points=points)
    assert loop.step().status in USED


BAD = [
    lambda q, qd, p: (np.full(N, np.nan), qd, p),
    lambda q, qd, p: (q, None, p),
    lambda q, qd, p: (q, qd, np.full(SPOTS, np.nan)),
    lambda q, qd, p: (q[:-1], qd, p),
    lambda q, qd, p: (q, qd, None),
    lambda q, qd, p: (q * 1e300, qd, p),
    lambda q, qd, p: (q, qd, -np.ones(SPOTS)),
    lambda q, qd, p: (q, qd, [[np.inf, 0.0, 0.0]]),
]


@pytest.mark.parametrize(
    ("law", "seed", "share"),
    [
        (qpsafe.HierarchicalLaw(), 0, 0.2),
        (FAST, 1, 0.5),
        (FAST, 2, 0.9),
        (FAST, 3, 0.05),
        (qpsafe.WeightedLaw(), 4, 0.3),
    ],
)
def test_good_and_bad_ticks_in_any_order(run: Any, law: Any, seed: int, share: float) -> None:
    """A point swings in front of the tool, near and far, while a share of the data is bad, singly or in bursts."""
    rng = np.random.default_rng(seed)
    loop = run(law)
    tip = loop.robot.pose("tcp", loop.robot.home)[:3, 3]
    statuses: dict[str, int] = {}
    regimes = set()
    burst = 0
    for k in range(350):
        angle = np.sin(0.02 * k)
        radius = 0.6 + 0.5 * np.cos(0.04 * k)
        point = tip + radius * np.array([np.cos(angle), np.sin(angle), 0.3 * np.sin(3 * angle)])
        if burst == 0 and rng.random() < share:
            burst = int(rng.integers(1, 6))
        if burst > 0:
            burst -= 1
            tick = loop.feed(*BAD[rng.integers(len(BAD))](loop.q, loop.qd, point[None]))
            assert tick.status == "bad_input"
        else:
            tick = loop.step(point[None])
            assert tick.status in USED
        statuses[tick.status] = statuses.get(tick.status, 0) + 1
        regimes.add(tick.regime)
    assert regimes == {"low", "medium", "high", "unknown"}
