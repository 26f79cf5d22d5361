"""Tuning in the engine: trial 0 is the default controller, and what begins far too late is made better."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import qpsafe
from qpsafe.sim.campaign.executors import dask_executor
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.trial import run_trial
from qpsafe.sim.tuning.ask import BATCH
from qpsafe.sim.tuning.journal import Journal
from qpsafe.sim.tuning.objectives import Outcome
from qpsafe.sim.tuning.play import Piece, play_piece
from qpsafe.sim.tuning.robot_file import write_folder
from qpsafe.sim.tuning.search import Rungs, Search, run_search
from qpsafe.sim.tuning.trial import front_of
from qpsafe.sim.tuning.values import present

SEED = 7_990_000


@pytest.mark.slow
def test_the_present_values_play_as_the_default_controller_does() -> None:
    plan = Plan(trials=3, seed=SEED, controllers=("default",))
    played = play_piece(Piece(plan, (0, 1, 2), (present(qpsafe.load_robot("irb140")),)))
    assert [runs[0] for runs in played] == [Outcome.of(run_trial(plan, k)[0]) for k in range(3)]


@pytest.mark.slow
def test_values_of_another_robots_file_play_as_that_robot_does(tmp_path: Path) -> None:
    robot = qpsafe.load_robot("irb140")
    other = replace(present(robot), calm=0.6, hold_time=0.3, damping=(15.0,) * 6)
    folder = write_folder(robot, other, "a test", tmp_path / "other")
    plan = Plan(trials=1, seed=SEED + 1, controllers=("default",))
    ((tuned,),) = play_piece(Piece(plan, (0,), (other,)))
    loaded = Outcome.of(run_trial(replace(plan, robot=str(folder)), 0)[0])
    assert tuned.harm == pytest.approx(loaded.harm, rel=1e-6)
    assert tuned.lost == pytest.approx(loaded.lost, abs=0.02)


@pytest.mark.slow
def test_two_dask_workers_play_the_trials_of_one_process_also_after_an_interruption(tmp_path: Path) -> None:
    """Real encounters in real processes: the same questions in the same order, and the same answers to the bit."""
    distributed = pytest.importorskip("distributed")
    search = Search(Plan(), 97, Rungs((6, 12, 18), lagged=3))
    straight = run_search(search, 1 + 2 * BATCH).trials
    file = tmp_path / "search.jsonl"

    def stopping(done: int, journal: Journal) -> None:
        if done > 1:
            raise KeyboardInterrupt

    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, dask_executor(cluster.scheduler_address) as executor:
        with pytest.raises(KeyboardInterrupt):
            run_search(search, 1 + 2 * BATCH, file, executor, stopping)
        assert len(Journal(file, search.identity()).trials) == 1 + BATCH
        assert run_search(search, 1 + 2 * BATCH, file, executor).trials == straight
    assert len({str(trial.point) for trial in straight}) == len(straight)


@pytest.mark.slow
def test_what_begins_far_too_late_is_made_better_for_the_people_of_the_search(tmp_path: Path) -> None:
    """Thresholds of three times the danger do so much harm that a short search finds what does less."""
    robot = qpsafe.load_robot("irb140")
    now = present(robot)
    late = replace(now, delta=3.0 * now.delta, delta_f=3.0 * now.delta_f)
    folder = write_folder(robot, late, "a test", tmp_path / "late")
    search = Search(Plan(robot=str(folder)), 98, Rungs((12, 24, 48), lagged=3))
    journal = run_search(search, 1 + 3 * BATCH)
    start, best = journal.trials[0].objectives, front_of(journal.trials)
    assert min(trial.score.harm for trial in best) < start.harm
