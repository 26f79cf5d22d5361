"""Arms of other people, for the tests of the simulation."""

from __future__ import annotations

from typing import Any

import other_arms
import pytest

from qpsafe.sim.drawing.gl import gl_available


@pytest.fixture(scope="session")
def arms() -> Any:
    """The module `other_arms`."""
    return other_arms


@pytest.fixture(scope="session")
def opengl() -> None:
    """Asked for here, not on import: the answer takes a Python of its own."""
    available, why_not = gl_available()
    if not available:
        pytest.skip(why_not)
