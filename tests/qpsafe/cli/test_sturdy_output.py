"""Good work ends well wherever its words go, and files that would be lost are refused before anything is read."""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from qpsafe.cli import common, main
from qpsafe.cli.outputs import keep_apart
from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sensing.sharp import SharpCurve

pytestmark = pytest.mark.long


def run(*words: object) -> Any:
    return CliRunner().invoke(main.app, [*map(str, words)])


def ended(monkeypatch: pytest.MonkeyPatch, act: Callable[[], None]) -> int:
    """The exit code of `main` with some work to do."""
    monkeypatch.setattr(main, "app", act)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    try:
        main.main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


# Where words go


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_what_cannot_be_shown_is_spelt(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    said = "q̇ Δ² \udcff"
    there = io.BytesIO()
    screen = io.TextIOWrapper(there, encoding=encoding)
    monkeypatch.setattr(sys, "stdout", screen)
    assert ended(monkeypatch, lambda: common.console(False).print(said)) == 0
    screen.flush()
    assert there.getvalue().strip() == said.encode(encoding, "backslashreplace")


@pytest.mark.parametrize("code", [0, 1])
def test_a_closed_output_changes_no_exit_code(code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def act() -> None:
        common.print_json({"good": not code})
        common.console(False).print("words")
        sys.exit(code)

    monkeypatch.setattr(sys, "stdout", None)
    assert ended(monkeypatch, act) == code


@pytest.mark.parametrize("columns", ["0", "00"])
@pytest.mark.parametrize("as_json", [False, True])
def test_no_width_at_all_is_the_usual_one(
    columns: str, as_json: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    screen = common.console(as_json)
    assert screen.width == 80
    screen.print("words")
    assert "words" in "".join(capsys.readouterr())


# Files that would be lost


def test_one_file_is_known_by_every_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file, other = tmp_path / "a.csv", tmp_path / "b.csv"
    file.write_text("kept")
    (tmp_path / "link.csv").symlink_to(file)
    os.link(file, tmp_path / "hard.csv")
    for name in ("a.csv", "./a.csv", "link.csv", "hard.csv", f"../{tmp_path.name}/a.csv"):
        with pytest.raises(ConfigurationError, match=r"--out = .*: expected another file than FILE"):
            keep_apart("here", ("FILE", file), ("--plot", None), ("--out", Path(name)))
    with pytest.raises(ConfigurationError, match=r"--plot = .*: expected another file than --out"):
        keep_apart("here", ("FILE", file), ("--out", other), ("--plot", Path("b.csv")))  # neither is there
    keep_apart("here", ("FILE", file), ("--out", other), ("--plot", None))


@pytest.fixture
def pairs(tmp_path: Path) -> Path:
    d = np.linspace(0.2, 0.8, 13)
    rows = [f"elbow,{a:.4f},{b:.4f}" for a, b in zip(d, SharpCurve().voltage(d), strict=True)]
    (tmp_path / "in.csv").write_text("\n".join(["spot,distance,voltage", *rows]))
    return tmp_path / "in.csv"


def test_calibrate_keeps_its_measurements_and_its_curves(pairs: Path) -> None:
    before, out, plot = pairs.read_bytes(), pairs.with_name("c.toml"), pairs.with_name("p.png")
    picture = pairs.rename(pairs.with_name("in.png"))
    for words, key in (
        ((picture, "--out", picture), "--out"),
        ((picture, "--out", out, "--plot", picture), "--plot"),
        ((picture, "--out", plot, "--plot", plot), "--plot"),
        (("none.csv", "--out", plot, "--plot", plot), "--plot"),  # before anything is read
    ):
        done = run("calibrate", *words)
        assert isinstance(done.exception, ConfigurationError)
        assert f"{key} = " in str(done.exception)
        assert picture.read_bytes() == before
    assert [*pairs.parent.iterdir()] == [picture]
    assert run("calibrate", picture, "--out", out).exit_code == 0


def test_calibrate_camera_keeps_recording_and_cell(tmp_path: Path) -> None:
    cell, recording = tmp_path / "cell.toml", tmp_path / "r.toml"
    for words, key in (((cell, "--out", cell), "CELL, which --write"), ((cell, "--out", recording), "FILE")):
        done = run("calibrate-camera", recording, *words)
        assert isinstance(done.exception, ConfigurationError)
        assert f"expected another file than {key}" in str(done.exception)
    done = run("calibrate-camera", recording, cell, "--out", cell, "--write")  # the cell is meant, but not there
    assert "another file" not in str(done.exception)


# What is typed


@pytest.mark.parametrize("value", ["inf", "nan"])
@pytest.mark.parametrize(
    "words",
    [
        ("compare", "--tolerance"),
        ("compare", "--duration"),
        ("calibrate", "x", "--tolerance"),
        ("calibrate-camera", "x", "x", "--tolerance"),
    ],
)
def test_what_is_not_finite_is_refused_by_name(words: tuple[str, ...], value: str) -> None:
    done = run(*words, value)
    if isinstance(done.exception, ConfigurationError):
        assert str(done.exception).endswith(f"{words[0]}: {words[-1]} = {value}: expected a finite number")
    else:
        assert done.exit_code == 2  # above the largest that is taken
        assert words[-1] in done.output


def test_json_is_taken_before_and_after_the_commands_of_robots(tmp_path: Path) -> None:
    model = load_robot("irb140").model_path
    (tmp_path / "spots.toml").write_text("")  # else the first to add chooses some
    for words in (("irb140",), ("inspect", "irb140"), ("add", model, "--force", "--out", tmp_path)):
        before, after = run("robots", "--json", *words), run("robots", *words, "--json")
        assert json.loads(before.stdout) == json.loads(after.stdout)
        assert not run("robots", *words).stdout.startswith("{")
