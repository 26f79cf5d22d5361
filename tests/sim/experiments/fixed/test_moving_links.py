"""What evasion is promised to gain is measured on links that move: a foot that is bolted down gets away from nobody."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import first

from qpsafe.robot.loader import load_quietly
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.experiments.shared.ready import made_ready
from qpsafe.sim.experiments.shared.report import summarise
from qpsafe.sim.world.distance import TrueDistances
from qpsafe.sim.world.scene import build_scene

pytestmark = pytest.mark.long


def on_a_foot(arms: Any, folder: Path, width: float) -> Path:
    """An arm on a foot that reaches sideways [m]."""
    file = arms.write_arm(folder)
    foot = f'<collision><origin xyz="0 0 0.02"/><geometry><box size="{width} {width} 0.04"/></geometry></collision>'
    text = file.read_text().replace('<link name="base_link">', f'<link name="base_link">{foot}')
    file.write_text(text)
    return file


@pytest.mark.parametrize("width", first(2, [1.6, 0.1, 0.5, 1.0]))
def test_the_foot_is_nearest_and_does_not_count(arms: Any, tmp_path: Path, width: float) -> None:
    robot = load_quietly(on_a_foot(arms, tmp_path, width))
    scene = build_scene(robot, pedestal=0.55)
    data = scene.make_data()
    whole, moving = TrueDistances(scene), TrueDistances(scene, moving=True)
    rng = np.random.default_rng(5)
    feet = 0
    for q in rng.uniform(0.4 * robot.lower, 0.4 * robot.upper, (40, robot.nq)):
        data.qpos[scene.q_addresses] = q
        for all_links, some in zip(whole.measure(data), moving.measure(data), strict=True):
            assert some.body != 0
            assert some.distance >= all_links.distance
            if all_links.body != 0:
                assert some.distance == all_links.distance
            else:
                feet += 1
    assert feet > 0 or width < 1.5  # people stand far away, straight ahead


@pytest.mark.slow
def test_an_arm_on_a_wide_foot_is_not_blamed_for_it(arms: Any, tmp_path: Path) -> None:
    robot = made_ready("test", str(on_a_foot(arms, tmp_path, 0.9)), tmp_path / "out").robot
    experiment = FixedExperiment(robot, duration=30.0)
    log = experiment.run()
    within, without = experiment.moving_links(log)
    foot = experiment.board_distance_without_controller()
    assert (within >= log.board_distance - 1e-9).all()
    assert (without >= foot - 1e-9).all()
    assert (without > foot + 1e-3).any()  # the foot was nearest somewhere
    report = summarise(log, without, experiment.windows(), robot, tuned=False, within=within)
    gained = [row.with_controller - row.without_controller for row in report.approaches]
    assert all(value > 0.0 for value in gained)
