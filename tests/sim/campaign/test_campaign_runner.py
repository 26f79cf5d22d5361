"""Campaigns: the same rows whoever plays them and however often they are stopped; what is finished is never lost."""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import made_up_trials
import pytest

from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.sim.campaign.executors import WorkerDiedError, dask_executor
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.runner import Results, TrialError, Trials, _pieces, play_trials, run_campaign, stored_results
from qpsafe.sim.campaign.store import MANIFEST, Store, stored_plan
from qpsafe.sim.campaign.trials.rows import NAMES, Columns, columns_of

PLAN = Plan(trials=22, seed=3, controllers=("none", "stop", "default"))


def run(plan: Plan = PLAN, out: Path | None = None, **options: object) -> Results:
    return run_campaign(plan, out, **({"trial": made_up_trials.run} | options))  # type: ignore[arg-type]


def same(a: Columns, b: Columns) -> None:
    """To the last bit."""
    for name in NAMES:
        assert a[name].tolist() == b[name].tolist() or a[name].tobytes() == b[name].tobytes(), name


@pytest.fixture(scope="module")
def straight() -> Columns:
    """Rows as a plain loop gives them."""
    return columns_of([row for trial in range(PLAN.trials) for row in made_up_trials.run(PLAN, trial)])


# Who plays


def test_this_process_threads_and_a_folder_give_what_a_loop_gives(straight: Columns, tmp_path: Path) -> None:
    same(run().columns, straight)
    with ThreadPoolExecutor(3) as executor:
        same(run(executor=executor).columns, straight)
    found = run(out=tmp_path, keep_every=0.0)
    same(found.columns, straight)
    assert found.trials == PLAN.trials
    assert found.speed == pytest.approx(straight["simulated"].sum() / found.seconds)
    assert len(list(tmp_path.glob("*.parquet"))) == 6
    again = run(out=tmp_path, trial=forbidden)  # nothing is left to play
    same(again.columns, straight)
    assert again.seconds == pytest.approx(found.seconds)
    same(stored_results(tmp_path).columns, straight)


def forbidden(plan: Plan, trial: int) -> list[dict[str, object]]:
    raise AssertionError(f"trial {trial} is played again")


