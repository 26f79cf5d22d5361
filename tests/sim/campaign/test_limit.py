"""The best with foresight: a bound that the controller never exceeds, motion within limits, optima that are known."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from amounts import first, some

import qpsafe
from qpsafe.errors import ConfigurationError, RobotWarning
from qpsafe.limits import JointLimits, stopping_speed
from qpsafe.sim.campaign.limit.escape import TOUCHING, Escape
from qpsafe.sim.campaign.limit.limit import Best, limit_of
from qpsafe.sim.campaign.limit.people_along import PeopleAlong, steps_of
from qpsafe.sim.campaign.limit.search import best_way
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.closest import PairsAlong, closest, smallest
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.recording import Recording
from qpsafe.sim.campaign.trials.servo import DT, Servo
from qpsafe.sim.campaign.trials.station import station
from qpsafe.sim.campaign.trials.trial import recorded
from qpsafe.sim.campaign.trials.work import _excess
from qpsafe.sim.engine.distances import Distances
from qpsafe.sim.engine.tracks import PersonTracks
from qpsafe.sim.engine.world import World
from qpsafe.sim.people.person import SEGMENTS
from qpsafe.sim.world.scene import build_scene

# it is not imported yet: that takes two seconds, also for whoever runs other files
pytestmark = pytest.mark.skipif(find_spec("cma") is None, reason="needs cma")

FEW = some(30, of=150)  # motions to try


@pytest.fixture(scope="module")
def plan(people: str) -> Plan:
    return Plan(motions=("line", "pick"), people=people, controllers=("default",), seed=4)


@pytest.fixture(scope="module", params=first(1, [0, 1]))
def best(request: pytest.FixtureRequest, plan: Plan) -> Best:
    return limit_of(plan, request.param, "default", FEW)


def escape_of(plan: Plan, trial: int, first: int) -> Escape:
    met = meeting(plan, trial)
    return Escape(met.station, met.tracks, recorded(plan, met, "default"), first, plan.lag)


# The bound


def test_nobody_does_better_than_the_limit_and_nothing_exceeds_what_is_fixed(best: Best) -> None:
    """The controller's own motion, and that without control, are among those tried."""
    limit = best.limit
    assert limit.limit >= limit.distance
    assert limit.limit >= limit.alone
    assert limit.limit <= limit.fixed
    assert limit.evaluations <= FEW
    assert limit.seen
    assert limit.first_sight > 0.0


def test_the_motion_is_what_is_said_of_it_by_other_means(plan: Plan, best: Best) -> None:
    """Up to first detection it is the controller's, its distance is what every tick's is, and it touches nothing."""
    assert best.motion is not None
    met, run = meeting(plan, best.limit.trial), best.run
    first = round(best.limit.first_sight / DT)
    assert (
        best.motion[:, :first].tobytes()
        == np.array((run.q, run.qd, run.reference_q, run.reference_qd))[:, :first].tobytes()
    )
    q = best.motion[0]
    assert closest(met.station, q, met.tracks).distance.min() == best.limit.limit
    assert closest(met.station, run.q, met.tracks).distance.min() == best.limit.distance
    pairs = met.station.distances
    assert min(smallest(met.station, q, some) for some in (pairs.furniture, pairs.floors, pairs.own)) >= 0.0


def test_every_command_is_inside_the_limits(plan: Plan, best: Best) -> None:
    """By the box of each tick, and by the measure that campaigns judge controllers with."""
    assert best.motion is not None
    robot = meeting(plan, best.limit.trial).station.robot
    limits, (q, _, asked, speed) = JointLimits.of(robot, DT), best.motion
    last, before = q[0], np.zeros(robot.nq)
    for k in range(len(q)):
        box = limits.box(last, before)
        assert (box.lower <= speed[k]).all()
        assert (speed[k] <= box.upper).all()
        last, before = asked[k], speed[k]
    said: Any = SimpleNamespace(reference_q=asked, reference_qd=speed, dt=DT)
    assert _excess(said, robot) == 0.0


def test_the_same_seed_gives_the_same_motion(plan: Plan, best: Best) -> None:
    again = limit_of(plan, best.limit.trial, "default", FEW)
    assert again.limit == best.limit
    assert again.motion is not None
    assert best.motion is not None
    assert again.motion.tobytes() == best.motion.tobytes()


def test_who_sees_nobody_has_no_limit(plan: Plan) -> None:
    found = limit_of(plan, 0, "none", FEW)
    assert found.motion is None
    assert np.isnan([found.limit.limit, found.limit.reached, found.limit.first_sight]).all()
    assert found.limit.contact
    assert not found.limit.seen
    assert not found.limit.avoidable
    assert found.limit.sentence == "Nobody was seen before the contact."


# The motion


