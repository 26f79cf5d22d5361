"""`qpsafe campaign`: files, JSON, exit codes, clear errors; stopped by whatever, it goes on to the same report."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import made_up_trials
import numpy as np
import pytest
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError, MissingExtraError
from qpsafe.sim.campaign.limit.row import Limit
from qpsafe.sim.campaign.limit.search import EVALUATIONS
from qpsafe.sim.campaign.plan import CONTROLLERS, QUICK, Plan
from qpsafe.sim.campaign.report.page import show_command
from qpsafe.sim.campaign.runner import stored_results
from qpsafe.sim.campaign.speed import Speed
from qpsafe.sim.campaign.worst.cases import Encounter, cases_to_dict, encounter_of, find_worst, load_case
from qpsafe.text.json_text import json_text

FEW = ["--trials", "12", "--workers", "1", "--controllers", "none,stop,default"]


@pytest.fixture(autouse=True)
def _made_up(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Made-up trials in the place of simulated ones, and a current folder of its own."""
    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: made_up_trials.run)
    monkeypatch.setattr("qpsafe.sim.campaign.speed.engine_speed", lambda plan, trials: Speed(100.0, 90.0, float("nan")))
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def _plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures take most of a command's time; tests/sim/campaign looks at the page."""
    monkeypatch.setattr("qpsafe.sim.campaign.report.page.report_page", lambda results, found: json_text(found))


def campaign(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["campaign", *arguments])


# Running


def test_a_campaign_is_kept_reported_and_printed(tmp_path: Path) -> None:
    result = campaign(*FEW, "--out", "kept", "--seed", "4")
    assert result.exit_code == 0, result.output
    for word in ("12 of 12 trials", "none", "stop", "default", "Less stop", "report.html"):
        assert word in " ".join(result.output.split())
    report = json.loads((tmp_path / "kept" / "report.json").read_text())
    assert report["seeds"] == [4, 15]
    assert report["plan"]["controllers"] == ["none", "stop", "default"]
    assert "<svg" in (tmp_path / "kept" / "report.html").read_text(encoding="utf-8")
    assert stored_results(tmp_path / "kept").trials == 12


def test_json_is_one_object_on_standard_output_and_nothing_else(tmp_path: Path) -> None:
    result = campaign(*FEW, "--quick", "--json")
    assert result.exit_code == 0, result.output
    assert list(json.loads(result.stdout)["controllers"]) == ["none", "stop", "default"]
    assert "trials" in result.stderr  # its progress
    assert not list(tmp_path.iterdir())  # a quick one is kept only where it is told to


def test_a_quick_one_compares_all_and_needs_no_pyarrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    report = json.loads(campaign("--quick", "--workers", "1", "--json").stdout)
    assert list(report["controllers"]) == list(CONTROLLERS)
    assert {found["trials"] for found in report["controllers"].values()} == {QUICK}
    for options in (["--quick", "--out", "kept"], ["--trials", "5"]):
        refused = campaign(*options)
        assert isinstance(refused.exception, MissingExtraError)
        assert "qpsafe[campaign]" in str(refused.exception)


@pytest.mark.usefixtures("_plain_page")
def test_a_folder_is_named_after_the_plan_and_the_same_command_goes_on(tmp_path: Path) -> None:
    assert campaign(*FEW).exit_code == 0
    (folder,) = (tmp_path / "out").iterdir()
    plan = Plan(trials=12, controllers=("none", "stop", "default"))
    assert folder.name == f"campaign-{plan.digest()[:8]}"
    files = sorted(file.name for file in folder.iterdir())
    assert campaign(*FEW).exit_code == 0
    assert sorted(file.name for file in folder.iterdir()) == files
    assert campaign(*FEW, "--seed", "1").exit_code == 0
    assert len(list((tmp_path / "out").iterdir())) == 2


@pytest.mark.usefixtures("_plain_page")
def test_a_file_says_the_plan_and_options_go_before_it(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text('trials = 9\nseed = 3\ncontrollers = ["stop", "default"]\nlag = 0.02\n')
    report = json.loads(campaign("plan.toml", "--seed", "8", "--json", "--workers", "1").stdout)
    said = report["plan"]
    assert (said["trials"], said["seed"], said["lag"], said["controllers"]) == (9, 8, 0.02, ["stop", "default"])
    quick = json.loads(campaign("run", "plan.toml", "--quick", "--json", "--workers", "1").stdout)
    assert quick["plan"]["trials"] == QUICK


def test_a_broken_controller_is_printed_and_the_exit_code_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(plan: Plan, trial: int) -> list[dict[str, Any]]:
        rows = made_up_trials.run(plan, trial)
        rows[2] |= {"contact": True, "moving": True, "towards": True, "contact_class": "towards"}
        return rows

    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: broken)
    result = campaign(*FEW, "--trials", "20", "--quick")
    assert result.exit_code == 1
    assert "default is worse than no control" in " ".join(result.output.split())
    assert json.loads(campaign(*FEW, "--trials", "20", "--quick", "--json").stdout)["findings"]


