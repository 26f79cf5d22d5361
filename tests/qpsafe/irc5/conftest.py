"""What tests of the robot's wire share."""

from __future__ import annotations

import pytest
from egm_wire import Wire


@pytest.fixture
def wire() -> Wire:
    """A session and its robot, nothing said yet."""
    return Wire()
