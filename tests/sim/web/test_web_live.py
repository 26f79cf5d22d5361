"""Behind the page: wishes are followed or refused in words, recordings replay, who is dragged near is evaded."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.laws.by_name import LAWS, PROJECTIONS
from qpsafe.robot.loader import bundled_robots, load_robot
from qpsafe.sim.recording.run_file import read_run
from qpsafe.sim.replay.replay import replay
from qpsafe.sim.web.live import Live, Wish
from qpsafe.sim.web.people import AWAY, HAND, PERSON, Drag
from qpsafe.sim.web.setup import DT, MOVE, RANDOM, STRAIGHT, Setup
from qpsafe.tick import BAD_INPUT, FAULT, Tick

pytestmark = pytest.mark.long

NEAR = Drag(PERSON, (0.75, 0.1, 0.0), 2.0)
RECORDED = some(80, of=200)  # ticks


def ticks(live: Live, count: int) -> list[Tick]:
    found = []
    for _ in range(count):
        live.tick()
        frame = live.frame()
        assert frame is not None
        found.append(frame.tick)
    return found


@pytest.fixture
def live(tmp_path: Path) -> Live:
    return Live(Setup(), tmp_path)


def test_who_is_dragged_to_the_robot_makes_it_evade_and_come_back(live: Live) -> None:
    calm = ticks(live, 50)[-1]
    live.follow(live.wish._replace(number=1, drag=NEAR))
    near = ticks(live, 400)
    assert calm.cdf_n == 0.0 < max(tick.cdf_n for tick in near)
    assert np.abs(near[-1].reference.q - calm.reference.q).max() > 0.05
    live.follow(live.wish._replace(number=2, drag=Drag(AWAY)))
    assert any(
        back.phase == "following" and np.abs(back.reference.q - calm.reference.q).max() < 2e-3
        for back in (ticks(live, 1)[0] for _ in range(1500))
    )


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_who_is_dragged_walks(live: Live, speed: float) -> None:
    """On the way one foot or the other stands on the floor and stays there, each swings; at the goal both stand."""
    live.follow(live.wish._replace(drag=Drag(PERSON, (4.8, 1.5, 0.0), 4.0)))
    for k in range(400):
        live.crowd(k)
    live.follow(live.wish._replace(drag=Drag(PERSON, (1.44, 0.45, 0.0), speed)))  # straight towards the robot
    ways = []
    before = live.crowd(400)[0].ends
    for k in range(401, 401 + round((3.6 / speed + 1.0) / DT)):
        ends = live.crowd(k)[0].ends
        if 600 < k < 600 + round(1.3 / speed / DT):  # at its speed
            toes = ends[[7, 13], 1] - before[[7, 13], 1]  # heels roll
            ways.append(np.linalg.norm(toes, axis=-1))
        before = ends
    assert (np.min(ways, axis=1) < 1e-9).mean() > 0.97  # but for ticks in which one lands and the other leaves
    assert (np.max(ways, axis=0) > 1.2 * speed * DT).all()
    standing = live.experiment.story.persons[0].pose(1.44, 0.45, math.atan2(-0.45, -1.44))
    assert np.abs(before - standing.ends).max() < 1e-9


@pytest.mark.parametrize("mode", [PERSON, HAND])
def test_nobody_is_faster_than_the_mouse_allows(live: Live, mode: str) -> None:
    live.follow(live.wish._replace(drag=Drag(mode, (1.5, -0.9, 0.5), 0.7)))
    live.follow(live.wish._replace(drag=Drag(mode, (0.8, 0.9, 0.3), 0.7)))
    places = [live.crowd(k)[0] for k in range(1, 200)]
    grips = np.array([(pose.hands[1] if mode == HAND else pose.positions[3][:2]) for pose in places])  # level
    ways = np.linalg.norm(np.diff(grips, axis=0), axis=1)
    assert (ways <= 0.7 * 0.004 * (1.0 if mode == PERSON else 1.05) + 1e-6).all()  # the arm bends a little beside
    assert ways.max() > 0.5 * 0.7 * 0.004


@given(x=st.floats(0.35, 1.5), y=st.floats(-0.8, 0.8), z=st.floats(-0.2, 0.9))
@settings(max_examples=some(10, of=25))
def test_a_hand_is_where_the_mouse_has_it(x: float, y: float, z: float) -> None:
    """Within reach of somebody who stands AHEAD behind it; 993 of 1000 of an arm are used."""
    crowd = people()
    crowd.want(Drag(AWAY))
    crowd.want(Drag(HAND, (x, y, z), 4.0))
    hand = crowd(next(COUNTER))[0].hands[1]
    assert np.abs(hand - (x, y, z)).max() < 0.02


COUNTER = itertools.count()


@cache
def people() -> Any:
    return Live(Setup(), Path()).crowd


@pytest.mark.parametrize(
    "change",
    [
        *first(1, [{"law": law, "cap": cap} for cap in (12.0, None) for law in LAWS]),
        {"projection": "paper"},
        {"gate": False},
        {"thresholds": (14.0, 0.1, 6.0, 0.2)},
        {"mass": 2.0, "damping": 0.5},
    ],
    ids=str,
)
def test_every_switch_works_while_the_robot_moves(live: Live, change: dict[str, Any]) -> None:
    live.follow(live.wish._replace(drag=NEAR))
    ticks(live, some(100, of=150))
    before = live.run
    live.follow(live.wish._replace(setup=replace(live.wish.setup, **change)))
    assert (live.note, live.run) == ("", before)  # the run goes on
    after = ticks(live, some(50, of=100))
    assert {tick.status for tick in after}.isdisjoint({FAULT, BAD_INPUT})
    rates = np.diff([tick.reference.qd for tick in after], axis=0) / 0.004
    assert (np.abs(rates) <= live.experiment.robot.max_acceleration + 1e-6).all()  # no step where parts are exchanged


def test_the_switches_change_what_they_name(live: Live) -> None:
    setup = Setup(law="nullspace", gate=False, cap=9.0, thresholds=(14.0, 0.1, 6.0, 0.2), mass=2.0, damping=3.0)
    own = live.loop.controller.evasion
    live.follow(live.wish._replace(setup=setup))
    controller = live.loop.controller
    assert type(controller.law).__name__ == "NullspaceLaw"
    assert controller.gate == "off"
    assert controller.barrier is not None
    assert controller.barrier.delta_max == 9.0
    assert [t.delta for t in controller.activation.thresholds] == [14.0, 6.0]
    assert np.array_equal(controller.evasion.mass, 2.0 * own.mass)
    assert np.array_equal(controller.evasion.damping, 3.0 * own.damping)


@pytest.mark.parametrize(
    ("robot", "sight"), first(1, itertools.product(bundled_robots(), ["ideal", "sharp", "perfect"]))
)
def test_every_bundled_robot_sees_somebody_near(tmp_path: Path, robot: str, sight: str) -> None:
    live = Live(Setup(robot=robot, sight=sight), tmp_path)
    reach = max(float(np.hypot(*live.experiment.robot.wire(live.experiment.robot.home, np.zeros(
        live.experiment.robot.nq)).ends[:, :2].T).max()), 0.3)  # fmt: skip
    live.follow(live.wish._replace(drag=Drag(HAND, (reach + 0.25, 0.0, 0.45), 4.0)))
    seen = ticks(live, 200)
    assert max(len(tick.points) for tick in seen) > 0
    assert {tick.status for tick in seen}.isdisjoint({FAULT, BAD_INPUT})


@pytest.mark.parametrize("story", [STRAIGHT, RANDOM])
def test_people_of_a_story_come_besides(tmp_path: Path, story: str) -> None:
    live = Live(Setup(story=story, seed=4), tmp_path)
    live.follow(live.wish._replace(drag=Drag(AWAY)))
    ticks(live, 20)
    frame = live.frame()
    assert frame is not None
    assert len(frame.people) >= 2 * 17
    assert frame.row.distance < 20.0  # not the one who is away


def test_a_recording_replays_bit_by_bit(tmp_path: Path) -> None:
    live = Live(Setup(task=MOVE, law="weighted", gate=False, mass=1.5, thresholds=(14.0, 0.1, 6.0, 0.2)), tmp_path)
    live.follow(live.wish._replace(drag=NEAR))
    ticks(live, 60)
    live.follow(live.wish._replace(record=True))
    ticks(live, RECORDED)
    live.follow(live.wish._replace(setup=replace(live.wish.setup, mass=1.0)))
    assert "recording" in live.note  # refused: one setup all through
    live.follow(live.wish._replace(record=False))
    (path,) = tmp_path.glob("*.npz")
    assert str(path) in live.note
    found = replay(read_run(path))
    assert (found.same, found.ticks) == (True, RECORDED)


@pytest.mark.slow
def test_furniture_of_a_cell_stands_there_and_is_known(tmp_path: Path) -> None:
    """A program leads the tool down, into a table if there is one: it stops above it. Recordings replay."""
    robot = load_robot("irb140")
    x, y, z = (float(value) for value in robot.pose("tcp", robot.home)[:3, 3])
    cell, program = tmp_path / "cell.toml", tmp_path / "down.toml"
    cell.write_text(f'[[box]]\nname = "table"\nsize = [0.4, 0.6, 0.04]\ncentre = [{x}, {y}, {z - 0.06}]\n')
    program.write_text(
        f"[points]\ndown = {{ position = [{x}, {y}, {z - 0.1}] }}\n[[segment]]\ndo = 'line'\nto = 'down'\n"
    )
    bare, furnished = (Live(Setup(task=str(program), cell=file), tmp_path) for file in ("", str(cell)))
    assert furnished.experiment.scene.model.ngeom == bare.experiment.scene.model.ngeom + 1
    for live, low in ((bare, z - 0.1), (furnished, z - 0.036)):
        live.follow(live.wish._replace(drag=Drag(AWAY)))
        last = ticks(live, 500)[-1]
        assert robot.pose("tcp", last.reference.q)[2, 3] == pytest.approx(low, abs=5e-4)

    live = Live(Setup(cell=str(cell)), tmp_path)
    live.follow(live.wish._replace(record=True))
    ticks(live, 100)
    live.follow(live.wish._replace(record=False))
    cell.unlink()  # what is recorded needs it no more
    (path,) = tmp_path.glob("*.npz")
    assert replay(read_run(path)).same


REFUSED = [
    {"setup": Setup(cell="no-such-file.toml")},
    {"setup": Setup(robot="no such robot")},
    {"setup": Setup(task="no-such-file.toml")},
    {"setup": Setup(story="no-such-file.toml")},
    {"setup": Setup(law="no such law")},
    {"setup": Setup(projection="none")},
    {"setup": Setup(sight="second")},
    {"setup": Setup(lag=float("nan"))},
    {"setup": Setup(cap=-1.0)},
    {"setup": Setup(thresholds=(5.0, 0.1, 8.0, 0.1))},
    {"setup": Setup(mass=float("inf"))},
    {"setup": Setup(damping="heavy")},  # type: ignore[arg-type]
    {"drag": Drag("fly")},
    {"drag": Drag(PERSON, (float("nan"), 0.0, 0.0))},
    {"drag": Drag(PERSON, (1e9, 0.0, 0.0))},
    {"drag": Drag(PERSON, "here")},  # type: ignore[arg-type]
    {"drag": Drag(PERSON, (1.0, 0.0, 0.0), -1.0)},
    {"pace": 0.0},
    {"pace": float("nan")},
    {"pace": "quick"},
]


def test_what_a_browser_may_send_and_nobody_can_have_is_refused_in_words(live: Live) -> None:
    for number, wrong in enumerate(REFUSED):
        kept = live.wish
        live.follow(kept._replace(number=number, **wrong))  # type: ignore[arg-type]
        assert live.note, wrong
        assert live.wish.setup == kept.setup, wrong
        assert live.wish.drag == kept.drag, wrong
        assert live.wish.pace == kept.pace, wrong
        assert ticks(live, 2)[-1].status == "ok", wrong
    live.follow(live.wish._replace(number=99))
    assert live.note == ""


def test_while_the_clock_stands_ticks_come_singly(live: Live) -> None:
    live.follow(live.wish._replace(paused=True))
    assert live.standing
    live.follow(live.wish._replace(steps=2))
    count = 0
    while not live.standing:
        live.tick()
        count += 1
    assert count == 2
    live.follow(live.wish._replace(paused=False))
    assert not live.standing


def test_the_worst_between_two_frames_is_told(live: Live) -> None:
    live.follow(live.wish._replace(drag=NEAR))
    ticks(live, 120)
    worst, gaps = [], []
    for _ in range(40):
        live.tick()
        worst.append(live._moment.tick.cdf_n)  # type: ignore[union-attr]
        gaps.append(min(gap.distance for gap in live._gaps.measure(live.loop.plant.data)))
    frame = live.frame()
    assert frame is not None
    assert frame.row.cdf_n == max(worst)
    assert frame.times.shape == (0, 2)  # the process measures them


@pytest.mark.slow
def test_a_robot_without_sensors_has_perfect_sight_and_cannot_be_recorded(tmp_path: Path, monkeypatch: Any) -> None:
    from qpsafe.sim.web import setup as module

    bare = module.load_robot("irb140").with_spots(None)
    monkeypatch.setattr(module, "load_robot", lambda name: bare)
    live = Live(Setup(), tmp_path)
    live.follow(live.wish._replace(drag=NEAR))
    assert max(len(tick.points) for tick in ticks(live, 250)) > 0
    live.follow(live.wish._replace(record=True))
    assert "sensors" in live.note
    assert not live.wish.record
    with pytest.raises(ConfigurationError):
        live.experiment.run()


def test_the_newest_wish_says_all() -> None:
    """So that any before it may be lost: it holds every choice there is."""
    assert set(Wish._fields) == {"number", "setup", "drag", "paused", "pace", "steps", "restarts", "record"}
    assert PROJECTIONS == ("strict", "paper")
