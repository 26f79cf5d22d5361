"""The same trials whoever plays them and however often they are stopped; what is finished is never lost."""

from __future__ import annotations

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_up_values
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.sim.campaign.executors import dask_executor
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.tuning.ask import BATCH
from qpsafe.sim.tuning.journal import Journal
from qpsafe.sim.tuning.objectives import Outcome
from qpsafe.sim.tuning.play import Piece
from qpsafe.sim.tuning.result import Tuned
from qpsafe.sim.tuning.search import APART, JUDGE, MOST, SEARCH, Rungs, Search, run_search
from qpsafe.sim.tuning.sensitivity import sensitivity
from qpsafe.sim.tuning.trial import Trial, front_of

pytestmark = pytest.mark.long

SEARCHED = Search(Plan(), 3, Rungs((6, 18, 36), lagged=3))
BATCHES = 4
TRIALS = 1 + BATCHES * BATCH


def run(out: Path | None = None, trials: int = TRIALS, **options: Any) -> Journal:
    return run_search(SEARCHED, trials, out, **({"play": made_up_values.play} | options))


@pytest.fixture(scope="module")
def straight() -> list[Trial]:
    return run().trials


@pytest.mark.slow
def test_threads_two_processes_and_a_file_give_the_same_trials(straight: list[Trial], tmp_path: Path) -> None:
    with ThreadPoolExecutor(3) as executor:
        assert run(executor=executor).trials == straight
    assert run(tmp_path / "search.jsonl").trials == straight
    assert run(trials=1 + 2 * BATCH, workers=2).trials == straight[: 1 + 2 * BATCH]


@pytest.mark.slow
def test_two_dask_workers_give_the_same_trials(straight: list[Trial]) -> None:
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, dask_executor(cluster.scheduler_address) as executor:
        assert run(executor=executor).trials == straight


@pytest.mark.parametrize("batches", first(1, [1, 0, 3]))
def test_what_is_stopped_goes_on_to_the_same_end(straight: list[Trial], tmp_path: Path, batches: int) -> None:
    def stopping(done: int, journal: Journal) -> None:
        if journal.batches > batches:
            raise KeyboardInterrupt

    file = tmp_path / "a" / "search.jsonl"
    with pytest.raises(KeyboardInterrupt):
        run(file, progress=stopping)
    assert len(Journal(file, SEARCHED.identity()).trials) == (1 + batches * BATCH)
    assert run(file).trials == straight
    assert run(file, play=forbidden).trials == straight  # nothing is left to play


def forbidden(piece: Piece) -> Any:
    raise AssertionError("played again")


@pytest.mark.parametrize("cut", first(1, [40, 1, 700]))
def test_a_line_that_was_half_written_is_played_again(straight: list[Trial], tmp_path: Path, cut: int) -> None:
    """What kill -9 or a power cut leaves."""
    file = tmp_path / "search.jsonl"
    run(file)
    data = file.read_bytes()
    file.write_bytes(data[:-cut])
    assert len(Journal(file, SEARCHED.identity()).trials) == TRIALS - BATCH
    assert run(file).trials == straight
    before, after = (
        [json.loads(line).get("trials") for line in text.splitlines()] for text in (data, file.read_bytes())
    )
    assert before == after


def test_a_shorter_search_is_the_beginning_of_a_longer_one(straight: list[Trial], tmp_path: Path) -> None:
    file = tmp_path / "search.jsonl"
    assert run(file, 2).trials == straight[: 1 + BATCH]  # whole batches
    assert run(file, minutes=0.0).trials == straight[: 1 + BATCH]
    assert run(file).trials == straight
    assert run(minutes=0.0).trials == straight[:1]  # the present values at least


