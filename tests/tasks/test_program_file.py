"""Programs in TOML: read, followed by the robot, and refused with file, line and key."""

import re
from pathlib import Path

import numpy as np
import pytest

import qpsafe
from qpsafe.cli.irc5.stream import _controller
from qpsafe.tasks.program_file import ProgramError, load_program
from qpsafe.text.lines import line_of

robot = qpsafe.load_robot("irb140")
GOOD = """# pick, lift, carry, drop
cycle = true
start = "rest"

[rates]
speed = 0.2

[points]
rest = { joints = [0.0, -5.0, 0.0, 0.0, 85.0, 0.0] }
pick = { position = [0.45, 0.2, 0.4] }
above = { position = [0.45, 0.2, 0.5] }
over = { position = [0.5, 0.0, 0.55] }

[points.drop]
position = [0.45, -0.2, 0.5]
euler = [180.0, 80.0, 180.0]

[[segment]]
do = "joint"
to = "above"

[[segment]]
do = "line"
to = "pick"
speed = 0.05

[[segment]]
do = "event"
name = "grip"
dwell = 0.3

[[segment]]
do = "line"
to = "above"

[[segment]]
do = "arc"
via = "over"
to = "drop"

[[segment]]
do = "event"
name = "release"

[[segment]]
do = "dwell"
time = 0.2

[[segment]]
do = "joint"
to = "rest"
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "program.toml"
    path.write_text(text)
    return path


def test_a_program_does_what_its_file_says(tmp_path: Path) -> None:
    program = load_program(write(tmp_path, GOOD), robot)
    assert [event.name for event in program.events] == ["grip", "release"]
    home = robot.pose("tcp", robot.home)
    assert program.sample(0.0).pose == pytest.approx(home, abs=1e-9)
    grip, release = (program.sample(event.time) for event in program.events)
    assert grip.pose[:3, 3] == pytest.approx([0.45, 0.2, 0.4], abs=1e-7)
    assert grip.pose[:3, :3] == pytest.approx(home[:3, :3], abs=1e-7)  # oriented as at the start
    assert release.pose[:3, 3] == pytest.approx([0.45, -0.2, 0.5], abs=1e-7)
    for sample in (grip, release):
        assert np.abs(sample.twist).max() < 1e-6
    times = np.linspace(0.0, program.duration, 500)
    assert max(np.linalg.norm(program.sample(t).twist[:3]) for t in times if program.move_at(t) == 1) <= 0.05 + 1e-9
    z = [program.sample(t).pose[2, 3] for t in times]
    assert max(z) == pytest.approx(0.55, abs=5e-3)  # by way of `over`


def test_the_controller_follows_a_program_and_reports_its_events(tmp_path: Path) -> None:
    program = load_program(write(tmp_path, GOOD), robot)
    tasks = [qpsafe.PositionTask("tcp", program), qpsafe.OrientationTask("tcp", program)]
    controller = qpsafe.SafetyController(robot, tasks)
    q, qd, events = robot.home, np.zeros(6), []
    for _ in range(round(1.9 * program.duration / 0.004)):
        tick = controller.step(q, qd, points=[])
        assert tick.status == "ok"
        assert np.linalg.norm(tick.errors[0]) < 3e-3
        assert np.linalg.norm(tick.errors[1]) < 3e-3
        q, qd = tick.reference.q, tick.reference.qd
        if tick.events:
            place = robot.pose("tcp", q)[:3, 3]
            events.append((*tick.events, tuple(np.round(place, 3))))
    grip, release = ("grip", (0.45, 0.2, 0.4)), ("release", (0.45, -0.2, 0.5))
    assert events in ([grip, release, grip], [grip, release, grip, release])


LINE = GOOD.splitlines().index('do = "line"') + 1  # of the second segment
MISTAKES = {
    "unknown key": ("cycle = true", "cycles = true", 2, "cycles"),
    "not a boolean": ("cycle = true", 'cycle = "yes"', 2, "cycle"),
    "unknown start": ('start = "rest"', 'start = "bed"', 3, "start"),
    "no speed": ("speed = 0.2", "speed = 0.0", 6, "rates.speed"),
    "infinite speed": ("speed = 0.05", "speed = inf", LINE + 2, "segment[1].speed"),
    "unknown kind": ('do = "line"', 'do = "fly"', LINE, "segment[1].do"),
    "unknown point": ('to = "pick"', 'to = "peck"', LINE + 1, "segment[1].to"),
    "unknown frame": ("cycle = true", 'frame = "tip"', 2, "frame"),
    "too few joints": ("0.0, 85.0, 0.0]", "85.0]", 9, "points.rest.joints"),
    "joint past its limit": ("85.0, 0.0]", "130.0, 0.0]", 9, "points.rest.joints"),
    "position of two numbers": ("[0.45, 0.2, 0.4]", "[0.45, 0.2]", 10, "points.pick.position[2]"),
    "position and joints": ("euler = [180.0, 80.0, 180.0]", "joints = [0.0]", 14, "points.drop"),
    "out of reach": ("[0.45, 0.2, 0.4]", "[1.45, 0.2, 0.4]", LINE + 1, "segment[1].to"),
    "under the floor": ("[0.45, 0.2, 0.4]", "[0.1, 0.0, -0.4]", LINE + 1, "segment[1].to"),
    "arc along a line": (
        "[0.5, 0.0, 0.55]",
        "[0.45, 0.0, 0.5]",
        GOOD.splitlines().index('via = "over"') + 1,
        "segment[4].via",
    ),
    "nowhere to go": ('to = "pick"', 'to = "above"', LINE + 1, "segment[1].to"),
    "cycle that does not close": ('to = "rest"', 'to = "above"', 2, "cycle"),
    "event without a name": ('name = "grip"', "dwell = 0.1 #", LINE + 4, "segment[2].name"),
    "NaN": ("time = 0.2", "time = nan", GOOD.splitlines().index("time = 0.2") + 1, "segment[6].time"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_refused_with_file_line_and_key(tmp_path: Path, name: str) -> None:
    old, new, line, key = MISTAKES[name]
    if name == "event without a name":
        old, new = 'name = "grip"\ndwell = 0.3', "dwell = 0.3"
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(ProgramError) as caught:
        load_program(path, robot)
    error = caught.value
    assert (error.where, error.key) == (f"{path}:{line}", key), str(error)
    assert error.expected


def test_malformed_files_are_refused_with_the_line(tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match=r"program\.toml:3"):
        load_program(write(tmp_path, 'cycle = true\n\nstart = "rest\n'), robot)
    with pytest.raises(ProgramError, match="file"):
        load_program(tmp_path / "none.toml", robot)
    with pytest.raises(ProgramError, match="segment"):
        load_program(write(tmp_path, ""), robot)
    with pytest.raises(ProgramError, match="segment"):
        load_program(write(tmp_path, '[[segment]]\ndo = "event"\nname = "grip"\n'), robot)


VARIED = """cycle = true
start = "box"

