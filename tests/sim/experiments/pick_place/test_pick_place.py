"""The paper's third experiment: screws are conserved, events happen once, equal settings give equal runs."""

import json
from collections import Counter
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.sim.drawing.gl import gl_available
from qpsafe.sim.experiments.pick_place.cell import PROGRAM
from qpsafe.sim.experiments.pick_place.experiment import PickPlaceExperiment, PickRun
from qpsafe.sim.experiments.pick_place.people import load_people
from qpsafe.sim.experiments.pick_place.pick_loop import PickLoop
from qpsafe.sim.experiments.pick_place.plots import seeds_figure, timeline
from qpsafe.sim.experiments.pick_place.report import cost, figures, promises, spread, to_dict
from qpsafe.sim.experiments.pick_place.seeds import run_seeds
from qpsafe.sim.experiments.pick_place.settings import PEOPLE
from qpsafe.sim.experiments.pick_place.snapshots import draw, moments, visits

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")


@pytest.fixture(scope="module")
def alone() -> PickRun:
    """One cycle without people."""
    return PickPlaceExperiment(ROBOT, cycles=1, people_file=None).run()


def test_a_cycle_delivers_a_screw(alone: PickRun) -> None:
    assert alone.finished
    assert [event.kind for event in alone.events] == ["grip", "release", "delivered"]
    assert len({event.screw for event in alone.events}) == 1
    assert Counter(place.partition(" ")[0] for place in alone.screws) == {"hole": 9, "box": 1}
    found = figures(alone)
    assert (found.delivered, found.missed, found.lost, found.contacts, found.unusual) == (1, 0, 0, 0, 0)
    assert found.duration == pytest.approx(alone.cycle_times.sum())
    assert found.clearance > 0.0  # nothing but the tip comes near, and it stays above the plate


def test_nothing_in_the_cell_is_danger(alone: PickRun) -> None:
    """Tables, support, box and screws are known, and the robot sees itself: without people nobody is seen."""
    assert (alone.log.cdf_n == 0.0).all()
    assert not alone.log.messages
    assert visits(alone) == []


@pytest.mark.slow
def test_equal_settings_give_equal_runs() -> None:
    """To the last bit, people and all."""
    first, second = (PickPlaceExperiment(ROBOT, seed=3, limit=1.0).run() for _ in range(2))
    assert not first.finished
    for field in fields(first.log):
        if field.name != "solve_time":
            np.testing.assert_array_equal(getattr(first.log, field.name), getattr(second.log, field.name))
    assert np.array_equal(first.states, second.states)


class Scared:
    """A sensor that sees something very near in chosen stretches of time, on top of what is there."""

    def __init__(self, sensor: Any, scares: list[tuple[int, int, int]]) -> None:
        self.sensor, self.scares, self.k = sensor, scares, 0

    def read(self, data: Any, state: Any) -> np.ndarray:
        distances = self.sensor.read(data, state)
        for spot, first, last in self.scares:
            if first <= self.k < last:
                distances[spot] = 0.2 + 1e-5 * (self.k % 7)  # a steady reading would be a stuck one
        self.k += 1
        return distances


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_suspensions_neither_lose_nor_repeat_events(alone: PickRun, seed: int) -> None:
    """Metamorphic: frights at any time delay what happens to the screws, and change nothing else."""
    rng = np.random.default_rng(seed)
    loop = PickLoop(PickPlaceExperiment(ROBOT, cycles=1, people_file=None))
    spots = loop.controller.spots
    assert spots is not None
    grip, release = (round(t / 0.004) for t in alone.times("grip", "release"))
    starts = [*rng.integers(0, 1500, 2), grip - 10, grip + 2]  # some when it matters
    scares = [(int(rng.integers(len(spots))), int(s), int(s) + int(rng.integers(40, 150))) for s in starts]
    loop.sensor = Scared(loop.sensor, scares)
    suspended, whole = 0, Counter(loop.whereabouts())
    for k in range(10_000):
        tick = loop.step().tick
        suspended += tick.phase == "suspended"
        if k % 25 == 0:
            places = Counter(place.partition(" ")[0] for place in loop.whereabouts())
            assert sum(places.values()) == sum(whole.values())
            assert not places["elsewhere"]
        loop.advance()
        if loop.events and loop.events[-1].kind in ("delivered", "lost"):
            break
    assert suspended > 10
    assert loop.k > release
    assert [e[1:] for e in loop.events] == [e[1:] for e in alone.events]


def test_people_vary_with_the_seed_and_can_reach_what_they_go_for() -> None:
    nominal, again = load_people(PEOPLE), load_people(PEOPLE)
    assert nominal.table == again.table
    assert nominal.table == load_people(PEOPLE, 0).table
    others = [load_people(PEOPLE, seed) for seed in range(1, 6)]  # planned at once: out of reach would be refused
    assert others[-1].table == load_people(PEOPLE, 5).table
    ends = [person.end for story in others for person in story.people]
    assert len(set(ends)) == len(ends)
    sides = {round(float(np.sign(person.root(0.0)[1]))) for person in nominal.people}
    assert sides == {-1, 1}  # from both sides of the robot