@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_the_rollout_is_the_box_and_the_servo_tick_by_tick(people: str, lag: float, rng: np.random.Generator) -> None:
    plan = Plan(motions=("line",), people=people, controllers=("default",), lag=lag)
    first = 40
    met = meeting(plan, 0)
    run = recorded(plan, met, "default")
    robot, escape = met.station.robot, Escape(met.station, met.tracks, run, first, lag)
    goals, since = rng.uniform(robot.lower - 1.0, robot.upper + 1.0, (2, robot.nq)), np.array([0, 30])
    q, qd, asked, speed = escape.motion(goals, since)
    limits, servo = JointLimits.of(robot, DT), Servo(met.station.start, lag)
    here, before = met.station.start, np.zeros(robot.nq)
    for k in range(160):
        assert q[k].tobytes() == servo.q.tobytes()
        assert qd[k].tobytes() == servo.qd.tobytes()
        if k < first:
            here, before = run.reference_q[k], run.reference_qd[k]
        else:
            away = goals[int(k >= first + 30)] - here
            wish = [
                np.copysign(stopping_speed(abs(e), a, DT), e) for e, a in zip(away, robot.max_acceleration, strict=True)
            ]
            before = limits.box(here, before).clip(np.array(wish))
            here = here + before * DT
        assert asked[k] == pytest.approx(here, abs=1e-15)
        assert speed[k] == pytest.approx(before, abs=1e-15)
        servo.follow(asked[k], speed[k])


def test_a_goal_within_reach_is_reached_and_kept(plan: Plan) -> None:
    escape = escape_of(plan, 0, 10)
    goal = 0.5 * (escape.robot.lower + escape.robot.upper)
    asked, speed = escape.motion(goal[None], np.array([0]))[2:]
    assert asked[-1] == pytest.approx(goal, abs=1e-9)
    assert speed[-1] == pytest.approx(0.0, abs=1e-9)


# Distances along it


def test_distances_are_those_of_every_tick(rng: np.random.Generator) -> None:
    """Ticks that are not measured could not have been the smallest; with tolerance and `enough` likewise."""
    plan = Plan(controllers=("none",), seed=40)
    boards = 0
    for trial in (0, 1, 2, 11):
        met = meeting(plan, trial)
        place, tracks, count = met.station, met.tracks, len(met.tracks)
        boards += tracks.boards.shape[1]
        ways = np.cumsum(rng.normal(size=(count, 6)) * 0.02 * rng.uniform(), axis=0)
        q, people = place.start + ways, PeopleAlong(place, tracks)
        every = closest(place, q, tracks).distance
        assert people.smallest(q) == every.min()
        half = count // 2
        assert people.smallest(q[half:], half) == every[half:].min()
        rough = people.smallest(q, tolerance=0.01)
        assert every.min() <= rough <= every.min() + 0.01
        assert people.smallest(q, enough=every.min() - 1e-9) == every.min()
        assert every.min() <= people.smallest(q, enough=every.min() + 0.1) <= every.min() + 0.1
    assert boards


@pytest.mark.slow
def test_pairs_are_the_same_from_a_known_start_and_below_a_bound(rng: np.random.Generator) -> None:
    place = station("irb140", "pick")
    pairs = place.distances.furniture
    for _ in range(3):
        q = place.start + np.cumsum(rng.normal(size=(200, 6)) * 0.01, axis=0)
        whole, along = smallest(place, q, pairs), PairsAlong(place, pairs, q[0])
        assert along.smallest(q) == whole
        assert along.smallest(q, 0.0) == min(whole, 0.0)
        assert along.smallest(q, 0.0) == min(whole, 0.0)  # nothing is left of the first time


def test_no_point_of_anybody_moves_farther_than_the_steps(rng: np.random.Generator) -> None:
    met = next(m for m in (meeting(Plan(seed=40), trial) for trial in range(30)) if m.tracks.boards.shape[1])
    tracks, steps = met.tracks, steps_of(met.tracks)
    share = rng.uniform(size=(1, len(tracks.radii), 1))
    points = (1.0 - share) * tracks.ends[:, :, 0] + share * tracks.ends[:, :, 1]
    inside = np.append(rng.uniform(-1.0, 1.0, (tracks.boards.shape[1], 3)) * tracks.half_sizes, [[1.0]], axis=1)
    corners = (tracks.boards @ inside[None, :, :, None])[:, :, :3, 0]
    for places in (points, corners):
        moved = np.linalg.norm(np.diff(places, axis=0), axis=2)
        assert (moved <= steps[:-1, None] + 1e-12).all()
    assert steps[-1] == 0.0


@pytest.mark.long
def test_what_touches_furniture_is_worse_than_any_contact(plan: Plan) -> None:
    """And a motion into the table is no candidate for the limit."""
    escape = escape_of(plan, 1, 10)
    table = escape.robot.home + np.array((0.0, 1.2, 0.3, 0.0, 0.0, 0.0))
    assert escape.compared(table[None], np.array([0])) < TOUCHING
    assert escape.distance(escape.motion(table[None], np.array([0]))) == -np.inf
    assert escape.compared(escape.robot.home[None], np.array([0])) > TOUCHING


