"""`qpsafe place`: files, JSON, clear errors, nothing left behind."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from functools import cache
from pathlib import Path
from textwrap import wrap
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from typer.testing import CliRunner

import qpsafe
from qpsafe.cli.main import app
from qpsafe.cli.sensors.place import _command, with_words
from qpsafe.errors import ConfigurationError
from qpsafe.placement import candidates
from qpsafe.placement.sensors import Sensor
from qpsafe.robot.robot import Robot

pytestmark = pytest.mark.long


@pytest.fixture(autouse=True)
def _nodes_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same candidates for all commands here, at a spacing that is known to give 40: to find it takes longer than
    all the rest, and is tested with `candidate_nodes`.
    """
    monkeypatch.setattr(candidates, "candidate_nodes", _found)


@cache
def _found_by_name(name: str, sensor: Sensor) -> candidates.Candidates:
    return _find(qpsafe.load_robot(name), spacing=0.1265, sensor=sensor)


def _found(robot: Robot, wanted: int, sensor: Sensor, **options: Any) -> candidates.Candidates:
    return _found_by_name(robot.name, sensor) if wanted == 40 else _find(robot, wanted, sensor=sensor, **options)


_find = candidates.candidate_nodes
QUICK = ["place", "--nodes", "40", "--pairs", "60", "--no-pictures", "--no-exact"]


def run(*arguments: str) -> object:
    return CliRunner().invoke(app, [*QUICK, *arguments])


def test_a_placement_is_written_and_loads(tmp_path: Path) -> None:
    result = run("--spots", "8", "--json", "--out", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    assert "40 candidate nodes" in " ".join(result.stderr.split())  # its progress
    report = json.loads(result.stdout)
    assert report == json.loads((tmp_path / "out" / "report.json").read_text())
    spots = qpsafe.SpotArray.load(tmp_path / "out" / "spots.toml", qpsafe.load_robot("irb140"))
    assert sorted(spots.names) == sorted(report["placements"]["detection"]["spots"])
    assert len(spots) == 8
    head = (tmp_path / "out" / "spots.toml").read_text(encoding="utf-8").replace("\n# ", " ")
    assert "`qpsafe place --spots 8 --nodes 40 --pairs 60 --no-exact`" in head
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"spots.toml", "report.json", "figure-9.png"}
    for curve in report["curves"].values():
        assert len(curve["probability"][1]) == report["nodes"] + 1
        low, high = curve["confidence"]
        assert all(a <= p <= b for a, p, b in zip(low, curve["probability"][1], high, strict=True))


@pytest.mark.slow
def test_arrays_are_placed_and_load(tmp_path: Path) -> None:
    result = run("--sensor", "vl53l5cx", "--objective", "nearest", "--spots", "6", "--json", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert (report["sensor"], report["wanted"]) == ("VL53L5CX", "nearest")
    sensors = qpsafe.load_range_sensors("irb140", tmp_path / "spots-vl53l5cx.toml")
    assert sorted(sensor.name for sensor in sensors) == sorted(report["placements"]["nearest"]["spots"])
    assert {sensor.shape for sensor in sensors} == {(8, 8)}
    assert not (tmp_path / "spots.toml").exists()
    for curve in report["curves"].values():
        for near, detected in zip(curve["nearest"], curve["probability"], strict=True):
            assert near == sorted(near)
            assert all(a <= b for a, b in zip(near, detected, strict=True))
    best = report["placements"]["nearest"]
    assert best["optimised_sample"]["nearest"] == pytest.approx(best["value"] / report["pairs"])


@pytest.mark.parametrize("file", ["spots.toml", "spots-vl53l5cx.toml"])
@pytest.mark.slow
def test_the_bundled_spots_are_what_the_command_at_their_head_makes(file: str, tmp_path: Path) -> None:
    bundled = (qpsafe.load_robot("irb140").folder / file).read_text(encoding="utf-8")
    command = bundled.replace("\n# ", " ").partition("`")[2].partition("`")[0]
    name, *arguments = shlex.split(command)
    assert name == "qpsafe"
    result = CliRunner().invoke(app, [*arguments, "--no-pictures", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert (tmp_path / file).read_text(encoding="utf-8") == bundled


@pytest.mark.slow
def test_fewest_spots_for_a_probability(tmp_path: Path) -> None:
    result = run("--probability", "0.6", "--json", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)["placements"]["probability"]
    assert found["optimised_sample"]["probability"] >= 0.6
    assert found["bound"] <= len(found["spots"]) == found["value"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--spots", "0"], "spots = 0: expected 1 to 40"),
        (["--spots", "41"], "spots = 41: expected 1 to 40"),
        (["--probability", "1.0"], "what all"),
        (["--probability", "1.5"], "above 0 and at most 1"),
        (["--probability", "0.5", "--spots", "3"], "a probability decides how many"),
        (["--pairs", "0"], "pairs = 0"),
        (["iiwa99"], "iiwa99"),
    ],
)
def test_what_cannot_be_asked_is_said_and_nothing_is_written(
    arguments: list[str], message: str, tmp_path: Path
) -> None:
    result = run(*arguments, "--out", str(tmp_path / "out"))
    assert result.exit_code != 0
    assert isinstance(result.exception, ConfigurationError)
    assert message in str(result.exception)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", ["--radius", "--pedestal"])
@pytest.mark.parametrize("value", ["-1", "0", "nan", "inf", "11"])
def test_a_length_out_of_range_is_refused_before_any_node_is_looked_for(option: str, value: str) -> None:
    result = run(option, value)
    assert result.exit_code == 2
    assert option in result.output
    assert "node" not in result.output


@given(
    name=st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z"), include_characters=" -"), min_size=1),
    spots=st.integers(1, 99),
    before=st.integers(0, 118),
    options=st.lists(st.sampled_from(["--no-caps", "--no-exact", "--radius 1.5", "--objective nearest"]), unique=True),
)
@example(name="ärm 1", spots=10, before=0, options=[])
@example(name="it's " * 40, spots=10, before=7, options=["--no-exact"])
@example(name="a-long-name-" * 12, spots=10, before=50, options=["--no-exact"])
def test_the_command_at_the_head_can_be_typed_as_it_stands(
    name: str, spots: int, before: int, options: list[str], parsed: Callable[[str, list[str]], Any]
) -> None:
    """Lines are broken between its words alone: what stands there is the command again, behind a # on each line."""
    typed = ["--spots", str(spots), *(word for option in options for word in option.split()), "--", name]
    words = _command(parsed("place", ["--json", *typed]))
    text = with_words(words, lambda command: "\n".join(wrap("x" * before + f" made by <<{command}>>: of many", 118)))
    there = shlex.split(text.partition("<<")[2].rpartition(">>")[0])
    assert there == words
    again = parsed("place", there[2:]).params
    assert again == parsed("place", typed).params
