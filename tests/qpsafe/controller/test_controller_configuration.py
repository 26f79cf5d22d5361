"""A mistake in the configuration is an error at construction that names the argument; nothing is left for the loop."""

import dataclasses
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.laws.problem import LawProblem, LawResult

N = 6


def task(frame: str = "tcp", gain: float = 1.0) -> qpsafe.PositionTask:
    return qpsafe.PositionTask(frame, qpsafe.FixedPose(np.eye(4)), gain)


def limits(n: int = N, dt: float = 0.004) -> qpsafe.JointLimits:
    one = np.ones(n)
    return qpsafe.JointLimits(-one, one, one, one, dt)


def spots(**changes: Any) -> qpsafe.SpotArray:
    return dataclasses.replace(qpsafe.load_spots(qpsafe.load_robot("irb140")), **changes)


class Bare:
    """A law without solve, a field without evaluate."""


THREE = qpsafe.Activation((qpsafe.Threshold(11.5, 0.15), qpsafe.Threshold(7.5, 0.25), qpsafe.Threshold(3.0, 0.3)))
ONE = qpsafe.Activation((qpsafe.Threshold(11.5, 0.15),))

WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "robot is a name": ({"robot": "irb140"}, "robot"),
    "robot is None": ({"robot": None}, "robot"),
    "robot is its class": ({"robot": type(qpsafe.load_robot("irb140"))}, "robot"),
    "no tasks": ({"tasks": []}, "tasks"),
    "tasks is None": ({"tasks": None}, "tasks"),
    "a task that is not in a list": ({"tasks": task()}, "tasks"),
    "a generator": ({"tasks": (task() for _ in range(2))}, "tasks"),
    "tasks by name": ({"tasks": ["position"]}, "tasks[0]"),
    "second is no task": ({"tasks": [task(), None]}, "tasks[1]"),
    "a task class": ({"tasks": [qpsafe.PositionTask]}, "tasks[0]"),
    "unknown frame": ({"tasks": [task(), task("gripper")]}, "tasks[1].frame"),
    "frame None": ({"tasks": [task(None)]}, "tasks[0].frame"),  # type: ignore[arg-type]
    "gain too high": ({"tasks": [task(gain=250.0)]}, "tasks[0].gain"),
    "gain too high for dt": ({"tasks": [task(), task(gain=10.0)], "dt": 0.1}, "tasks[1].gain"),
    "three tasks": ({"tasks": [task()] * 3}, "activation"),
    "thresholds missing": ({"activation": ONE}, "activation"),
    "thresholds too many": ({"activation": THREE}, "activation"),
    "thresholds bare": ({"activation": (11.5, 7.5)}, "activation"),
    "law by name": ({"law": "hierarchical"}, "law"),
    "law without solve": ({"law": Bare()}, "law"),
    "dt = 0": ({"dt": 0.0}, "dt"),
    "dt < 0": ({"dt": -0.004}, "dt"),
    "dt = NaN": ({"dt": np.nan}, "dt"),
    "dt = inf": ({"dt": np.inf}, "dt"),
    "dt is text": ({"dt": "4 ms"}, "dt"),
    "dt is None": ({"dt": None}, "dt"),
    "dt is True": ({"dt": True}, "dt"),
    "dt in milliseconds": ({"dt": 4}, "dt"),
    "dt in milliseconds, of numpy": ({"dt": np.float32(4.0)}, "dt"),
    "dt is complex": ({"dt": 0.004 + 0j}, "dt"),
    "dt of another precision than the limits'": ({"dt": np.float32(0.004), "limits": limits()}, "limits.dt"),
    "law is a class": ({"law": qpsafe.HierarchicalLaw}, "law"),
    "field is a class": ({"field": qpsafe.DangerField}, "field"),
    "evasion is a class": ({"evasion": qpsafe.Evasion}, "evasion"),
    "evasion of another tick": ({"evasion": qpsafe.Evasion(4.0, 20.0, N, 0.01)}, "evasion.dt"),
    "limits is a class": ({"limits": qpsafe.JointLimits}, "limits"),
    "barrier is a number": ({"barrier": 12.0}, "barrier"),
    "barrier is a class": ({"barrier": qpsafe.DangerBarrier}, "barrier"),
    "barrier of another field": (
        {"barrier": qpsafe.DangerBarrier(12.0, field=qpsafe.DangerField(kinetic=2.0))},
        "barrier.field",
    ),
    "field of another barrier": (
        {"barrier": qpsafe.DangerBarrier(12.0), "field": qpsafe.DangerField(kinetic=2.0)},
        "barrier.field",
    ),
    "recovery is a time": ({"recovery": 0.3}, "recovery"),
    "recovery is a class": ({"recovery": qpsafe.RecoveryRules}, "recovery"),
    "sensing is a class": ({"sensing": qpsafe.SensingRules}, "sensing"),
    "spots is a class": ({"spots": qpsafe.SpotArray}, "spots"),
    "known is a number": ({"known": 3}, "known"),
    "known is one obstacle": ({"known": qpsafe.Obstacle.box("table", (1, 1, 0.1))}, "known"),
    "carried by nobody": ({"carried": [1]}, "carried"),
    "carried by an unknown frame": ({"carried": {"gripper": []}}, "carried"),
    "carried is one obstacle": ({"carried": {"tcp": qpsafe.Obstacle.box("part", (1, 1, 0.1))}}, "carried['tcp']"),
    "carried is a number": ({"carried": {"tcp": [1]}}, "carried['tcp'][0]"),
    "field without evaluate": ({"field": Bare()}, "field"),
    "evasion is a number": ({"evasion": 4.0}, "evasion"),
    "evasion of seven joints": ({"evasion": qpsafe.Evasion(4.0, 20.0, 7)}, "evasion"),
    "limits by a wrong name": ({"limits": "none"}, "limits"),
    "limits are True": ({"limits": True}, "limits"),
    "limits are a number": ({"limits": 1.0}, "limits"),
    "limits of seven joints": ({"limits": limits(7)}, "limits"),
    "limits of one joint": ({"limits": limits(1)}, "limits"),
    "limits of another tick": ({"limits": limits(dt=0.01)}, "limits.dt"),
    "default limits at another dt": ({"limits": limits(), "dt": 0.002}, "limits.dt"),
    "sensing is a time": ({"sensing": 0.3}, "sensing"),
    "known by name": ({"known": ("table",)}, "known[0]"),
    "spots by file name": ({"spots": "spots.toml"}, "spots"),
}

