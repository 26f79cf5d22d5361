"""Finals: among people whom the search did not know, the same whoever plays them, and cured of the winner's curse."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import made_up_values
import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.tuning.ask import BATCH
from qpsafe.sim.tuning.finals import FINALISTS, MOST, finalists, run_finals
from qpsafe.sim.tuning.journal import Journal
from qpsafe.sim.tuning.objectives import Outcome, mean
from qpsafe.sim.tuning.play import Piece
from qpsafe.sim.tuning.result import Tuned, result
from qpsafe.sim.tuning.search import APART, JUDGE, SEARCH, Rungs, Search, run_search
from qpsafe.sim.tuning.trial import Trial, front_of

SEARCHED = Search(Plan(), 3, Rungs((6, 12, 18), (0.75, 0.5), lagged=3))
TRIALS, ENCOUNTERS = 1 + 4 * BATCH, 30


@cache
def _lines() -> bytes:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "search.jsonl"
        run_search(SEARCHED, TRIALS, file, play=made_up_values.play)
        return file.read_bytes()


def searched(folder: Path, name: str = "search.jsonl") -> Journal:
    """A search that is done, with the finals that its file holds if it is there."""
    file = folder / name
    if not file.exists():
        file.write_bytes(_lines())
    return Journal(file, SEARCHED.identity())


def finals(journal: Journal, encounters: int = ENCOUNTERS, **options: Any) -> list[Trial]:
    return run_finals(SEARCHED, journal, encounters, **({"play": made_up_values.play} | options))


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> list[Trial]:
    return finals(searched(tmp_path_factory.mktemp("straight")))


def test_they_meet_people_whom_neither_search_nor_judgement_meets(straight: list[Trial], tmp_path: Path) -> None:
    met: set[int] = set()

    def seen(piece: Piece) -> Any:
        met.update(piece.plan.seed_of(k) for k in piece.encounters)
        assert piece.plan.lag == 0.0
        return made_up_values.play(piece)

    assert finals(searched(tmp_path), play=seen) == straight
    assert met == set(range(SEARCH + APART * 3 + MOST, SEARCH + APART * 3 + MOST + ENCOUNTERS))
    assert SEARCHED.plan.seed + Rungs().encounters[-1] <= min(met)
    assert min(SEARCH + APART * 4, JUDGE) >= SEARCH + APART * 3 + 2 * MOST


def test_figures_are_means_over_the_finals_own_encounters(straight: list[Trial]) -> None:
    space = SEARCHED.space()
    for trial in straight:
        runs = [
            made_up_values.outcome(SEARCH + APART * 3 + MOST + k, 0.0, space.at(trial.point)) for k in range(ENCOUNTERS)
        ]
        assert trial.score.harm == pytest.approx(mean(runs, "harm"))
        assert trial.score.lost == pytest.approx(mean(runs, "lost"))
        assert {"lag 2", "lag 5", "furniture"} <= set(trial.score.constraints)


def test_finalists_are_the_front_and_what_is_next_to_it(straight: list[Trial], tmp_path: Path) -> None:
    trials = searched(tmp_path).trials
    numbers = [trial.number for trial in finalists(trials)]
    assert straight[0].number == 0
    assert [trial.number for trial in straight[1:]] == numbers
    assert len(numbers) == min(FINALISTS, sum(trial.counts for trial in trials[1:]))
    front = {trial.number for trial in front_of(trials)} - {0}
    assert front <= set(numbers) or set(numbers) <= front
    assert finalists(trials[:1]) == []
    assert [trial.number for trial in finals(run_search(SEARCHED, 1, play=made_up_values.play))] == [0]


def test_threads_and_a_file_give_the_same(straight: list[Trial], tmp_path: Path) -> None:
    with ThreadPoolExecutor(3) as executor:
        assert finals(searched(tmp_path, "a"), executor=executor) == straight
    assert finals(searched(tmp_path, "b")) == straight


@pytest.mark.parametrize("calls", [1, 6, 11])
def test_what_is_stopped_goes_on_to_the_same_end(straight: list[Trial], tmp_path: Path, calls: int) -> None:
    count = 0

    def stopping(piece: Piece) -> Any:
        nonlocal count
        count += 1
        if count > calls:
            raise KeyboardInterrupt
        return made_up_values.play(piece)

    with pytest.raises(KeyboardInterrupt):
        finals(searched(tmp_path), play=stopping)
    assert finals(searched(tmp_path)) == straight
    assert finals(searched(tmp_path), play=forbidden) == straight  # nothing is left to play


def forbidden(piece: Piece) -> Any:
    raise AssertionError("played again")


def test_fewer_encounters_are_the_beginning_of_more(straight: list[Trial], tmp_path: Path) -> None:
    few = finals(searched(tmp_path), 12)
    assert few != straight
    assert finals(searched(tmp_path)) == straight
    assert finals(searched(tmp_path), 12, play=forbidden) == few
    assert len(searched(tmp_path).trials) == TRIALS


def test_progress_counts_every_run_once(tmp_path: Path) -> None:
    heard = []
    finals(searched(tmp_path), 12, progress=lambda done, total: heard.append((done, total)))
    everybody = 1 + len(finalists(searched(tmp_path).trials))
    assert heard[0] == (0, 12 * everybody)
    assert heard[-1] == (12 * everybody,) * 2
    assert heard == sorted(heard)
    finals(searched(tmp_path), progress=lambda done, total: heard.append((done, total)))
    assert (12 * everybody, ENCOUNTERS * everybody) in heard
    assert heard[-1] == (ENCOUNTERS * everybody,) * 2


def test_a_furniture_contact_among_new_people_keeps_a_finalist_off_the_front(tmp_path: Path) -> None:
    journal = searched(tmp_path)

    def clumsy(piece: Piece) -> list[list[Outcome]]:
        present = SEARCHED.space().at(SEARCHED.space().start)
        runs = zip(piece.values, zip(*made_up_values.play(piece), strict=True), strict=True)
        mine = [[o._replace(furniture=values != present) for o in outcomes] for values, outcomes in runs]
        return [list(row) for row in zip(*mine, strict=True)]

    met = finals(journal, play=clumsy)
    found = Tuned.of(SEARCHED, SEARCHED.space(), journal, "balanced", met)
    assert found.chosen.number == 0
    assert len(met) > 1


@pytest.mark.slow
def test_luck_on_the_searchs_people_does_not_choose() -> None:
    """Where values change nothing but by luck, the search's best looks better than it is, and the finals tell."""
    lucky, true = [], []

    def luck(piece: Piece) -> list[list[Outcome]]:
        rows = []
        for k in piece.encounters:
            seed = piece.plan.seed_of(k)
            keys = [(seed, round(1e6 * values.delta), round(1e6 * values.dwell)) for values in piece.values]
            harms = [np.random.default_rng(key).random() for key in keys]
            lost = np.random.default_rng(seed).random()
            rows.append([Outcome(harm, lost, False, False, False, 0.0, 0, 0) for harm in harms])
        return rows

    for seed in range(2):
        search = Search(Plan(), seed, SEARCHED.rungs)
        journal = run_search(search, TRIALS, play=luck)
        met = run_finals(search, journal, 300, play=luck)
        start = journal.trials[0].score.harm
        for trial in met[1:]:
            lucky.append(journal.trials[trial.number].score.harm - start)
            true.append(trial.score.harm - met[0].score.harm)
    assert np.mean(lucky) < -0.05  # of what is not there at all
    assert abs(np.mean(true)) < 0.5 * abs(np.mean(lucky))


def test_the_result_says_who_met_whom(straight: list[Trial], tmp_path: Path) -> None:
    journal = searched(tmp_path)
    found = Tuned.of(SEARCHED, SEARCHED.space(), journal, "balanced", finals(journal))
    said = result(found, None)
    assert said["finals"]["encounters"] == [SEARCH + APART * 3 + MOST, SEARCH + APART * 3 + MOST + ENCOUNTERS - 1]
    assert [point["number"] for point in said["finals"]["finalists"]] == [trial.number for trial in straight]
    assert said["present"]["harm"] == straight[0].score.harm
    assert {point["number"] for point in said["front"]} <= {trial.number for trial in straight}
    assert said["chosen"]["number"] in {point["number"] for point in said["front"]}
    assert result(Tuned.of(SEARCHED, SEARCHED.space(), journal, "balanced"), None)["finals"] is None


@pytest.mark.parametrize("encounters", [0, -3, MOST + 1])
def test_a_number_that_is_none_is_named(encounters: int, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"encounters.*1 to 5,000"):
        finals(searched(tmp_path), encounters)
