"""The robot, and the engines that solve for it."""

from __future__ import annotations

from typing import Any

import pytest
from amounts import first
from ik_engines import Mink, Pink

import qpsafe


@pytest.fixture(scope="module")
def robot() -> Any:
    return qpsafe.load_robot("irb140")


@pytest.fixture(scope="module", params=first(1, [Mink, Pink]), ids=["mink", "pink"])
def engine(request: pytest.FixtureRequest, robot: Any) -> Any:
    return request.param(robot)
