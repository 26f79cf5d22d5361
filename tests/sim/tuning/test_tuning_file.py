"""Values in a robot's file: they load again as the same controller, and comments and other tables stay."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.sim.tuning.robot_file import MARK, check_writing, edited, farthest, write_folder, write_values
from qpsafe.sim.tuning.space import Space
from qpsafe.sim.tuning.values import TABLES, present

ROBOTS = ("irb140", "iiwa14", "irb14000")


@pytest.mark.parametrize("name", first(1, ROBOTS))
def test_what_is_written_loads_as_the_same_controller(name: str, tmp_path: Path) -> None:
    robot = qpsafe.load_robot(name)
    space = Space.of(robot)
    values = space.at(space.near(np.random.default_rng(1), 0.3))
    folder = write_folder(robot, values, "a run", tmp_path / "copy")
    other = qpsafe.load_robot(folder)
    assert farthest(present(other), values) < 1e-12
    frame = robot.tool_frames[0]
    here = qpsafe.FixedPose(robot.pose(frame, robot.home))
    tasks = [qpsafe.PositionTask(frame, here), qpsafe.OrientationTask(frame, here)]
    loaded, made = qpsafe.SafetyController(other, tasks), values.parts(robot)
    assert loaded.activation.levels == made["activation"].levels
    np.testing.assert_allclose(loaded.evasion.matrices, made["evasion"].matrices, rtol=1e-12)
    for key in TABLES["recovery"]:
        assert getattr(loaded.recovery_rules, key) == pytest.approx(getattr(made["recovery"], key), rel=1e-12)
    for key in TABLES["gate"]:
        assert getattr(loaded.gate, key) == getattr(made["gate"], key)
    # the paper's are there as before
    assert present(qpsafe.load_robot(folder, parameters="paper")) == present(robot)
    # everything else stays
    before, after = (tomllib.loads((f / "robot.toml").read_text(encoding="utf-8")) for f in (robot.folder, folder))
    assert {k: v for k, v in after.items() if k not in TABLES} == {k: v for k, v in before.items() if k not in TABLES}
    lines = (folder / "robot.toml").read_text(encoding="utf-8").splitlines()
    for line in (robot.folder / "robot.toml").read_text(encoding="utf-8").splitlines():
        if line.lstrip().startswith("#") or "#" in line:
            assert line in lines
    assert lines.count(f"{MARK} a run") == len(TABLES)


def test_a_later_run_takes_the_place_of_an_earlier_one(tmp_path: Path) -> None:
    robot = qpsafe.load_robot("irb140")
    space = Space.of(robot)
    folder = write_folder(robot, space.at(space.near(np.random.default_rng(2), 0.2)), "one", tmp_path / "copy")
    once = qpsafe.load_robot(folder)
    values = space.at(space.near(np.random.default_rng(3), 0.2))
    write_values(folder / "robot.toml", once, values, "two")
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    assert f"{MARK} one" not in text
    assert text.count(f"{MARK} two") == len(TABLES)
    assert farthest(present(qpsafe.load_robot(folder)), values) < 1e-12


KEYS = st.sampled_from(["delta", "mass", "calm"])
VALUES = st.one_of(st.floats(0.001, 1e6), st.lists(st.floats(0.1, 9.0), min_size=1, max_size=4))


@settings(max_examples=some(10, of=60))
@given(st.dictionaries(KEYS, VALUES, min_size=1), st.booleans())
def test_an_edited_text_says_what_it_should_and_keeps_the_rest(values: dict[str, object], there: bool) -> None:
    text = 'name = "[danger]"  # [danger]\nlinks = [\n    ["a", "b"],\n    ["c"],\n]\n\n'
    text += (
        "[danger]  # of the field\ndelta = 1.5    # ours\nmass = [\n    1.0,  # first\n    2.0,\n]\nother = 3\n\n"
        * there
    )
    text += '# of the part below\n[[regions]]\nname = "x"\n'
    found = edited(text, {"danger": values}, f"{MARK} z")
    assert found is not None
    said, before = tomllib.loads(found), tomllib.loads(text)
    assert said.pop("danger") == before.pop("danger", {}) | values
    assert said == before
    assert '# of the part below\n[[regions]]\nname = "x"' in found
    if there:
        assert "# of the field" in found
        assert "# ours" in found


@pytest.mark.parametrize("danger", ["danger = { delta = 11.5, epsilon = 0.15, delta_f = 7.5, epsilon_f = 0.25 }"])
def test_a_file_that_cannot_be_edited_is_named_and_stays_as_it_is(tmp_path: Path, danger: str) -> None:
    robot = qpsafe.load_robot("irb140")
    shutil.copytree(robot.folder, tmp_path / "own")
    file = tmp_path / "own" / "robot.toml"
    text = file.read_text(encoding="utf-8")
    start, end = text.index("[danger]"), text.index("# Where distance sensors")
    text = f"{danger}\n" + text[:start] + text[end:]
    file.write_text(text, encoding="utf-8")
    own = qpsafe.load_robot(tmp_path / "own")
    with pytest.raises(ConfigurationError, match=r"robot.toml.*danger.*a line of its own"):
        write_values(file, own, present(own), "x")
    assert file.read_text(encoding="utf-8") == text


NUMBER = st.floats(0.001, 1e6)
#: What stands behind a key, or above it; none of it is changed.
REMARK = st.sampled_from(["", "  # ours", '# "quoted" [danger] = 1', "  # it's", "\t# é = [1.0, 2.0]"])


@st.composite
def written(draw: st.DrawFn) -> tuple[str, list[str]]:
    """A file in one of the many ways that TOML allows, and the remarks in it."""
    lines, remarks, head = ['name = "x"', "", "# of the field"], [], draw(st.sampled_from(["[danger]", '["danger"]']))
    remark = draw(REMARK)
    lines.append(f"{draw(st.sampled_from(['', '  ']))}{head}{remark}")
    remarks.append(remark)
    for key in draw(st.lists(KEYS, unique=True)):
        name, remark = draw(st.sampled_from([key, f'"{key}"', f"'{key}'", f"  {key}"])), draw(REMARK)
        value = draw(st.one_of(NUMBER, st.lists(NUMBER, min_size=1, max_size=4)))
        remarks.append(remark)
        if isinstance(value, float):
            lines.append(f"{name} = {value!r} {remark}")
        elif draw(st.booleans()):
            lines.append(f"{name}={value!r}{remark}")
        else:
            inside = [draw(REMARK) for _ in value]
            lines.append(f"{name} = [ {draw(st.sampled_from(['', '# 1.5 of']))}")
            lines += [f"    {one!r}, {words}" for one, words in zip(value, inside, strict=True)]
            lines.append(f"]{remark}")
            remarks += inside
    lines += ["other = 3", "", "# of the next", "[wire]", "links = 1"]
    ends = draw(st.sampled_from(["\n", "\r\n"]))
    return ends.join(lines) + draw(st.sampled_from(["", ends])), [remark.strip() for remark in remarks]


@settings(max_examples=some(20, of=600), deadline=None)
@given(written(), st.dictionaries(KEYS, VALUES, min_size=1))
def test_remarks_and_line_ends_stay_however_it_is_written(
    file: tuple[str, list[str]], values: dict[str, object]
) -> None:
    text, remarks = file
    found = edited(text, {"danger": values}, f"{MARK} z")
    assert found is not None
    said, before = tomllib.loads(found), tomllib.loads(text)
    assert said.pop("danger") == before.pop("danger") | values
    assert said == before
    assert found.count("\r\n") in (0, found.count("\n"))
    assert ("\r\n" in found) is ("\r\n" in text)
    for remark in remarks:
        assert found.count(remark) >= text.count(remark) > 0 or not remark
    again = edited(found, {"danger": values}, f"{MARK} z")
    assert again == found  # nothing is added twice


def _own(folder: Path, change: Callable[[str], str], ends: str = "\n") -> Path:
    """The file of a robot of one's own, written in another way."""
    shutil.copytree(qpsafe.load_robot("irb140").folder, folder)
    file = folder / "robot.toml"
    text = change(file.read_text(encoding="utf-8"))
    file.write_bytes(text.replace("\n", ends).encode())
    return file