def test_another_search_is_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "search.jsonl"
    run(file, 1)
    for other, key in (
        (replace(SEARCHED, seed=4), "search"),
        (replace(SEARCHED, rungs=Rungs((6, 18, 42), lagged=3)), "rungs"),
        (replace(SEARCHED, plan=replace(SEARCHED.plan, motions=("hold",))), "motions"),
    ):
        with pytest.raises(ConfigurationError, match=rf"search.jsonl.*{key}.*another folder"):
            run_search(other, 1, file, play=made_up_values.play)
    file.write_text("no journal\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="line of JSON"):
        run(file)


def test_seeds_of_searches_and_of_the_judgement_never_meet() -> None:
    for seed in (0, MOST):
        plan = Search(Plan(seed=5, lag=0.02), seed, SEARCHED.rungs).plan
        assert plan.seed == SEARCH + APART * seed
        assert plan.seed + plan.trials <= min(SEARCH + APART * (seed + 1), JUDGE)
        assert plan.lag == 0.0
    assert Rungs().encounters[-1] <= APART
    for seed in (-1, MOST + 1, True, 1.0):
        with pytest.raises(ConfigurationError, match=r"seed.*0 to 99"):
            Search(Plan(), seed)  # type: ignore[arg-type]


def test_the_search_gets_better_and_its_front_keeps_every_constraint(straight: list[Trial]) -> None:
    best = front_of(straight)
    start = straight[0].objectives
    assert straight[0].point == SEARCHED.space().start
    assert straight[0].counts
    assert any(trial.objectives.dominates(start) for trial in best)
    for trial in best:
        assert trial.whole
        assert trial.encounters == 36
        assert all(value <= 0.0 for value in trial.score.constraints.values())
        assert not any(o.objectives.dominates(trial.objectives) for o in straight if o.counts)
    # the made-up way back touches furniture where it is fast
    fast = [t for t in straight if t.whole and SEARCHED.space().at(t.point).speed > 0.9]
    assert all(t.score.constraints["furniture"] > 0.0 and t not in best for t in fast)


def test_few_are_played_through_and_every_batch_has_one(straight: list[Trial]) -> None:
    for batch in range(1, 1 + BATCHES):
        mine = [trial for trial in straight if trial.batch == batch]
        assert sorted(trial.encounters for trial in mine) == [6] * 5 + [18] * 2 + [36]
        assert [trial.number for trial in mine] == list(range(1 + BATCH * (batch - 1), 1 + BATCH * batch))


def test_what_matters_is_what_the_made_up_outcomes_depend_on(straight: list[Trial]) -> None:
    space = SEARCHED.space()
    found = sensitivity(space, straight)
    for shares in found.values():
        assert sum(shares.values()) == pytest.approx(1.0)
        assert list(shares) == [d.name for d in space.dimensions]
        deciding = sum(shares[name] for name in ("delta", "delay_arm", "dwell"))
        assert deciding > 3.0 / len(shares)
    assert sensitivity(space, straight[:5]) == {}


def test_the_choice_is_on_the_front_and_names_its_run(tmp_path: Path) -> None:
    journal = run(tmp_path / "search.jsonl")
    for prefer in ("safety", "balanced", "work"):
        found = Tuned.of(SEARCHED, SEARCHED.space(), journal, prefer)
        assert found.chosen in found.best
        for word in ("search 3", f"{TRIALS} trials", prefer, f"trial {found.chosen.number}"):
            assert word in found.run


def test_without_optuna_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(MissingExtraError, match=r"optuna: pip install 'qpsafe\[tune\]'"):
        run(trials=1 + 2 * BATCH)


JUNK = st.sampled_from([None, True, "x", "1", -1, 1.5, [], [[]], {}, {"a": 1}, [None], float("nan"), float("inf")])


def _spoilt(said: Any, data: st.DataObject) -> Any:
    """A JSON value with something in it replaced, left out or added."""
    inside = list(said.items() if isinstance(said, dict) else enumerate(said)) if isinstance(said, dict | list) else []
    if not inside or data.draw(st.integers(0, 3)) == 0:
        return data.draw(JUNK)
    key, value = inside[data.draw(st.integers(0, min(len(inside), 8) - 1))]
    other: Any = said.copy()
    kind = data.draw(st.sampled_from(["deeper", "deeper", "gone", "more"]))
    if kind == "deeper":
        other[key] = _spoilt(value, data)
    elif kind == "gone":
        del other[key]
    elif isinstance(said, dict):
        other["more"] = data.draw(JUNK)
    else:
        other.append(data.draw(JUNK))
    return other


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A journal with trials and finals."""
    file = tmp_path_factory.mktemp("journal") / "search.jsonl"
    kept = run(file, 1 + BATCH)
    assert kept.reference is not None
    kept.keep_finals({0: (0, kept.reference[0][:4]), 2: (0, kept.reference[0][:4])}, 1.0)
    kept.keep_finals({0: (4, kept.reference[0][:2])}, 1.0)
    return file


@settings(max_examples=some(40, of=400), deadline=None)
@given(st.data())
def test_a_spoilt_line_is_named_or_says_what_it_did(written: Path, data: st.DataObject) -> None:
    lines = written.read_text(encoding="utf-8").splitlines()
    number = data.draw(st.integers(0, len(lines) - 1))
    lines[number] = json.dumps(_spoilt(json.loads(lines[number]), data))
    other = written.with_name("spoilt.jsonl")
    other.write_text("\n".join(lines) + "\n", encoding="utf-8")
    try:
        found = Journal(other, SEARCHED.identity())
    except ConfigurationError as error:
        assert "spoilt.jsonl: " in str(error)  # noqa: PT017
        assert number == 0 or f"line {number + 1}" in str(error) or f"line {number + 2}" in str(error)  # noqa: PT017
        return
    assert all(isinstance(trial.number, int) and trial.score.violation >= 0.0 for trial in found.trials)
    assert all(isinstance(one, Outcome) for runs in found.finals.values() for one in runs)
    assert found.seconds >= 0.0 or number > 0


@pytest.mark.parametrize(
    ("lines", "wrong"),
    [
        (['{"format": "qpsafe tuning 1"}'], "line 1"), ([None, ""], "line 2"), ([None, None], "line 2"),
        ([None, '{"trials": []}'], "line 2.*seconds"), ([None, '{"trials": [{}], "seconds": 1}'], "line 2"),
        ([None, '{"finals": {"x": [0, []]}, "seconds": 1}'], "line 2"), ([None, '{"seconds": NaN}'], "line 2"),
        ([None, '{"finals": {"3": [5, []]}, "seconds": 1}'], "line 2.*go on from 0"), (["[]"], "line 1"),
    ],
)  # fmt: skip
def test_the_line_that_is_none_of_its_own_is_named(tmp_path: Path, lines: list[str | None], wrong: str) -> None:
    file = tmp_path / "search.jsonl"
    Journal(file, {"a": 1})
    first = file.read_text(encoding="utf-8").rstrip()
    file.write_text("".join(f"{first if line is None else line}\n" for line in lines), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=rf"search.jsonl: {wrong}"):
        Journal(file, {"a": 1})
