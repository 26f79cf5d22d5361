"""Somebody walks straight at the robot: what is told of the links that move agrees with the whole robot's distance."""

from __future__ import annotations

import numpy as np
import pytest

import qpsafe
from qpsafe.sim.experiments.fast_person import runs
from qpsafe.sim.people.ahead import PosesAhead
from qpsafe.sim.world.distance import TrueDistances


@pytest.mark.slow
@pytest.mark.parametrize(("name", "speed", "base_is_nearest"), [("path", 1.6, False), ("fixed", 2.0, True)])
def test_links_that_move_are_no_nearer_than_the_robot(name: str, speed: float, base_is_nearest: bool) -> None:
    """And as near wherever the nearest point of all is on one of them, by the distances that logs are made of."""
    (run,) = runs(qpsafe.load_robot("irb140"), speeds=(speed,), names=(name,))
    scene, log = run.built.scene, run.log
    true, poses, least, on_base = TrueDistances(scene), PosesAhead(run.built.walk.people, log.dt), np.inf, np.inf
    data = scene.make_data(log.q[0])
    for k in range(len(log.time)):
        data.qpos[scene.q_addresses] = log.q[k]
        scene.place_people(data, poses(k))
        near = true.person(data)
        if near.body > 0:
            least = min(least, near.distance)
        else:
            on_base = min(on_base, near.distance)
    assert (on_base < least) == base_is_nearest
    assert min(on_base, least) == pytest.approx(run.encounter.distance, abs=1e-6)
    assert run.moving_links <= least + 1e-6
    assert run.moving_links >= run.encounter.distance - 1e-6
    if not base_is_nearest:
        assert run.moving_links == pytest.approx(least, abs=1e-6)
    else:
        assert run.moving_links > on_base + 0.01


@pytest.mark.slow
def test_sharp_sensors_are_what_is_asked_for() -> None:
    ideal, sharp = (
        next(iter(runs(qpsafe.load_robot("irb140"), speeds=(2.5,), names=("fixed",), sensor=sensor)))
        for sensor in ("ideal", "sharp")
    )
    assert (ideal.built.sensor, sharp.built.sensor) == ("ideal", "sharp")
    assert not np.array_equal(ideal.log.q, sharp.log.q)
