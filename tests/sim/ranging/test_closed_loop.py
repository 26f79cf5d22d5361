"""Arrays and a camera in the first experiment: the robot sees by them, and a run is what its settings say."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import first

import qpsafe
from qpsafe.sim.engine.tracks import people_of
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.fixed.fixed_loop import FixedLoop
from qpsafe.sim.recording.run_file import StateRecorder, read_run, write_run
from qpsafe.sim.replay.replay import replay
from qpsafe.sim.replay.settings import settings_of
from qpsafe.sim.stories.file import parse_story

pytestmark = pytest.mark.long

ROBOT = qpsafe.load_robot("irb140")
WALK = """
[[person]]
name = "A"
start = [{start}, 0.1]
heading = 180.0

[[person.step]]
do = "walk"
to = [{end}, 0.0]
speed = 1.6
ease = 0.3
"""


def experiment(sensor: str, ticks: int, start: float = 1.3, end: float = 0.75) -> FixedExperiment:
    story = parse_story(WALK.format(start=start, end=end))
    return FixedExperiment(ROBOT, story=story, duration=ticks * 0.004, sensor=sensor)


@pytest.mark.parametrize("sensor", first(1, ["vl53l5cx", "sharp+depth"]))
def test_a_run_can_be_replayed_bit_by_bit(sensor, tmp_path) -> None:
    """Its file holds no images: they are made again from the recorded joints."""
    run, states = experiment(sensor, 100), StateRecorder()
    log = run.run(states.observe)
    write_run(tmp_path / "run.npz", log, settings_of(run), ROBOT, states)
    assert log.distances.shape[1] == len(log.spot_names) == {"v": 20, "s": 21}[sensor[0]]
    assert np.isfinite(log.distances).any()
    assert set(log.status) == {"ok"}
    found = replay(read_run(tmp_path / "run.npz"))
    assert found.same, found.first


@pytest.mark.slow
def test_a_copy_goes_on_as_the_run_does_bit_by_bit() -> None:
    loop = FixedLoop(experiment("vl53l5cx+depth", 110))
    for _ in range(50):
        loop.step()
        loop.advance()
    twin = loop.copy()
    for _ in range(60):
        one, other = loop.step(), twin.step()
        assert one.tick.reference.q.tobytes() == other.tick.reference.q.tobytes()
        assert one.distances.tobytes() == other.distances.tobytes()
        loop.advance()
        twin.advance()


@pytest.mark.parametrize("sensor", first(1, ["depth", "vl53l5cx", "vl53l5cx-ideal", "depth-ideal"]))
def test_what_counts_is_somebody_and_neither_the_floor_nor_the_robot(sensor) -> None:
    """Every point lies near the body, as far as points that are lost come nearer, 0.24 m; far away, none counts."""
    loop = FixedLoop(experiment(sensor, 120))
    for _ in range(120):
        moment = loop.step()
        ends, radii, *_ = people_of(loop.scene, loop.plant.data)
        axis = ends[:, 1] - ends[:, 0]
        for point in moment.tick.points:
            share = np.clip(((point - ends[:, 0]) * axis).sum(axis=1) / (axis * axis).sum(axis=1), 0.0, 1.0)
            away = np.linalg.norm(point - ends[:, 0] - share[:, None] * axis, axis=1) - radii
            assert away.min() < 0.35
        assert moment.tick.status == "ok"
        assert moment.tick.cdf_n > 1.0
        loop.advance()
    empty = FixedLoop(experiment(sensor, 25, start=4.5, end=4.4))
    for _ in range(25):
        tick = empty.step().tick
        assert (tick.status, len(tick.points), tick.cdf_n) == ("ok", 0, 0.0)
        empty.advance()


def test_a_sensor_whose_images_are_kept_away_is_named() -> None:
    loop, name, said = FixedLoop(experiment("vl53l5cx", 80)), "waist front 2", []
    for _ in range(80):
        tick = loop.step(frames=lambda images: [i for i in images if i.sensor.name != name]).tick
        said.append(name in tick.unseen)
        loop.advance()
    assert said == sorted(said)
    assert not said[0]
    assert said[-1]
