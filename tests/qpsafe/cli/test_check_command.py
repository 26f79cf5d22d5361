"""`qpsafe check`, and the commands that check a program before they run it."""

import json
import re
from io import StringIO
from pathlib import Path

import pytest
from amounts import first
from rich.console import Console
from typer.testing import CliRunner

from qpsafe.check.check import check_path
from qpsafe.cli.check import refuse_or_warn
from qpsafe.cli.main import app
from qpsafe.errors import ConfigurationError
from qpsafe.robot.loader import load_robot
from qpsafe.sensing.cell_file import load_cell
from qpsafe.tasks.program_file import load_program

pytestmark = pytest.mark.long

run = CliRunner().invoke
PROGRAM = """
frame = "tcp"
start = "left"
[points]
left = { position = [0.45, 0.05, 0.54] }
right = { position = [0.45, -0.05, 0.54] }
low = { position = [0.45, -0.05, 0.46] }
far = { position = [1.45, -0.05, 0.46] }
[[segment]]
do = "line"
to = "GOAL"
"""
TABLE = '[[box]]\nname = "table"\nsize = [0.3, 0.3, 0.04]\ncentre = [0.5, 0.0, 0.48]\n'


def files(folder: Path, goal: str) -> list[str]:
    (folder / "my.toml").write_text(PROGRAM.replace("GOAL", goal), encoding="utf-8")
    (folder / "cell.toml").write_text(TABLE, encoding="utf-8")
    return [str(folder / "my.toml"), "--cell", str(folder / "cell.toml")]


@pytest.mark.parametrize(("goal", "good"), first(1, [("low", False), ("right", True)]))
def test_a_check_says_the_same_in_words_in_json_and_by_its_exit_code(goal: str, good: bool, tmp_path: Path) -> None:
    words = files(tmp_path, goal)
    done = run(app, ["check", *words, "--json", "--out", str(tmp_path / "new")])
    report = json.loads(done.stdout)
    assert report["good"] is good
    assert report["checks"]["furniture"]["good"] is good
    assert done.exit_code == (0 if good else 1)
    assert report == json.loads((tmp_path / "new" / "check.json").read_text(encoding="utf-8"))
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["check.json", "check.png"]
    shown = run(app, ["check", *words])
    assert shown.exit_code == done.exit_code
    assert ("NOT good" in shown.output) is not good
    text = " ".join(shown.output.split())
    assert all(word in text for word in report["checks"]["furniture"]["words"].replace(";", "").split())


def test_a_program_out_of_reach_is_one_object_too(tmp_path: Path) -> None:
    done = run(app, ["check", *files(tmp_path, "far"), "--json"])
    report = json.loads(done.stdout)
    assert report["good"] is False
    assert "a goal that can be reached" in report["error"]
    assert isinstance(done.exception, ConfigurationError)  # one line, exit code 1, by `main`


@pytest.mark.parametrize(
    "command", first(2, [["stream", "--cell", "CELL"], ["demo", "path"], ["demo", "pick-and-place"]])
)
def test_commands_refuse_what_goes_through_a_table_or_the_robot_before_they_start(
    command: list[str], tmp_path: Path
) -> None:
    """The third experiment has tables of its own; the second one's tool turns into the robot."""
    program, _, cell = files(tmp_path, "low")
    text = Path(program).read_text(encoding="utf-8")
    if command[-1] == "path":
        inside = "low = { joints = [14.9, 53.3, 39.0, -22.9, 76.2, -22.9] }\n"
        text = re.sub("low = .*\n", inside, text).replace('"line"', '"joint"').replace('start = "left"', "")
    elif command[-1] == "pick-and-place":
        text = text.replace("[0.45, -0.05, 0.46]", "[0.44, 0.40, 0.20]").replace("[0.45, 0.05", "[0.45, 0.15")
    Path(program).write_text(text, encoding="utf-8")
    words = [cell if word == "CELL" else word for word in command]
    words += [] if command[0] == "stream" else ["--out", str(tmp_path / "out")]
    done = run(app, [*words, "--program", program])
    assert isinstance(done.exception, ConfigurationError), done.output
    assert "--unchecked" in str(done.exception)
    assert not (tmp_path / "out").exists()


def test_what_is_wrong_is_only_said_where_that_is_wanted(tmp_path: Path) -> None:
    program, _, cell = files(tmp_path, "low")
    robot, out = load_robot("irb140"), StringIO()
    result = check_path(robot, load_program(program, robot), known=load_cell(cell))
    with pytest.raises(ConfigurationError, match=r"furniture: .* table"):
        refuse_or_warn("qpsafe stream", Path(program), result, False, Console(file=out))
    assert not out.getvalue()
    refuse_or_warn("qpsafe stream", Path(program), result, True, Console(file=out, width=500))
    assert "furniture" in out.getvalue()
    assert "table" in out.getvalue()
