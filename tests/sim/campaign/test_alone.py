"""Two at work in one folder: the second is refused by name, and nothing is lost or counted twice."""

from __future__ import annotations

import errno
import signal
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import made_up_trials
import made_up_values
import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign import alone
from qpsafe.sim.campaign.alone import alone_in
from qpsafe.sim.campaign.limit.folder import limits_of
from qpsafe.sim.campaign.limit.row import Limit
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.runner import run_campaign
from qpsafe.sim.tuning.finals import run_finals
from qpsafe.sim.tuning.journal import Journal
from qpsafe.sim.tuning.search import Rungs, Search, run_search

PLAN = Plan(trials=12, controllers=("none", "stop"))
SEARCHED = Search(Plan(), 3, Rungs((6, 12, 18), lagged=3))
HOLDER = """
import sys
from pathlib import Path
from qpsafe.sim.campaign.alone import alone_in
with alone_in(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def campaign(folder: Path) -> Any:
    return run_campaign(PLAN, folder, trial=made_up_trials.run)


def limits(folder: Path) -> Any:
    def limit(plan: Plan, trial: int, controller: str, evaluations: int) -> Limit:
        return Limit(trial, trial, "hold", controller, 1.0, -0.1, -0.1, 0.0, 0.1, True, True, False, 0.0, evaluations)

    return limits_of(folder, "none", limit=limit)


def search(folder: Path) -> Any:
    return run_search(SEARCHED, 1, folder / "search.jsonl", play=made_up_values.play).trials


def finals(folder: Path) -> Any:
    return run_finals(SEARCHED, Journal(folder / "search.jsonl", SEARCHED.identity()), 6, play=made_up_values.play)


WORK: dict[str, tuple[Callable[[Path], Any], Callable[[Path], Any]]] = {  # what is refused, and what has to be there
    "campaign": (campaign, campaign),
    "limits": (limits, campaign),
    "search": (search, search),
    "finals": (finals, search),
}


def told(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.mark.parametrize("what", WORK)
def test_who_comes_second_is_refused_and_changes_nothing(what: str, tmp_path: Path) -> None:
    work, before = WORK[what]
    folder, other = tmp_path / "one", tmp_path / "other"
    before(folder)
    (folder / ".trials-1.parquet.7.part").write_text("half")  # of the first one, who is still writing
    was = told(folder)
    with alone_in(folder):
        with pytest.raises(ConfigurationError, match=r"one.*in use by another process.*wait for that"):
            work(folder)
        assert told(folder) == was
        before(other)
        work(other)  # goes on elsewhere
    work(folder)


def test_a_second_campaign_amid_the_first_leaves_it_as_it_would_have_been(tmp_path: Path) -> None:
    refused = []

    def trial(plan: Plan, number: int) -> Any:
        with pytest.raises(ConfigurationError):
            campaign(tmp_path)
        refused.append(number)
        return made_up_trials.run(plan, number)

    found = run_campaign(PLAN, tmp_path, trial=trial, keep_every=0.0)
    assert refused == list(range(12))
    assert np.array_equal(found.columns["trial"], np.repeat(np.arange(12), 2))


@pytest.mark.parametrize("lacking", ["file system", "system"])
def test_where_nobody_can_be_kept_out_that_is_said(
    lacking: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Disks on a network, and systems without such locks: the work is done all the same."""
    if lacking == "system":
        monkeypatch.setattr(alone, "fcntl", None)
    else:
        no_locks = types.SimpleNamespace(flock=_refuse, LOCK_EX=0, LOCK_NB=0)
        monkeypatch.setattr(alone, "fcntl", no_locks)
    with pytest.warns(UserWarning, match="one cannot be locked here: make sure"):
        found = campaign(tmp_path / "one")
    assert len(found.columns["trial"]) == 24


def _refuse(handle: int, how: int) -> None:
    raise OSError(errno.ENOLCK, "no locks available")


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_whatever_ends_a_process_gives_its_folder_back(tmp_path: Path, end: int) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    with pytest.raises(ConfigurationError):
        campaign(tmp_path)
    holder.send_signal(end)
    holder.communicate()
    assert campaign(tmp_path).trials == 12
    assert not any(file.suffix in (".lock", ".part") for file in tmp_path.iterdir())  # nothing is left behind