# Optima that are known

SLIDE = """
<mujoco><worldbody>
  <body name="base"><geom type="sphere" size="0.01" pos="-5 0 0"/>
    <body name="car"><joint name="x" type="slide" axis="1 0 0" range="-4 4"/>
      <geom type="sphere" size="0.1" mass="1"/></body></body>
</worldbody><actuator><motor name="x" joint="x"/></actuator></mujoco>
"""


def test_a_car_that_is_run_after_does_as_well_as_a_car_can(tmp_path: Path) -> None:
    """One joint: the motion that is farthest at every moment, x*(t) >= x(t), is the best of all."""
    (tmp_path / "car.xml").write_text(SLIDE)
    with pytest.warns(RobotWarning):  # limits that the file does not state
        robot = qpsafe.load_robot(tmp_path / "car.xml")
    scene = build_scene(robot, pedestal=0.5, people=())
    world = World.of(scene)
    place: Any = SimpleNamespace(robot=robot, world=world, distances=Distances(world, robot))
    ticks, first, gap, radius, run_speed = 500, 20, 0.4, 0.05, 0.45
    way = np.minimum(run_speed * DT * np.arange(ticks), 0.6)  # then he stops
    centres = np.zeros((ticks, len(SEGMENTS), 2, 3))
    centres[..., 0] = (way - gap - 0.1 - radius)[:, None, None]
    nobody = np.empty((ticks, 0, 4, 4))
    tracks = PersonTracks(
        centres, np.full(len(SEGMENTS), radius), nobody, np.empty((0, 3)), DT, ("hand",) * len(SEGMENTS)
    )
    still = np.zeros((ticks, 1))
    stay = Recording(
        DT, still, still, still, still, np.array(["following"] * ticks), np.zeros(ticks),
        np.zeros(ticks, dtype=np.int64), [np.empty((0, 3))] * ticks,
    )  # fmt: skip
    x, v, a, fastest = 0.0, 0.0, robot.max_acceleration[0], np.zeros(ticks)
    for k in range(first, ticks - 1):
        v = min(v + a * DT, robot.max_velocity[0], stopping_speed(4.0 - x, a, DT))
        x += v * DT
        fastest[k + 1] = x
    optimum = (fastest - way + gap).min()
    escape = Escape(place, tracks, stay, first)
    assert escape.people.smallest(still) < 0.0 < optimum < gap  # it matters
    found, tried = best_way(escape, [still[0]], 3, FEW)
    assert tried <= FEW
    motion = escape.motion(found.goals, found.since)
    assert escape.distance(motion) == pytest.approx(optimum, abs=1e-6)


def test_who_stands_still_near_the_tool_need_come_no_nearer(people: str) -> None:
    """The distance at first detection is the optimum, and the search stops there: nothing can exceed it."""
    plan = Plan(motions=("hold",), people=people, controllers=("default",))
    met = meeting(plan, 0)
    run = recorded(plan, met, "default")
    near = closest(met.station, run.q[:1].repeat(len(run.q), axis=0), met.tracks).distance
    k = int(np.flatnonzero(near < 0.15)[0])
    ends = met.tracks.ends[k : k + 1].repeat(len(run.q), axis=0)
    boards = met.tracks.boards[k : k + 1].repeat(len(run.q), axis=0)
    stands = PersonTracks(ends, met.tracks.radii, boards, met.tracks.half_sizes, DT, met.tracks.names)
    stay = run._replace(
        q=run.q[:1].repeat(len(run.q), axis=0), qd=0.0 * run.qd, reference_q=run.q[:1].repeat(len(run.q), axis=0),
        reference_qd=0.0 * run.qd,
    )  # fmt: skip
    escape = Escape(met.station, stands, stay, 5)
    found, tried = best_way(escape, [stay.q[0]], 1, FEW)
    assert escape.fixed == near[k]
    assert tried < FEW
    assert escape.distance(escape.motion(found.goals, found.since)) == near[k]


@pytest.mark.parametrize("evaluations", [1, 3, 20])
def test_a_handful_of_motions_is_a_search_too(plan: Plan, evaluations: int) -> None:
    """Fewer than those that are tried in any case were a bare ValueError."""
    found = limit_of(plan, 0, "default", evaluations)
    assert found.limit.evaluations <= evaluations
    assert found.limit.distance <= found.limit.limit or np.isnan(found.limit.limit)


@pytest.mark.parametrize("evaluations", [0, -1, 2.5, True, "many", None])
def test_no_number_of_motions_is_named(plan: Plan, evaluations: Any) -> None:
    with pytest.raises(ConfigurationError, match="evaluations"):
        limit_of(plan, 0, "default", evaluations)
