"""A controller that keeps clear of furniture, floor and itself, whatever it is asked to do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from amounts import first, some
from clearance_runs import MARGIN, NOBODY, controller_at, distances, kept, run, tasks_at

import qpsafe
from qpsafe.geometry.clearance import ClearanceLimit
from qpsafe.geometry.solids import Solids
from qpsafe.sensing.hulls import Obstacle
from qpsafe.tasks.moves import Line
from qpsafe.tasks.program import Program
from qpsafe.tasks.rotation import exp3


@pytest.mark.parametrize("name", first(1, qpsafe.bundled_robots()))
def test_tasks_that_lead_into_things_do_not_touch_them(name: str) -> None:
    """Goals at random, half a metre away in an instant; without rows the same tasks do touch. Speeds are such that the
    arm turns by a lot while it brakes, which is what the millimetre is for."""
    robot = qpsafe.load_robot(name)
    with_rows, without = (
        [kept(robot, seed, clearance=clearance) for seed in range(some(3, of=6))] for clearance in (None, "off")
    )
    assert min(found[0] for found in with_rows if found is not None) > MARGIN - 1.5e-3
    assert min(found[0] for found in without if found is not None) < 0.0


@pytest.mark.parametrize(
    "law", first(1, [qpsafe.HierarchicalLaw(), qpsafe.HierarchicalLaw("paper"), qpsafe.WeightedLaw()])
)
def test_evasion_stops_at_a_table(law: Any) -> None:
    """Somebody comes from above: the arm is pushed down, and lies on the margin; without rows it goes through."""
    robot = qpsafe.load_robot("irb140")
    known = [Obstacle.box("table", (0.25, 0.6, 0.05), (0.38, 0.0, 0.4))]
    gap = distances(robot, known)

    def above(q: Any) -> Any:
        return robot.pose("tcp", q)[None, :3, 3] + [0.0, 0.0, 0.06]

    least = {}
    for clearance in (None, "off"):
        parts = {"law": law, "clearance": clearance, "evasion": "paper"}  # which goes straight down
        controller = controller_at(robot, tasks_at(robot, (0.0, 0.0, 0.0)), known, **parts)
        ticks = list(run(controller, 250, above))
        assert any(tick.regime == "high" for tick in ticks)
        least[clearance] = min(gap(tick.reference.q) for tick in ticks[::2])
        if clearance is None:
            near = {name for tick in ticks for pair in tick.clearance for name in pair[:2]}
            assert "table" in near
            assert "kept clear: " in next(tick.explain() for tick in ticks if tick.clearance)
    assert least[None] > MARGIN - 3e-4
    assert least["off"] < 0.0


def sweeping(robot: Any, seed: int) -> tuple[list[Obstacle], list[Any]]:
    """A turned box, and a tool led along it 2 cm too deep: over its edges and corners, there and back."""
    rng, box = np.random.default_rng(seed), np.eye(4)
    box[:3, :3], box[:3, 3] = exp3(0.3 * rng.normal(size=3)), (0.5, 0.0, 0.2)
    known = [Obstacle.box("box", (0.15, 0.2, 0.2), pose=box)]
    start = robot.pose("tcp", robot.home)
    start[:3, 3] = 0.5 + rng.uniform(-0.05, 0.05), -0.25, known[0].vertices[:, 2].max() - 0.02
    end, above = start.copy(), start.copy()
    end[0, 3], end[1, 3], above[2, 3] = start[0, 3] + rng.uniform(-0.1, 0.1), 0.25, start[2, 3] + 0.15
    program = Program([Line(above, start), Line(start, end), Line(end, above)], [], True)
    return known, [qpsafe.PositionTask("tcp", program), qpsafe.OrientationTask("tcp", program)]


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 5))])
def test_a_tool_slides_over_edges_and_corners_without_jerks(seed: int) -> None:
    """Steps of q̇ in shares of what the joints can: most are small; and the orientation is not given away."""
    robot, steps, turned = qpsafe.load_robot("irb140"), [], []
    known, tasks = sweeping(robot, seed)
    gap, controller, qd = distances(robot, known), controller_at(robot, tasks, known), np.zeros(6)
    for tick in run(controller, 2100):
        if tick.resolved.soft:
            steps.append(np.max(np.abs(tick.reference.qd - qd) / (0.004 * robot.max_acceleration)))
            turned.append(np.linalg.norm(tick.errors[1]))
            assert gap(tick.reference.q) > MARGIN - 1e-4
        qd = tick.reference.qd
    assert len(steps) > 40
    assert np.median(steps) < 0.25
    assert np.mean(np.array(steps) > 0.5) < 0.2
    assert max(turned) < 0.1


def test_far_from_everything_nothing_changes() -> None:
    """The same bits with and without."""
    robot = qpsafe.load_robot("irb140")
    known = [Obstacle.box("floor", (4.0, 4.0, 0.5), (0.0, 0.0, -1.2))]
    tasks = tasks_at(robot, (0.05, 0.1, 0.03))
    ways = [
        [tick.reference.q.tobytes() for tick in run(controller_at(robot, tasks, known, clearance=clearance), 150)]
        for clearance in (None, "off")
    ]
    assert ways[0] == ways[1]


class Own(qpsafe.HierarchicalLaw):
    """A law of another making: the compiled call is left."""


class OwnWeighted(qpsafe.WeightedLaw):
    """Likewise."""


@pytest.mark.parametrize(
    ("law", "own"),
    first(
        2,
        [
            (qpsafe.HierarchicalLaw(), Own()),
            (qpsafe.WeightedLaw(), OwnWeighted()),
            (qpsafe.HierarchicalLaw("paper"), Own("paper")),
        ],
    ),
)
def test_the_compiled_call_is_the_law_under_the_same_rows(law: Any, own: Any) -> None:
    """Tick by tick from the same state: command, and what is told of each regime, soft level first."""
    robot = qpsafe.load_robot("irb140")
    known, tasks = sweeping(robot, 2)
    made = [controller_at(robot, tasks, known, law=one) for one in (law, own)]
    q, qd, rows = robot.home.copy(), np.zeros(6), 0
    for k in range(760):
        points = robot.pose("tcp", q)[None, :3, 3] + [0.0, 0.0, 0.16] if 600 < k < 660 else NOBODY
        ticks = [controller.step(q, qd, points=points) for controller in made]
        assert np.abs(ticks[0].reference.qd - ticks[1].reference.qd).max() <= 1e-12
        if ticks[0].resolved.soft:
            rows += 1
            shapes = [[len(residuals) for _, residuals in tick.residuals] for tick in ticks]
            assert shapes[0] == shapes[1]
            for one, other in zip(ticks[0].residuals, ticks[1].residuals, strict=True):
                assert one[1] == pytest.approx(other[1], abs=1e-9)
        q, qd = ticks[0].reference.q, ticks[0].reference.qd
    assert rows > 10


def test_projections_know_no_rows() -> None:
    robot = qpsafe.load_robot("irb140")
    known, tasks = sweeping(robot, 1)
    ways = [
        [tick.reference.q.tobytes() for tick in run(controller, 700)]
        for controller in (
            controller_at(robot, tasks, known, law=qpsafe.NullspaceLaw(), clearance=clearance)
            for clearance in (None, "off")
        )
    ]
    assert ways[0] == ways[1]


def test_what_may_be_given() -> None:
    robot, tasks = qpsafe.load_robot("irb140"), tasks_at(qpsafe.load_robot("irb140"), (0.0, 0.0, 0.0))
    box = Obstacle.box("box", (0.1, 0.1, 0.1), (0.9, 0.0, 0.0))
    default = controller_at(robot, tasks, [box])
    assert isinstance(default.clearance, ClearanceLimit)
    assert default.clearance.margin == MARGIN
    assert "box" in default.clearance.solids.names
    assert controller_at(robot, tasks, [box], limits="off").clearance == "off"
    assert controller_at(robot, tasks, [box], clearance="off").clearance == "off"
    wide = ClearanceLimit(robot, Solids.of(robot, [box]), margin=0.02)
    default.clearance = wide
    assert default.clearance is wide
    other = qpsafe.load_robot("iiwa14")
    for wrong in ("wide", 0.02, ClearanceLimit(other, Solids.of(other))):
        with pytest.raises(qpsafe.ConfigurationError, match="clearance"):
            default.clearance = wrong
    assert default.clearance is wide
