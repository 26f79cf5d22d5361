"""Every public parameter of every part either takes effect from the next tick on, or refuses to be changed.

Parts and parameters are found by reflection: what is added later is held to the same. What a part remembers (`STATE`)
is no parameter.
"""

import copy
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from amounts import some

import qpsafe
from qpsafe.laws.problem import LawProblem, LawResult
from qpsafe.recovery.returning import Returns
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.tasks.frame import FrameTask, RelativeFrameTask
from qpsafe.tasks.joint import JointTask, PostureTask
from qpsafe.tasks.moves import Arc, Dwell, JointMove, JointMoveOfFrame, Line
from qpsafe.tasks.program import Program
from qpsafe.tasks.timing import Rates, TimeLaw
from qpsafe.tasks.trajectory import FixedJoints

ROBOT = qpsafe.load_robot("irb140")
N, DT = ROBOT.nq, 0.004
HOME = ROBOT.pose("tcp", ROBOT.home)
ONE = np.ones(N)


def shifted(*shift: float) -> np.ndarray:
    pose = HOME.copy()
    pose[:3, 3] += shift
    return pose


def parts() -> dict[str, Any]:
    """One of every kind of part."""
    here, move = qpsafe.FixedPose(HOME), JointMove(ROBOT.home, ROBOT.home + 0.1, ONE, ONE, 10.0 * ONE)
    line = Line(HOME, shifted(0.1, 0.0, 0.0))
    spots = qpsafe.load_spots(ROBOT)
    assert spots is not None
    controller = qpsafe.SafetyController(ROBOT, [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)])
    assert controller.sensing is not None
    return {
        "controller": controller,
        "robot": ROBOT.with_spots("spots.toml"),
        "limits": qpsafe.JointLimits(-ONE, ONE, ONE, ONE, DT, max_jerk=ONE),
        "hierarchical law": qpsafe.HierarchicalLaw(),
        "weighted law": qpsafe.WeightedLaw(weights=(1.0, 2.0, 3.0)),
        "field": qpsafe.DangerField(),
        "threshold": qpsafe.Threshold(11.5, 0.15),
        "activation": qpsafe.Activation(),
        "evasion": qpsafe.Evasion(4.0, 20.0, N),
        "barrier": qpsafe.DangerBarrier(12.0),
        "sensing rules": qpsafe.SensingRules(),
        "recovery rules": qpsafe.RecoveryRules(),
        "spots": spots,
        "sensing": controller.sensing,
        "health": controller.sensing.health,
        "recovery": controller.recovery,
        "position": qpsafe.PositionTask("tcp", here),
        "orientation": qpsafe.OrientationTask("tcp", here),
        "frame": FrameTask("tcp", here, rows=(0, 4)),
        "relative": RelativeFrameTask("tcp", "dh3", here),
        "joint": JointTask(FixedJoints(ROBOT.home), joints=(0, 2)),
        "posture": PostureTask(ROBOT.home),
        "fixed pose": here,
        "fixed joints": FixedJoints(ROBOT.home),
        "line": line,
        "arc": Arc(HOME, HOME[:3, 3] + [0.1, 0.1, 0.0], shifted(0.2, 0.0, 0.0)),
        "dwell": Dwell(HOME, 1.0),
        "joint move": move,
        "joint move of a frame": JointMoveOfFrame(ROBOT, "tcp", move),
        "program": Program([line, Dwell(line.goal, 0.1)], [(1, "grip")]),
        "time law": TimeLaw([0.0], [1.0], [1.0], [1.0], [1.0]),
        "rates": Rates(1.0, 1.0, 1.0),
    }


#: What parts remember, and what only the controller sets.
STATE = {
    "evasion": {"velocity"},
    "sensing": {"memory", "counted", "unseen", "health", "fresh"},
    "health": {"counts", "seen", "dead", "codes", "stopped", "severity", "too_many", "out_of_order"},
    "recovery": {"clocks", "path_time", "paused", "phase", "on_path", "waits_for", "suspend_above", "tasks"},
    "controller": {"sensing", "recovery", "evasion"},
}
#: Exchanged by assignment; the test below shows that they take effect.
EXCHANGED = {
    "controller": {"law", "field", "activation", "evasion", "limits", "barrier", "clearance", "separation", "gate"}
}
#: Read at every tick, and nowhere else.
LIVE = {kind: {"name", "essential"} for kind in ("position", "orientation", "frame", "relative")}
LIVE |= {kind: {"name", "essential", "frames"} for kind in ("joint", "posture")}  # they have no frames
#: The library below.
FOREIGN = {"robot": {"model"}}


