"""Clearance inside `mink.solve_ik` and `pink.solve_ik`: a target below a table leads the arm down to it, no more."""

from __future__ import annotations

from typing import Any

import mink
import mujoco
import numpy as np
import pink
import pinocchio as pin
import pytest
from amounts import first

import qpsafe
from qpsafe.geometry.measure import nearest_of
from qpsafe.geometry.solids import Solids
from qpsafe.plugins import mink as for_mink
from qpsafe.plugins import pink as for_pink
from qpsafe.sensing.hulls import Obstacle

DT, MARGIN = 0.004, 0.004
TABLE = Obstacle.box("table", (0.5, 0.8, 0.05), (0.55, 0.0, 0.3))


@pytest.fixture(scope="module")
def robot() -> Any:
    return qpsafe.load_robot("irb140")


class Mink:
    """The IRB 140 in mink."""

    def __init__(self, robot: Any, target: Any, clear: Any) -> None:
        model = mujoco.MjModel.from_xml_path(str(robot.model_path))
        self.configuration = mink.Configuration(model, q=robot.home)
        self.task = mink.FrameTask("tcp", "site", 1.0, 0.3, gain=0.02)
        self.task.set_target(mink.SE3.from_matrix(target))
        self.danger = for_mink.DangerMonitor(robot, DT)
        self.limits = [for_mink.JointLimit(self.danger)]
        if clear:
            self.limits.append(for_mink.ClearanceLimit(self.danger, [TABLE]))

    def solve(self) -> Any:
        return mink.solve_ik(self.configuration, [self.task], DT, "daqp", limits=self.limits)


class Pink:
    """The IRB 140 in pink, kept clear by a limit or by a barrier."""

    kind = "limit"

    def __init__(self, robot: Any, target: Any, clear: Any) -> None:
        self.configuration = pink.Configuration(robot.model, robot.model.createData(), np.array(robot.home))
        self.task = pink.FrameTask("tcp", 1.0, 0.3, gain=0.02)
        self.task.set_target(pin.SE3(target))
        self.danger = for_pink.DangerMonitor(robot, DT)
        self.limits, self.barriers = [for_pink.JointLimit(self.danger)], []
        if clear and self.kind == "limit":
            self.limits.append(for_pink.ClearanceLimit(self.danger, [TABLE]))
        elif clear:
            self.barriers.append(for_pink.ClearanceBarrier(self.danger, [TABLE]))

    def solve(self) -> Any:
        return pink.solve_ik(
            self.configuration, [self.task], DT, "daqp", limits=self.limits, barriers=self.barriers, safety_break=False
        )


class PinkBarrier(Pink):
    """Likewise."""

    kind = "barrier"


def along(engine: Any, robot: Any, clear: bool, ticks: int = 350) -> Any:
    """Joint positions of a run towards a target inside the table."""
    target = robot.pose("tcp", robot.home)
    target[2, 3] = 0.25
    loop, qd, path = engine(robot, target, clear), np.zeros(6), []
    for _ in range(ticks):
        loop.danger.update(loop.configuration.q, qd, points=[])
        qd = loop.solve()
        loop.configuration.integrate_inplace(qd, DT)
        path.append(np.array(loop.configuration.q))
    return np.array(path)


@pytest.mark.parametrize("engine", first(1, [Pink, Mink, PinkBarrier]))
def test_the_arm_stops_at_the_margin_and_no_call_fails(engine: Any, robot: Any) -> None:
    solids = Solids.of(robot, [TABLE])
    gaps = [
        min(nearest_of(solids.solid, robot.at(q).body_poses(), solids.furniture).distance for q in path[::5])
        for path in (along(engine, robot, True), along(engine, robot, False))
    ]
    assert MARGIN - 3e-4 < gaps[0] < MARGIN + 2e-3
    assert gaps[1] < -0.01


def test_pinks_limit_and_barrier_are_the_same(robot: Any) -> None:
    assert np.abs(along(Pink, robot, True) - along(PinkBarrier, robot, True)).max() < 1e-6


def test_the_barrier_is_the_distance_and_its_rate(robot: Any) -> None:
    danger = for_pink.DangerMonitor(robot, DT)
    barrier = for_pink.ClearanceBarrier(danger, [TABLE], margin=0.05)
    q = robot.home + np.array([0.0, 0.35, 0.1, 0.0, 0.0, 0.0])
    danger.update(q, np.zeros(6), points=[])
    at = pink.Configuration(robot.model, robot.model.createData(), q)
    value, J = barrier.compute_barrier(at), barrier.compute_jacobian(at)
    solids = Solids.of(robot, [TABLE])
    nearest = int(np.argmin(value))
    here = nearest_of(solids.solid, robot.at(q).body_poses(), solids.furniture, 0.2).distance
    assert value[nearest] == pytest.approx(here - 0.05, abs=1e-9)
    h = 1e-6
    for j in range(6):
        e = h * np.eye(6)[j]
        rate = [
            nearest_of(solids.solid, robot.at(q + s * e).body_poses(), solids.furniture, 0.2).distance
            for s in (1.0, -1.0)
        ]
        assert J[nearest, j] == pytest.approx((rate[0] - rate[1]) / (2.0 * h), abs=2e-3)


@pytest.mark.parametrize("kind", [for_mink.ClearanceLimit, for_pink.ClearanceLimit, for_pink.ClearanceBarrier])
def test_mistakes_are_named(kind: Any, robot: Any) -> None:
    with pytest.raises(qpsafe.ConfigurationError, match="danger"):
        kind(robot)
    with pytest.raises(qpsafe.ConfigurationError, match="margin"):
        kind(for_mink.DangerMonitor(robot, DT), margin=-1.0)