SPOTS: dict[str, tuple[dict[str, Any], str]] = {
    "frames of another robot": ({"frames": ("link_7",) * 20}, "frames"),
    "one frame too few": ({"frames": ("dh1",) * 19}, "frames"),
    "links counted from 1": ({"links": np.full(20, 6)}, "links"),
    "links below 0": ({"links": np.full(20, -1)}, "links"),
    "links not whole": ({"links": np.full(20, 0.5)}, "links"),
    "one link too few": ({"links": np.zeros(19, dtype=int)}, "links"),
    "planar positions": ({"positions": np.zeros((20, 2))}, "positions"),
    "NaN position": ({"positions": np.full((20, 3), np.nan)}, "positions"),
    "no direction": ({"directions": np.zeros((20, 3))}, "directions"),
    "NaN direction": ({"directions": np.full((20, 3), np.nan)}, "directions"),
    "long direction": ({"directions": np.tile([0.0, 0.0, 1.01], (20, 1))}, "directions"),
    "range upside down": ({"range_min": 0.9}, "range_min"),
    "endless range": ({"range_max": np.inf}, "range_min"),
    "NaN range": ({"range_max": np.nan}, "range_min"),
}


def build(irb140: Any, changes: dict[str, Any]) -> qpsafe.SafetyController:
    return qpsafe.SafetyController(**({"robot": irb140, "tasks": [task(), task()]} | changes))


@pytest.mark.parametrize("key", WRONG)
def test_a_wrong_argument_is_named(irb140: Any, key: str) -> None:
    changes, expected_key = WRONG[key]
    with pytest.raises(qpsafe.ConfigurationError) as caught:
        build(irb140, changes)
    assert caught.value.where == ("SafetyController")
    assert caught.value.key == expected_key
    assert caught.value.expected
    assert expected_key in str(caught.value)


