"""Arms of other people, for the tests of the simulation."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def arms() -> Any:
    """The module `arms`."""
    spec = importlib.util.spec_from_file_location("other_arms", Path(__file__).with_name("arms.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
