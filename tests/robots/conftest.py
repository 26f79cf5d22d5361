"""Writers of model files, for the tests that compare how they are read."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest


def _writer(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Writer


@pytest.fixture(scope="session")
def arm_writer() -> Any:
    """`arm_writer.Writer`."""
    return _writer("arm_writer")


@pytest.fixture(scope="session")
def mjcf_writer() -> Any:
    """`mjcf_writer.Writer`."""
    return _writer("mjcf_writer")


@pytest.fixture(scope="session")
def urdf_writer() -> Any:
    """`urdf_writer.Writer`."""
    return _writer("urdf_writer")