def parameters(kind: str, part: Any) -> Iterator[str]:
    for key in dir(part):
        if key.startswith("_") or key == "fixed" or callable(getattr(part, key)):
            continue
        if key not in STATE.get(kind, set()) | LIVE.get(kind, set()) | FOREIGN.get(kind, set()):
            yield key


def containers(value: Any, deep: int = 0) -> Iterator[Any]:
    """Everything in a value that could be written into."""
    if isinstance(value, np.ndarray | list | dict | set | bytearray):
        yield value
    if isinstance(value, tuple | list) and deep < 4:
        for item in value:
            yield from containers(item, deep + 1)


@pytest.mark.parametrize("kind", parts())
def test_a_parameter_refuses_to_be_changed(kind: str) -> None:
    """By assignment, by deletion and in place; also on copies, which numpy makes writable. All keep their values."""
    part = parts()[kind]
    copies = [] if kind == "controller" else [copy.copy(part), copy.deepcopy(part)] if kind != "robot" else []
    if kind in ("limits", "activation", "barrier", "fixed pose", "position", "spots", "hierarchical law"):
        copies.append(pickle.loads(pickle.dumps(part)))
    for one in (part, *copies):
        found = list(parameters(kind, one))
        assert found
        for key in found:
            value = getattr(one, key)
            if key not in EXCHANGED.get(kind, set()):
                with pytest.raises((AttributeError, qpsafe.ConfigurationError), match=key):
                    setattr(one, key, value)
                with pytest.raises((AttributeError, qpsafe.ConfigurationError), match=key):
                    delattr(one, key)
            for container in containers(value):
                assert isinstance(container, np.ndarray), (kind, key, "is a list or the like")
                if container.size and (one is part or kind in ("limits", "fixed pose")):
                    assert not container.flags.writeable, (kind, key)


def test_what_is_exempt_is_there() -> None:
    made = parts()
    for table in (STATE, EXCHANGED, LIVE, FOREIGN):
        for kind, keys in table.items():
            assert all(hasattr(made[kind], key) for key in keys), kind


@pytest.mark.parametrize("kind", ["hierarchical law", "position", "limits", "activation", "barrier", "line"])
def test_a_method_is_not_replaced_on_one_object(kind: str) -> None:
    """Compiled code would not call it."""
    part = parts()[kind]
    methods = [key for key in dir(part) if not key.startswith("_") and key != "of" and callable(getattr(part, key))]
    methods.remove("name") if "name" in methods else None
    assert methods
    for key in methods:
        with pytest.raises(qpsafe.ConfigurationError, match="derive"):
            setattr(part, key, lambda *args: None)


def test_a_part_keeps_nothing_of_the_callers_arrays() -> None:
    """What somebody gave can be changed afterwards, and changes nothing."""
    mine = [ONE.copy() for _ in range(4)]
    limits = qpsafe.JointLimits(-mine[0], mine[1], mine[2], mine[3])
    matrices = np.diag(ONE), np.diag(ONE)
    evasion = qpsafe.Evasion(*matrices, N)
    spots = qpsafe.load_spots(ROBOT)
    assert spots is not None
    positions = np.array(spots.positions)
    fields = {key: getattr(spots, key) for key in ("names", "links", "frames", "directions", "range_min", "range_max")}
    own = qpsafe.SpotArray(positions=positions, **fields)
    for array in (*mine, *matrices, positions):
        array *= 9.0
    assert np.array_equal(limits.upper, ONE)
    assert np.array_equal(limits.max_velocity, ONE)
    assert np.array_equal(evasion.mass, np.eye(N))
    assert np.array_equal(own.positions, spots.positions)


class OwnField(qpsafe.DangerField):
    """Of another class, so it takes the general way."""


