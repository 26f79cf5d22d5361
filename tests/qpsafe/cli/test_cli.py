"""The command line as a person or a program uses it."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from qpsafe import __version__
from qpsafe.bench.clock import BLOCK, Row, time_rows
from qpsafe.cli.main import app
from qpsafe.errors import QpsafeError
from qpsafe.sim.recording.run_file import read_run

run = CliRunner().invoke
WEB = (("port", "9000"), ("host", "127.0.0.2"), ("token", "abc"))
PROGRAM = [sys.executable, "-c", "from qpsafe.cli.main import main; main()"]


@pytest.mark.parametrize("command", [[], ["demo"], ["demo", "fixed"], ["compare"], ["robots"], ["bench"]])
def test_help_of_every_command(command: list[str]) -> None:
    result = run(app, [*command, "--help"])
    assert result.exit_code == 0
    assert "Usage" in result.output


def test_version() -> None:
    assert run(app, ["--version"]).output.strip() == f"qpsafe {__version__}"


@pytest.mark.parametrize(
    "arguments",
    [["demo", "fixed", "--law", "magic"], ["demo", "fixed", "--lag", "-1"], ["compare", "--states", "0"], ["dance"]],
)
def test_wrong_usage_is_refused_before_anything_runs(arguments: list[str]) -> None:
    result = run(app, arguments)
    assert result.exit_code == 2


@pytest.mark.long
def test_demo_writes_report_figures_and_signals(tmp_path: Path) -> None:
    result = run(app, ["demo", "fixed", "--duration", "0.4", "--no-video", "--json", "--out", str(tmp_path / "new")])
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["kept"] is True
    assert report.pop("encounter")["contact"] is None
    assert report == json.loads((tmp_path / "new" / "report.json").read_text())
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == [
        "distance.png",
        "figure.png",
        "report.json",
        "run.npz",
        "signals.csv",
    ]


@pytest.mark.slow
def test_demo_takes_other_sensors(tmp_path: Path) -> None:
    """A name in the robot's folder or a path; a run keeps which; they fit one robot."""
    quick = ["demo", "fixed", "--duration", "0.1", "--no-video", "--out", str(tmp_path / "a")]
    result = run(app, [*quick, "--spots", "spots-by-hand.toml"])
    assert result.exit_code == 0, result.output
    assert read_run(tmp_path / "a" / "run.npz").header["settings"]["spots"] == "spots-by-hand.toml"
    assert run(app, ["replay", str(tmp_path / "a" / "run.npz")]).exit_code == 0
    for wrong in (["--spots", str(tmp_path / "none.toml")], ["--spots", "spots-by-hand.toml", "--robot", "all"]):
        assert isinstance(run(app, [*quick, *wrong]).exception, QpsafeError)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["ideal+depth", "vl53l5cx"])
