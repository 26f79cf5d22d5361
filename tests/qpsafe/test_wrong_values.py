"""Whatever a constructor is given: it makes something that works, or says which argument is wrong."""

from __future__ import annotations

import inspect
from functools import cache
from typing import Any

import numpy as np
import pytest
from amounts import some, thinned

import qpsafe
from qpsafe.plugins.monitor import DangerMonitor
from qpsafe.plugins.rows import BoxRows, ClikRows, DangerRows, EvasiveRows
from qpsafe.tasks.frame import FrameTask, RelativeFrameTask
from qpsafe.tasks.joint import JointTask, PostureTask
from qpsafe.tasks.moves import Arc, Dwell, JointMove, JointMoveOfFrame, Line
from qpsafe.tasks.program import Program
from qpsafe.tasks.timing import Rates, TimeLaw
from qpsafe.tasks.trajectory import FixedJoints
from qpsafe.text.given import number, numbers, parts, whole

ONE = np.ones(6)


class Odd:
    """Raises whatever is asked of it."""

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        raise RuntimeError("repr")

    def __array__(self, *args: Any, **kwargs: Any) -> Any:
        raise RuntimeError("array")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("eq")

    def __iter__(self) -> Any:
        raise RuntimeError("iter")


WRONG = (
    None, "x", "", b"x", [], (), {}, object(), Odd(), int, len, np.nan, np.inf, -np.inf, -1, -1.0, 0, 0.0, True, False,
    10**400, -(10**400), 1e300, 1e-300, 1e100, 1e-100, 1 + 1j, [None] * 6, ["1"] * 6, [[1.0, 2.0], [3.0]],
    [10**400] * 6, [1, 2],
    {1.0}, range(6), np.array(1.0), np.nan * ONE, np.inf * ONE, 1e300 * ONE, 1e-300 * ONE, 1e100 * ONE,
    1e-100 * ONE, ONE + 1j, ONE > 0.0,
    ONE.astype(object), np.array(["1"] * 6), np.zeros((6, 6)), np.ma.masked_all(6), np.ma.masked,
    np.ma.array(1e9 * ONE, mask=[1, 0, 0, 0, 0, 0]), [np.ma.masked_all(6)] * 6,
)  # fmt: skip


@cache
def robot() -> Any:
    return qpsafe.load_robot("irb140")


@cache
def right() -> dict[Any, dict[str, Any]]:
    """Arguments that every constructor takes."""
    home = robot().pose("tcp", robot().home)
    there = home.copy()
    there[0, 3] += 0.1
    here, joints = qpsafe.FixedPose(home), JointMove(robot().home, robot().home + 0.1, ONE, ONE, 10.0 * ONE)
    framed: dict[str, Any] = {"frame": "tcp", "trajectory": here}
    return {
        qpsafe.BatchController: {"controller": controller(), "n": 2},
        qpsafe.JointLimits: {"lower": -3 * ONE, "upper": 3 * ONE, "max_velocity": ONE, "max_acceleration": ONE},
        qpsafe.HierarchicalLaw: {},
        qpsafe.WeightedLaw: {},
        qpsafe.DangerField: {},
        qpsafe.DangerBarrier: {"delta_max": 12.0},
        qpsafe.Threshold: {"delta": 11.5, "epsilon": 0.15},
        qpsafe.Activation: {},
        qpsafe.Evasion: {"mass": 4.0, "damping": 20.0, "n": 6},
        qpsafe.RecoveryRules: {},
        qpsafe.FixedPose: {"pose": home},
        FixedJoints: {"position": robot().home},
        qpsafe.PositionTask: framed,
        qpsafe.OrientationTask: framed,
        FrameTask: framed,
        RelativeFrameTask: framed | {"base": "dh3"},
        JointTask: {"trajectory": FixedJoints(robot().home)},
        PostureTask: {"posture": robot().home},
        Line: {"start": home, "goal": there},
        Arc: {"start": home, "via": home[:3, 3] + [0.1, 0.1, 0.0], "goal": there},
        Dwell: {"pose": home, "duration": 1.0},
        JointMove: dict(zip(("start", "goal", "speed", "acceleration", "jerk"), (0 * ONE, *[ONE] * 4), strict=True)),
        JointMoveOfFrame: {"robot": robot(), "frame": "tcp", "move": joints},
        Rates: {"speed": 1.0, "acceleration": 1.0, "jerk": 1.0},
        TimeLaw: dict(zip(("start", "goal", "speed", "acceleration", "jerk"), (0 * ONE, *[ONE] * 4), strict=True)),
        Program: {"moves": [Line(home, there)]},
        DangerMonitor: {"robot": robot()},
        evasive_rows: {"danger": DangerMonitor(robot()), "cost": 0.03, "against": 1.0, "prefix": ""},
        danger_rows: {
            "danger": DangerMonitor(robot()), "delta_max": 12.0, "horizon": 0.2, "points": 3, "prefix": "",
        },
        box_rows: {"danger": DangerMonitor(robot()), "prefix": ""},
        clik_rows: {"task": qpsafe.PositionTask("tcp", here), "robot": robot(), "dt": 0.004, "prefix": ""},
    }  # fmt: skip


