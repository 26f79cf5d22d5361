"""Ticks, robots and controllers in the hands of the standard library: copied, pickled, replaced, compared, shown."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.tasks.errors import TaskErrors
from qpsafe.tasks.joint import FixedJoints
from qpsafe.tasks.moves import Arc, Dwell, JointMove, JointMoveOfFrame, Line

WAYS: dict[str, Callable[[Any], Any]] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda thing: pickle.loads(pickle.dumps(thing)),
}
BARRIERS = {"none": None, "barrier": qpsafe.DangerBarrier(12.0)}


def controller(robot: qpsafe.Robot, barrier: qpsafe.DangerBarrier | None = None) -> qpsafe.SafetyController:
    goal = qpsafe.FixedPose(robot.pose("tcp", robot.home))
    tasks = [qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)]
    return qpsafe.SafetyController(robot, tasks, barrier=barrier)


def ticks(it: qpsafe.SafetyController, q: np.ndarray, first: int, last: int) -> list[qpsafe.Tick]:
    """Somebody comes nearer, through all regimes into a suspension; every reading has its own noise."""
    found = []
    for k in range(first, last):
        distances = 0.8 - 0.004 * k + 0.01 * np.random.default_rng(k).random(len(it.spots))  # type: ignore[arg-type]
        found.append(it.step(q, np.zeros(it.robot.nq), np.maximum(distances, 0.2)))
        q = found[-1].reference.q
    return found


@pytest.mark.parametrize("barrier", first(1, BARRIERS))
@pytest.mark.parametrize("way", WAYS)
def test_a_copied_controller_goes_on_by_itself(irb140: Any, way: str, barrier: str) -> None:
    whole = controller(irb140, BARRIERS[barrier])
    expected = ticks(whole, irb140.home, 0, 120)
    assert {"low", "high"} <= {tick.regime for tick in expected}
    original = controller(irb140, BARRIERS[barrier])
    here = ticks(original, irb140.home, 0, 60)[-1].reference.q
    other = WAYS[way](original)
    for it in (other, original):  # whom the copy has left alone
        for tick, wanted in zip(ticks(it, here, 60, 120), expected[60:], strict=True):
            # NumPy may round in another way where arrays lie elsewhere in memory
            for name in ("regime", "phase", "status", "messages", "events", "waits_for"):
                assert getattr(tick, name) == getattr(wanted, name)
            for name in ("q", "qd", "seq"):
                found = getattr(tick.reference, name)
                assert found == pytest.approx(getattr(wanted.reference, name), rel=0.0, abs=1e-12)
            assert (tick.cdf_n, *tick.activations) == pytest.approx((wanted.cdf_n, *wanted.activations), rel=1e-12)
            assert np.concatenate(tick.errors) == pytest.approx(np.concatenate(wanted.errors), rel=0.0, abs=1e-12)
    other.reset()
    assert original.step(here, np.zeros(6)).reference.seq == 120


@pytest.mark.parametrize("way", WAYS)
def test_a_copied_robot_is_the_same_and_stays_so(irb140: Any, way: str) -> None:
    other = WAYS[way](irb140)
    q = irb140.home + 0.1
    assert repr(other) == repr(irb140)
    assert np.array_equal(other.jacobian("tcp", q), irb140.jacobian("tcp", q))
    assert ticks(controller(other), q, 0, 60) == ticks(controller(irb140), q, 0, 60)
    with pytest.raises(qpsafe.ConfigurationError):
        other.lower = q
    with pytest.raises(ValueError, match="read-only"):
        other.lower[0] = 0.0


@pytest.mark.parametrize("way", [*WAYS, "replace"])
def test_a_copied_tick_says_the_same(irb140: Any, way: str) -> None:
    it = controller(irb140)
    usual = ticks(it, irb140.home, 0, 60)[-1]
    for tick in (usual, it.step(np.full(6, np.nan), np.zeros(6))):  # of which one is all NaN
        other = replace(tick) if way == "replace" else WAYS[way](tick)
        assert other == tick
        assert other.explain() == tick.explain()
        assert other.residuals == tick.residuals
        for a, b in zip(other.errors, tick.errors, strict=True):
            assert np.array_equal(a, b)


def test_ticks_are_equal_only_where_all_they_say_is(irb140: Any) -> None:
    tick = ticks(controller(irb140), irb140.home, 0, 60)[-1]
    assert len(tick.points) > 0
    assert replace(tick, solve_time=1.0) == tick
    assert tick != tick.reference
    others = {"solve_time", "resolved", "off_path"}  # the last two tell `errors` and `box`
    assert replace(tick, off_path=TaskErrors.of(tick.errors)) == tick
    assert replace(tick, off_path=TaskErrors.of(tuple(error + 1e-9 for error in tick.errors))) != tick
    for part in fields(tick):
        if part.name not in others:
            value = getattr(tick, part.name)
            if part.name == "reference":
                changed = replace(value, seq=value.seq + 1)
            elif isinstance(value, np.ndarray) and not value.size:
                changed = np.ones((1, *value.shape[1:]))
            elif isinstance(value, np.ndarray | float):
                changed = value + 1
            elif isinstance(value, str):
                changed = value + "?"
            else:
                changed = (*(value or ()), "one more")
            assert replace(tick, **{part.name: changed}) != tick, part.name
    assert replace(tick, resolved=None) != tick


def test_a_changed_tick_keeps_the_rest(irb140: Any) -> None:
    tick = ticks(controller(irb140), irb140.home, 0, 60)[-1]
    other = replace(tick, status="degraded", messages=("by hand",))
    assert "degraded" in other.explain()
    assert "by hand" in other.explain()
    assert (other.reference, other.cdf_n) == (tick.reference, tick.cdf_n)


def test_a_tick_names_the_tasks_in_their_order_after_an_exchange_too(irb140: Any) -> None:
    it, far = controller(irb140), np.full(20, np.inf)
    found = [line.split(":")[0].strip() for line in it.step(irb140.home, np.zeros(6), far).explain().splitlines()]
    assert found[2:4] == ["position of tcp", "orientation of tcp"]
    it.set_tasks([it.tasks[1], it.tasks[0]])
    found = [line.split(":")[0].strip() for line in it.step(irb140.home, np.zeros(6), far).explain().splitlines()]
    assert found[2:4] == ["orientation of tcp", "position of tcp"]
    with pytest.raises(qpsafe.ConfigurationError):
        it.set_tasks([qpsafe.PostureTask(irb140.home)] * 3)  # no thresholds for three
    assert it.step(irb140.home, np.zeros(6), far).task_names == ("orientation of tcp", "position of tcp")


def shown(robot: qpsafe.Robot) -> dict[str, tuple[Any, tuple[str, ...]]]:
    """Objects that a person sees at a prompt, and what must be said of them."""
    pose = robot.pose("tcp", robot.home)
    pose[:3, 3] = 0.25, -0.5, 0.125
    away = pose.copy()
    away[:3, 3] += 0.0625
    goal, it = qpsafe.FixedPose(pose), controller(robot)
    tick = ticks(it, robot.home, 0, 60)[-1]
    line, n = Line(pose, away), robot.nq
    move = JointMove(np.zeros(n), np.full(n, 0.75), np.ones(n), np.ones(n), np.full(n, 10.0))
    law = qpsafe.HierarchicalLaw("paper", damping=0.03)
    place = "[0.25, -0.5, 0.125]"
    return {
        "controller": (it, (robot.name, "position of tcp", "HierarchicalLaw('strict'", "0.004", "suspended")),
        "task": (qpsafe.PositionTask("tcp", goal, gain=7.5), ("PositionTask('tcp'", place, "gain=7.5")),
        "rows": (qpsafe.FrameTask("tcp", goal, rows=(0, 1, 5)), ("(0, 1, 5)",)),
        "posture": (qpsafe.PostureTask(np.full(n, 0.5)), ("[0.5, 0.5",)),
        "joints": (qpsafe.JointTask(FixedJoints(np.full(n, 0.5)), joints=[2, 3]), ("(2, 3)", "[0.5, 0.5")),
        "law": (law, ("'paper'", "damping=0.03")),
        "another law": (qpsafe.HierarchicalLaw(solver="daqp"), ("solver='daqp'",)),
        "weights": (qpsafe.WeightedLaw(weights=(3.0, 2.0)), ("(3.0, 2.0)",)),
        "ratio": (qpsafe.WeightedLaw(50.0), ("ratio=50",)),
        "nullspace": (qpsafe.NullspaceLaw(), ("NullspaceLaw()",)),
        "answer": (tick.law, ("'solved'", "weights=")),
        "pose": (goal, (place,)),
        "sample": (goal.sample(0.0), (place,)),
        "line": (line, (place, "[0.3125, -0.4375, 0.1875]", f"{line.duration:.4g}")),
        "arc": (Arc(pose, pose[:3, 3] + (0.1, 0.0, 0.0), away), ("Arc(", place)),
        "dwell": (Dwell(pose, 2.5), (place, "2.5")),
        "joint move": (move, ("[0.75, 0.75", f"{move.duration:.4g}")),
        "joint move of a frame": (JointMoveOfFrame(robot, "tcp", move), ("'tcp'", "0.75")),
        "program": (qpsafe.Program([line], [(0, "grip")], frame="tcp"), ("'tcp'", "1 move", "1 event")),
        "tick": (tick, (str(tick.reference.seq), tick.status, tick.regime, f"{tick.cdf_n:.4g}")),
        "box": (tick.box, (f"{tick.box.upper[0]:.4g}",)),  # type: ignore[union-attr]
        "activation": (it.activation, ("11.5", "7.5")),
        "evasion": (qpsafe.Evasion(3.0, 17.0, 2), ("[3, 3]", "[17, 17]")),
        "limits": (it.limits, (f"{robot.max_velocity[0]:.4g}", f"{robot.max_acceleration[0]:.4g}")),
        "barrier": (qpsafe.DangerBarrier(12.5), ("12.5",)),
        "spots": (it.spots, ("20 spots",)),
        "obstacle": (qpsafe.Obstacle.box("shelf", (1.0, 0.5, 0.25)), ("'shelf'", "[0.5, 0.25, 0.125]")),
        "state": (robot.at(robot.home), (robot.name, f"{robot.home[4]:.4g}")),
        "wire": (robot.wire(robot.home, np.ones(n)), ("6 links",)),
        "log": (FixedExperiment(robot, duration=0.02).run(), ("5 ticks", "'low': 5", "0 not ok")),
    }


def test_what_is_shown_at_a_prompt_is_short_and_has_the_numbers(irb140: Any) -> None:
    for name, (thing, words) in shown(irb140).items():
        text = repr(thing)
        assert len(text) <= 200, name
        assert "\n" not in text, name
        assert " at 0x" not in text, name
        for word in (type(thing).__name__ + "(", *words):
            assert word in text, (name, word, text)


def test_a_task_of_ones_own_is_shown_without_a_word_from_its_maker(irb140: Any) -> None:
    class Own(qpsafe.PositionTask):
        pass

    class Nameless(qpsafe.Task):
        value = error = jacobian = velocity = lambda self, *_: np.zeros(1)  # type: ignore[assignment]

    goal = qpsafe.FixedPose(irb140.pose("tcp", irb140.home))
    assert repr(Own("tcp", goal)).startswith("Own('tcp', FixedPose(")
    assert repr(Nameless(goal, 1.0)).startswith("Nameless(FixedPose(")
    assert Nameless(goal, 1.0).label == "task"
