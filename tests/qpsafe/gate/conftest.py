"""Random plays, for the tests of the gate's promise."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def plays() -> Any:
    """The module `gate_plays`."""
    spec = importlib.util.spec_from_file_location("gate_plays", Path(__file__).with_name("gate_plays.py"))
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclass looks there
    spec.loader.exec_module(module)
    return module
