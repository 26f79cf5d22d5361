"""Robots for tests of tuning."""

from typing import Any

import pytest

import qpsafe


@pytest.fixture(scope="session")
def irb140() -> Any:
    return qpsafe.load_robot("irb140")