[points]
a = { position = [0.45, 0.20, 0.4] }
b = { position = [0.45, 0.25, 0.4] }
c = { position = [0.50, 0.20, 0.4] }
box = { position = [0.45, -0.2, 0.5] }

[vary]
hole = ["a", "b", "c"]

[[segment]]
do = "line"
to = "hole"
above = 0.1

[[segment]]
do = "line"
to = "hole"

[[segment]]
do = "event"
name = "grip"

[[segment]]
do = "line"
to = "box"
"""


def test_points_that_vary_take_turns(tmp_path: Path) -> None:
    """The program with a list of points is the one with its segments written out for each of them."""
    program = load_program(write(tmp_path, VARIED), robot)
    head, body = VARIED.split("[vary]")
    segments = "[[segment]]" + body.partition("[[segment]]")[2]
    written_out = head + "".join(segments.replace('"hole"', f'"{name}"') for name in "abc")
    other = load_program(write(tmp_path, written_out), robot)
    assert program.duration == other.duration
    assert program.events == other.events
    for t in np.linspace(0.0, 2.0 * program.duration, 200):
        assert (program.sample(t).pose == other.sample(t).pose).all()
    grips = [program.sample(program.event(k).time).pose[:3, 3] for k in range(4)]  # type: ignore[union-attr]
    assert np.allclose(grips, [[0.45, 0.2, 0.4], [0.45, 0.25, 0.4], [0.5, 0.2, 0.4], [0.45, 0.2, 0.4]], atol=1e-7)
    assert program.moves[0].sample(9.0).pose[2, 3] == pytest.approx(0.5, abs=1e-7)  # above the first


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "said"),
    [
        ('"c"]', '"d"]', 11, "vary.hole", "'d'"),
        ('hole = ["a"', 'box = ["a"', 11, "vary.box", "no point"),
        ('["a", "b", "c"]', "[]", 11, "vary.hole", "at least 1"),
        ("[0.50, 0.20, 0.4]", "[1.50, 0.20, 0.4]", 15, "segment[0].to", "'c'"),  # says which of them
        ("above = 0.1", "above = nan", 16, "segment[0].above", "finite"),
    ],
)
def test_mistakes_in_points_that_vary(tmp_path: Path, old: str, new: str, line: int, key: str, said: str) -> None:
    path = write(tmp_path, VARIED.replace(old, new, 1))
    with pytest.raises(ProgramError) as caught:
        load_program(path, robot)
    assert (caught.value.where, caught.value.key) == (f"{path}:{line}", key)
    assert said in str(caught.value)


def test_too_fast_for_a_joint_is_refused_by_its_name(tmp_path: Path) -> None:
    text = GOOD.replace("speed = 0.05", "speed = 40.0").replace(
        "speed = 0.2", "speed = 40.0\nacceleration = 1e4\njerk = 1e7"
    )
    with pytest.raises(ProgramError, match=r"segment\[1\].to.*joint_\d needs"):
        load_program(write(tmp_path, text), robot)


OWN = """<mujoco model="own"><worldbody><body name="base"><body name="upper">
<joint name="shoulder" axis="0 0 1" range="-60 100" limited="true"/><geom type="box" size="0.2 0.05 0.05"/>
<body name="fore" pos="0.5 0 0"><joint name="elbow" axis="0 1 0" range="-100 100" limited="true"/>
<geom type="box" size="0.05 0.05 0.1"/><site name="grip" pos="0.25 0 0"/></body></body></body></worldbody></mujoco>"""


@pytest.mark.filterwarnings("ignore::qpsafe.errors.RobotWarning")
@pytest.mark.parametrize("name", [*qpsafe.bundled_robots(), "own"])
def test_a_program_without_a_frame_is_followed_by_the_first_tool(tmp_path: Path, name: str) -> None:
    """Whatever a robot calls its tool's tip, `qpsafe stream --program` needs no key for it."""
    if name == "own":
        (tmp_path / "own.xml").write_text(OWN)
        name = str(tmp_path / "own.xml")
    own = qpsafe.load_robot(name)
    path = write(tmp_path, '[[segment]]\ndo = "dwell"\ntime = 1.0\n')
    assert load_program(path, own).frame == own.tool_frames[0]
    controller = _controller(name, path, None, None, None)
    assert {task.frame for task in controller.tasks} == {own.tool_frames[0]}  # type: ignore[attr-defined]
    path.write_text(f'frame = "{own.frame_names[1]}"\n' + path.read_text())
    assert load_program(path, own).frame == own.frame_names[1]
    path.write_text(path.read_text().replace(own.frame_names[1], "no such frame"))
    with pytest.raises(ProgramError, match="without this key") as caught:
        load_program(path, own)
    assert repr(own.tool_frames[0]) in caught.value.expected


