"""Sensors that were chosen for an arm and would take its cell for danger are taken off again, and no others."""

from __future__ import annotations

import tomllib
from pathlib import Path

import made_up_arm
import numpy as np
import pytest
from amounts import first

from qpsafe.robot.loader import load_quietly
from qpsafe.robot.robot import Robot
from qpsafe.sensing.skin.spots import load_spots
from qpsafe.sim.experiments.pick_place.for_robot import in_the_way
from qpsafe.sim.experiments.shared.ready import made_ready, without

EYE = """
[[spot]]
name = "eye"
link = {link}
frame = "tool0"
position = [0.06, 0.0, -0.1]
direction = [0.0, 0.0, 1.0]
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file: Path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    file.write_text(made_up_arm.arm_urdf(), encoding="utf-8")
    return file


@pytest.mark.slow
@pytest.mark.parametrize("seed", first(1, range(4)))
def test_exactly_those_that_are_named_are_left_out(model: Path, tmp_path: Path, seed: int) -> None:
    named: list[str] = []

    def some(robot: Robot) -> list[str]:
        spots = load_spots(robot)
        assert spots is not None
        kept = np.random.default_rng(seed).random(len(spots.names)) > 0.3
        named[:] = [name for k, name in enumerate(spots.names) if not kept[k] or k == seed]
        return named

    ready = made_ready("test", str(model), tmp_path / "less", in_the_way=some)
    whole = made_ready("test", str(model), tmp_path / "all")
    text = (tmp_path / "all" / "robot" / "spots.toml").read_text(encoding="utf-8")
    less, every = load_spots(ready.robot), load_spots(whole.robot)
    assert less is not None
    assert every is not None
    assert less.names == tuple(name for name in every.names if name not in named)
    for i, name in enumerate(less.names):  # the others are what they were
        np.testing.assert_array_equal(less.positions[i], every.positions[every.names.index(name)])
    assert any("taken off again" in words for words in ready.said)
    assert not any("taken off again" in words for words in whole.said)
    assert without(text, ()) == text
    assert tomllib.loads(without(text, every.names)).get("spot", []) == []


@pytest.mark.slow
def test_all_are_kept_where_none_could_stay(model: Path, tmp_path: Path) -> None:
    def every(robot: Robot) -> tuple[str, ...]:
        spots = load_spots(robot)
        assert spots is not None
        return spots.names

    ready = made_ready("test", str(model), tmp_path / "out", in_the_way=every)
    assert load_spots(ready.robot) is not None
    assert not any("taken off again" in words for words in ready.said)


@pytest.mark.slow
def test_a_sensor_that_looks_along_the_tool_is_in_the_way_and_no_other(model: Path, tmp_path: Path) -> None:
    robot = made_ready("test", str(model), tmp_path / "out").robot
    assert in_the_way(robot) == frozenset()
    file = robot.folder / "spots.toml"
    file.write_text(file.read_text(encoding="utf-8") + EYE.format(link=len(robot.wire_frames)), encoding="utf-8")
    assert in_the_way(load_quietly(robot.folder)) == {"eye"}
