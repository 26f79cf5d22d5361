"""Furniture of a cell's file in a campaign: people walk round it, the controller knows it, and it is measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.plan import Plan, parse_plan
from qpsafe.sim.campaign.trials.station import Station
from qpsafe.text.toml_text import TomlText

CELL = """
[[box]]
name = "table"
size = [0.5, 0.9, 0.05]
centre = [0.9, 0.1, -0.3]

[[hull]]
name = "wedge"
vertices = [[-0.9, 0.4, -0.8], [-0.9, 0.8, -0.8], [-0.5, 0.4, -0.8], [-0.5, 0.8, 0.1]]
"""


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    file = tmp_path / "cell.toml"
    file.write_text(CELL, encoding="utf-8")
    return file


def test_it_is_known_seen_walked_round_and_measured(cell: Path) -> None:
    robot = qpsafe.load_robot("irb140")
    bare, full = Station("hold", robot), Station("hold", robot, furniture=str(cell))
    more = [obstacle for obstacle in full.known if obstacle.name.startswith("cell")]
    assert len(full.known) == len(bare.known) + len(more)
    corners = {tuple(np.round(v, 6)) for v in more[0].vertices.tolist()}
    assert corners == {(x, y, z) for x in (0.65, 1.15) for y in (-0.35, 0.55) for z in (-0.325, -0.275)}
    assert len(more[1].vertices) == 4
    assert len(full.world.furniture) == len(bare.world.furniture) + 2
    assert len(full.floor_plan.obstacles) == len(bare.floor_plan.obstacles) + 2


def test_a_plan_names_it_and_its_contents_count(cell: Path, tmp_path: Path) -> None:
    plan = Plan(cell=str(cell))
    before = plan.digest()
    assert before != Plan().digest()
    assert "--cell" in plan.options()
    assert parse_plan(TomlText('cell = "cell.toml"', tmp_path / "plan.toml"), tmp_path).cell == str(cell)
    cell.write_text(CELL.replace("0.05", "0.06"), encoding="utf-8")
    assert plan.digest() != before
    with pytest.raises(ConfigurationError, match=r"cell.*nowhere"):
        Plan(cell="nowhere.toml")
