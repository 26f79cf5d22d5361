"""`qpsafe tune`: files, JSON, exit codes, clear errors; stopped by whatever, it goes on to the same front."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import made_up_trials
import made_up_values
import numpy as np
import pytest
from typer.testing import CliRunner

import qpsafe
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.tuning.robot_file import MARK, farthest
from qpsafe.sim.tuning.space import Space
from qpsafe.sim.tuning.values import present

pytestmark = pytest.mark.long

FEW = ["--trials", "17", "--workers", "1", "--judge", "24", "--finals", "30"]


@pytest.fixture(autouse=True)
def _made_up(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Made-up outcomes in the place of simulated ones; a tuned robot is a little quicker than the present one."""

    def judged(plan: Plan, trial: int) -> list[dict[str, Any]]:
        rows = made_up_trials.run(plan, trial)
        quiet = {"furniture": False, "self": False, "limit_excess": 0.0}
        sooner = 0.5 if "tune" in plan.robot else 0.0
        return [row | quiet | {"lost_time": row["lost_time"] - sooner} for row in rows]

    monkeypatch.setattr("qpsafe.sim.tuning.hall.play_piece", made_up_values.play)
    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: judged)
    monkeypatch.chdir(tmp_path)


def tune(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["tune", *arguments])


def test_a_search_is_kept_judged_reported_and_printed(tmp_path: Path) -> None:
    result = tune(*FEW, "--out", "tuned", "--seed", "2")
    assert result.exit_code == 0, result.output
    for word in ("The front", "present", "matters for harm", "better in work lost", "tune.html"):
        assert word in result.output
    page = (tmp_path / "tuned" / "tune.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 2
    assert "http" not in page.replace("http://www.w3.org", "")  # needs nothing else
    for word in ("on encounters that nothing was tuned on", "delay_arm", "[evasion] mass", "Search 2"):
        assert word in page
    said = json.loads((tmp_path / "tuned" / "tune.json").read_text(encoding="utf-8"))
    robot = qpsafe.load_robot(tmp_path / "tuned" / "robot")
    chosen = Space.of(qpsafe.load_robot("irb140")).at(said["chosen"]["point"])
    assert farthest(present(robot), chosen) < 1e-12
    assert said["run"] in (tmp_path / "tuned" / "robot" / "robot.toml").read_text(encoding="utf-8")
    assert said["search"]["encounters"] == [7_020_000, 7_020_215]
    assert said["finals"]["encounters"] == [7_025_000, 7_025_029]
    assert f"{len(said['finals']['finalists']) - 1} trials and the present values met 30 others" in page
    assert said["judgement"]["seed"] == 8_000_000
    # again: nothing is played, and the same is printed as JSON
    again = tune(*FEW, "--out", "tuned", "--seed", "2", "--json")
    assert json.loads(again.stdout) == said


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.97, 0.7])  # in the search, in the finals
def test_ctrl_c_keeps_what_is_finished_and_the_same_command_goes_on(
    monkeypatch: pytest.MonkeyPatch, share: float
) -> None:
    calls, at = 0, math.inf

    def play(piece: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == at:
            raise KeyboardInterrupt
        return made_up_values.play(piece)

    with monkeypatch.context() as patched:
        patched.setattr("qpsafe.sim.tuning.hall.play_piece", play)
        whole = json.loads(tune(*FEW, "--out", "whole", "--json").stdout)
        at, calls = round(share * calls), 0
        stopped = tune(*FEW, "--out", "cut")
    assert calls == at
    assert stopped.exit_code != 0
    assert "finished trials are kept in cut: the same command goes on there" in stopped.output
    again = json.loads(tune(*FEW, "--out", "cut", "--json").stdout)
    for said in (whole, again):
        del said["search"]["processor_s"]
    assert again == whole


@pytest.mark.slow
def test_values_are_written_into_a_robot_of_ones_own_and_only_there(tmp_path: Path) -> None:
    shutil.copytree(qpsafe.load_robot("irb140").folder, tmp_path / "own")
    before = present(qpsafe.load_robot(tmp_path / "own"))
    result = tune(*FEW, "--robot", "own", "--write", "--out", "tuned")
    assert result.exit_code == 0, result.output
    assert MARK in (tmp_path / "own" / "robot.toml").read_text(encoding="utf-8")
    now, copy = (present(qpsafe.load_robot(tmp_path / place)) for place in ("own", "tuned/robot"))
    assert now == copy
    assert farthest(now, before) > 0.01
    refused = tune(*FEW, "--write")
    assert isinstance(refused.exception, ConfigurationError)
    assert "--write" in str(refused.exception)


@pytest.mark.slow
def test_what_is_not_better_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: made_up_trials.run)
    shutil.copytree(qpsafe.load_robot("irb140").folder, tmp_path / "own")
    text = (tmp_path / "own" / "robot.toml").read_text(encoding="utf-8")
    result = tune(*FEW, "--robot", "own", "--write", "--out", "x")
    assert "already as good" in result.output
    assert "stays as it is" in result.output
    assert (tmp_path / "own" / "robot.toml").read_text(encoding="utf-8") == text
    assert "with the present values, since nothing speaks for others" in " ".join(result.output.split())
    kept = qpsafe.load_robot(tmp_path / "x" / "robot")
    assert farthest(present(kept), present(qpsafe.load_robot("irb140"))) < 1e-12


