"""Every table of the command line: no bracket of code or of files is eaten, no word or number is cut."""

from __future__ import annotations

import ast
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import made_up_trials
import numpy as np
import pytest
from amounts import first, thinned
from rich.cells import cell_len
from rich.console import Console

import qpsafe.cli
from qpsafe.cli import bench, check, common, compare, robots, story, tune
from qpsafe.cli.campaign import limit, single
from qpsafe.cli.campaign import run as campaign
from qpsafe.cli.demos import all_robots, fast_person, fixed, path, pick_and_place
from qpsafe.cli.irc5 import irc5_faults, stream_report
from qpsafe.cli.sensors import calibrate, calibrate_camera, place, sick_sensors
from qpsafe.cli.sheet import Sheet
from qpsafe.robot.loader import load_robot
from qpsafe.sim.campaign.limit.row import Limit
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.report.limits import limits_summary
from qpsafe.sim.campaign.worst.search import Case, Found

HOSTILE = "arm[/x] [red]b[/] :smile: [0m]"
WIDTHS = (60, 80)


# Every table of every command

Show = Callable[[Console, Path], None]


def of_bench(screen: Console, folder: Path) -> None:
    from qpsafe.bench.clock import Times
    from qpsafe.bench.peers import MINK
    from qpsafe.bench.ticks import ROWS

    names = [*ROWS, MINK]
    times = Times(20_000, 57.1e-6, 103.4e-6, 1234.5e-6, 123456.7e-6, 0.55, 0.53, 0.57)
    bench.show(dict.fromkeys(names, times), {"processor": f"{HOSTILE} CPU @ 2.20GHz", "python": "3.12.1"}, screen)


def of_compilation(screen: Console, folder: Path) -> None:
    from qpsafe.bench.compilation import Start

    kernels = {"qpsafe.hqp.own.hierarchy.run": 5.123, "qpsafe.pipeline.sense_kernel.evasion_of_distances_of_all": 0.4}
    bench.show_compilation(Start(kernels, 16.1, 23.4), Start(kernels, 0.9, 1.2), screen)


def of_calibration(screen: Console, folder: Path) -> None:
    from qpsafe.sensing.sharp import SharpCurve
    from qpsafe.sensing.skin.calibration import Fit

    curve, distances = SharpCurve(), np.linspace(0.2, 0.8, 120)
    fits = [Fit(f"{name} {HOSTILE}", curve, distances, curve.voltage(distances + 0.1), 117) for name in "ab"]
    calibrate._show(fits, 0.01, screen)


def of_camera(screen: Console, folder: Path) -> None:
    from qpsafe.ranging.extrinsics.calibrate import CameraCalibration

    weak = ("translation along (0.00, 0.00, 1.00)", f"the robot {HOSTILE}")
    found = CameraCalibration(np.eye(4), 1e-6 * np.eye(6), 0.0123, 0.987, 0.0123, 12345, 123, np.zeros(3), weak)
    calibrate_camera._show(HOSTILE, found, 0.01, screen)


def of_check(screen: Console, folder: Path) -> None:
    from qpsafe.check.check import check_path
    from qpsafe.sensing.hulls import Obstacle
    from qpsafe.tasks.trajectory import FixedPose

    robot = load_robot("irb140")
    pose = robot.pose("tcp", robot.home)
    result = check_path(robot, FixedPose(pose), known=[Obstacle.box(f"table {HOSTILE}", [0.3] * 3, pose[:3, 3])])
    check.show(result, f"{HOSTILE}.toml", screen)


def of_compare(screen: Console, folder: Path) -> None:
    from qpsafe.laws.equivalence import compare_states
    from qpsafe.laws.nullspace import NullspaceLaw
    from qpsafe.sim.experiments.fixed.compare import ClosedLoop

    found = compare_states(NullspaceLaw(), 18)
    loop = ClosedLoop(60.0, 1.2e-12, 15000, 1234, 1234, 3.4e-3, 0.123, 1.0, 12.3)
    runs = ("paper", "paper, limits inactive", "null-space law", "strict", "weighted 1e6 : 1e3 : 1")
    compare._show(dict.fromkeys(runs, found), loop, 1e-8, False, screen)