@pytest.mark.usefixtures("_plain_page")
def test_a_folder_is_reported_again(tmp_path: Path) -> None:
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


def without_times(text: str) -> str:
    return re.sub(r'"engine": \{.*?\}|<p class="soft" id="times">.*?</p>', "", text, flags=re.DOTALL)


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
        (["show", "3", "--controller", "brave"], "--controllers = 'brave'"),
        (["worst", "brave"], "--controllers = 'brave'"),
        (["limit", "first"], "TRIAL = 'first': expected the number of a trial, or FILE.json#K with"),
        (["limit", "worst.json#0"], "worst.json: cases[0]"),
        (["limit", ".", "--seed", "3"], "--seed = '.'"),
        (["limit", "."], "manifest.json"),
    ],
)
def test_what_cannot_be_asked_is_named_and_nothing_is_written(arguments: list[str], said: str, tmp_path: Path) -> None:
    result = campaign(*arguments)
    assert result.exit_code != 0
    assert isinstance(result.exception, ConfigurationError)
    assert said in str(result.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", [[], ["show", "1"], ["limit", "1"], ["worst", "stop"]])
@pytest.mark.parametrize("option", ["--people", "--cell", "--motions"])
@pytest.mark.parametrize("text", ["speed = 3", "[[box]", '[[person]]\nname = "A"'])
def test_a_wrong_file_is_named_with_its_line_before_anything_begins(
    command: list[str], option: str, text: str, tmp_path: Path
) -> None:
    (tmp_path / "wrong.toml").write_text(text)
    result = campaign(*command, option, "wrong.toml")
    assert isinstance(result.exception, ConfigurationError)
    assert str(result.exception).startswith("wrong.toml:1: ")
    assert [file.name for file in tmp_path.iterdir()] == ["wrong.toml"]


def test_a_plan_whose_robot_is_not_there_is_named_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text('trials = 3\nrobot = "mine"\n')
    assert "plan.toml:2: robot = 'mine': expected a bundled robot" in str(campaign("plan.toml").exception)


@pytest.mark.usefixtures("_plain_page")
def test_another_plan_in_the_folder_is_named_and_leaves_it_as_it_is(tmp_path: Path) -> None:
    campaign(*FEW, "--out", "kept")
    before = {file: file.read_bytes() for file in (tmp_path / "kept").iterdir()}
    refused = campaign(*FEW, "--out", "kept", "--lag", "0.012")
    assert isinstance(refused.exception, ConfigurationError)
    assert "kept: lag = 0.0: expected 0.01" in str(refused.exception)
    assert "goes on" not in refused.output
    assert {file: file.read_bytes() for file in (tmp_path / "kept").iterdir()} == before


def test_what_ends_it_says_how_to_go_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
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
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(plan: Plan, trial: int) -> list[dict[str, Any]]:
        return made_up_trials.run(plan, trial) if trial < 9 else [1 / 0]  # type: ignore[list-item]

    folder = "a folder " * 12 + name  # longer than a line: the command is not broken
    monkeypatch.setattr("qpsafe.sim.campaign.runner._engine", lambda: failing)
    line = next(line for line in campaign(*FEW, "--out", folder).output.splitlines() if line.startswith("to judge"))
    assert shlex.split(line)[-4:] == ["qpsafe", "campaign", "report", folder]


# Stopped and killed

SCRIPT = """
import sys
import made_up_trials
from qpsafe.sim.campaign import runner
runner._engine = lambda: made_up_trials.run_slowly
runner.KEEP_EVERY = 0.1
runner.run_campaign.__kwdefaults__["keep_every"] = 0.1
from qpsafe.cli.main import main
if __name__ == "__main__":
    main()
"""
LONG = ["campaign", "--trials", "400", "--workers", "2", "--controllers", "none,stop,default", "--out"]


def began(folder: Path, until_kept: bool = True) -> subprocess.Popen[str]:
    """A campaign of 400 trials in a Python of its own, which has kept some."""
    script = folder.parent / "campaign.py"
    script.write_text(SCRIPT)
    environment = os.environ | {"PYTHONPATH": str(Path(made_up_trials.__file__).parent), "NO_COLOR": "1"}
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    command = [sys.executable, str(script), *LONG, str(folder)]
    process = subprocess.Popen(command, env=environment, **options)  # type: ignore[call-overload]
    limit = time.monotonic() + 60
    while until_kept and not list(folder.glob("*.parquet")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < limit
        time.sleep(0.02)
    return process


def all_end(group: int) -> None:
    """Wait until no process of a group is left: they end by themselves."""
    limit = time.monotonic() + 20
    with suppress(ProcessLookupError):
        while True:
            os.killpg(group, 0)
            assert time.monotonic() < limit
            time.sleep(0.05)


def reports(folder: Path) -> list[str]:
    return [without_times((folder / name).read_text(encoding="utf-8")) for name in ("report.json", "report.html")]


@pytest.mark.slow
def test_killed_and_interrupted_it_goes_on_to_the_same_report_byte_for_byte_but_for_times(tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    process = began(folder)
    process.kill()  # signal 9, in the middle
    process.communicate()
    all_end(process.pid)
    first = stored_results(folder).trials
    assert 0 < first < 400
    process = began(folder)
    while stored_results(folder).trials == first:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # Ctrl-C, as a terminal does: to all processes
    out, errors = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "Traceback" not in out + errors
    assert f"finished trials are kept in {folder}: the same command goes on there" in " ".join(out.split())
    assert "interrupted" in errors
    all_end(process.pid)
    assert first < stored_results(folder).trials < 400
    process = began(folder, until_kept=False)
    out, errors = process.communicate(timeout=120)
    assert process.returncode == 0, out + errors
    straight = campaign(*LONG[1:3], "--workers", "1", *LONG[5:], "straight")
    assert straight.exit_code == 0
    assert reports(folder) == reports(tmp_path / "straight")


# One trial again, and the worst


def test_show_plays_the_trial_or_the_case_that_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
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
    table["cases"] = [{}, {"motion": "hold", "u": [0.25, 1]}]
    (tmp_path / "worst.json").write_text(json.dumps(table))
    told = campaign("show", "worst.json#1", "--out", "there", "--seed", "5", "--json")
    assert json.loads(told.stdout)["contact"] is True
    (plan, trial, controller, out, _), (other, case, name, there, label) = played
    assert (plan.seed, plan.sensor, trial, controller, out) == (9, "sharp", 7, "stop", Path("out/campaign-show"))
    assert (other.seed, other.lag, case) == (5, 0.02, Encounter("hold", (0.25, 1.0)))
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


def test_the_worst_cases_are_found_written_and_can_be_played_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
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


# What was possible


def found_limit(plan: Plan, what: Any, controller: str, evaluations: int) -> Limit:
    """Made up; trial 0 is avoidable, the others are not."""
    trial = what if isinstance(what, int) else -1
    best = 0.04 if trial == 0 else -0.01
    return Limit(
        trial, plan.seed_of(trial), "hold", controller, 1.5, -0.06, -0.09, best, 0.05, True, True, best > 0.0,
        0.03 / (best + 0.09), evaluations,
    )  # fmt: skip


def test_the_limit_of_a_trial_or_a_case(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[tuple[Any, ...]] = []

    class Module:
        @staticmethod
        def limit_of(*what: Any) -> Any:
            asked.append(what)
            return SimpleNamespace(limit=found_limit(*what))

    monkeypatch.setitem(sys.modules, "qpsafe.sim.campaign.limit.limit", Module)  # type: ignore[arg-type]
    shown = campaign("limit", "0", "--seed", "9", "--motions", "hold", "--controller", "stop")
    assert shown.exit_code == 0, shown.output
    for words in ("best motion found, with foresight 40", "avoidable, by 40 mm at least", "stop gained 23 %", "1.50 s"):
        assert words in " ".join(shown.output.split())
    table = {
        "plan": Plan(seed=3, lag=0.02).to_dict(),
        "controller": "strict",
        "cases": [{"motion": "hold", "u": [0.5]}],
    }
    (tmp_path / "worst.json").write_text(json.dumps(table))
    told = json.loads(campaign("limit", "worst.json#0", "--evaluations", "300", "--json").stdout)
    assert told["avoidable"] is False
    assert "no proof" in told["sentence"]
    (plan, trial, controller, tries), (other, said, name, few) = asked
    assert (plan.seed, plan.motions, trial, controller, tries) == (9, ("hold",), 0, "stop", EVALUATIONS)
    assert (other.lag, said, name, few) == (0.02, Encounter("hold", (0.5,)), "strict", 300)


@pytest.mark.usefixtures("_plain_page")
def test_the_limits_of_a_folder_go_into_its_report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("qpsafe.sim.campaign.limit.folder._limit", found_limit)
    campaign(*FEW, "--trials", "40", "--out", "kept")
    shown = campaign("limit", "kept", "--workers", "1")
    assert shown.exit_code == 0, shown.output
    assert "qpsafe campaign report kept" in " ".join(shown.output.split())
    told = json.loads(campaign("limit", "kept", "--workers", "1", "--controller", "default", "--json").stdout)
    report = json.loads(campaign("report", "kept", "--json").stdout)
    assert report["limits"] == {"default": {k: v for k, v in told.items() if k not in ("controller", "trials")}}
    assert told["looked_at"] == len(told["trials"]) == report["controllers"]["default"]["contacts"]
    assert '"limits": {' in (tmp_path / "kept" / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("_plain_page")
def test_ctrl_c_says_that_limits_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    def stops(*_: Any) -> Limit:
        raise KeyboardInterrupt

    monkeypatch.setattr("qpsafe.sim.campaign.limit.folder._limit", stops)
    campaign(*FEW, "--trials", "40", "--out", "kept")
    stopped = campaign("limit", "kept", "--workers", "1")
    assert "what was found is kept in kept: the same command goes on there" in " ".join(stopped.output.split())