class Lazy:
    """A law of one's own."""

    def solve(self, problem: LawProblem) -> LawResult:
        return LawResult(0.5 * problem.qd0)


def slower(share: float, **more: Any) -> qpsafe.JointLimits:
    return qpsafe.JointLimits(
        ROBOT.lower, ROBOT.upper, share * ROBOT.max_velocity, share * ROBOT.max_acceleration, **more
    )


THRESHOLDS = (qpsafe.Threshold(16.0, 0.1), qpsafe.Threshold(6.0, 0.2))
WEAK = qpsafe.DangerField(kinetic=0.2)
EXCHANGES: dict[str, list[dict[str, Any]]] = {
    "law": [
        {"law": law}
        for law in (
            qpsafe.HierarchicalLaw("paper"),
            qpsafe.HierarchicalLaw(damping=0.3),
            qpsafe.HierarchicalLaw(solver="daqp"),
            qpsafe.WeightedLaw(5.0),
            qpsafe.NullspaceLaw(),
            Lazy(),
        )
    ],
    "limits": [
        {"limits": limits}
        for limits in (
            slower(0.1),
            slower(0.3, max_jerk=50.0 * ONE),
            slower(0.9, return_speed=0.01),
            "off",
            slower(2.0),
        )
    ],
    "field": [{"field": field} for field in (WEAK, qpsafe.DangerField(static=0.3), OwnField(gamma=1.5))],
    "activation": [{"activation": qpsafe.Activation(THRESHOLDS)}],
    "evasion": [{"evasion": qpsafe.Evasion(mass, damping, N)} for mass, damping in ((0.5, 20.0), (4.0, 60.0 * ONE))],
    "barrier": [{"barrier": qpsafe.DangerBarrier(11.0)}],
    "several": [
        {"field": WEAK, "barrier": qpsafe.DangerBarrier(9.0, field=WEAK), "limits": slower(0.2)},
        {"law": qpsafe.WeightedLaw(9.0), "activation": qpsafe.Activation(THRESHOLDS), "limits": slower(0.5)},
    ],
}


def made(**changes: Any) -> qpsafe.SafetyController:
    here = qpsafe.FixedPose(HOME)
    return qpsafe.SafetyController(
        ROBOT, [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here)], **changes
    )


def own(part: Any) -> Any:
    """A copy of what remembers; tasks, rules and robots are shared."""
    if isinstance(part, Returns):
        copied = copy.copy(part)
        copied.__dict__.update({key: own(x) for key, x in part.__dict__.items()})
        return copied
    return part.copy() if isinstance(part, list | np.ndarray) else part


def transplant(old: Any, new: Any) -> None:
    """What a controller remembers, into one that was made otherwise."""
    for key in ("_seq", "_active", "_q", "_qd", "_qd_before"):
        setattr(new, key, getattr(old, key))
    above, returns = new.recovery.suspend_above, new._recovery
    returns.__dict__.update({key: own(x) for key, x in old.recovery.__dict__.items()})
    returns.suspend_above = above
    new.evasion.velocity = old.evasion.velocity.copy()
    for mine, others in zip(new.sensing.memory, old.sensing.memory, strict=True):
        mine[...] = others
    for key in ("stopped", "_dying", "_out"):
        setattr(new.sensing.health, key, getattr(old.sensing.health, key))


