"""Limits of a campaign's contacts: kept one by one, the same file whoever searched and however often it stopped."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from math import nan
from pathlib import Path
from typing import Any

import made_up_trials
import numpy as np
import pytest
from amounts import first

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.limit.folder import limits_of, stored_limits
from qpsafe.sim.campaign.limit.row import Limit, limit_from
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.report.limits import MEASURES, limits_summary
from qpsafe.sim.campaign.report.page import report_page
from qpsafe.sim.campaign.report.summary import summary
from qpsafe.sim.campaign.runner import Results, run_campaign, stored_results
from qpsafe.sim.campaign.trials.rows import of_controller
from qpsafe.text.json_text import json_text

pytest.importorskip("pyarrow")

PLAN = Plan(trials=90, controllers=("stop", "default"))
FILE = "limit-default.jsonl"


def made_up(plan: Plan, trial: int, controller: str, evaluations: int) -> Limit:
    """From the trial's seed alone."""
    rng = np.random.default_rng((plan.seed_of(trial), 7))
    seen, distance = bool(rng.uniform() < 0.8), -float(rng.uniform(0.0, 0.1))
    best = float(rng.uniform(-0.05, 0.2)) if seen else nan
    return Limit(
        trial=trial, seed=plan.seed_of(trial), motion="hold", controller=controller,
        first_sight=1.5 if seen else nan, distance=distance, alone=distance - 0.01, limit=best,
        fixed=best + 0.01 if seen else nan, contact=True, seen=seen, avoidable=seen and best > 0.0,
        reached=0.01 / (best - distance + 0.01) if seen else nan, evaluations=evaluations,
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    run_campaign(PLAN, tmp_path / "kept", trial=made_up_trials.run)
    return tmp_path / "kept"


@pytest.fixture
def results(folder: Path) -> Results:
    return stored_results(folder)


def touched(results: Results) -> list[int]:
    mine = of_controller(results.columns, "default")
    return mine["trial"][mine["contact"]].tolist()


def test_every_contact_of_the_controller_has_its_limit(folder: Path, results: Results) -> None:
    told: list[tuple[int, int]] = []
    found = limits_of(folder, "default", limit=made_up, progress=lambda *done: told.append(done))
    wanted = touched(results)
    assert [item.trial for item in found] == wanted
    assert len(wanted) > 3
    assert told == [(k, len(wanted)) for k in range(len(wanted) + 1)]
    assert json_text([*stored_limits(folder, results)["default"]]) == json_text([*found])  # NaN is not itself
    assert list(stored_limits(folder, results)) == ["default"]
    again: list[tuple[int, int]] = []
    limits_of(folder, "default", limit=_never, progress=lambda *done: again.append(done))
    assert again == [(len(wanted), len(wanted))]


def _never(*_: Any) -> Limit:
    raise AssertionError("searched again")


def test_stopped_and_cut_off_it_goes_on_to_the_same_file(folder: Path, tmp_path: Path) -> None:
    limits_of(folder, "default", limit=made_up)
    whole = (folder / FILE).read_bytes()
    lines = whole.splitlines(keepends=True)
    (folder / FILE).write_bytes(b"".join(lines[:3]) + lines[3][:-20])  # as kill -9 in a write leaves it
    asked: list[int] = []

    def stops(plan: Plan, trial: int, controller: str, evaluations: int) -> Limit:
        asked.append(trial)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return made_up(plan, trial, controller, evaluations)

    with pytest.raises(KeyboardInterrupt):
        limits_of(folder, "default", limit=stops)
    assert (folder / FILE).read_bytes() == b"".join(lines[:5])
    assert [json.loads(line)["trial"] for line in lines[3:6]] == asked
    (folder / FILE).write_bytes(b"".join((lines[0], *reversed(lines[1:4]))))
    with ThreadPoolExecutor(3) as executor:
        limits_of(folder, "default", executor, limit=made_up)
    assert (folder / FILE).read_bytes() == whole
    assert {file.suffix for file in folder.iterdir()} == {".json", ".parquet", ".jsonl"}


@pytest.mark.parametrize(
    ("change", "key"),
    first(
        3,
        [
            (lambda head, row: (head | {"evaluations": 7}, row), "evaluations"),
            (lambda head, row: (head | {"code": "other"}, row), "code"),
            (lambda head, row: (head | {"plan": head["plan"] | {"seed": 3}}, row), "plan"),
            (lambda head, row: (head | {"format": "else"}, row), "format"),
            (lambda head, row: ([], row), "format"),
            (lambda head, row: (head, row | {"seen": 1}), "file"),
            (lambda head, row: (head, {"trial": 3}), "file"),
            (lambda head, row: (head, 5), "file"),
        ],
    ),
)
def test_limits_of_something_else_are_refused_by_name(
    folder: Path, results: Results, change: Callable[[Any, Any], tuple[Any, Any]], key: str
) -> None:
    limits_of(folder, "default", limit=made_up)
    head, row, *_ = (json.loads(line) for line in (folder / FILE).read_text().splitlines())
    text = "".join(json.dumps(line) + "\n" for line in change(head, row))
    (folder / FILE).write_text(text)
    with pytest.raises(ConfigurationError, match=rf"limit-default\.jsonl: {key} = "):
        limits_of(folder, "default", limit=made_up)
    assert (folder / FILE).read_text() == text
    if key not in ("evaluations", "code"):  # a report takes what there is
        with pytest.raises(ConfigurationError):
            stored_limits(folder, results)


def test_a_controller_or_a_folder_that_is_not_there_is_named(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ConfigurationError, match="controller = 'strict': expected one of stop, default"):
        limits_of(folder, "strict", limit=made_up)
    with pytest.raises(ConfigurationError, match=r"manifest\.json"):
        limits_of(tmp_path, "default", limit=made_up)
    monkeypatch.setattr("qpsafe.sim.campaign.plan.code_digest", lambda: "other")
    with pytest.raises(ConfigurationError, match="code"):  # these trials would not be met again
        limits_of(folder, "default", limit=made_up)


def test_a_row_is_the_same_after_json() -> None:
    for trial in range(20):
        row = made_up(PLAN, trial, "default", 800)
        read = limit_from(json.loads(json_text(row._asdict())))
        assert json_text(read._asdict()) == json_text(row._asdict())
        assert np.isnan(read.limit) == np.isnan(row.limit)


# The report


@pytest.mark.slow
def test_without_limits_the_report_is_as_it_was(folder: Path, results: Results) -> None:
    """Byte by byte; with them it has one key and one section more."""
    assert stored_limits(folder, results) == {}
    plain, empty = summary(results), summary(results, limits={})
    assert json_text(plain) == json_text(empty)
    limits_of(folder, "default", limit=made_up)
    kept = stored_limits(folder, results)
    more = summary(results, limits=kept)
    assert json_text({key: value for key, value in more.items() if key != "limits"}) == json_text(plain)
    page, longer = report_page(results, plain), report_page(results, more)
    assert "What was possible" not in page
    begin, end = longer.index("<h2>What was possible"), longer.index("<h2>Distances and energies")
    assert longer[:begin] + longer[end:] == page
    assert f"of {more['controllers']['default']['contacts']}" in longer[begin:end]


def test_the_summary_counts_what_the_limits_say(folder: Path, results: Results) -> None:
    found = limits_of(folder, "default", limit=made_up)
    said = limits_summary(found)
    assert set(said) == {measure.name for measure in MEASURES} | {"avoidable_interval"}
    assert said["looked_at"] == len(found)
    assert said["unseen"] == sum(np.isnan(item.limit) for item in found)
    assert said["avoidable"] == sum(item.limit > 0.0 for item in found) >= said["clearly_avoidable"]
    assert said["clearly_avoidable"] == sum(item.limit > 0.02 for item in found)
    assert said["unavoidable"] == sum(item.fixed <= 0.0 for item in found)
    ordered = sorted(item.limit for item in found if item.seen)
    assert said["limit_median"] == ordered[(len(ordered) - 1) // 2]
    low, high = said["avoidable_interval"]
    assert low < said["avoidable"] / said["looked_at"] < high
    nothing = limits_summary([made_up(PLAN, 0, "default", 5)._replace(seen=False, limit=nan, reached=nan)])
    assert nothing["limit_median"] is None
    assert {measure.name: measure.shown(nothing) for measure in MEASURES}["limit_median"] == "-"


def test_sentences_say_what_numbers_say() -> None:
    row = made_up(PLAN, 0, "default", 5)._replace(contact=True, seen=True, avoidable=True, limit=0.0412, fixed=0.05)
    assert re.search(r"avoidable, by 41 mm", row.sentence)
    assert "no proof" in row._replace(avoidable=False, limit=-0.01).sentence
    assert "No motion could" in row._replace(avoidable=False, limit=-0.01, fixed=-0.005).sentence
    assert "seen" in row._replace(avoidable=False, seen=False).sentence
    assert "no contact" in row._replace(contact=False).sentence
