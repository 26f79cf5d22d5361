"""All cases at one moment of a run: each goes on from a copy, with its fault for a while."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sensing.speed_cap import wire_speed
from qpsafe.sim.sick.cases import WINDOW, Case, Reaction, Record, Window
from qpsafe.sim.sick.frame_cases import ONE, FrameCase
from qpsafe.sim.world.distance import TrueDistances

if TYPE_CHECKING:
    from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop, Moment

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


class Outcome(NamedTuple):
    """What became of one case at one moment.

    Attributes:
        reaction: The promised one.
        contact: Whether the robot touched board or person, where the healthy run did not.
        passed: Largest excess over a joint limit, relative to it.
        nearest: Smallest distance to board or person [m].
        nearest_healthy: The same in the healthy run [m].
    """

    reaction: Reaction
    contact: bool
    passed: float
    nearest: float
    nearest_healthy: float


def at_moment(loop: FixedLoop, before: Array, cases: Sequence[Case | FrameCase], seed: int) -> list[Outcome]:
    """All cases at one moment.

    Args:
        loop: The run until then.
        before: What the sensors said in the tick before (k,) [m].
        cases: Lines of the table.
        seed: Of the sensors that fall sick.
    """
    rng = np.random.default_rng(seed)
    healthy = _play(loop.copy(), np.zeros(0, dtype=np.intp), before, None)
    quiet = min(record.gap for record in healthy)
    results = []
    for case in cases:
        sick = _sick(loop, before, case, rng)
        copy = loop.copy()
        ticks = _play(copy, sick, before, case)
        controller = copy.controller
        controller.acknowledge()
        parts = [] if controller.ranging is None else [controller.ranging.watches.severity]
        parts += [] if controller.sensing is None else [controller.sensing.health.severity]
        after = next((severity for severity in ("stopped", "capped") if severity in parts), "clear")
        window = Window(sick, loop.sensor_names, before, healthy, ticks, after, controller.rules, controller.dt)
        gap = min(record.gap for record in ticks)
        contact = gap <= 0.0 < quiet
        results.append(Outcome(case.reaction(window), contact, _excess(loop, ticks), gap, quiet))
    return results


def _sick(loop: FixedLoop, before: Array, case: Case | FrameCase, rng: np.random.Generator) -> Numbers:
    """Which of the sensors fall sick: the first of spots is one that sees something."""
    those = np.arange(len(before))
    if isinstance(case, FrameCase):
        assert loop.ranging is not None
        those = those[len(before) - len(loop.ranging.names) :]
        first = int(rng.choice(those))
    else:
        seeing = np.flatnonzero(np.isfinite(before))
        first = int(rng.choice(seeing)) if len(seeing) else int(rng.integers(len(before)))
    number = max(round(case.share * len(those)), 1)
    others = rng.permutation(those[those != first])
    return np.concatenate(([first], others[: number - 1])).astype(np.intp)


def _play(loop: FixedLoop, sick: Numbers, before: Array, case: Case | FrameCase | None) -> list[Record]:
    """Go on for a window, the sick sensors spoilt for as long as the case says."""
    records: list[Record] = []
    sensing, robot, gaps = loop.controller.sensing, loop.controller.robot, TrueDistances(loop.scene)
    frames = case.frames(tuple(loop.sensor_names[i] for i in sick)) if isinstance(case, FrameCase) else None
    anchors: list[Array] = []
    for k in range(WINDOW):
        fault = None
        if isinstance(case, Case) and k < case.lasts:

            def fault(distances: Array, case: Case = case) -> tuple[Array, Array]:
                spoilt, ages = distances.copy(), np.zeros(len(distances))
                spoilt[sick], ages[sick] = case.spoil(distances[sick], before[sick])
                return spoilt, ages

        moment = loop.step(fault, frames if case is not None and k < case.lasts else None)
        tick, moved = moment.tick, 0.0
        here = _where(loop, moment, sick, before)
        if here is not None:
            # an image that stays is one of the first that come
            anchors += [here] if len(anchors) < (ONE if frames else 1) else []
            moved = min(float(np.abs(here - a).max() if frames else np.linalg.norm(here - a)) for a in anchors)
        records.append(
            Record(
                tick.status,
                tick.severity,
                tick.unseen,
                np.zeros(0) if sensing is None else sensing.counted,
                tick.cdf_n,
                wire_speed(tick.reference.qd, robot.at(tick.reference.q)),
                tick.reference.q,
                tick.reference.qd,
                min(found.distance for found in gaps.measure(loop.plant.data)),
                moved,
            )
        )
        loop.advance()
    return records


def _where(loop: FixedLoop, moment: Moment, sick: Numbers, before: Array) -> Array | None:
    """What moves if the first sick sensor's readings must change: a spot's point, or the pose of a range sensor."""
    sensing, ranging = loop.controller.sensing, loop.controller.ranging
    if not len(sick):
        return None
    name = loop.sensor_names[sick[0]]
    if ranging is not None and name in (sensor.name for sensor in ranging.sensors):
        sensor = next(sensor for sensor in ranging.sensors if sensor.name == name)
        fixed = sensor.mount == "world"  # then the robot before it
        return moment.state.body_poses() if fixed else moment.state.pose(sensor.mount) @ sensor.pose
    if sensing is None or not np.isfinite(before[sick[0]]):
        return None
    spots = before[: len(sensing.spots)]
    return sensing.spots.points(moment.state, np.where(np.isfinite(spots), spots, 0.0))[sick[0]]


def _excess(loop: FixedLoop, ticks: list[Record]) -> float:
    """Largest excess over a joint limit of the references: position [rad], velocity and acceleration relative to it."""
    robot, dt = loop.controller.robot, loop.controller.dt
    q, qd = np.array([record.q for record in ticks]), np.array([record.qd for record in ticks])
    position = max((robot.lower - q).max(), (q - robot.upper).max())
    velocity = (np.abs(qd) / robot.max_velocity).max() - 1.0
    acceleration = (np.abs(np.diff(qd, axis=0)) / (robot.max_acceleration * dt)).max() - 1.0
    return float(max(position, velocity, acceleration))