def test_a_robot_whose_file_cannot_be_written_is_refused_before_the_search(tmp_path: Path) -> None:
    shutil.copytree(qpsafe.load_robot("irb140").folder, tmp_path / "own")
    file = tmp_path / "own" / "robot.toml"
    text = file.read_text(encoding="utf-8")
    start, end = text.index("[danger]"), text.index("# Where distance sensors")
    text = "danger = { delta = 11.5, epsilon = 0.15, delta_f = 7.5, epsilon_f = 0.25 }\n" + text[:start] + text[end:]
    file.write_text(text, encoding="utf-8")
    result = tune(*FEW, "--robot", "own", "--out", "x")
    assert isinstance(result.exception, ConfigurationError)
    assert "a line of its own" in str(result.exception)
    assert str(file) in str(result.exception)
    assert not (tmp_path / "x").exists()
    assert file.read_text(encoding="utf-8") == text


@pytest.mark.slow
def test_without_finals_the_search_chooses() -> None:
    said = json.loads(tune(*FEW, "--finals", "0", "--out", "x", "--json").stdout)
    assert said["finals"] is None
    assert said["chosen"]["number"] in {point["number"] for point in said["front"]}


def test_with_one_trial_the_present_values_are_chosen_and_not_judged() -> None:
    said = json.loads(tune("--trials", "1", "--workers", "1", "--json", "--out", "x").stdout)
    assert said["chosen"]["number"] == 0
    assert said["judgement"] is None
    assert said["sentence"].startswith("The present values were already as good")
    np.testing.assert_equal(said["chosen"]["values"], said["present"]["values"])


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--prefer", "speed"], r"--prefer.*'speed'.*safety, balanced, work"),
        (["--seed", "100"], r"--seed.*100.*0 to 99"),
        (["--finals", "5001"], r"--finals.*5001.*at most 5,000"),
        (["--program", "nowhere.toml"], r"--program.*nowhere.toml"),
        (["--people", "nowhere.toml"], r"--people.*nowhere.toml"),
        (["--cell", "nowhere.toml"], r"--cell.*nowhere.toml"),
        (["--robot", "nobody"], r"nobody.*a bundled robot"),
        (["--dask", "nonsense://x", "--workers", "2"], r"--workers.*only without --dask"),
    ],
)
def test_what_is_wrong_is_named(arguments: list[str], named: str) -> None:
    result = tune(*FEW, *arguments)
    assert isinstance(result.exception, ValueError), result.output
    assert re.search(named, str(result.exception))


def test_an_address_of_workers_that_is_none_is_named() -> None:
    few = [argument for argument in FEW if argument not in ("--workers", "1")]
    result = tune(*few, "--dask", "nonsense://x")
    assert isinstance(result.exception, ValueError), result.output
    assert re.search(r"--dask.*nonsense", str(result.exception))


def test_without_optuna_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    result = tune(*FEW)
    assert isinstance(result.exception, MissingExtraError)
    assert "qpsafe tune needs optuna: pip install 'qpsafe[tune]'" in str(result.exception)
