"""Recordings of a simulated robot before a simulated camera whose pose is known."""

from __future__ import annotations

import pytest
from camera_calibration import Studio


@pytest.fixture(scope="session")
def studio() -> Studio:
    return Studio.of("irb140")