def of_fixed(screen: Console, folder: Path) -> None:
    from qpsafe.sim.experiments.shared.report import ApproachRow, Check, RegimeRow, Report

    regimes = [RegimeRow(name, 12.34, 56.78, 123.45, 1.234567, 1.2345, 1.234567, 1.2345) for name in ("low", HOSTILE)]
    kept = Check(f"joint {HOSTILE} limits", "passed by 1.0e-09 rad/s²", "passed by at most 1e-09", True)
    report = Report(
        regimes=regimes,
        approaches=[ApproachRow(12.3, 45.6, 0.123, 1.012)],
        checks=[kept, kept._replace(kept=False)],
        tracking=(0.0123, 0.1234),
        unusual=(1234, HOSTILE),
        left_out=(HOSTILE, "position error"),
    )
    fixed.show(report, "hierarchical law, strict projection", screen)


def of_fast(screen: Console, folder: Path) -> None:
    from qpsafe.sim.experiments.encounter import Encounter

    never = Encounter(-0.123, 12.34, None, 0.123, -0.12, None, 1.25, 1234.5, None)
    touched = replace(never, contact=12.34, fastest_in_contact=1.2, towards_speed=-0.123)
    names = {"fixed": never, "pick-and-place": touched}
    runs = [
        SimpleNamespace(experiment=name, speed=1.6, moving_links=0.123, encounter=item) for name, item in names.items()
    ]
    fast_person.show(runs, screen)  # type: ignore[arg-type]


def of_path(screen: Console, folder: Path) -> None:
    from qpsafe.sim.experiments.path.report import PathFigures, promises

    numbers = (1.2e-3, 1.2e-5, 1.5e-3, 1.0, 12345, 0.912, 1.0, 0.912, 1.234, 1.2e-4, 12, 44.12)
    found = {name: PathFigures(*numbers) for name in ("strict", "paper", "nullspace", "strict, no recovery")}
    others = {name: found[name] for name in ("paper", "nullspace")}
    checks, _ = promises(found["strict"], found["strict, no recovery"], others)
    path.show(found, checks, ["an event that did not happen"], screen)


def of_pick(screen: Console, folder: Path) -> None:
    from qpsafe.sim.experiments.pick_place.report import PickFigures, promises

    times = (12.34,) * 10
    numbers = (True, 10, 1, 2, 13, 14, 1234.5, times, 0.123, 0.234, 12345, 12346, 0.0123, 12, 123.4, 1234.5, 12345)
    alone, *runs = (PickFigures(seed, *numbers) for seed in (0, 17, 18))
    pick_and_place.show(runs, alone, promises(runs, alone, 10), screen)


def of_robots(screen: Console, folder: Path) -> None:
    from qpsafe.sim.experiments.fixed.table import RobotRow

    gained = (0.1234, -0.0123, 0.1)
    rows = [RobotRow(name, 14, 12, (3, 3), 1234.5, name != "ok", gained, "", name == "ok") for name in ("ok", HOSTILE)]
    all_robots.show_robots(rows, screen)


def of_faults(screen: Console, folder: Path) -> None:
    from qpsafe.sim.irc5.fault_cases import CASES
    from qpsafe.sim.irc5.fault_matrix import Result

    rest = (1.234, 0.987, 1.2e-3, 12, ("ValueError: [x]",) * 3)
    results = [Result(case.name, case.promise, 250, 500, 499, 249, *rest) for case in CASES]
    irc5_faults.show(results, screen)


def of_sick(screen: Console, folder: Path) -> None:
    from qpsafe.sim.sick.cases import CASES
    from qpsafe.sim.sick.matrix import Result

    results = [Result(c.name, c.promise, 90, 200, 199, 84, 123, 12, 1.2e-3, -0.123, 0.234) for c in CASES]
    sick_sensors.show(results, screen)