@pytest.mark.slow
def test_runs_are_the_same_in_one_process_or_two() -> None:
    experiment = PickPlaceExperiment(ROBOT, limit=0.2)
    counted: list[int] = []
    two = run_seeds(experiment, [None, 0], jobs=2, done=counted.append)
    assert two == run_seeds(experiment, [None, 0], jobs=1)
    assert counted == [1, 2]


def test_the_report_names_what_is_not_kept(alone: PickRun) -> None:
    good = figures(alone)
    with_people = replace(good, duration=good.duration + 2.0, nearest=0.3, nearest_moving=0.3)
    assert all(check.kept for check in promises([with_people], good, 1))
    assert cost(with_people, good) == pytest.approx(2.0)
    worse = {
        "cycle done": replace(with_people, finished=False),
        "delivered": replace(with_people, delivered=0),
        "missed or lost": replace(with_people, lost=1),
        "contact": replace(with_people, contacts=1, nearest_moving=-0.01),
        "furniture": replace(with_people, clearance=-0.001),
    }
    for name, bad in worse.items():
        (broken,) = [check for check in promises([with_people, bad], good, 1) if not check.kept]
        assert name in broken.name
    report = to_dict([with_people], good, promises([with_people], good, 1))
    assert json.loads(json.dumps(report, allow_nan=False)) == json.loads(json.dumps(report))
    assert report["without_people"]["nearest"] is None
    assert spread([3.0, 1.0, 2.0]) == {
        "smallest": 1.0,
        "quartile_1": 1.5,
        "median": 2.0,
        "quartile_3": 2.5,
        "largest": 3.0,
    }


def test_contact_counts_while_the_robot_moves_and_nan_counts_as_contact(alone: PickRun) -> None:
    """The measurement itself: a run with a touch, moved or still, and one whose distance is unknown."""
    gap = np.full(len(alone.log.time), 0.5)
    gap[100:103] = (-0.01, 0.0, np.nan)
    touched = replace(alone, log=replace(alone.log, person_distance=gap))
    assert figures(replace(touched, motion=np.full(len(gap), 2e-3))).contacts == 3
    still = figures(replace(touched, motion=np.full(len(gap), 0.9e-3)))
    assert (still.contacts, still.touched) == (0, 3)


def test_figures_are_drawn(alone: PickRun, tmp_path: Path) -> None:
    timeline(alone, [], tmp_path / "timeline.png", "a title")
    seeds_figure([figures(alone, 0), figures(alone, 1)], figures(alone), tmp_path / "seeds.png")
    for name in ("timeline.png", "seeds.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert [moment.letter for moment in moments(alone)] == ["a", "b"]


def test_programs_that_cannot_be_done_are_refused_before_the_run(tmp_path: Path) -> None:
    far = tmp_path / "far.toml"
    far.write_text(PROGRAM.read_text().replace("hole_7 = { position = [0.39", "hole_7 = { position = [0.99"))
    line = 1 + next(i for i, text in enumerate(far.read_text().splitlines()) if text.startswith('to = "hole"'))
    with pytest.raises(ConfigurationError, match=rf"far\.toml:{line}: segment\[0\]\.to = 'hole_7'"):
        PickPlaceExperiment(ROBOT, program=far).run()


@pytest.mark.slow
def test_ten_cycles_with_both_people() -> None:
    """The paper's demonstration: all screws delivered, nobody touched, and Fig. 14 has all its pictures."""
    experiment = PickPlaceExperiment(ROBOT)
    run = experiment.run()
    found = figures(run)
    assert found.finished
    assert (found.delivered, found.missed, found.lost) == (10, 0, 0)
    assert (found.taken, found.placed) == (2, 3)
    assert (found.contacts, found.touched) == (0, 0)
    assert found.nearest > 0.1
    assert Counter(place.partition(" ")[0] for place in run.screws)["elsewhere"] == 0
    assert len(run.screws) == 13
    found_moments = moments(run)
    assert [moment.letter for moment in found_moments] == list("abcdefgh")
    regimes = {moment.letter: run.log.regime[moment.tick] for moment in found_moments}
    assert regimes["a"] == regimes["h"] == "low"
    assert regimes["d"] != "low"
    assert {visit.person for visit in visits(run)} >= {0, 1}


@pytest.mark.slow
def test_snapshots_are_drawn(alone: PickRun, tmp_path: Path) -> None:
    if not gl_available()[0]:
        pytest.skip("no OpenGL")
    experiment = PickPlaceExperiment(ROBOT, cycles=1, people_file=None)
    assert [moment.letter for moment in draw(experiment, alone, tmp_path / "snapshots.png")] == ["a", "b"]
    assert (tmp_path / "snapshots.png").read_bytes().startswith(b"\x89PNG")
