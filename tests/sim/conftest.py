"""Arms of other people, for the tests of the simulation."""

from __future__ import annotations

from typing import Any

import other_arms
import pytest


@pytest.fixture(scope="session")
def arms() -> Any:
    """The module `other_arms`."""
    return other_arms