def of_place(screen: Console, folder: Path) -> None:
    from qpsafe.placement.milp import Solution
    from qpsafe.placement.study import Judgement

    judged = Judgement(0.8912, 0.8812, 0.9012, 0.4512, 1.0, 0.7612, 0.7512, 0.7712)
    item = SimpleNamespace(
        fair=judged, flattered=judged, solution=Solution(np.arange(20), 2500.0, 2600.0, "sorting", 123.4)
    )
    names = tuple(f"{HOSTILE} left {i}" for i in range(20))
    result = SimpleNamespace(
        samples=(None, SimpleNamespace(pairs=100_000)),
        placements=dict.fromkeys(("cost", "detection", "evasion", "probability"), item),
        wanted="detection",
        candidates=SimpleNamespace(nodes=SimpleNamespace(names=names)),
        answer=item,
    )
    place.show(result, screen)  # type: ignore[arg-type]


def of_inspect(screen: Console, folder: Path) -> None:
    bundled = load_robot("irb140").folder
    shutil.copytree(bundled, folder / "arm[/x]")
    for name, key in (("robot.toml", "title"), ("spots.toml", "name")):
        file = folder / "arm[/x]" / name
        text = file.read_text(encoding="utf-8")
        assert f'{key} = "' in text
        file.write_text(text.replace(f'{key} = "', f'{key} = "{HOSTILE} '), encoding="utf-8")
    robots.inspect(str(folder / "arm[/x]"))


def of_story(screen: Console, folder: Path) -> None:
    file = folder / "story[/x].toml"
    file.parent.mkdir()
    person = f'title = "{HOSTILE}"\n[[person]]\nname = "Ada {HOSTILE}"\nstart = [1.5, 0.0]\n'
    file.write_text(person + '[[person.step]]\ndo = "wait"\ntime = 3.0\n', encoding="utf-8")
    story.story(file)


def of_stream(screen: Console, folder: Path) -> None:
    times = dict.fromkeys(("p50", "p99", "p99.9", "maximum"), 1.234567)
    result = {
        "duration": 86400.0,
        "packets": 21_600_000,
        "answered": 21_599_998,
        "answered_in_time": 21_590_000,
        "missed": 10_000,
        "missed_parts": {"lost before": 10_000},
        "response": times,
        "stamped_by_kernel": True,
        "histogram": {"< 1 ms": 12},
        "memory": {"steady": 123e6, "end": 116.7e6, "growth": -6.3e6},
        "failure": HOSTILE,
        "watchdog": {"asked": True},
        "troubles": [HOSTILE],
        "refused": "3 datagrams refused",
        "events": {"counts": {HOSTILE: 12}, "last": []},
        "at_rest": False,
    }
    stream_report.show(result, screen)


def of_campaign(screen: Console, folder: Path) -> None:
    from qpsafe.sim.campaign.report.summary import summary
    from qpsafe.sim.campaign.runner import run_campaign

    found = summary(run_campaign(Plan(trials=30), trial=made_up_trials.run))
    campaign.show_table(found | {"findings": [f"{HOSTILE} passes a joint limit"]}, screen)


def of_trial(screen: Console, folder: Path) -> None:
    for luck in (0.0, 1.0):  # with contact, and without
        single._show_row(made_up_trials.row(Plan(), 29_999, "none", luck, True) | {"motion": HOSTILE}, screen)


def of_worst(screen: Console, folder: Path) -> None:
    row = made_up_trials.row(Plan(), 0, "none", 0.0, True)
    case = Case((0.5,), row)
    found = Found(2000, (case,) * 12, (case,), case, case, (case,) * 12)
    single._show_cases(found, Path("out") / HOSTILE, "none", screen)


def of_limit(screen: Console, folder: Path) -> None:
    row = Limit(2999, 1002999, "hold", HOSTILE, 1.5, -0.1, -0.2, 0.04, 0.05, True, True, True, -0.98, 12345)
    limit._show(row, screen)
    limit._show_summary(HOSTILE, limits_summary([row] * 1234), screen)