@pytest.mark.slow
def test_two_processes_and_one_that_dies_give_the_same(
    straight: Columns, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    same(run(workers=2).columns, straight)
    mark, said = tmp_path / "mark", []
    mark.touch()
    monkeypatch.setenv("MADE_UP_MARK", str(mark))
    same(run(workers=2, trial=made_up_trials.run_and_die_once, notice=said.append).columns, straight)
    assert not mark.exists()
    assert len(said) == 1
    assert "once more" in said[0]
    with pytest.raises(WorkerDiedError, match="trials 4 to 7"):  # the piece that kills, and no other
        run(out=tmp_path / "kept", workers=2, trial=made_up_trials.run_and_die)
    assert not multiprocessing.active_children()
    same(run(out=tmp_path / "kept").columns, straight)


@pytest.mark.slow
def test_dask_gives_the_same(straight: Columns) -> None:
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1"}
    with distributed.LocalCluster(**options) as cluster, dask_executor(cluster.scheduler_address) as executor:
        same(run(executor=executor).columns, straight)


def test_where_no_dask_is_is_named() -> None:
    pytest.importorskip("distributed")
    for address in ("nonsense://x", "nonsense", "tcp://127.0.0.1:x"):
        with pytest.raises(ConfigurationError, match=f"--dask = '{address}'"), dask_executor(address):
            pass


@pytest.mark.parametrize("finished", [set(), {0}, {21}, set(range(22)), {3, 4, 5, 9, 16}])
def test_pieces_are_what_is_left_each_once_in_order(finished: set[int]) -> None:
    pieces = list(_pieces(22, finished))
    assert [number for piece in pieces for number in range(*piece)] == sorted(set(range(22)) - finished)
    assert all(1 <= piece.end - piece.first <= 4 for piece in pieces)


# What ends it


class StopError(BaseException):
    """As Ctrl-C is."""


@pytest.mark.parametrize("when", [1, 2, 5])
def test_what_is_finished_is_kept_and_not_played_again(straight: Columns, tmp_path: Path, when: int) -> None:
    calls: list[int] = []

    def stopping(plan: Plan, trial: int) -> list[dict[str, object]]:
        calls.append(trial)
        if len(calls) > 4 * when:
            raise StopError
        return made_up_trials.run(plan, trial)

    with pytest.raises(StopError):
        run(out=tmp_path, trial=stopping)
    kept = stored_results(tmp_path)
    assert kept.trials == 4 * when
    calls.clear()
    heard: list[tuple[int, int]] = []

    def counting(plan: Plan, trial: int) -> list[dict[str, object]]:
        calls.append(trial)
        return made_up_trials.run(plan, trial)

    same(run(out=tmp_path, trial=counting, progress=lambda *now: heard.append(now)).columns, straight)
    assert calls == list(range(4 * when, PLAN.trials))
    assert heard[0] == (4 * when, 22)
    assert heard[-1] == (22, 22)


def test_a_trial_that_fails_is_named_and_the_others_are_kept(tmp_path: Path) -> None:
    def failing(plan: Plan, trial: int) -> list[dict[str, object]]:
        return made_up_trials.run(plan, trial) if trial != 9 else [1 / 0]  # type: ignore[list-item]

    with pytest.raises(TrialError, match=r"trial 9: ZeroDivisionError: .* \(at test_campaign_runner"):
        run(out=tmp_path, trial=failing)
    assert stored_results(tmp_path).trials == 8
    with pytest.raises(TrialError, match="trial 0: its rows are not one a controller"):
        play_trials(lambda plan, trial: made_up_trials.run(plan, trial)[1:], PLAN, Trials(0, 1))


# The folder


def test_a_longer_campaign_goes_on_and_a_shorter_one_takes_what_it_needs(straight: Columns, tmp_path: Path) -> None:
    run(replace(PLAN, trials=9), tmp_path)
    same(run(out=tmp_path).columns, straight)
    few = run(replace(PLAN, trials=5), tmp_path, trial=forbidden)
    same(few.columns, {name: values[:15] for name, values in straight.items()})


@pytest.mark.parametrize(("change", "said"), [({"seed": 4}, "seed = 3: expected 4"), ({"lag": 0.012}, "lag = 0.0")])
def test_another_plan_does_not_mix(tmp_path: Path, change: dict[str, object], said: str) -> None:
    run(out=tmp_path)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(ConfigurationError) as refused:
        run(replace(PLAN, **change), tmp_path)  # type: ignore[arg-type]
    assert said in str(refused.value)
    assert str(tmp_path) in str(refused.value)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_other_code_does_not_mix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(out=tmp_path)
    monkeypatch.setattr("qpsafe.sim.campaign.plan.code_digest", lambda: "other")
    with pytest.raises(ConfigurationError, match=r"code = .* take another folder"):
        run(out=tmp_path)
    assert stored_results(tmp_path).trials == 22  # but it can be reported


def test_the_plan_comes_back_even_if_its_files_have_gone(tmp_path: Path) -> None:
    people = tmp_path / "people.toml"
    people.touch()
    plan = replace(PLAN, people=str(people))
    run(plan, tmp_path / "kept")
    people.unlink()
    assert stored_plan(tmp_path / "kept") == plan


@pytest.mark.parametrize("text", ["", "{}", "[]", "3", '{"format": "other"}', '{"format": "qpsafe campaign 1"}'])
def test_a_folder_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"manifest\.json"):
        stored_results(tmp_path)
    (tmp_path / MANIFEST).write_text(text)
    for attempt in (lambda: stored_results(tmp_path), lambda: run(out=tmp_path)):
        with pytest.raises(ConfigurationError, match=r"manifest\.json"):
            attempt()


def test_a_file_that_cannot_be_read_is_named_and_can_be_removed(straight: Columns, tmp_path: Path) -> None:
    run(out=tmp_path, keep_every=0.0)
    file = sorted(tmp_path.glob("*.parquet"))[2]
    for content in (b"", file.read_bytes()[:-9], b"PAR1" + 100 * b"\0" + b"PAR1"):
        file.write_bytes(content)
        with pytest.raises(ConfigurationError, match=f"{file.name}.*played again"):
            run(out=tmp_path)
    file.unlink()
    (tmp_path / ".trials-0.parquet.1.part").write_bytes(b"half")
    same(run(out=tmp_path).columns, straight)
    assert not list(tmp_path.glob(".*"))


def test_files_carry_units_and_definitions(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    run(out=tmp_path)
    (file,) = tmp_path.glob("*.parquet")
    field = parquet.read_schema(file).field("energy")
    assert field.metadata[b"unit"] == b"J"
    assert b"closing speed" in field.metadata[b"meaning"]


def test_without_pyarrow_it_runs_in_memory_and_a_folder_names_the_extra(
    straight: Columns, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    same(run().columns, straight)
    asked: list[None] = []
    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: asked.append(None))
    with pytest.raises(MissingExtraError, match=r"qpsafe\[campaign\]"):
        run_campaign(PLAN, tmp_path / "new")
    assert not asked  # nobody waits for an engine that will not be used
    assert not (tmp_path / "new").exists()


def test_a_full_disk_leaves_no_half_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path, PLAN)
    before = sorted(tmp_path.iterdir())

    def full(*_: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="space"):
        store.keep([play_trials(made_up_trials.run, PLAN, Trials(0, 4))])
    assert sorted(tmp_path.iterdir()) == before
    assert json.loads((tmp_path / MANIFEST).read_text())["plan"]["seed"] == 3
