"""Opponents keep what they promise: stops stand before they are touched, scaling nears nobody faster than v_max."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import first

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.opponents import registry
from qpsafe.sim.campaign.opponents.monitor import Monitor
from qpsafe.sim.campaign.opponents.registry import names, opponent, register
from qpsafe.sim.campaign.trials.closest import closest
from qpsafe.sim.campaign.trials.recording import STATUSES, Recording, record
from qpsafe.sim.campaign.trials.senses import Senses
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.campaign.trials.station import station
from qpsafe.sim.campaign.trials.work import work
from qpsafe.sim.engine.bodies import Bodies
from qpsafe.sim.engine.tracks import PersonTracks
from qpsafe.sim.experiments.fast_person import at_speed
from qpsafe.tick import FAULT

pytestmark = pytest.mark.long

TICKS = 1100  # somebody who walks at 1.6 m/s is there by then


@cache
def tracks(speed: float) -> PersonTracks:
    return at_speed(speed).track(DT * np.arange(TICKS))


def played(name: str, motion: str, speed: float) -> Recording:
    place = station("irb140", motion)
    return record(place, opponent(name), Senses(place, tracks(speed), "ideal", 0), TICKS)


WAIT = '[[segment]]\ndo = "dwell"\ntime = {}\n'
LIFT = "[rates]\nspeed = {}\n[points.up]\nposition = [0.453, 0.0, 0.6]\n"
LINE = '[[segment]]\ndo = "line"\nto = "up"\n'


@pytest.mark.parametrize(
    ("program", "moves"),
    [
        (WAIT.format(1.0), False),
        (LIFT.format(0.02) + LINE, False),
        (LIFT.format(0.3) + WAIT.format(25.0) + LINE, False),  # not in the time that is looked at
        (LIFT.format(0.3) + LINE, True),
    ],
)
def test_a_program_that_stands_is_slow_or_waits_can_be_stopped_as_a_held_pose_can(
    program: str, moves: bool, tmp_path: Path
) -> None:
    file = tmp_path / "program.toml"
    file.write_text(program)
    place, held = station("irb140", str(file)), station("irb140", "hold")
    assert place.deceleration > 0.0
    assert (place.speed > 0.1) is moves
    if not moves:
        assert (place.deceleration, place.speed) == (held.deceleration, 0.0)


@pytest.mark.parametrize(("motion", "speed"), first(1, [("line", 1.0), ("pick", 1.6), ("line", 1.6), ("pick", 1.0)]))
def test_a_stop_with_perfect_sight_stands_whenever_it_is_touched(motion: str, speed: float) -> None:
    """S_p reckons with people at up to 1.6 m/s: nobody as slow is touched by a robot that moves towards them."""
    run = played("stop_perfect_sight", motion, speed)
    near = closest(station("irb140", motion), run.q, tracks(speed))
    touched = np.flatnonzero(near.distance <= 0.0)
    assert len(touched) or motion == "pick" or speed < 1.6
    speeds = near.approach(station("irb140", motion).robot, run.q, run.qd)
    assert (speeds[touched] < 1e-9).all()
    assert run.path_time[-1] > 0.5  # it did work


def test_scaling_with_perfect_sight_nears_nobody_faster_than_allowed() -> None:
    """Up to what braking along the path takes, and only while it brakes as hard as it reckons with."""
    place, speed = station("irb140", "line"), 1.0
    run = played("scaling_perfect_sight", "line", speed)
    bodies, limit = Bodies(place.world, place.robot), Monitor(place).separation
    over = []
    for k in range(0, TICKS, 4):
        near = bodies.to_people(place.robot.at(run.q[k]), tracks(speed).row(k), 2.0)
        over.append(float((near.rows @ run.qd[k] - limit.speed(near.distance)).max(initial=0.0)))
    assert max(over) < 0.1
    assert np.mean(np.array(over) > 0.02) < 0.05


@pytest.mark.slow
def test_rows_of_separation_let_nobody_be_approached_faster_than_allowed() -> None:
    """Told of every part of somebody who walks at 1.6 m/s, until they touch; of one point a link, nearly so."""
    place, speed = station("irb140", "line"), 1.6
    bodies, limit = Bodies(place.world, place.robot), place.separation
    most = {}
    for name in ("none", "separation_perfect_sight", "strict_separation_perfect_sight"):
        run, over = played(name, "line", speed), []
        for k in range(0, TICKS, 4):
            near = bodies.to_people(place.robot.at(run.q[k]), tracks(speed).row(k), 2.0)
            if near.distance.min(initial=1.0) <= 0.0:
                break
            over.append(float((near.rows @ run.qd[k] - limit.speed(near.distance)).max(initial=0.0)))
        most[name] = max(over)
        assert run.path_time[-1] > 0.5
    assert most["none"] > 0.1
    assert most["separation_perfect_sight"] < 0.01
    assert most["strict_separation_perfect_sight"] < 0.05


@pytest.mark.parametrize(
    "name",
    first(
        3, ["default", "default_perfect_sight", "stop", *sorted({*names(), "stop_perfect_sight"} - {"default", "stop"})]
    ),
)
def test_all_keep_the_limits_and_never_refuse_to_move(name: str) -> None:
    robot = station("irb140", "line").robot
    run = played(name, "line", 1.6)
    qdd = np.diff(run.reference_qd, axis=0, prepend=0.0) / DT
    assert (np.abs(run.reference_qd) <= robot.max_velocity + 1e-9).all()
    assert (np.abs(qdd) <= robot.max_acceleration * (1.0 + 1e-9) + 1e-9).all()
    assert (run.reference_q >= robot.lower - 1e-9).all()
    assert (run.reference_q <= robot.upper + 1e-9).all()
    assert np.isfinite(run.reference_q).all()
    assert (run.status <= 1).all()
    assert run.path_time[-1] > 0.5


@pytest.mark.slow
def test_without_people_all_do_the_same_work() -> None:
    """Nobody there: nobody stops, whoever watches."""
    place = station("irb140", "line")
    nobody = PersonTracks.of((), [()] * 400, DT)
    runs = {name: record(place, opponent(name), Senses(place, nobody, "ideal", 0), 400) for name in names()}
    for name, run in runs.items():
        assert run.path_time[-1] == pytest.approx(runs["none"].path_time[-1], abs=0.02), name
        if name in ("stop", "default", "strict", "velocities"):
            assert np.array_equal(run.q, runs["none"].q), name


def test_a_users_controller_takes_part_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_known", dict(registry._known))

    def made(place: Any) -> Any:
        return place.controller()

    register("mine", made, "as it comes")
    assert opponent("mine").make is made
    assert opponent("mine_perfect_sight").sight == "points"
    for bad in ("mine", "x_perfect_sight", "", "a:b"):
        with pytest.raises(ConfigurationError, match="controllers"):
            register(bad, made)
    found = opponent(f"{__file__}:test_a_users_controller_takes_part_by_name")
    assert callable(found.make)
    for wrong in ("nobody", "no.such.module:thing", "math:nothing", "math:pi"):
        with pytest.raises(ConfigurationError, match="controllers"):
            opponent(wrong)


def test_the_guide_says_what_every_controller_is() -> None:
    page = (Path(__file__).resolve().parents[3] / "docs" / "how-to" / "campaign.md").read_text(encoding="utf-8")
    for name in names():
        assert f"| `{name}` | {opponent(name).sentence} |" in page


@pytest.mark.parametrize("robot", ["irb140", "iiwa14", "irb14000"])
def test_brisk_is_the_default_with_later_thresholds_and_pages_say_how_much(robot: str) -> None:
    place = station(robot, "hold")
    brisk, default = (opponent(name).make(place).activation for name in ("brisk", "default"))
    assert brisk.counts == default.counts
    for one, other, factor in zip(brisk.levels, default.levels, registry.BRISK, strict=True):
        assert (one.delta, one.epsilon) == (pytest.approx(factor * other.delta), other.epsilon)
    high, low = registry.BRISK
    docs = Path(__file__).resolve().parents[3] / "docs"
    for page in ("explanation/verified-motion.md", "how-to/tuning.md", "../CHANGELOG.md"):
        assert f"scaled({high}, {low})" in (docs / page).read_text(encoding="utf-8"), page
    assert f"up to {high:.0f} times, orientation up to {low} times" in opponent("brisk").sentence


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("when", [0, 3])
def test_a_clock_that_is_no_number_is_a_fault_and_no_work(wrong: float, when: int) -> None:
    """It was taken for no time lost."""
    place, ticks = station("irb140", "line"), 6

    class Wild:
        def __init__(self) -> None:
            self.own, self.count = place.controller(), 0

        def step(self, q: Any, qd: Any, distances: Any = None, *, points: Any = None, **_: Any) -> Any:
            tick = self.own.step(q, qd, points=np.empty((0, 3)))
            self.count += 1
            return replace(tick, path_time=wrong) if self.count == when + 1 else tick

    entry = registry.Opponent("wild", "a clock that stops", lambda _: Wild())  # type: ignore[arg-type, return-value]
    run = record(place, entry, Senses(place, PersonTracks.of((), [()] * ticks, DT), "ideal", 0), ticks)
    assert run.path_time[when] == (run.path_time[when - 1] if when else 0.0)
    assert np.flatnonzero(run.status == STATUSES.index(FAULT)).tolist() == [when]
    assert np.isfinite(work(run, place)).all() or np.isnan(work(run, place).path_error)
    assert work(run, place).bad_ticks == 1