def test_demo_takes_sensors_of_many_zones(sensor: str, tmp_path: Path) -> None:
    """The report says which; the run is replayed bit by bit, its images made again."""
    quick = ["demo", "fixed", "--duration", "0.4", "--no-video", "--out", str(tmp_path / "a")]
    result = run(app, [*quick, "--sensor", sensor, "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["sensor"] == sensor
    assert read_run(tmp_path / "a" / "run.npz").header["settings"]["sensor"] == sensor
    assert run(app, ["replay", str(tmp_path / "a" / "run.npz")]).exit_code == 0
    assert all(word in run(app, ["demo", "fixed", "--help"]).output for word in ("vl53l5cx", "depth"))


@pytest.mark.parametrize("sensor", ["radar", "perfect", "ideal+sharp"])
def test_demo_refuses_other_sensors_before_anything_runs(sensor: str, tmp_path: Path) -> None:
    result = run(app, ["demo", "fixed", "--sensor", sensor, "--out", str(tmp_path / "new")])
    assert isinstance(result.exception, QpsafeError)
    assert not (tmp_path / "new").exists()


#: What a run writes under circumstances only, by command.
PERHAPS = {
    "fixed --duration 0.2": ("video.mp4",),
    "path --duration 3": ("video.mp4",),
    "fast-person --speed 2.5 --experiment fixed": ("video-fixed-2.5.mp4",),
    "pick-and-place --cycles 1": ("video.mp4", "seeds.png", "snapshots.png"),
}


@pytest.mark.parametrize(
    "words", [pytest.param(words, marks=() if "fixed" in words else pytest.mark.long) for words in PERHAPS]
)
def test_nothing_of_an_earlier_run_lies_beside_a_new_one(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would be taken for this run's. What is no run's stays."""
    monkeypatch.setattr("qpsafe.sim.drawing.gl.gl_available", lambda: (False, "it is dark"))
    kept = tmp_path / "video of mine.mp4"
    for name in (kept.name, *PERHAPS[words]):
        (tmp_path / name).write_bytes(b"of an earlier run")
    result = run(app, ["demo", *words.split(), "--out", str(tmp_path)])
    assert result.exit_code in (0, 1), result.output
    assert kept.read_bytes() == b"of an earlier run"
    for name in PERHAPS[words]:
        assert not (tmp_path / name).exists()
        assert result.output.count(f"removed {name}") == 1
    assert any(tmp_path.glob("run*.npz"))


@pytest.mark.slow
def test_demo_without_opengl_says_so_in_one_line(without_display: Callable[..., Any], tmp_path: Path) -> None:
    done = without_display("demo", "fixed", "--duration", "0.2", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if "no video" in line]
    assert len(lines) == 1
    assert "MUJOCO_GL" in lines[0]


@pytest.mark.slow
def test_interrupted_demo_leaves_no_files(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [*PROGRAM, "demo", "fixed", "--out", str(tmp_path / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline, looks = time.monotonic() + 60, 0
    while looks < 5 and time.monotonic() < deadline:  # until it runs: the folder was tried before, and taken away
        time.sleep(0.05)
        looks = looks + 1 if (tmp_path / "out").exists() else 0
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted" in errors
    assert "Traceback" not in errors
    assert list((tmp_path / "out").iterdir()) == []


def test_compare_is_honest_in_its_exit_code() -> None:
    arguments = ["compare", "--states", "54", "--no-closed-loop", "--json"]
    result = run(app, arguments)
    assert result.exit_code == 0
    assert json.loads(result.stdout)["good"] is True
    result = run(app, [*arguments, "--tolerance", "1e-30"])
    assert result.exit_code == 1
    assert json.loads(result.stdout)["good"] is False


@pytest.mark.parametrize(
    ("options", "sample"),
    [
        ([], (10_000, 25.0)),
        (["--full"], (10_000, 60.0)),
        (["--states", "54"], (54, 25.0)),
        (["--full", "--duration", "3"], (10_000, 3.0)),
    ],
)
def test_compare_states_its_sample(monkeypatch: pytest.MonkeyPatch, options: list[str], sample: tuple) -> None:
    from qpsafe.laws import equivalence
    from qpsafe.sim.experiments.fixed import compare

    asked = []

    def states(law, count, seed, limits, progress):
        asked.append(count)
        return [equivalence.Deviation("all", np.zeros(count), np.zeros(count))]

    def runs(robot, duration, solver, progress):
        asked.append(duration)
        return compare.ClosedLoop(duration, *8 * (0,))

    monkeypatch.setattr(equivalence, "compare_states", states)
    monkeypatch.setattr(compare, "compare_closed_loop", runs)
    result = run(app, ["compare", "--json", *options])
    said = json.loads(result.stdout)["sample"]
    others = min(sample[0], 1_000)
    assert (said["states"], said["duration"]) == sample
    assert asked == [sample[0], sample[0], others, others, others, sample[1]]


def test_robots_lists_and_inspects() -> None:
    assert set(json.loads(run(app, ["robots", "--json"]).stdout)) >= {"irb140", "iiwa14"}
    shown = json.loads(run(app, ["robots", "irb140", "--json"]).stdout)
    assert list(shown["joints"]) == [f"joint_{i}" for i in range(1, 7)]
    assert len(shown["spots"]) == 20
    assert "joint_6" in run(app, ["robots", "irb140"]).output


def test_unknown_robot_is_one_line_and_exit_code_1(without_display: Callable[..., Any]) -> None:
    done = without_display("robots", "r2d2")
    assert done.returncode == 1
    assert done.stderr.startswith("qpsafe: ")
    assert "irb140" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_bench_compiles_every_kernel_and_finds_it_in_the_cache(tmp_path: Path) -> None:
    result = run(app, ["bench", "--compile", "--out", str(tmp_path / "bench.json")])
    assert result.exit_code == 0
    first, later = json.loads((tmp_path / "bench.json").read_text())["results"].values()
    assert first["kernels"].keys() == later["kernels"].keys() >= {"qpsafe.hqp.own.hierarchy.run"}
    assert later["processor"] < 0.5 * first["processor"]


def test_rows_take_turns_and_are_compared_block_by_block() -> None:
    calls: list[str] = []
    rows = {name: Row(lambda _, name=name: calls.append(name)) for name in ("a", "b")}
    times = time_rows(rows, 2 * BLOCK, peer="a", warm_up=0)
    assert calls == (["a"] * BLOCK + ["b"] * BLOCK) * 2
    assert times["a"].runs == 2 * BLOCK
    assert times["a"].ratio == times["a"].ratio_low == 1.0


@pytest.mark.slow
def test_bench_writes_its_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from qpsafe.bench.peers import MINK
    from qpsafe.sim.campaign.speed import Speed

    speed = Speed(160.0, 110.0, 4.0)  # tests/sim/campaign times a real one
    monkeypatch.setattr("qpsafe.sim.campaign.speed.engine_speed", lambda mujoco: speed)
    result = run(app, ["bench", "--ticks", "100", "--json", "--out", str(tmp_path / "bench.json")])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout) == json.loads((tmp_path / "bench.json").read_text())
    content = json.loads((tmp_path / "bench.json").read_text())
    for times in content["results"].values():
        assert 0.0 < times["median"] <= times["p99"] <= times["p999"] <= times["maximum"]
        assert 0.0 < times["ratio_low"] <= times["ratio"] <= times["ratio_high"]
    assert content["results"][MINK]["ratio"] == 1.0
    assert content["machine"]["processor"]
    assert content["engine"]["ratio"] == 40.0


@pytest.mark.slow
def test_robots_add_writes_a_file_that_loads_and_never_over_another(tmp_path: Path) -> None:
    import shutil

    from qpsafe.robot.loader import load_robot

    model = tmp_path / "arm.xml"
    shutil.copy(load_robot("iiwa14").model_path, model)
    result = run(app, ["robots", "add", str(model)])
    assert result.exit_code == 0, result.output
    assert "1 rad/s is taken" in " ".join(result.stdout.split())
    assert load_robot(tmp_path).nq == 7
    path = tmp_path / "robot.toml"
    path.write_text(path.read_text().replace('name = "iiwa14"', 'name = "mine"'))
    result = run(app, ["robots", "add", str(model)])
    assert result.exit_code != 0
    assert "--force" in str(result.exception)
    assert load_robot(tmp_path).name == "mine"
    assert run(app, ["robots", "add", str(model), "--force"]).exit_code == 0
    assert load_robot(tmp_path).name == "iiwa14"
    assert sorted(item.name for item in tmp_path.iterdir()) == ["arm.xml", "robot.toml", "spots.toml"]


def test_robots_add_refuses_what_has_its_file(tmp_path: Path) -> None:
    result = run(app, ["robots", "add", "irb140", "--out", str(tmp_path)])
    assert result.exit_code != 0
    assert not list(tmp_path.iterdir())


def test_inspecting_a_bare_model_says_what_was_assumed() -> None:
    from qpsafe.robot.loader import load_robot

    result = run(app, ["robots", str(load_robot("irb140").model_path)])
    assert result.exit_code == 0
    assert "note:" in result.stdout
    shown = json.loads(run(app, ["robots", str(load_robot("irb140").model_path), "--json"]).stdout)
    assert any("speed" in note for note in shown["notes"])


@pytest.mark.parametrize("command", [["stream"], ["replay", "run.npz"]], ids=lambda words: words[0])
@pytest.mark.parametrize(("name", "value"), WEB)
def test_an_option_that_would_do_nothing_is_refused(command: list[str], name: str, value: str) -> None:
    result = run(app, [*command, f"--web-{name}", value])
    assert isinstance(result.exception, QpsafeError), result.output
    assert f"--web-{name} = " in str(result.exception)
    assert str(result.exception).endswith("expected only together with --web")
