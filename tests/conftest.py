"""Settings of hypothesis, how much is drawn, the order of files, and one compilation for all processes of a run.

Hypothesis has no deadlines, since machines are shared; in CI it tries the same examples every time. Where slow tests
are left out, others draw less, see benchmarks/amounts.py.
"""

import functools
import gc
import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import amounts
import pytest
from hypothesis import settings

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
    gc.collect()
    gc.freeze()  # modules and items stay: nobody need look through them again and again
    gc.enable()


def pytest_configure(config: pytest.Config) -> None:
    """Say how much is drawn; make the kernels ready, all processes of the run together."""
    gc.disable()  # until all is collected
    gc.set_threshold(10_000, 20, 20)
    os.environ[amounts.VARIABLE] = amounts.FEW if "not slow" in config.option.markexpr else amounts.ALL
    settings.register_profile(
        "here", deadline=None, derandomize=bool(os.environ.get("CI")), max_examples=amounts.some(8, 100)
    )
    settings.load_profile("here")
    worker = getattr(config, "workerinput", {}).get("workerid")
    if worker is None and getattr(config.option, "numprocesses", None):
        return  # it hands out tests, and runs none
    with suppress(ImportError):  # whatever cannot be imported, tests tell
        keep_commands()
        keep_robots()
        if worker is not None and fcntl is not None:
            make_ready(int(worker.removeprefix("gw")))


def keep_commands() -> None:
    """Make a program's commands once, and not again whenever a test asks it: that takes longer than most answers."""
    from typer import main, testing

    main.get_command = testing._get_command = functools.cache(main.get_command)  # type: ignore[assignment]


def keep_robots() -> None:
    """Load bundled robots once: whatever is worked out from their shapes is kept for them."""
    from qpsafe.robot import loader

    load, kept = loader._load_described, dict[Path, Any]()

    def once(path: Path, model: Path | None) -> Any:
        if model is not None or loader._bundled_folder() not in path.parents:
            return load(path, model)
        if path not in kept:
            kept[path] = load(path, None)
        return kept[path]

    loader._load_described = once


def make_ready(worker: int) -> None:
    """Import all kernels, each compiled by the process that comes to it first; the others wait, and load it.

    From an empty cache all processes would compile every one. Every second process begins at the other end, so that
    two of them compile different ones.
    """
    from qpsafe.bench.compilation import modules
    from qpsafe.compiled import compiled

    over = compiled._Watch.over

    @contextmanager
    def alone(watch: Any, kernel: str) -> Iterator[None]:
        with Path(str(sys.modules[kernel.rpartition(".")[0]].__file__)).open("rb") as source:
            fcntl.flock(source, fcntl.LOCK_EX)
            with over(watch, kernel):
                yield

    compiled._Watch.over = alone  # type: ignore[method-assign,assignment]
    try:
        for name in modules()[:: -1 if worker % 2 else 1]:
            importlib.import_module(name)
    finally:
        compiled._Watch.over = over  # type: ignore[method-assign]
