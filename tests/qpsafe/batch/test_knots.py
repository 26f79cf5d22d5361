"""Trajectories as knots, against the trajectories; offsets against pinocchio."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from amounts import some
from hypothesis import given
from hypothesis import strategies as st

import qpsafe
from qpsafe.batch.knots import Path, Refused, _sample_knots, path_of
from qpsafe.tasks.moves import Arc, Dwell, JointMove, JointMoveOfFrame, Line
from qpsafe.tasks.offset import displaced, offset_of
from qpsafe.tasks.program import Program
from qpsafe.tasks.rotation import exp3
from qpsafe.tasks.trajectory import FixedPose, Sample

vectors = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).map(np.array)


def pose(place: Any, turn: Any) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3], T[:3, :3] = place, exp3(np.array(turn, dtype=float))
    return T


def interpolated(path: Path, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    poses, twists = np.empty((len(times), 4, 4)), np.empty((len(times), 6))
    _sample_knots(path.times, path.knots, times, poses, twists)
    return poses, twists


@pytest.mark.parametrize("kind", ["line", "arc", "joints", "program"])
def test_knots_are_as_near_as_they_say_at_any_time(irb140: Any, kind: str) -> None:
    a, b = pose((0.5, 0.0, 0.4), (0.0, 3.0, 0.0)), pose((0.4, 0.2, 0.5), (0.5, 2.0, 0.3))
    fast = (irb140.max_velocity, 4.0 * irb140.max_velocity, 40.0 * irb140.max_velocity)
    trajectory = {
        "line": Line(a, b),
        "arc": Arc(a, (0.45, 0.15, 0.4), b),
        "joints": JointMoveOfFrame(irb140, "tcp", JointMove(irb140.home, irb140.home + 0.7, *fast)),
        "program": Program([Line(a, b), Dwell(b, 0.1), Line(b, a)], [(1, "grip"), (2, "go")], cycle=True),
    }[kind]
    path = path_of(trajectory, 0.004, 1.0)
    times = np.random.default_rng(0).uniform(0.0, trajectory.duration, some(150, of=400))
    poses, twists = interpolated(path, times)
    for time, T, twist in zip(times, poses, twists, strict=True):
        sample = trajectory.sample(time)
        assert np.abs(T - sample.pose).max() <= 2e-10
        assert np.abs(twist - sample.twist).max() <= 2e-8
    end, still = interpolated(path, np.array([path.period]))
    assert np.abs(end[0] - trajectory.sample(path.period).pose).max() <= 1e-15
    assert not still.any()
    assert [name for _, name in path.events] == (["grip", "go"] if kind == "program" else [])


class Jump:
    """Half a millimetre at once; or what is no sample."""

    def __init__(self, good: bool) -> None:
        self.good = good

    def sample(self, t: float) -> Any:
        return Sample(pose((5e-4 * (t > 0.1), 0.0, 0.0), np.zeros(3)), np.zeros(6) if self.good else np.full(6, np.nan))


@pytest.mark.parametrize(("good", "words"), [(True, "jumps"), (False, "no finite Sample")])
def test_what_cannot_be_followed_is_refused_by_name_and_works_the_general_way(
    irb140: Any, good: bool, words: str
) -> None:
    with pytest.raises(Refused, match=words):
        path_of(Jump(good), 0.004, 0.3)
    controller = qpsafe.SafetyController(irb140, [qpsafe.PositionTask("tcp", Jump(good))])
    batch = qpsafe.BatchController(controller, 1, horizon=0.3)
    assert not batch.compiled
    assert words in batch.why


class Late:
    """Good for a while, then it fails."""

    def __init__(self, place: np.ndarray) -> None:
        self.place = place

    def sample(self, t: float) -> Any:
        if t > 0.25:
            raise RuntimeError("no more")
        return Sample(self.place, np.zeros(6))


def test_a_path_that_fails_beyond_what_was_looked_at_makes_its_robots_brake_and_say_so(irb140: Any) -> None:
    controller = qpsafe.SafetyController(irb140, [qpsafe.PositionTask("tcp", Late(irb140.pose("tcp", irb140.home)))])
    batch = qpsafe.BatchController(controller, 2, horizon=0.2)
    assert batch.compiled
    q, qd = np.tile(irb140.home, (2, 1)), np.zeros((2, 6))
    for _ in range(80):
        tick = batch.step(q, qd, points=[[], []])
        q, qd = tick.q, tick.qd
    assert (tick.status == tick.STATUSES.index("fault")).all()
    assert "horizon" in tick.words(0)[0]
    assert (tick.path_time <= 0.2 + 1e-12).all()
    assert not qd.any()
    assert "no more" in qpsafe.BatchController(controller, 2, horizon=0.3).why


def test_a_pose_that_does_not_move_is_one_knot() -> None:
    path = path_of(FixedPose(pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6))), 0.004, 1.0)
    assert len(path.times) == 1


@given(vectors, vectors, vectors, vectors, st.floats(1e-12, 3.0))
def test_offsets_move_a_reference_to_where_they_were_taken(
    place: np.ndarray, turn: np.ndarray, shift: np.ndarray, axis: np.ndarray, angle: float
) -> None:
    """Back and forth, and against pinocchio's exponential, its logarithm and the derivative of the exponential."""
    theta = angle * axis / max(float(np.linalg.norm(axis)), 1e-3)
    reference, twist, rate = pose(place, turn), np.r_[turn, shift], np.r_[axis, place]
    offset = np.r_[shift, theta]
    moved, moving = displaced(reference, twist, offset, rate)
    expected = exp3(theta) @ reference[:3, :3]
    assert np.abs(moved[:3, :3] - expected).max() <= 1e-14
    assert np.abs(offset_of(moved, reference) - offset).max() <= 1e-13
    assert np.abs(offset_of(moved, reference)[3:] - pin.log3(moved[:3, :3] @ reference[:3, :3].T)).max() <= 1e-9
    omega = exp3(theta) @ twist[3:] + pin.Jexp3(-theta) @ rate[3:]
    assert np.abs(moving - np.r_[twist[:3] + rate[:3], omega]).max() <= 1e-12
