"""Robots and random numbers for tests of the campaign."""

from typing import Any

import numpy as np
import pytest

import qpsafe


@pytest.fixture(scope="session")
def irb140() -> Any:
    return qpsafe.load_robot("irb140")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)
