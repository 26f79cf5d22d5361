"""Settings of hypothesis, the order of files, and one compilation for all processes of a run.

Hypothesis has no deadlines, since machines are shared; in CI it tries the same examples every time.
"""

import importlib
import os
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings

from qpsafe.bench.compilation import modules

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

#: The longest first: processes that take file after file then end together.
LONGEST = (
    "test_real_campaign.py",
    "test_tutorials.py",
    "test_placement_nodes.py",
    "test_docs.py",
    "test_cli.py",
    "test_campaign_command.py",
    "test_fixed_experiment.py",
    "test_path_experiment.py",
    "test_check.py",
    "test_pick_place.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest first; all others stay in their order."""
    rank = {name: i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.name, len(LONGEST)))


def pytest_configure(config: pytest.Config) -> None:
    """Let one process after another make the kernels ready: from an empty cache all would compile every one at once."""
    if hasattr(config, "workerinput") and fcntl is not None:
        with Path(__file__).open("rb") as here, suppress(ImportError):  # whatever cannot be imported, tests tell
            fcntl.flock(here, fcntl.LOCK_EX)
            for name in modules():
                importlib.import_module(name)