def evasive_rows(**given: Any) -> Any:
    EvasiveRows().set_up(**given)


def danger_rows(**given: Any) -> Any:
    DangerRows().set_up(**given)


def box_rows(**given: Any) -> Any:
    BoxRows().set_up(**given)


def clik_rows(**given: Any) -> Any:
    ClikRows().set_up(**given)


def controller(**parts: Any) -> qpsafe.SafetyController:
    here = qpsafe.FixedPose(robot().pose("tcp", robot().home))
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)]
    return qpsafe.SafetyController(robot(), **{"tasks": tasks} | parts)


#: What a controller calls a part of this kind.
PLACES = {
    qpsafe.JointLimits: "limits",
    qpsafe.HierarchicalLaw: "law",
    qpsafe.WeightedLaw: "law",
    qpsafe.DangerBarrier: "barrier",
    qpsafe.Activation: "activation",
    qpsafe.Evasion: "evasion",
    qpsafe.RecoveryRules: "recovery",
}


def use(part: Any) -> None:
    """Let a robot run with the part, near danger and after it; without a fault."""
    kind = type(part)
    if kind is qpsafe.BatchController:
        tick = part.step(np.tile(robot().home, (part.n, 1)), np.zeros((part.n, 6)), points=[[]] * part.n)
        assert "fault" not in [tick.STATUSES[code] for code in tick.status]
        return
    if isinstance(part, qpsafe.Task):
        running = controller(tasks=[part], activation=qpsafe.Activation((qpsafe.Threshold(11.5, 0.15),)))
    elif kind in PLACES:
        running = controller(**{PLACES[kind]: part})
    else:
        return
    q, near = robot().home, [robot().pose("tcp", robot().home)[:3, 3] + [0.15, 0.0, 0.0]]
    for k in range(some(15, of=60)):
        tick = running.step(q, np.zeros(6), points=near if 2 <= k < 6 else [])
        assert tick.status != "fault", tick.messages
        assert np.isfinite(tick.reference.qd).all()


def test_the_arguments_that_the_others_vary_are_right() -> None:
    for make, given in right().items():
        made = make(**given)
        use(made)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("number_of_kind", thinned(2, range(31)))
def test_a_constructor_makes_what_works_or_names_what_is_wrong(number_of_kind: int) -> None:
    make, given = list(right().items())[number_of_kind]
    keys = list(given) if not inspect.isclass(make) else list(inspect.signature(make).parameters)
    refused = 0
    for key in keys:
        for value in WRONG:
            try:
                made = make(**given | {key: value})
                use(made)
            except qpsafe.ConfigurationError as error:
                refused += error.key != ""
            except Exception as error:
                raise AssertionError(f"{make.__name__}({key}={type(value)}) raises {type(error)}: {error}") from error
    assert refused > 10 * len(keys)


def test_every_one_of_them_was_tried() -> None:
    assert len(right()) == 31


@pytest.mark.parametrize(
    "values", [(1.0, 2.0), [1, 2], np.array([1, 2]), np.array([1.0, 2.0], np.float32), range(1, 3)]
)
def test_numbers_come_as_an_array_of_ones_own(values: Any) -> None:
    found = numbers("Part", "key", values, "numbers", ndim=1)
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, [1.0, 2.0])
    found[:] = 0.0
    np.testing.assert_array_equal(np.asarray(values), [1, 2])


def test_masked_arrays_without_a_mask_are_numbers() -> None:
    np.testing.assert_array_equal(numbers("Part", "key", np.ma.array([1.0, 2.0]), "numbers"), [1.0, 2.0])


@pytest.mark.parametrize("ask", [numbers, number, whole, parts])
def test_what_is_refused_is_named(ask: Any) -> None:
    more = (0, 9) if ask is whole else ()
    with pytest.raises(qpsafe.ConfigurationError, match=r"Part: key = .*: expected this"):
        ask("Part", "key", Odd(), "this", *more)
