"""With nothing in sight the robot comes to rest at its goal, or the tick says what stands in the way."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import first, some

import qpsafe
from qpsafe.robot.loader import bundled_robots

NOTHING = np.empty((0, 3))
NEAR = {"position": 1e-3, "orientation": 5e-3}  # [m], [rad] that a robot at rest may be off without a word


def joint(name: str, number: int, origin: tuple[float, float, float], axis: str) -> str:
    place = " ".join(map(str, origin))
    return (
        f'<joint name="{name}" type="revolute"><parent link="l{number - 1}"/><child link="l{number}"/>'
        f'<origin xyz="{place}"/><axis xyz="{axis}"/><limit lower="-6.2" upper="6.2" velocity="3" effort="9"/></joint>'
    )


@pytest.fixture
def three_parallel_axes(tmp_path: Path) -> Any:
    """Builds arms whose joints 2, 3 and 4 are parallel, with lengths of their own."""

    def build(rng: np.random.Generator) -> Any:
        a = np.round(rng.uniform(0.6, 1.5, 8) * [0.15, 0.15, -0.1, 0.5, 0.45, 0.1, 0.1, 0.1], 4)
        origins = [(0, 0, a[0]), (0, a[1], 0), (0, a[2], a[3]), (0, 0, a[4]), (0, a[5], 0), (0, 0, a[6])]
        axes = ["0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0"]
        mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
        text = "".join(f'<link name="l{i}">{mass}</link>' for i in range(7))
        text += "".join(joint(f"j{i + 1}", i + 1, origins[i], axes[i]) for i in range(6))
        text += '<link name="tip"/><joint name="t" type="fixed"><parent link="l6"/><child link="tip"/>'
        text += f'<origin xyz="0 {a[7]} 0"/></joint>'
        path = tmp_path / "arm.urdf"
        path.write_text(f'<robot name="arm">{text}</robot>')
        with pytest.warns(qpsafe.RobotWarning):  # what the file does not say is assumed
            return qpsafe.load_robot(path)

    return build


def parallel_goals(rng: np.random.Generator, count: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Goals and starts, the wrist singular or nearly so at most goals."""
    for _ in range(count):
        goal = rng.uniform(-1.5, 1.5, 6)
        goal[4] = rng.choice([0.0, 0.02, 0.1, 0.3, rng.uniform(-1.5, 1.5)])
        yield goal, goal + rng.uniform(-0.6, 0.6, 6)


def bundled_goals(rng: np.random.Generator, robot: Any, count: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Goals anywhere within the limits, some singular; starts anywhere near."""
    for _ in range(count):
        goal = rng.uniform(robot.lower, robot.upper)
        if rng.random() < 0.5:
            goal[rng.integers(robot.nq)] = rng.choice([0.0, 0.02])
        start = goal + rng.uniform(-0.6, 0.6, robot.nq)
        yield np.clip(goal, robot.lower, robot.upper), np.clip(start, robot.lower, robot.upper)


#: [rad/s] below it joints rest, as for `qpsafe.recovery.stall`: near a singular pose the last 1e-4 rad take a minute.
AT_REST = 0.01


def outcome(robot: Any, frame: str, goal: np.ndarray, start: np.ndarray, law: Any = None, seconds: float = 20.0) -> str:
    """ "there", "said" (at rest or not, but the tick says so), "nearing" (by a twentieth in two seconds, if slowly), or
    what is wrong: "moves", "off"."""
    here = qpsafe.FixedPose(robot.pose(frame, goal))
    tasks = [qpsafe.PositionTask(frame, here), qpsafe.OrientationTask(frame, here)]
    controller = qpsafe.SafetyController(robot, tasks, law=law)
    q, qd, still, sums = start, np.zeros(robot.nq), 0, []
    for _ in range(round(seconds / controller.dt)):
        tick = controller.step(q, qd, points=NOTHING)
        q, qd = tick.reference.q, tick.reference.qd
        still = still + 1 if float(np.abs(qd).max()) < AT_REST else 0
        off = any(np.linalg.norm(e) > NEAR[task.name] for e, task in zip(tick.errors, tasks, strict=True))
        sums.append(sum(float(np.linalg.norm(e)) for e in tick.errors))
        if still > 250 and not off:
            return "there"
        if still > 250 and tick.messages:
            break
    if tick.messages:
        assert tick.status == "degraded"
        return "said" if still > 250 or "held" in tick.messages[0] or "stands off" in tick.messages[0] else "moves"
    if sums[-1] < 0.95 * sums[-500]:
        return "nearing"
    return "off" if still > 250 else "moves"


def frame_of(robot: Any) -> str:
    return "tcp" if "tcp" in robot.frame_names else robot.tool_frames[0]


def judge(cases: Iterator[tuple[Any, str, np.ndarray, np.ndarray]], law: Any = None) -> tuple[int, int]:
    """How many arrive, and how many do not and say so; all others are printed and fail."""
    found: dict[str, int] = {"there": 0, "said": 0}
    if law is not None:  # without damping the way through a singular pose can be slow
        found["nearing"] = 0
    for robot, frame, goal, start in cases:
        how = outcome(robot, frame, goal, start, law)
        assert how in found, (robot.name, how, goal.tolist(), start.tolist())
        found[how] += 1
    return found["there"], found["said"]


def test_arms_with_three_parallel_axes_rest_or_say_why_not(three_parallel_axes: Any) -> None:
    rng = np.random.default_rng(3)
    arms = [three_parallel_axes(rng) for _ in range(some(1, of=4))]
    there, said = judge((arm, "tip", *case) for arm in arms for case in parallel_goals(rng, some(1, of=4)))
    assert there >= 0.9 * (there + said)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1000, 1010))
def test_thousands_of_goals_on_arms_with_three_parallel_axes(three_parallel_axes: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    arms = [three_parallel_axes(rng) for _ in range(4)]
    there, said = judge((arm, "tip", *case) for arm in arms for case in parallel_goals(rng, 60))
    assert there >= 0.9 * (there + said)


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_robots())
def test_hundreds_of_goals_on_every_bundled_robot(name: str) -> None:
    robot, rng = qpsafe.load_robot(name), np.random.default_rng(2000)
    judge((robot, frame_of(robot), *case) for case in bundled_goals(rng, robot, 250))


@pytest.mark.parametrize("name", first(1, bundled_robots()))
def test_bundled_robots_rest_or_say_why_not(name: str) -> None:
    robot, rng = qpsafe.load_robot(name), np.random.default_rng(4)
    judge((robot, frame_of(robot), *case) for case in bundled_goals(rng, robot, 2))


@pytest.mark.slow
@pytest.mark.parametrize("law", [qpsafe.HierarchicalLaw("paper"), qpsafe.WeightedLaw(), qpsafe.NullspaceLaw()])
def test_so_do_the_other_laws(three_parallel_axes: Any, law: Any) -> None:
    rng = np.random.default_rng(3000)
    arm = three_parallel_axes(rng)
    judge(((arm, "tip", *case) for case in parallel_goals(rng, 100)), law)
