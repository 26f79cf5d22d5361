"""`qpsafe demo pick-and-place` as a person or a program uses it."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from qpsafe.cli.main import app
from qpsafe.errors import QpsafeError
from qpsafe.sim.experiments.pick_place.cell import PROGRAM

run = CliRunner().invoke
DEMO = ["demo", "pick-and-place"]


@pytest.mark.parametrize("wrong", [["--seeds", "0"], ["--cycles", "-1"], ["--law", "magic"], ["--lag", "1"]])
def test_wrong_usage_is_refused(wrong: list[str]) -> None:
    assert run(app, [*DEMO, *wrong]).exit_code == 2


@pytest.mark.parametrize("option", ["--program", "--people"])
def test_wrong_files_are_refused_before_anything_is_written(tmp_path: Path, option: str) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(PROGRAM.read_text().replace("cycle = true", "cycles = true"))
    result = run(app, [*DEMO, option, str(wrong), "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, QpsafeError)
    assert "wrong.toml:" in str(result.exception)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_demo_writes_what_it_says(tmp_path: Path) -> None:
    out = tmp_path / "new"
    result = run(app, [*DEMO, "--cycles", "1", "--seeds", "2", "--json", "--out", str(out)])
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["kept"] is True
    assert report == json.loads((out / "report.json").read_text())
    assert [item["seed"] for item in report["runs"]] == [0, 1]
    assert all(item["delivered"] == 1 for item in report["runs"])
    names = {path.name for path in out.iterdir()} - {"snapshots.png"}  # needs OpenGL
    assert names == {"figure.png", "report.json", "run.npz", "seeds.png", "signals.csv"}
