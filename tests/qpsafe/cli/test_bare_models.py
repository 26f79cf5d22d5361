"""A model file alone is the same robot to every simulation, with what is chosen for it; for a real one nothing is."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Any

import made_up_arm
import pytest
import typer
from typer.testing import CliRunner

from qpsafe.check.report import to_dict
from qpsafe.cli.demos.any_robot import check_stated
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_quietly
from qpsafe.text.json_text import json_text

PROGRAM = """
[points]
near = { position = [0.80, 0.10, 0.60] }
far = { position = [0.80, -0.10, 0.60] }
[[segment]]
do = "joint"
to = "near"
[[segment]]
do = "line"
to = "far"
"""
#: What is typed before and behind `--robot MODEL`, where something must be.
BEFORE = {"campaign show": ["0"], "campaign limit": ["0"], "campaign worst": ["default"], "check": ["task.toml"]}
BEHIND = {"stream": ["--experiment", "fixed"], "web": ["--port", "0"]}
#: Commands that need neither home posture nor sensors of a robot, or want a folder that has them.
OTHERS = {"calibrate", "calibrate-camera"}


class Chosen(Exception):
    """What is chosen for a model is asked for."""


@pytest.fixture(autouse=True)
def _here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(made_up_arm.arm_urdf(), encoding="utf-8")
    (tmp_path / "task.toml").write_text(PROGRAM, encoding="utf-8")


def with_robot(group: typer.Typer, path: tuple[str, ...] = ()) -> list[str]:
    """All commands that have the option, by their words."""
    found = []
    for command in group.registered_commands:
        assert command.callback is not None
        name = command.name or command.callback.__name__
        robot = inspect.signature(command.callback).parameters.get("robot")
        if robot is not None and not isinstance(getattr(robot.default, "param_decls", None), tuple):
            found.append(" ".join((*path, name)))
    for inner in group.registered_groups:
        assert inner.typer_instance is not None
        found += with_robot(inner.typer_instance, (*path, str(inner.name)))
    return found


NAMED = sorted({*with_robot(app)} - OTHERS - {"place"})  # which names it by an argument, and wants regions


def test_commands_are_looked_at() -> None:
    assert {"check", "stream", "irc5-sim", "demo path", "campaign run", "tune", "web"} <= set(NAMED)


@pytest.mark.parametrize("command", NAMED)
def test_every_command_that_simulates_a_bare_model_has_the_same_choices(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def made_ready(where: str, name: str, *_: Any, **__: Any) -> None:
        assert where.startswith("qpsafe ")
        raise Chosen(name)

    monkeypatch.setattr("qpsafe.sim.experiments.shared.ready.made_ready", made_ready)
    words = [*command.split(), *BEFORE.get(command, []), "--robot", "arm.urdf", *BEHIND.get(command, [])]
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, Chosen), (result.output, result.exception)
    assert str(result.exception) == "arm.urdf"


@pytest.mark.slow
def test_check_and_the_demo_find_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[Any] = []

    def stop(where: str, program: Any, result: Any, *_: Any) -> None:
        found.append(json.loads(json_text(to_dict(result))))
        raise Chosen

    checked = CliRunner().invoke(app, ["check", "task.toml", "--robot", "arm.urdf", "--json"])
    report = json.loads(checked.stdout)
    monkeypatch.setattr("qpsafe.cli.check.refuse_or_warn", stop)
    demo = CliRunner().invoke(app, ["demo", "path", "--robot", "arm.urdf", "--program", "task.toml"])
    assert isinstance(demo.exception, Chosen), (demo.output, demo.exception)
    for name in ("reach", "joints", "singular", "self"):
        assert report["checks"][name] == found[0]["checks"][name]


@pytest.mark.parametrize("more", [[], ["--no-sensors"], ["--program", "task.toml"]])
def test_a_robot_that_is_there_is_driven_to_no_posture_that_nobody_stated(more: list[str]) -> None:
    result = CliRunner().invoke(app, ["stream", "--robot", "arm.urdf", *more])
    assert isinstance(result.exception, ConfigurationError)
    assert (result.exception.key, result.exception.value) == ("--robot", "arm.urdf")
    assert "qpsafe robots add" in result.exception.expected
    assert not Path("out").exists()


def test_without_sensors_that_has_to_be_said(monkeypatch: pytest.MonkeyPatch) -> None:
    bundled = load_quietly("irb140")
    monkeypatch.setattr("qpsafe.robot.loader.load_quietly", lambda *_, **__: bundled.with_spots(None))
    with pytest.raises(ConfigurationError, match="--no-sensors"):
        check_stated("qpsafe stream", "mine", sensors=True)
    check_stated("qpsafe stream", "mine", sensors=False)
    result = CliRunner().invoke(app, ["stream", "--robot", "mine"])
    assert isinstance(result.exception, ConfigurationError)
    assert "--no-sensors" in result.exception.expected