def test_a_file_of_windows_with_its_mark_stays_one(tmp_path: Path) -> None:
    file = _own(tmp_path / "own", lambda text: "\ufeff" + text, "\r\n")
    robot = qpsafe.load_robot(file.parent)
    space = Space.of(robot)
    values = space.at(space.near(np.random.default_rng(4), 0.2))
    write_values(file, robot, values, "x")
    after = file.read_bytes()
    assert after.startswith("\ufeff".encode())
    assert after.count(b"\r\n") == after.count(b"\n")
    assert farthest(present(qpsafe.load_robot(file.parent)), values) < 1e-12
    assert [path.name for path in file.parent.iterdir() if path.name.startswith(".")] == []


def test_what_stops_the_writing_leaves_the_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = _own(tmp_path / "own", str)
    robot, before = qpsafe.load_robot(file.parent), file.read_bytes()

    def stop(*_: object) -> None:
        assert file.read_bytes() == before  # at no time is it another one, or half of one
        raise KeyboardInterrupt

    monkeypatch.setattr("qpsafe.sim.tuning.robot_file.farthest", stop)
    with pytest.raises(KeyboardInterrupt):
        write_values(file, robot, present(robot), "x")
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir() if path.name.startswith(".")] == []


WAYS = {
    "inline": (lambda text, table: f"danger = {{ {', '.join(_stated(table))} }}\n" + text.replace(table, ""), False),
    "dotted": (lambda text, table: "".join(f"danger.{x}\n" for x in _stated(table)) + text.replace(table, ""), False),
    "quoted table": (lambda text, table: text.replace("[danger]", '["danger"]'), True),
    "quoted key": (lambda text, table: text.replace("\ndelta =", '\n"delta" ='), True),
    "spaces": (lambda text, table: text.replace("[danger]", "  [ danger ]  # [x]"), True),
}


def _stated(table: str) -> list[str]:
    return [line.split("#")[0].strip() for line in table.splitlines() if "=" in line.split("#")[0]]


@pytest.mark.parametrize("way", WAYS)
def test_whether_a_file_can_be_written_is_known_before_a_search(tmp_path: Path, way: str) -> None:
    change, good = WAYS[way]

    def changed(text: str) -> str:
        start = text.index("[danger]")
        return change(text, text[start : text.index("# Where distance sensors")])

    file = _own(tmp_path / "own", changed)
    robot, before = qpsafe.load_robot(file.parent), file.read_bytes()
    if good:
        check_writing(robot)
    else:
        with pytest.raises(ConfigurationError, match=rf"{file}: danger = .*a line of its own"):
            check_writing(robot)
    assert file.read_bytes() == before