@pytest.mark.parametrize("key", SPOTS)
def test_wrong_spots_are_named(irb140: Any, key: str) -> None:
    changes, expected_key = SPOTS[key]
    with pytest.raises(qpsafe.ConfigurationError) as caught:
        build(irb140, {"spots": spots(**changes)})
    assert (caught.value.where, caught.value.key) == ("SpotArray", expected_key)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"lower": "low"}, "lower"),
        ({"lower": None}, "lower"),
        ({"lower": -1.0, "upper": 1.0, "max_velocity": 1.0, "max_acceleration": 1.0}, "lower"),
        ({"upper": [[1.0]]}, "upper"),
        ({"max_velocity": ["fast"]}, "max_velocity"),
        ({"max_acceleration": [np.nan]}, "max_acceleration"),
        ({"dt": "4 ms"}, "dt"),
        ({"dt": [0.004]}, "dt"),
        ({"dt": np.nan}, "dt"),
        ({"return_speed": None}, "return_speed"),
        ({"return_speed": -0.1}, "return_speed"),
    ],
)
def test_wrong_limits_are_named(changes: dict[str, Any], key: str) -> None:
    good: dict[str, Any] = {"lower": [-1.0], "upper": [1.0], "max_velocity": [1.0], "max_acceleration": [1.0]}
    with pytest.raises(qpsafe.ConfigurationError) as caught:
        qpsafe.JointLimits(**(good | changes))
    assert (caught.value.where, caught.value.key) == ("JointLimits", key)


class Still:
    """A law of one's own needs no more than this."""

    def solve(self, problem: LawProblem) -> LawResult:
        return LawResult(np.zeros_like(problem.qd0))


RIGHT: dict[str, dict[str, Any]] = {
    "defaults": {},
    "one task": {"tasks": [task()]},
    "a tuple of tasks": {"tasks": (task(), task())},
    "three tasks": {"tasks": [task()] * 3, "activation": THREE},
    "an own law": {"law": Still()},
    "10 ms": {"dt": 0.01},
    "a tick of another precision": {"dt": np.float32(0.004)},
    "the longest tick": {"dt": 0.1, "tasks": [task(gain=0.5)]},
    "no hold": {"sensing": qpsafe.SensingRules(hold_time=0)},
    "a known table": {"known": [qpsafe.Obstacle.box("table", (1, 1, 0.1))]},
    "no limits": {"limits": "off"},
    "the robot's limits": {"limits": "robot"},
    "the default limits": {"limits": None},
    "a barrier": {"barrier": qpsafe.DangerBarrier(12.0)},
    "a barrier of the own field": {
        "barrier": qpsafe.DangerBarrier(12.0, field=qpsafe.DangerField(kinetic=2.0)),
        "field": qpsafe.DangerField(kinetic=2.0),
    },
    "something carried": {"carried": {"tcp": [qpsafe.Obstacle.box("part", (0.1, 0.1, 0.1))]}},
    "own limits": {"limits": limits()},
    "own evasion": {"evasion": qpsafe.Evasion(np.full(N, 2.0), np.eye(N) * 9.0, N)},
    "own field": {"field": qpsafe.DangerField(kinetic=0.0)},
    "own spots": {"spots": spots(range_max=1.5)},
}


@pytest.mark.parametrize("key", RIGHT)
def test_what_is_right_is_accepted_and_runs(irb140: Any, key: str) -> None:
    controller = build(irb140, RIGHT[key])
    for _ in range(3):
        tick = controller.step(irb140.home, np.zeros(N), np.full(20, 0.5))
        assert tick.status in ("ok", "degraded"), tick
        assert len(tick.activations) == len(controller.tasks)
    assert tick.f == 1.0 or len(controller.tasks) > 1


def test_home_outside_own_limits_does_not_move_before_there_is_data(irb140: Any) -> None:
    controller = build(irb140, {"limits": limits()})  # home's joint 5 is beyond 1 rad
    for _ in range(5):
        tick = controller.step(None, None, None)  # type: ignore[arg-type]
        assert not tick.reference.active
        assert np.array_equal(tick.reference.q, irb140.home)


@pytest.mark.parametrize("kind", [qpsafe.PositionTask, qpsafe.OrientationTask, qpsafe.FrameTask])
@pytest.mark.parametrize("trajectory", [np.eye(4), None, "line", qpsafe.FixedPose])
def test_a_trajectory_that_cannot_be_sampled_is_refused_by_its_task(kind: Any, trajectory: Any) -> None:
    with pytest.raises(qpsafe.ConfigurationError) as info:
        kind("tcp", trajectory)
    assert kind.__name__ in str(info.value)
    assert "trajectory" in str(info.value)
    assert "FixedPose" in str(info.value)
