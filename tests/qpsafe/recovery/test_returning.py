"""Ways back: those of tasks of another making, asked one by one, are those that one compiled call leads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.recovery.recovery import Recovery
from qpsafe.tasks.errors import TaskErrors
from qpsafe.tasks.moves import Line
from qpsafe.tasks.trajectory import FixedPose, Sample

DT = 0.004


class Asked(qpsafe.FrameTask):
    """The same task; but that its offset is the same is not known to compiled code."""

    def offset(self, value: np.ndarray, sample: Any) -> np.ndarray:
        return super().offset(value, sample)


class Same:
    """A fixed pose that compiled code does not know to be one: other arrays at every tick."""

    def __init__(self, pose: np.ndarray) -> None:
        self.pose = pose

    def sample(self, t: float) -> Any:
        return Sample(self.pose.copy(), np.zeros(6))


class Lost(Same):
    """It gives nothing any more."""

    lost = False

    def sample(self, t: float) -> Any:
        return None if self.lost else super().sample(t)


def ways(robot: Any, kinds: tuple[Any, ...], rules: qpsafe.RecoveryRules, path: Any = None) -> list[Any]:
    """References and clocks of tasks of these kinds on the way of a robot that is pushed away and left alone."""
    start = robot.pose("tcp", robot.home)
    goal = start.copy()
    goal[:3, 3] += 0.1, 0.05, -0.1
    path = Line(start, goal) if path is None else path
    tasks = [kind("tcp", path, rows=rows) for kind, rows in zip(kinds, ((0, 1, 2), (3, 4, 5)), strict=True)]
    recovery, rng, told, q = Recovery(tasks, 9.775, DT, rules), np.random.default_rng(3), [], robot.home
    for k in range(400):
        danger = 20.0 if 20 <= k < 40 or 180 <= k < 183 else 1.0
        q = q + (rng.normal(0.0, 1e-3, robot.nq) if k < 40 else 0.0)
        state, activations = robot.at(q), (1.0, 0.0 if 125 <= k < 150 else 1.0) if danger < 9.0 else (0.0, 0.0)
        clocks = recovery.clocks
        samples = recovery.update(danger, state, activations)
        if k % 30 == 0 and recovery.phase != "following":  # a tick that failed, and its clocks set back, leave no trace
            recovery.clocks = clocks
            samples = recovery.update(danger, state, activations)
        if k % 9 == 0:
            errors = recovery.errors(state, samples).values
            against = TaskErrors.against([path.sample(recovery.path_time)] * 2, tasks, state).values
            assert all(np.array_equal(a, b) for a, b in zip(errors, against, strict=True))
        told.append((recovery.phase, recovery.path_time, *[part for sample in samples for part in sample]))
    assert {one[0] for one in told} == {"following", "suspended", "recovering"}
    return told


@pytest.mark.parametrize(
    "rules", first(1, [qpsafe.RecoveryRules(), qpsafe.RecoveryRules.paper()]), ids=["ours", "paper"]
)
def test_a_task_that_is_asked_is_led_back_as_one_that_is_not(irb140: Any, rules: Any) -> None:
    ours = ways(irb140, (qpsafe.FrameTask, qpsafe.FrameTask), rules)
    for kinds in ((Asked, qpsafe.FrameTask), (Asked, Asked)):
        for one, other in zip(ours, ways(irb140, kinds, rules), strict=True):
            assert one[:2] == other[:2]
            for a, b in zip(one[2:], other[2:], strict=True):
                np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12)


def test_a_pose_that_is_known_to_stand_still_is_led_back_as_one_that_is_looked_at_anew(irb140: Any) -> None:
    pose, kinds = irb140.pose("tcp", irb140.home), (qpsafe.FrameTask, qpsafe.FrameTask)
    known, looked_at = (ways(irb140, kinds, qpsafe.RecoveryRules(), path(pose)) for path in (FixedPose, Same))
    for one, other in zip(known, looked_at, strict=True):
        assert one[:2] == other[:2]
        assert all(np.array_equal(a, b) for a, b in zip(one[2:], other[2:], strict=True))


def test_what_gives_no_sample_is_taken_for_no_pose_that_stands_still(irb140: Any) -> None:
    path = Lost(irb140.pose("tcp", irb140.home))
    recovery, state = Recovery([qpsafe.FrameTask("tcp", path)], 9.775, DT), irb140.at(irb140.home)
    recovery.update(20.0, state, (0.0,))
    path.lost = True
    with pytest.raises(AttributeError):
        recovery.update(20.0, state, (0.0,))


def test_a_pose_that_somebody_changes_in_place_all_the_same_is_where_it_is_now(irb140: Any) -> None:
    def goals(path: Any) -> list[np.ndarray]:
        recovery, state = Recovery([qpsafe.FrameTask("tcp", path)], 9.775, DT), irb140.at(irb140.home)
        told = []
        for k in range(60):
            if k == 20:
                path.pose.flags.writeable = True
                path.pose[1, 3] += 0.05
            danger, active = (20.0, 0.0) if 5 <= k < 30 else (0.0, 1.0)
            told.append(recovery.update(danger, state, (active,))[0].pose.copy())
        return told

    pose = irb140.pose("tcp", irb140.home)
    for one, other in zip(goals(FixedPose(pose)), goals(Same(pose.copy())), strict=True):
        np.testing.assert_array_equal(one, other)
