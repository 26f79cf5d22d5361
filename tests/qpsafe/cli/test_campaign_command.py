"""`qpsafe campaign`: files, JSON, exit codes, clear errors, and how to go on."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import made_up_trials
import pytest
from amounts import crossed
from made_up_trials import FEW, without_times

from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.campaign.plan import CONTROLLERS, QUICK, Plan
from qpsafe.sim.campaign.runner import stored_results
from qpsafe.sim.campaign.speed import Speed

pytestmark = pytest.mark.long

Campaign = Callable[..., Any]

#: No number of a trial, nor a case.
WORDS = ("#0", "#", "", "x#y", "+1", "1.5", "9" * 5000, "10000000", str(2**53), "worst.json#" + "9" * 5000)


def test_a_campaign_is_kept_reported_and_printed(campaign: Campaign, tmp_path: Path) -> None:
    result = campaign(*FEW, "--out", "kept", "--seed", "4")
    assert result.exit_code == 0, result.output
    for word in ("12 of 12 trials", "none", "stop", "default", "Less stop", "report.html"):
        assert word in " ".join(result.output.split())
    report = json.loads((tmp_path / "kept" / "report.json").read_text())
    assert report["seeds"] == [4, 15]
    assert report["plan"]["controllers"] == ["none", "stop", "default"]
    assert "<svg" in (tmp_path / "kept" / "report.html").read_text(encoding="utf-8")
    assert stored_results(tmp_path / "kept").trials == 12


def test_json_is_one_object_on_standard_output_and_nothing_else(campaign: Campaign, tmp_path: Path) -> None:
    result = campaign(*FEW, "--quick", "--json")
    assert result.exit_code == 0, result.output
    assert list(json.loads(result.stdout)["controllers"]) == ["none", "stop", "default"]
    assert "trials" in result.stderr  # its progress
    assert not list(tmp_path.iterdir())  # a quick one is kept only where it is told to


def test_a_quick_one_compares_all_and_needs_no_pyarrow(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    report = json.loads(campaign("--quick", "--workers", "1", "--json").stdout)
    assert list(report["controllers"]) == list(CONTROLLERS)
    assert {found["trials"] for found in report["controllers"].values()} == {QUICK}
    for options in (["--quick", "--out", "kept"], ["--trials", "5"]):
        refused = campaign(*options)
        assert isinstance(refused.exception, MissingExtraError)
        assert "qpsafe[campaign]" in str(refused.exception)


@pytest.mark.usefixtures("plain_page")
def test_a_folder_is_named_after_the_plan_and_the_same_command_goes_on(campaign: Campaign, tmp_path: Path) -> None:
    assert campaign(*FEW).exit_code == 0
    (folder,) = (tmp_path / "out").iterdir()
    plan = Plan(trials=12, controllers=("none", "stop", "default"))
    assert folder.name == f"campaign-{plan.digest()[:8]}"
    files = sorted(file.name for file in folder.iterdir())
    assert campaign(*FEW).exit_code == 0
    assert sorted(file.name for file in folder.iterdir()) == files
    assert campaign(*FEW, "--seed", "1").exit_code == 0
    assert len(list((tmp_path / "out").iterdir())) == 2


@pytest.mark.usefixtures("plain_page")
def test_a_file_says_the_plan_and_options_go_before_it(campaign: Campaign, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text('trials = 9\nseed = 3\ncontrollers = ["stop", "default"]\nlag = 0.02\n')
    report = json.loads(campaign("plan.toml", "--seed", "8", "--json", "--workers", "1").stdout)
    said = report["plan"]
    assert (said["trials"], said["seed"], said["lag"], said["controllers"]) == (9, 8, 0.02, ["stop", "default"])
    quick = json.loads(campaign("run", "plan.toml", "--quick", "--json", "--workers", "1").stdout)
    assert quick["plan"]["trials"] == QUICK


def test_a_broken_controller_is_printed_and_the_exit_code_says_so(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(plan: Plan, trial: int) -> list[dict[str, Any]]:
        rows = made_up_trials.run(plan, trial)
        rows[2] |= {"contact": True, "moving": True, "towards": True, "contact_class": "towards"}
        return rows

    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: broken)
    result = campaign(*FEW, "--trials", "20", "--quick")
    assert result.exit_code == 1
    assert "default is worse than no control" in " ".join(result.output.split())
    assert json.loads(campaign(*FEW, "--trials", "20", "--quick", "--json").stdout)["findings"]


@pytest.mark.usefixtures("plain_page")
def test_a_folder_is_reported_again(campaign: Campaign, tmp_path: Path) -> None:
    campaign(*FEW, "--out", "kept")
    pages = [tmp_path / "kept" / name for name in ("report.html", "report.json")]
    before = [without_times(page.read_text(encoding="utf-8")) for page in pages]
    for page in pages:
        page.unlink()
    assert campaign("report", "kept").exit_code == 0
    assert [without_times(page.read_text(encoding="utf-8")) for page in pages] == before
    other = campaign("report", "kept", "--out", "other", "--json")
    assert json.loads(other.stdout)["trials"] == {"finished": 12, "planned": 12}
    assert {file.name for file in (tmp_path / "other").iterdir()} == {"report.html", "report.json"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.toml"], "none.toml: file = "),
        (["--trials", "0"], "--trials = 0"),
        (["--seed", "-1"], "--seed = -1"),
        (["--controllers", "stop,brave"], "--controllers = 'brave': expected one of none, stop"),
        (["--sensor", "radar"], "--sensor = 'radar'"),
        (["--motions", "hold,dance"], "--motions = 'dance'"),
        (["--lag", "3"], "--lag = 3.0"),
        (["--people", "nobody.toml"], "--people = 'nobody.toml'"),
        (["--dask", "nonsense"], "--dask = 'nonsense'"),
        (["report", "nowhere"], "manifest.json"),
        (["show", "first"], "TRIAL = 'first'"),
        (["show", "worst.json#0"], "worst.json: cases[0]"),
        (["show", "3", "--controller", "brave"], "show: controller = 'brave'"),
        (["show", "3", "--controller", ""], "show: controller = ''"),
        (["show", "3", "--controller", "none,stop"], "controller = 'none,stop'"),
        (["worst", "brave"], "worst: controller = 'brave'"),
        (["worst", ""], "worst: controller = ''"),
        *((["show", word], f"TRIAL = {word[:40]!r}") for word in WORDS),
        *((["limit", word], f"TRIAL = {word[:40]!r}") for word in WORDS),
        (["reprot", "c1"], "COMMAND = 'reprot': expected a plan's TOML file that is there, or a command: run, show"),
        (["limit", "first"], "TRIAL = 'first': expected the number of a trial, or FILE.json#K with"),
        (["limit", "worst.json#0"], "worst.json: cases[0]"),
        (["limit", ".", "--seed", "3"], "--seed = 3: expected nothing"),
        (["limit", ".", "--controller", ""], "manifest.json"),
        (["limit", "."], "manifest.json"),
    ],
)
def test_what_cannot_be_asked_is_named_and_nothing_is_written(
    campaign: Campaign, arguments: list[str], said: str, tmp_path: Path
) -> None:
    result = campaign(*arguments)
    assert result.exit_code != 0
    assert isinstance(result.exception, ConfigurationError)
    assert said in str(result.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("command", "option"),
    crossed([[], ["show", "1"], ["limit", "1"], ["worst", "stop"]], ["--people", "--cell", "--motions"]),
)
@pytest.mark.parametrize("text", ["speed = 3", "[[box]", '[[person]]\nname = "A"'])
def test_a_wrong_file_is_named_with_its_line_before_anything_begins(
    campaign: Campaign, command: list[str], option: str, text: str, tmp_path: Path
) -> None:
    (tmp_path / "wrong.toml").write_text(text)
    result = campaign(*command, option, "wrong.toml")
    assert isinstance(result.exception, ConfigurationError)
    assert str(result.exception).startswith("wrong.toml:1: ")
    assert [file.name for file in tmp_path.iterdir()] == ["wrong.toml"]


def test_a_plan_whose_robot_is_not_there_is_named_with_its_line(campaign: Campaign, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text('trials = 3\nrobot = "mine"\n')
    assert "plan.toml:2: robot = 'mine': expected a bundled robot" in str(campaign("plan.toml").exception)


@pytest.mark.usefixtures("plain_page")
def test_another_plan_in_the_folder_is_named_and_leaves_it_as_it_is(campaign: Campaign, tmp_path: Path) -> None:
    campaign(*FEW, "--out", "kept")
    before = {file: file.read_bytes() for file in (tmp_path / "kept").iterdir()}
    refused = campaign(*FEW, "--out", "kept", "--lag", "0.012")
    assert isinstance(refused.exception, ConfigurationError)
    assert "kept: lag = 0.0: expected 0.01" in str(refused.exception)
    assert "goes on" not in refused.output
    assert {file: file.read_bytes() for file in (tmp_path / "kept").iterdir()} == before


@pytest.mark.slow
def test_what_ends_it_says_how_to_go_on(campaign: Campaign, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def failing(plan: Plan, trial: int) -> list[dict[str, Any]]:
        return made_up_trials.run(plan, trial) if trial < 9 else [1 / 0]  # type: ignore[list-item]

    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: failing)
    result = campaign(*FEW, "--out", "kept")
    assert "trial 9: ZeroDivisionError" in str(result.exception)
    said = "finished trials are kept in kept: the same command goes on there"
    assert said in " ".join(result.output.split())
    assert "nothing is kept without --out" in campaign(*FEW, "--quick").output
    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: made_up_trials.run)
    assert json.loads(campaign("report", "kept", "--json").stdout)["trials"] == {"finished": 8, "planned": 12}
    assert "It is not finished: 8 of 12 trials." in (tmp_path / "kept" / "report.html").read_text(encoding="utf-8")
    assert "12 of 12" in campaign(*FEW, "--out", "kept").output


@pytest.mark.parametrize("name", ["kept", "my run", "Größe $(x) & y", "it's"])
def test_the_command_that_is_told_can_be_typed_whatever_the_folder_is_called(
    campaign: Campaign, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(plan: Plan, trial: int) -> list[dict[str, Any]]:
        return made_up_trials.run(plan, trial) if trial < 9 else [1 / 0]  # type: ignore[list-item]

    folder = "a folder " * 12 + name  # longer than a line: the command is not broken
    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: failing)
    line = next(line for line in campaign(*FEW, "--out", folder).output.splitlines() if line.startswith("to judge"))
    assert shlex.split(line)[-4:] == ["qpsafe", "campaign", "report", folder]


@pytest.mark.usefixtures("plain_page")
def test_a_report_needs_none_of_the_plans_files_any_more(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From another directory, and after people's file has gone: then alone the engine is not timed."""
    text = '[[person]]\nname = "A"\nstart = [1.3, 0.1]\n[[person.step]]\ndo = "walk"\nto = [0.5, 0.0]\nspeed = 1.0\n'
    (tmp_path / "ada.toml").write_text(text)
    asked: list[Plan] = []

    def timed(plan: Plan, trials: int) -> Speed:
        asked.append(plan)
        EncounterModel.load(plan.people)
        return Speed(100.0, 90.0, float("nan"))

    monkeypatch.setattr("qpsafe.sim.campaign.speed.engine_speed", timed)
    told = json.loads(campaign(*FEW, "--people", "ada.toml", "--out", "kept", "--json").stdout)
    (tmp_path / "else").mkdir()
    monkeypatch.chdir(tmp_path / "else")
    there = json.loads(campaign("report", "../kept", "--json").stdout)
    (tmp_path / "ada.toml").unlink()
    gone = json.loads(campaign("report", "../kept", "--json").stdout)
    assert [found["engine"].pop("simulated_s_per_wall_s") for found in (told, there, gone)] == [100.0, 100.0, None]
    for found in (told, there, gone):
        found.pop("engine")
    assert told == there == gone
    assert {plan.people for plan in asked} == {str(tmp_path / "ada.toml")}
