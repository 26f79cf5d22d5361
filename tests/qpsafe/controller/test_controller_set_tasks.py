"""Tasks redefined, reordered, paused while the controller runs; `run` watches limits at every tick."""

from typing import Any

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.tasks.joint import PostureTask
from qpsafe.tasks.trajectory import Sample

ROBOT = qpsafe.load_robot("irb140")
HOME = ROBOT.pose("tcp", ROBOT.home)


class Sway:
    """Moves to and fro along y, 0.1 m/s at most."""

    def sample(self, t: float) -> Sample:
        pose = HOME.copy()
        pose[1, 3] += 0.1 * np.sin(t)
        return Sample(pose, np.array([0, 0.1 * np.cos(t), 0, 0, 0, 0]))


def shifted(y: float) -> qpsafe.FixedPose:
    pose = HOME.copy()
    pose[1, 3] += y
    return qpsafe.FixedPose(pose)


@pytest.mark.parametrize("seed", first(2, range(4)))
def test_any_change_of_tasks_keeps_the_command_inside_its_limits(run: Any, seed: int) -> None:
    """Position, velocity and acceleration limits hold at every tick, whatever the tasks become, in danger or not."""
    rng = np.random.default_rng(seed)
    loop = run()
    for _ in range(25):
        target = shifted(rng.uniform(-0.3, 0.3))
        tasks: list[Any] = [qpsafe.PositionTask("tcp", target), qpsafe.OrientationTask("tcp", target)]
        tasks.append(PostureTask(ROBOT.home + rng.normal(size=6) * 0.3))
        kept = rng.permutation(3)[: rng.integers(1, 4)]
        thresholds = ((11.5, 0.15), (7.5, 0.25), (4.0, 0.2))[: len(kept)]
        activation = qpsafe.Activation(tuple(qpsafe.Threshold(*pair) for pair in thresholds))
        loop.controller.set_tasks([tasks[k] for k in kept], activation, restart=bool(rng.integers(2)))
        tip = ROBOT.pose("tcp", loop.q)[:3, 3]
        points = [tip + rng.normal(size=3) * 0.3] if rng.integers(2) else []
        for _ in range(20):
            tick = loop.step(np.reshape(points, (-1, 3)))
            assert len(tick.errors) == len(kept)
            assert tick.status in ("ok", "degraded")


def test_the_robot_is_led_to_new_tasks_and_no_faster_than_a_return(run: Any) -> None:
    loop = run()
    loop.step()
    goal = shifted(0.2)
    loop.controller.set_tasks([qpsafe.PositionTask("tcp", goal), qpsafe.OrientationTask("tcp", goal)])
    assert loop.step().phase == "recovering"
    last, phase = ROBOT.pose("tcp", loop.q)[:3, 3], "recovering"
    while phase == "recovering":
        phase = loop.step().phase
        now = ROBOT.pose("tcp", loop.q)[:3, 3]
        assert np.linalg.norm(now - last) <= 0.5 * 0.004 * 1.01
        last = now
    assert last == pytest.approx(goal.pose[:3, 3], abs=5e-4)
    assert 0.7 < loop.count * 0.004 < 2.5  # 15/8 of 0.2 m at 0.5 m/s


def test_reordering_on_the_path_lets_it_run_on(run: Any) -> None:
    """Both tasks can be met, so their order makes no difference and no step."""
    path = Sway()
    tasks = [qpsafe.PositionTask("tcp", path), qpsafe.OrientationTask("tcp", path)]
    loops = [run(tasks=tasks), run(tasks=tasks)]
    for loop in loops:
        loop.step()
    for k in range(300):
        if k == 150:
            loops[1].controller.set_tasks(tasks[::-1])
        a, b = (loop.step() for loop in loops)
        assert b.phase == "following" or k < 50
        assert np.abs(a.reference.qd - b.reference.qd).max() < 1e-6
    assert a.path_time == b.path_time
    assert np.abs(a.errors[0] - b.errors[1]).max() < 1e-8


def test_tasks_that_are_refused_change_nothing(run: Any) -> None:
    loop = run()
    controller = loop.controller
    before = controller.tasks, controller.activation, controller.recovery.tasks
    three = [*controller.tasks, PostureTask(ROBOT.home)]
    for tasks, activation in ((three, None), ([], None), (controller.tasks, "none"), ([PostureTask([0.0])], None)):
        with pytest.raises(ConfigurationError, match="SafetyController"):
            controller.set_tasks(tasks, activation)
    assert before == (controller.tasks, controller.activation, controller.recovery.tasks)


def test_a_paused_path_stands_still_and_goes_on(run: Any) -> None:
    path = Sway()
    loop = run(tasks=[qpsafe.PositionTask("tcp", path), qpsafe.OrientationTask("tcp", path)])
    for _ in range(100):
        loop.step()
    loop.controller.pause()
    for _ in range(400):
        tick = loop.step()
    stopped = tick.path_time
    assert np.abs(tick.reference.qd).max() < 1e-3
    assert np.linalg.norm(tick.errors[0]) < 2e-3
    loop.controller.resume()
    tick = loop.step()
    assert stopped < tick.path_time < stopped + 0.004


def test_low_mid_and_high_tasks_are_released_one_after_the_other(run: Any) -> None:
    """Three tasks have four regimes: the nearer an obstacle, the fewer are kept."""
    here = qpsafe.FixedPose(HOME)
    tasks = [qpsafe.PositionTask("tcp", here), qpsafe.OrientationTask("tcp", here), PostureTask(ROBOT.home)]
    thresholds = tuple(qpsafe.Threshold(*pair) for pair in ((11.5, 0.15), (7.5, 0.25), (5.0, 0.1)))
    names = []
    for distance in np.geomspace(2.0, 0.05, 25):
        loop = run(tasks=tasks, activation=qpsafe.Activation(thresholds))
        tick = loop.step(HOME[None, :3, 3] + [distance, 0.0, 0.0])
        assert len(tick.activations) == 3
        names.append(tick.regime)
    assert [name for k, name in enumerate(names) if name not in names[:k]] == ["low", "medium-2", "medium-1", "high"]
