"""Limits of all contacts of a controller in a campaign's folder, kept there one by one, and read by its report."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.alone import alone_in
from qpsafe.sim.campaign.digests import file_name_of
from qpsafe.sim.campaign.executors import answers, crew_at_work
from qpsafe.sim.campaign.limit.row import Limit, limit_from
from qpsafe.sim.campaign.limit.search import EVALUATIONS
from qpsafe.sim.campaign.plan import Plan, names_only
from qpsafe.sim.campaign.runner import Results, stored_results
from qpsafe.sim.campaign.store import Store
from qpsafe.sim.campaign.trials.rows import of_controller
from qpsafe.text.json_text import json_text, plain
from qpsafe.text.whole_file import whole_file

FORMAT = "qpsafe campaign limit 1"

#: Finds the limit of a trial: plan, number, controller, evaluations. Deterministic, and possible to pickle.
LimitFunction = Callable[[Plan, int, str, int], Limit]


def limits_of(
    folder: Path,
    controller: str,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    workers: int = 1,
    evaluations: int = EVALUATIONS,
    limit: LimitFunction | None = None,
) -> tuple[Limit, ...]:
    """The limit of every trial of a folder in which a controller has a contact, by trial.

    Whatever ends it, Ctrl-C among others, what is found is kept in the folder, and not searched again.

    Args:
        folder: Of a campaign.
        controller: Whose contacts.
        executor: Any of `concurrent.futures`, or Dask's; None for processes of our own.
        progress: Called with the trials that are done, and how many there are.
        workers: Processes, if there is no executor; 1 for none but this one.
        evaluations: Motions to try in a trial.
        limit: Finds one; by default by `qpsafe.sim.campaign.limit.limit.limit_of`.

    Raises:
        ConfigurationError: It is no folder of a campaign, or one of other code, it does not have the controller, or
            limits of another search; or another process is at work there.
        MissingExtraError: pyarrow or cma is not installed.
        WorkerDiedError: A process died twice of the same trial.
    """
    results = stored_results(folder)
    plan = results.plan
    if controller not in plan.controllers:
        raise ConfigurationError(folder, "controller", controller, f"one of {', '.join(plan.controllers)}")
    with alone_in(folder):
        Store(folder, plan)  # refuses a folder of other code: its trials would not be met again
        wanted = _contacts(results, controller)
        file, head = _file(folder, controller), _head(results, controller, evaluations)
        found = {item.trial: item for item in _read(file, head)} if file.exists() else {}
        _write(file, head, found.values())
        todo = [trial for trial in wanted if trial not in found]
        search, done = partial(_one, limit or _limit, plan, controller, evaluations), len(wanted) - len(todo)
        if progress is not None:
            progress(done, len(wanted))
        with (
            crew_at_work(executor, workers) as crew,
            file.open("a", encoding="utf-8") as kept,
            closing(answers(crew, search, todo)) as answered,
        ):
            for item in answered:
                found[item.trial] = item
                kept.write(_line(item._asdict()))
                kept.flush()
                done += 1
                if progress is not None:
                    progress(done, len(wanted))
        _write(file, head, found.values())  # in order: the same file whoever searched
    return tuple(found[trial] for trial in wanted)


def stored_limits(folder: Path, results: Results) -> dict[str, tuple[Limit, ...]]:
    """The limits that a folder holds, finished or not, by controller; of trials of the results only.

    Args:
        folder: Of a campaign.
        results: What it holds.

    Raises:
        ConfigurationError: A file is of another campaign, or cannot be read.
    """
    found = {}
    for name in results.plan.controllers:
        file = _file(folder, name)
        if file.exists():
            wanted = set(_contacts(results, name))
            limits = [item for item in _read(file, _head(results, name, None)) if item.trial in wanted]
            if limits:
                found[name] = tuple(sorted(limits, key=lambda item: item.trial))
    return found


def _contacts(results: Results, controller: str) -> list[int]:
    mine = of_controller(results.columns, controller)
    return [int(trial) for trial in mine["trial"][mine["contact"]]]


def _limit(plan: Plan, trial: int, controller: str, evaluations: int) -> Limit:
    from qpsafe.sim.campaign.limit.limit import limit_of  # readers need no kernels

    return limit_of(plan, trial, controller, evaluations).limit


def _one(limit: LimitFunction, plan: Plan, controller: str, evaluations: int, trial: int) -> Limit:
    return limit(plan, trial, controller, evaluations)


def _file(folder: Path, controller: str) -> Path:
    return folder / f"limit-{file_name_of(controller)}.jsonl"


def _head(results: Results, controller: str, evaluations: int | None) -> dict[str, Any]:
    """First line of a file: whose limits these are; what a reader need not know is None.

    Args:
        results: Of the campaign.
        controller: Whose limits.
        evaluations: Motions that are tried in a trial.
    """
    code = None if evaluations is None else sha256(b"".join(p.read_bytes() for p in _sources())).hexdigest()
    plan = results.plan.named()
    return {"format": FORMAT, "controller": controller, "plan": plan, "evaluations": evaluations, "code": code}


def _sources() -> list[Path]:
    return sorted(Path(__file__).parent.glob("*.py"))


def _line(value: Any) -> str:
    return json_text(value, indent=None) + "\n"


def _write(file: Path, head: dict[str, Any], limits: Any) -> None:
    ordered: Sequence[Limit] = sorted(limits, key=lambda item: item.trial)
    with whole_file(file) as part:
        part.write_text(_line(head) + "".join(_line(item._asdict()) for item in ordered), encoding="utf-8")


def _read(file: Path, head: dict[str, Any]) -> list[Limit]:
    """The limits of a file; a last line that was cut off is none."""
    try:
        first, *lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        there = dict(json.loads(first))
        whole = [json.loads(line) for line in lines if line.endswith("\n")]
        limits = [limit_from(said) for said in whole]
    except (OSError, ValueError, TypeError, AttributeError) as error:
        problem = f"{type(error).__name__}: {error}"
        raise ConfigurationError(file, "file", problem, "limits; if you remove the file they are found again") from None
    if isinstance(there.get("plan"), dict):
        there["plan"] = names_only(there["plan"])  # older ones have paths
    for key, value in plain(head).items():
        if value is not None and there.get(key) != value:
            expected = f"{value!r}, as now: remove the file, and they are found again"
            raise ConfigurationError(file, key, there.get(key), expected)
    return limits