def data(k: int) -> tuple[np.ndarray | None, dict[str, Any]]:
    """A hand that comes and goes, given as points, as distances, and now and then nothing that can be used."""
    if k % 41 > 36:
        return None, {"points": []}  # it brakes
    near = 0.32 + 0.2 * np.sin(0.11 * k)
    if k % 60 < 30:
        return ROBOT.home, {"points": HOME[None, :3, 3] + [near, 0.02, 0.0]}
    return ROBOT.home, {"distances": np.where(np.arange(20) == k // 60, near, np.inf)}


def run(controller: Any, ticks: range, q: Any, qd: Any) -> list[Any]:
    found = []
    for k in ticks:
        good, seen = data(k)
        tick = controller.step(q if good is not None else None, qd, **seen)
        q, qd = tick.reference.q, tick.reference.qd
        found.append(tick)
    return found


@pytest.mark.parametrize("kind", EXCHANGES)
def test_an_exchanged_part_is_as_good_as_one_given_at_construction(kind: str) -> None:
    """From the same state on, every tick is the same to the last bit, braking included; and it is not as it was."""
    for changes in EXCHANGES[kind]:
        for start in (25, 40)[: some(1, of=2)]:  # in motion, before and after a tick that brakes
            old, unchanged = made(), made()
            last = run(old, range(start), ROBOT.home, np.zeros(N))[-1].reference
            run(unchanged, range(start), ROBOT.home, np.zeros(N))
            new = made(**changes)
            transplant(old, new)
            for key, part in changes.items():
                if key == "evasion":  # it goes on from where the old one was
                    part = copy.deepcopy(part)
                    part.velocity = old.evasion.velocity.copy()
                setattr(old, key, part)
                assert getattr(old, key) is part or part == "off"
            ticks = range(start, start + some(40, of=70))
            differs = False
            for a, b, c in zip(*(run(one, ticks, last.q, last.qd) for one in (old, new, unchanged)), strict=True):
                assert a.reference == b.reference, (kind, changes)
                assert (a.status, a.messages, a.m, a.f, a.phase) == (b.status, b.messages, b.m, b.f, b.phase)
                assert np.array_equal(a.cdf_n, b.cdf_n, equal_nan=True)
                differs |= a.reference != c.reference
            assert differs, (kind, changes)


def test_exchanged_limits_hold_for_braking_from_the_next_tick_on() -> None:
    controller, slow = made(), slower(0.1)
    last = run(controller, range(30), ROBOT.home, np.zeros(N))[-1].reference
    controller.limits = slow
    for _ in range(40):
        tick = controller.step(None, None)  # type: ignore[arg-type]
        assert (np.abs(tick.reference.qd - last.qd) <= slow.max_acceleration * DT + 1e-12).all()
        last = tick.reference


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("law", qpsafe.HierarchicalLaw),
        ("law", None),
        ("field", 1.0),
        ("activation", qpsafe.Activation((qpsafe.Threshold(11.5, 0.15),))),
        ("activation", "high"),
        ("evasion", qpsafe.Evasion(4.0, 20.0, N + 1)),
        ("evasion", qpsafe.Evasion(4.0, 20.0, N, 0.01)),
        ("limits", slower(1.0, dt=0.01)),
        ("limits", 3),
        ("barrier", 12.0),
        ("barrier", qpsafe.DangerBarrier(12.0, field=WEAK)),
        ("tasks", []),
        ("dt", 0.001),
        ("known", [qpsafe.Obstacle.box("floor", (6.0, 6.0, 0.5), (0.0, 0.0, -0.25))]),
        ("carried", {}),
        ("range_sensors", ()),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_has_changed(key: str, value: Any) -> None:
    controller, other = made(), made()
    before = getattr(controller, key)
    with pytest.raises((qpsafe.ConfigurationError, AttributeError), match=key):
        setattr(controller, key, value)
    assert getattr(controller, key) is before or getattr(controller, key) == before
    for a, b in zip(*(run(one, range(40), ROBOT.home, np.zeros(N)) for one in (controller, other)), strict=True):
        assert a.reference == b.reference


def test_none_means_the_default_and_off_means_off() -> None:
    own = qpsafe.JointLimits.of(ROBOT, DT)
    for controller in (made(), made(limits=None), made(limits="robot"), made(limits=own)):
        assert isinstance(controller.limits, qpsafe.JointLimits)
        assert all(
            np.array_equal(getattr(controller.limits, key), getattr(own, key)) for key in qpsafe.JointLimits.fixed
        )
    controller = made(limits="off")
    assert controller.limits == "off"
    assert made(limits=controller.limits).limits == "off"
    controller.limits = None
    assert controller.limits != "off"


def test_sensing_that_is_copied_goes_on_alone() -> None:
    sensing = made().sensing
    assert isinstance(sensing, DistanceSensing)
    other = copy.deepcopy(sensing)
    assert all(mine is not others for mine, others in zip(sensing.memory, other.memory, strict=True))
    assert other.memory[0] is other.health.counts
