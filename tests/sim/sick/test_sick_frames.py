"""Sick images in closed loop: some cases here, the whole matrix when there is time; and what spoils them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import qpsafe
from qpsafe.ranging.adapters.vl53l5cx import vl53l5cx
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.people.choreography import Approach, Choreography
from qpsafe.sim.sick import frames
from qpsafe.sim.sick.frame_cases import FRAME_CASES, KEPT, NAMED, STOPS
from qpsafe.sim.sick.frames import SpoilsFrames
from qpsafe.sim.sick.matrix import run_matrix

ROBOT = qpsafe.load_robot("irb140")
BRIEF = Choreography(
    approaches=(Approach(math.radians(0.0), 0.0, 1.02, 0.72, medium_pause=0.2, close_pause=0.2),),
    duration=5.0,
    home_radius=1.7,
    approach_speed=0.9,
    withdraw_speed=0.9,
)
SENSOR = vl53l5cx("a")
#: One of each promise.
FEW = ("one image blind", "frozen, with new stamps", "other optics than declared, by its driver",
       "shifted by one row, for good", "a quarter of the sensors blind")  # fmt: skip


def image(stamp: float, offset: float = 0.0):
    return SENSOR.image(np.arange(64.0) / 64 + offset, stamp=stamp, sigma=np.full(64, 0.01))


@pytest.mark.slow
def test_some_cases_react_as_promised() -> None:
    cases = [case for case in FRAME_CASES if case.name in FEW]
    experiment = FixedExperiment(ROBOT, choreography=BRIEF, duration=5.0, sensor="vl53l5cx")
    results = run_matrix(experiment, count=1, seed=4, cases=cases, jobs=1)
    assert [result.case for result in results] == [case.name for case in cases]
    assert len(cases) == len(FEW)
    for result in results:
        assert result.kept is (True if result.applied else None), result
    assert sum(result.applied for result in results) >= len(results) - 1


@pytest.mark.slow
def test_a_reaction_that_does_not_come_is_missed() -> None:
    """A healthy sensor is not named, and a dead one does not go on as if nothing were."""
    healthy, dead = (case for case in FRAME_CASES if case.name in ("one image blind", "silent, for good"))
    wrong = [
        type(dead)("healthy, called dead", lambda image, first: image, NAMED, dead.within),
        type(dead)("dead, called kept", frames.silent, KEPT, healthy.within),
        type(dead)("a quarter healthy, called stopped", lambda image, first: image, STOPS, dead.within, share=0.25),
    ]
    experiment = FixedExperiment(ROBOT, choreography=BRIEF, duration=5.0, sensor="vl53l5cx-ideal")
    for result in run_matrix(experiment, count=1, seed=4, cases=wrong, jobs=1):
        assert result.kept is False, result


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["vl53l5cx", "sharp+depth"])
def test_every_case_at_20_moments(sensor) -> None:
    for result in run_matrix(FixedExperiment(ROBOT, sensor=sensor), count=20, jobs=2):
        assert result.kept is not False, result


def test_only_the_sick_are_spoilt_and_only_as_said() -> None:
    other = vl53l5cx("b").image(np.ones(64), stamp=0.0)
    for spoil in (frames.blind, frames.frozen, frames.silent, frames.shifted):
        passed = SpoilsFrames(["a"], spoil)([other, image(0.0)])
        assert passed[0] is other
        assert len(passed) == (1 if spoil is frames.silent else 2)


def test_frozen_and_repeated_images_are_the_first_that_came() -> None:
    for spoil, stamps in ((frames.frozen, [0.0, 0.1, 0.2]), (frames.repeated, [0.0, 0.0, 0.0])):
        faulty = SpoilsFrames(["a"], spoil)
        passed = [faulty([image(0.1 * k, offset=k)])[0] for k in range(3)]
        assert [item.stamp for item in passed] == pytest.approx(stamps)
        assert all(np.array_equal(item.distances, image(0.0).distances) for item in passed)


def test_rows_go_down_by_one_and_what_belongs_to_them_goes_along() -> None:
    original = image(0.0)._replace(sigma=np.arange(64.0), valid=np.arange(64) % 3 > 0)
    spoilt = frames.shifted(original, original)
    for part in ("distances", "sigma", "valid"):
        rows = np.asarray(getattr(original, part)).reshape(8, 8)
        assert np.array_equal(np.asarray(getattr(spoilt, part)).reshape(8, 8), rows[[7, *range(7)]])


def test_another_lens_spreads_the_middle() -> None:
    """What stood at an angle stands 1.25 times as far out, to the next zone."""
    spoilt = np.asarray(frames.other_lens(image(0.0), image(0.0)).distances).reshape(8, 8) * 64
    row, column = np.divmod(spoilt, 8)
    places = np.arange(8) - 3.5
    assert np.abs((column - 3.5) * 1.25 - places).max() <= 0.5 * 1.25
    assert np.abs((row - 3.5) * 1.25 - places[:, None]).max() <= 0.5 * 1.25


def test_other_optics_are_told_by_the_sensor_itself() -> None:
    other = frames.other_optics(image(0.0), image(0.0)).sensor
    assert not SENSOR.same_zones(other)
    assert len(other) == 64