def test_lines_of_keys() -> None:
    text = 'a = 1\n[b.c]\nd = 2\n"e f" = 3\n[[g]]\nh = 4\n[[g]]\nh = 5\n  [i]\n'
    expected = {
        ("a",): 1,
        ("b", "c"): 2,
        ("b", "c", "d"): 3,
        ("g", 0, "h"): 6,
        ("g", 1): 7,
        ("g", 1, "h"): 8,
        ("i",): 9,
    }
    for keys, line in expected.items():
        assert line_of(text, keys) == line
    assert line_of(text, ("g", 1, "x")) == 7
    assert line_of(text, ("x",)) == 1


def test_the_program_in_the_docs_is_one(tmp_path: Path) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "reference" / "tasks.md").read_text(encoding="utf-8")
    program = load_program(write(tmp_path, page.split("```toml\n")[1].split("```")[0]), robot)
    assert [event.name for event in program.events] == ["grip", "release"]


def test_a_file_is_followed_once_a_robot_and_read_anew_when_it_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "program.toml"
    path.write_text(GOOD)
    first = load_program(path, robot)
    assert load_program(path, robot) is first
    assert load_program(path, robot.with_spots("spots.toml")) is not first  # it might be another one
    path.write_text(GOOD.replace("time = 0.2", "time = 0.7"))
    assert load_program(path, robot).duration == pytest.approx(first.duration + 0.5)
    path.write_text(GOOD.replace("cycle = true", "cycle = 3"))
    for _ in range(2):  # what is wrong is said every time
        with pytest.raises(ProgramError, match=re.escape(f"{path}:2: cycle")):
            load_program(path, robot)
