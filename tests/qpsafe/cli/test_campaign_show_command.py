"""`qpsafe campaign show` and `worst`: one trial again, and the worst cases of a controller."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import made_up_trials
import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.report.page import show_command
from qpsafe.sim.campaign.worst.cases import Encounter, cases_to_dict, encounter_of, find_worst, load_case
from qpsafe.text.json_text import json_text

pytestmark = pytest.mark.long

Campaign = Callable[..., Any]


def test_show_plays_the_trial_or_the_case_that_is_named(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    played: list[tuple[Any, ...]] = []

    class Module:
        @staticmethod
        def show(*what: Any, label: str, notice: Any, progress: Any) -> Any:
            played.append((*what, label))
            notice("no video: too dark")
            progress(1, 2)
            row = made_up_trials.row(what[0], 7, what[2], 0.0, False)
            return SimpleNamespace(row=row, files=(what[3] / "video.mp4",))

    monkeypatch.setitem(sys.modules, "qpsafe.sim.campaign.show", Module)  # type: ignore[arg-type]
    command = show_command(Plan(seed=9, sensor="sharp"), 7, "stop").split()
    assert command[:2] == ["qpsafe", "campaign"]
    result = campaign(*command[2:])
    assert result.exit_code == 0, result.output
    for word in ("video.mp4", "no video: too dark", "contact_region"):
        assert word in result.output
    assert "nan" not in result.output
    table = {"plan": Plan(seed=3, lag=0.02).to_dict(), "controller": "strict"}
    table["cases"] = [{}, {"motion": "hold", "u": [0.25] * 41 + [1]}]
    (tmp_path / "worst.json").write_text(json.dumps(table))
    told = campaign("show", "worst.json#1", "--out", "there", "--seed", "5", "--json")
    assert json.loads(told.stdout)["contact"] is True
    (plan, trial, controller, out, _), (other, case, name, there, label) = played
    assert (plan.seed, plan.sensor, trial, controller, out) == (9, "sharp", 7, "stop", Path("out/campaign-show"))
    assert (other.seed, other.lag, case) == (5, 0.02, Encounter("hold", (0.25,) * 41 + (1.0,)))
    assert (name, there, label) == ("strict", Path("there"), "worst-1")
    (tmp_path / "plan.toml").write_text("trials = 3")
    twice = campaign("show", "worst.json#1", "--file", "plan.toml")
    assert "--file = 'plan.toml'" in str(twice.exception)
    table["plan"]["robot"] = 7  # type: ignore[index]
    table["plan"]["lag"] = 9.0  # type: ignore[index]
    (tmp_path / "worst.json").write_text(json.dumps(table))
    assert "worst.json: plan.lag = 9.0" in str(campaign("show", "worst.json#1").exception)


def play_case(plan: Plan, case: Encounter, controller: str) -> dict[str, Any]:
    """Contact near a point of the cube, while the robot picks."""
    gap = float(np.linalg.norm(np.array(case.u) - 0.4)) - 0.2 + (case.motion != "pick")
    row = made_up_trials.row(plan, 0, controller, 0.0 if gap < 0.0 else 1.0, False)
    told = {"motion": case.motion, "distance": gap, "contact": gap <= 0.0, "search": -gap, "closing_speed": 1.0}
    return row | told | {"distance_time": 20.0 * case.u[0]}


@pytest.mark.slow
def test_the_worst_cases_are_found_written_and_can_be_played_again(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("cma")
    monkeypatch.setattr("qpsafe.sim.campaign.worst.cases._engine", lambda: play_case)
    monkeypatch.setattr("qpsafe.sim.campaign.worst.cases._continuous", lambda plan: np.ones(6, dtype=bool))
    result = campaign("worst", "stop", "--trials", "600", "--workers", "1", "--json", "--out", "found")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found == json.loads((tmp_path / "found" / "worst-stop.json").read_text())
    assert len(found["cases"]) == found["searched"] >= found["new"] >= 10
    for number, case in enumerate(found["cases"]):
        plan, controller, again = load_case(tmp_path / "found" / "worst-stop.json", number)
        assert (plan.seed, controller) == (0, "stop")
        assert again.motion == "pick"
        assert play_case(Plan(), again, "stop")["distance"] == case["row"]["distance"] < 0.05
    shown = campaign("worst", "stop", "--trials", "600", "--workers", "1", "--seed", "2", "--out", "found")
    text = " ".join(shown.output.split())
    assert "qpsafe campaign show found/worst-stop.json#0" in text
    assert "worse than all of its kind" in text
    little = campaign("worst", "stop", "--trials", "40", "--workers", "1", "--motions", "hold")
    assert little.exit_code == 1
    assert "could not find 10" in " ".join(little.output.split())


def test_the_first_coordinate_chooses_the_motion_and_threads_change_nothing() -> None:
    pytest.importorskip("cma")
    from concurrent.futures import ThreadPoolExecutor

    plan = Plan(motions=("hold", "line", "pick"))
    motions = [encounter_of(plan, (first, 0.5)).motion for first in (0.0, 0.34, 0.67, 1.0)]
    assert motions == ["hold", "line", "pick", "pick"]
    options: dict[str, Any] = {"case": play_case, "continuous": np.ones(3, dtype=bool)}
    alone = find_worst(plan, "stop", 80, **options)
    with ThreadPoolExecutor(3) as executor:
        both = [
            cases_to_dict(plan, "stop", found) for found in (alone, find_worst(plan, "stop", 80, executor, **options))
        ]
    assert json_text(both[0]) == json_text(both[1])


@pytest.mark.parametrize("command", ["show", "limit"])
@pytest.mark.parametrize(
    ("change", "options", "said"),
    [
        ({}, ["--motions", "line"], "--motions = 'line': expected none"),
        ({}, ["--controller", ""], "controller = ''"),
        ({"u": [0.5] * 41}, [], "worst.json#0: u = '41 numbers': expected 42"),
        ({"u": [0.5] * 41 + [1.5]}, [], "worst.json#0: u[41] = 1.5"),
        ({"u": [float("nan")] * 42}, [], "worst.json#0: u[0] = nan"),
        ({"motion": "dance"}, [], "worst.json#0: motion = 'dance'"),
        ({"u": 3}, [], "worst.json: cases[0]"),
    ],
)
def test_a_case_that_is_none_is_named_with_its_file(
    campaign: Campaign, command: str, change: dict[str, Any], options: list[str], said: str, tmp_path: Path
) -> None:
    table = {"plan": Plan().to_dict(), "controller": "stop", "cases": [{"motion": "hold", "u": [0.5] * 42} | change]}
    (tmp_path / "worst.json").write_text(json.dumps(table))
    refused = campaign(command, "worst.json#0", *options)
    assert isinstance(refused.exception, ConfigurationError)
    assert said in str(refused.exception)
    assert len(str(refused.exception)) < 300
