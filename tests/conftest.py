"""Settings of hypothesis, how much is drawn, the order of files, and one compilation for all processes of a run.

Hypothesis has no deadlines, since machines are shared; in CI it tries the same examples every time. Where slow tests
are left out, others draw less, see benchmarks/amounts.py.
"""

import importlib
import os
from contextlib import suppress
from pathlib import Path

import amounts
import pytest
from hypothesis import settings

from qpsafe.bench.compilation import modules

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]


#: The longest first: processes that take file after file then end together.
LONGEST = (
    "test_tutorials.py",
    "test_docs.py",
    "test_batch_against_controllers.py",
    "test_fixed_experiment.py",
    "test_web_live.py",
    "test_cli.py",
    "test_campaign_command.py",
    "test_pick_place.py",
    "test_check.py",
    "test_path_experiment.py",
    "test_controller_bad_data.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest first; all others stay in their order."""
    rank = {name: i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.name, len(LONGEST)))


def pytest_configure(config: pytest.Config) -> None:
    """Say how much is drawn; let one process after another make the kernels ready: from an empty cache all would
    compile every one at once.
    """
    os.environ[amounts.VARIABLE] = amounts.FEW if "not slow" in config.option.markexpr else amounts.ALL
    settings.register_profile(
        "here", deadline=None, derandomize=bool(os.environ.get("CI")), max_examples=amounts.some(30, 100)
    )
    settings.load_profile("here")
    if hasattr(config, "workerinput") and fcntl is not None:
        with Path(__file__).open("rb") as here, suppress(ImportError):  # whatever cannot be imported, tests tell
            fcntl.flock(here, fcntl.LOCK_EX)
            for name in modules():
                importlib.import_module(name)
