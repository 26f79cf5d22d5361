"""Robots and random numbers for tests of the campaign."""

from typing import Any

import numpy as np
import pytest

import qpsafe


@pytest.fixture(scope="session")
def irb140() -> Any:
    return qpsafe.load_robot("irb140")


@pytest.fixture(scope="session")
def people(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A file with somebody who walks into the robot, within a second or so."""
    path = tmp_path_factory.mktemp("people") / "ada.toml"
    path.write_text("""
[[person]]
name = "Ada"
start = [1.35, 0.1]
heading = 180.0

[[person.step]]
do = "walk"
to = [0.5, 0.05]
speed = 1.6
""")
    return str(path)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)
