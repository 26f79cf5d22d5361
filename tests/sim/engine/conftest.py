"""Random scenes and people, for the tests that compare the engine with MuJoCo and coal."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def worlds() -> Any:
    """The module `random_worlds`."""
    spec = importlib.util.spec_from_file_location("random_worlds", Path(__file__).with_name("random_worlds.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