def of_tuning(screen: Console, folder: Path) -> None:
    front = [{"number": number, "harm": 12.3456, "lost": 123.456} for number in (0, 17, 2999)]
    shares = {name: dict.fromkeys((f"{table} {HOSTILE}" for table in "abcdef"), 1.0) for name in ("harm", "lost")}
    for faults in ([], [HOSTILE]):
        finals = {"encounters": [7_005_000, 7_005_971], "finalists": front} if faults else None
        said = {"front": front, "finals": finals, "present": front[0], "chosen": front[1], "sensitivity": shares,
                "sentence": HOSTILE, "judgement": {"new_faults": faults}}  # fmt: skip
        tune._show(said, screen)


def of_checks(screen: Console, folder: Path) -> None:
    of_fixed(screen, folder)


#: The functions that make tables, and what prints each of them with numbers as they occur.
TABLES: dict[Callable[..., None], Show] = {
    bench.show: of_bench,
    bench.show_compilation: of_compilation,
    calibrate._show: of_calibration,
    calibrate_camera._show: of_camera,
    check.show: of_check,
    campaign.show_table: of_campaign,
    campaign._show_differences: of_campaign,
    single._show_row: of_trial,
    single._show_cases: of_worst,
    limit._show: of_limit,
    limit._show_summary: of_limit,
    common.show_checks: of_checks,
    compare._show: of_compare,
    fixed.show: of_fixed,
    fast_person.show: of_fast,
    path.show: of_path,
    pick_and_place.show: of_pick,
    all_robots.show_robots: of_robots,
    irc5_faults.show: of_faults,
    place.show: of_place,
    robots.inspect: of_inspect,
    sick_sensors.show: of_sick,
    story.story: of_story,
    stream_report.show: of_stream,
    tune._show: of_tuning,
}


def test_no_table_is_forgotten_and_none_is_made_otherwise() -> None:
    made = set()
    for file in Path(qpsafe.cli.__file__).parent.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        assert file.name == "sheet.py" or "rich.table import Table" not in text
        assert file.name == "common.py" or not re.search(r"[^.\w]Console\(|\becho\(.*style|secho\(", text)
        assert not re.search(r"\[/\w*\]", text), f"{file.name}: markup is not read"
        for function in ast.walk(ast.parse(text)):
            if isinstance(function, ast.FunctionDef) and "Sheet(" in ast.unparse(function) and file.name != "sheet.py":
                made.add(f"{file.stem}.{function.name}")
    assert made == {f"{table.__module__.rpartition('.')[2]}.{table.__name__}" for table in TABLES}


@pytest.mark.parametrize("width", first(1, WIDTHS))
@pytest.mark.parametrize("show", thinned(2, dict.fromkeys(TABLES.values())), ids=lambda show: show.__name__)
def test_every_table_is_whole_on_a_narrow_screen(
    show: Show,
    width: int,
    whole: Callable[[Sheet, int], str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    sheets: list[Sheet] = []
    monkeypatch.setattr(common, "console", partial(_recording, common.console, sheets))
    for module in (robots, story):  # what makes its own screen
        monkeypatch.setattr(module, "console", common.console)
    monkeypatch.setenv("COLUMNS", str(width))
    show(common.console(False), tmp_path)
    text = capsys.readouterr().out
    assert sheets
    for sheet in sheets:
        assert whole(sheet, width) in text
    # a command that one types again is in one piece, however long its folder is called
    assert max(cell_len(line) for line in text.splitlines() if "qpsafe campaign show " not in line) <= width


def _recording(make: Callable[[bool], Console], sheets: list[Sheet], json: bool) -> Console:
    """A screen that keeps the tables printed on it."""
    screen = make(json)
    write = screen.print

    def kept(*objects: Any, **options: Any) -> None:
        sheets.extend(item for item in objects if isinstance(item, Sheet))
        write(*objects, **options)

    screen.print = kept  # type: ignore[method-assign]
    return screen


@pytest.mark.parametrize("show", [of_inspect, of_story, of_fixed, of_place])
def test_names_from_files_are_shown_as_they_are(
    show: Show, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    show(common.console(False), tmp_path)
    assert HOSTILE in " ".join(capsys.readouterr().out.split())
