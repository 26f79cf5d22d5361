"""Play a campaign's trials, keep what is finished, go on where it stopped.

The unit of work is a trial with all its controllers. A trial depends on the plan and its number alone, so results are
equal to the last bit whoever plays them, in whatever order, in one go or several.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from qpsafe.errors import QpsafeError
from qpsafe.extras import require
from qpsafe.sim.campaign.alone import alone_in
from qpsafe.sim.campaign.executors import answers, crew_at_work
from qpsafe.sim.campaign.manifest import read_manifest, versions_now
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.store import Played, Store, read
from qpsafe.sim.campaign.trials.rows import Columns, columns_of, joined

#: Plays a trial: plan, number -> a row a controller. Deterministic, and possible to pickle.
TrialFunction = Callable[[Plan, int], Sequence[dict[str, Any]]]

CHUNK = 4  # trials that are handed out together
KEEP_EVERY = 30.0  # [s]; what a power cut may cost
KEEP_MOST = 500  # trials in memory that are not yet in the folder


class TrialError(QpsafeError):
    """A trial could not be played."""


class Trials(NamedTuple):
    """Numbers of trials, from the first up to, not including, the end."""

    first: int
    end: int

    def __str__(self) -> str:
        return f"trials {self.first} to {self.end - 1}"


@dataclass(frozen=True)
class Results:
    """Results of a campaign.

    Attributes:
        plan: Its plan.
        columns: Rows of all finished trials, by trial and in the plan's order of controllers.
        seconds: Time that all processes together spent on trials [s].
        wall: Wall time of the last go; None if it is not known [s].
        versions: Of what they were played with.
    """

    plan: Plan
    columns: Columns
    seconds: float
    wall: float | None
    versions: dict[str, str]

    @property
    def trials(self) -> int:
        """How many are finished."""
        return len(self.columns["trial"]) // len(self.plan.controllers)

    @property
    def speed(self) -> float:
        """Simulated seconds, of all controllers, a second of one process."""
        return float(self.columns["simulated"].sum()) / self.seconds if self.seconds else 0.0


def run_campaign(
    plan: Plan,
    out: Path | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
    *,
    workers: int = 1,
    trial: TrialFunction | None = None,
    notice: Callable[[str], None] | None = None,
    keep_every: float = KEEP_EVERY,
) -> Results:
    """Play the trials of a plan that are not finished yet.

    Whatever ends it, Ctrl-C among others, what is finished is kept if there is a folder, and not played again.

    Args:
        plan: What to play.
        out: Folder for finished trials (extra `campaign`); None to keep them in memory only.
        executor: Any of `concurrent.futures`, or Dask's; None for processes of our own.
        progress: Called with the trials that are finished, and how many there are.
        workers: Processes, if there is no executor; 1 for none but this one.
        trial: Plays one trial; by default `qpsafe.sim.campaign.trials.trial.run_trial`.
        notice: Told in words when a process has died.
        keep_every: Time after which finished trials are written to the folder [s].

    Raises:
        TrialError: A trial could not be played.
        WorkerDiedError: A process died twice of the same trials.
        ConfigurationError: The folder holds another campaign, or another process is at work there.
        MissingExtraError: pyarrow is not installed, and there is a folder.
    """
    begun = perf_counter()
    if out is not None:
        require("campaign", "a folder of trials", "pyarrow")  # before one is made, or the engine compiled
    play = partial(play_trials, trial or _engine(), plan)
    with alone_in(out), _stored(out, plan) as store:
        finished = set() if store is None else store.trials() & set(range(plan.trials))
        parts: list[Played] = []
        count, kept = len(finished), perf_counter()
        if progress is not None:
            progress(count, plan.trials)
        with crew_at_work(executor, workers) as crew:
            try:
                with closing(answers(crew, play, _pieces(plan.trials, finished), notice)) as found:
                    for part in found:
                        parts.append(part)
                        count += len(part.columns["trial"]) // len(plan.controllers)
                        if progress is not None:
                            progress(count, plan.trials)
                        full = CHUNK * len(parts) >= KEEP_MOST or perf_counter() - kept >= keep_every
                        if store is not None and full:
                            store.keep(parts)
                            parts.clear()
                            kept = perf_counter()
            finally:
                if store is not None:
                    store.keep(parts)
        if store is None:
            whole = Played(joined([p.columns for p in parts], plan.controllers), sum(p.seconds for p in parts))
            made = Results(plan, whole.columns, whole.seconds, None, versions_now())
        else:
            made = stored_results(store.folder)
    return replace(made, wall=perf_counter() - begun)


def _stored(out: Path | None, plan: Plan) -> AbstractContextManager[Store | None]:
    return nullcontext() if out is None else closing(Store(out, plan))


def stored_results(folder: Path) -> Results:
    """What a folder holds, finished or not.

    Raises:
        MissingExtraError: pyarrow is not installed.
        ConfigurationError: It is no folder of a campaign, or a file cannot be read.
    """
    manifest = read_manifest(folder)
    whole = read(folder, manifest.plan)
    return Results(manifest.plan, whole.columns, whole.seconds, None, manifest.versions)


def play_trials(trial: TrialFunction, plan: Plan, piece: Trials) -> Played:
    """Play some trials: what a process does.

    Args:
        trial: Plays one.
        plan: The campaign's.
        piece: Which ones.

    Raises:
        TrialError: One could not be played; names it.
    """
    begun = perf_counter()
    rows: list[dict[str, Any]] = []
    for number in range(*piece):
        try:
            found = trial(plan, number)
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{Path(where.filename).name}:{where.lineno}"
            raise TrialError(f"trial {number}: {type(error).__name__}: {error} (at {place})") from error
        if [(row.get("trial"), row.get("controller")) for row in found] != [
            (number, name) for name in plan.controllers
        ]:
            raise TrialError(f"trial {number}: its rows are not one a controller, in the plan's order")
        rows += found
    return Played(columns_of(rows), perf_counter() - begun)


def _pieces(trials: int, finished: set[int]) -> Iterator[Trials]:
    """What is left to play, in pieces of consecutive trials."""
    first = 0
    while first < trials:
        if first in finished:
            first += 1
            continue
        end = first + 1
        while end < min(first + CHUNK, trials) and end not in finished:
            end += 1
        yield Trials(first, end)
        first = end


def _engine() -> TrialFunction:
    from qpsafe.sim.campaign.trials.trial import run_trial  # type: ignore[import-not-found,unused-ignore]

    return run_trial
