"""Campaigns and tuning for arms of which there is only a URDF: what one lacks is chosen, what it cannot do left out."""

from __future__ import annotations

from pathlib import Path

import made_up_arm
import other_arms
import pytest
from typer.testing import CliRunner

from qpsafe.cli.campaign.options import make_plan
from qpsafe.cli.demos.any_robot import own_folder
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_quietly
from qpsafe.sensing.skin.spots import load_spots


@pytest.fixture(autouse=True)
def _here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def blunt(folder: Path) -> Path:
    """The made-up arm with a last link that reaches beyond its tool: no plate for it to work at."""
    file = folder / "blunt.urdf"
    text = made_up_arm.arm_urdf().replace(
        '<origin xyz="0.14 0 0" rpy="0 1.570796 0" />', '<origin xyz="0.01 0 0" rpy="0 1.570796 0" />'
    )
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.slow
def test_motions_that_nobody_named_and_it_cannot_do_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = blunt(tmp_path)
    plan = make_plan(None, robot=str(file))
    assert plan.motions == ("hold", "line")
    said = " ".join(capsys.readouterr().err.split())
    assert "left out" in said
    assert "a tool whose tip leads" in said
    assert "RobotWarning" not in said
    with pytest.raises(ConfigurationError, match="tip leads"):
        make_plan(None, robot=str(file), motions="hold,pick")


@pytest.mark.slow
def test_an_arm_of_five_joints_holds(tmp_path: Path) -> None:
    motions = make_plan(None, robot=str(other_arms.write_arm(tmp_path, other_arms.SIX[:5]))).motions
    assert "hold" in motions
    assert "line" not in motions


@pytest.mark.slow
def test_a_folder_that_was_added_is_the_robot_of_every_command(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(made_up_arm.arm_urdf(), encoding="utf-8")
    result = CliRunner().invoke(app, ["robots", "add", "arm.urdf", "--out", "arm"])
    assert result.exit_code == 0, result.output
    assert "home posture chosen" in " ".join(result.output.split())
    robot = load_quietly("arm")
    assert len(load_spots(robot)) >= 20
    assert abs(robot.home).max() > 0.1
    plan = make_plan(None, robot="arm")
    assert (plan.robot, plan.motions) == ("arm", ("hold", "line", "pick"))
    assert not (tmp_path / "out").exists()  # nothing had to be made for it


def test_sensors_that_are_there_are_kept(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(made_up_arm.arm_urdf(), encoding="utf-8")
    (tmp_path / "spots.toml").write_text("# mine\n")
    assert CliRunner().invoke(app, ["robots", "add", "arm.urdf"]).exit_code == 0
    assert (tmp_path / "spots.toml").read_text() == "# mine\n"
    assert load_quietly(tmp_path).spots_path == tmp_path / "spots.toml"


@pytest.mark.slow
def test_a_folder_without_sensors_gets_some_in_a_copy(tmp_path: Path) -> None:
    file = other_arms.write_arm(tmp_path)
    folder = tmp_path / "mine"
    assert CliRunner().invoke(app, ["robots", "add", str(file), "--out", str(folder)]).exit_code == 0
    (folder / "spots.toml").unlink()
    before = (folder / "robot.toml").read_text()
    plan = make_plan(None, robot=str(folder), motions="hold")
    assert plan.robot != str(folder)
    assert load_quietly(plan.robot).spots_path is not None
    assert (folder / "robot.toml").read_text() == before
    assert not (folder / "spots.toml").exists()


def test_models_of_one_name_do_not_share_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["a/model.urdf", "b/model.urdf", "a/model.xml", "package:model"]
    for name in names[:3]:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    assert len({own_folder(name) for name in names}) == len(names)
    assert own_folder("a/model.urdf") == own_folder(str(tmp_path / "a" / "model.urdf"))
    monkeypatch.chdir(tmp_path / "a")
    assert own_folder(".").name.startswith("a-")


def test_what_is_no_arm_is_added_as_its_file_says(tmp_path: Path) -> None:
    file = other_arms.write_arm(tmp_path, tuple((tuple(9.0 * x for x in xyz), *rest) for xyz, *rest in other_arms.SIX))
    result = CliRunner().invoke(app, ["robots", "add", str(file), "--out", "huge"])
    assert result.exit_code == 0, result.output
    assert "no home posture and no sensors are chosen" in " ".join(result.output.split())
    assert load_quietly("huge").spots_path is None


def test_nothing_is_written_into_a_folder_that_the_next_run_makes_anew(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["tune", "--robot", str(blunt(tmp_path)), "--write"])
    assert isinstance(result.exception, ConfigurationError)
    assert "robots add" in str(result.exception)
    assert not (tmp_path / "out").exists()
