"""What a reader of URDF leaves out without a word is read here as it is written, or refused by name."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import some
from hypothesis import given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.robot.loader import load_robot
from qpsafe.robot.models.urdf import UrdfFile
from qpsafe.robot.robot import Robot
from qpsafe.robot.robot_file.starting_file import starting_robot_toml
from qpsafe.sensing.hulls import Obstacle

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
LINK = '<inertial><mass value="2"/>' + INERTIA + "</inertial>{}"
ARM = """<robot name="arm"{version}><link name="base">{base}</link><link name="{link}">{body}</link>
  <joint name="{joint}" type="revolute"><parent link="base"/><child link="{link}"/><axis xyz="{axis}"/>
  <limit lower="{lower}" upper="{upper}" velocity="{velocity}" effort="1"/></joint></robot>"""
USUAL = {
    "version": "",
    "base": "",
    "link": "fore",
    "body": "",
    "joint": "turn",
    "axis": "0 0 1",
    "lower": "-1",
    "upper": "1",
    "velocity": "1",
}
# shapes with places for the words of their numbers, and how many numbers there are
SHAPES = {
    '<box size="{}"/>': 3,
    '<sphere radius="{}"/>': 1,
    '<cylinder radius="{}" length="0.4"/>': 1,
    '<cylinder radius="0.1" length="{}"/>': 1,
    '<capsule radius="{}" length="0.4"/>': 1,
    '<capsule radius="0.1" length="{}"/>': 1,
}
BLANKS = st.sampled_from(["", " ", "  ", "&#10;", "&#9;", " &#13;&#10; "])
NUMBERS = st.floats(1e-3, 10.0).flatmap(
    lambda x: st.sampled_from([repr(x), f"{x:e}", f"+{x!r}", f"{x:E}", f"{x:.3f}0"])
)


def load(folder: Path, **changed: str) -> Robot:
    text = ARM.format_map(USUAL | changed)
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(folder / "arm.urdf")


def shape(text: str, origin: str = "") -> str:
    return f"<collision>{origin}<geometry>{text}</geometry></collision>"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("silence")


@settings(max_examples=some(24, of=60), deadline=None)
@given(st.sampled_from(list(SHAPES)), st.data())
def test_blanks_around_numbers_change_nothing(folder: Path, form: str, data: st.DataObject) -> None:
    words = [data.draw(NUMBERS) for _ in range(SHAPES[form])]
    spaced = "".join(f"{data.draw(BLANKS) or ' '}{word}" for word in words) + data.draw(BLANKS)
    mass = data.draw(NUMBERS)
    robots = [
        load(folder, body=f'<inertial><mass value="{kg}"/>{INERTIA}</inertial>' + shape(form.format(text)))
        for kg, text in ((f"{data.draw(BLANKS)}{mass}{data.draw(BLANKS)}", spaced), (mass, " ".join(words)))
    ]
    for robot in robots:
        assert robot.model.inertias[1].mass == float(mass)
    ((_, _, points),), ((_, _, plain),) = (robot.hulls() for robot in robots)
    np.testing.assert_array_equal(points, plain)


@pytest.mark.parametrize(
    "word", ["1_0", "\uff11", "\u0663", "0x1", "1d0", "1e", "1,5", "1e400", "inf", "nan", "--1", "1f"]
)
@pytest.mark.parametrize("form", [*SHAPES, "mass", "origin"])
def test_what_the_reader_takes_for_no_number_is_refused_by_name(word: str, form: str, tmp_path: Path) -> None:
    if form == "mass":
        body = f'<inertial><mass value="{word}"/>{INERTIA}</inertial>'
    elif form == "origin":
        body = shape('<box size="1 1 1"/>', f'<origin xyz="0 0 {word}"/>')
    else:
        body = shape(form.format(" ".join([word] * SHAPES[form])))
    with pytest.raises(RobotFileError, match="link fore: "):
        load(tmp_path, body=body)


@pytest.mark.parametrize("version", ["", ' version="1.0"', ' version=" 1.1"', ' version="1.2"'])
def test_a_capsule_beside_a_box_is_read_whatever_version_is_stated(version: str, tmp_path: Path) -> None:
    body = shape('<capsule radius="0.1" length="0.4"/>') + shape('<box size="0.1 0.1 0.4"/>')
    capsule, box = (points for *_, points in load(tmp_path, version=version, body=body).hulls())
    assert np.ptp(box, axis=0) == pytest.approx([0.1, 0.1, 0.4])
    assert np.ptp(capsule, axis=0) == pytest.approx([0.2, 0.2, 0.6], rel=0.02)


@pytest.mark.parametrize("version", ["", ' version="1.0"', ' version="1.2"'])
def test_a_quaternion_turns_a_shape_whatever_version_is_stated(version: str, tmp_path: Path) -> None:
    half = "0 0.7071067811865476 0 0.7071067811865476 "
    body = shape('<box size="0.1 0.2 0.3"/>', f'<origin xyz="0 0 0" quat_xyzw="{half}"/>')
    ((*_, points),) = load(tmp_path, version=version, body=body).hulls()
    assert np.ptp(points, axis=0) == pytest.approx([0.3, 0.2, 0.1])


@pytest.mark.parametrize("wrong", ['quat_xyzw="0 0 0 0"', 'quat_xyzw="0 0 1"', 'quat_xyzw="0 0 0 1" rpy="0 0 1"'])
def test_a_quaternion_that_is_none_is_refused_by_name(wrong: str, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="link fore: collision: origin quat_xyzw"):
        load(tmp_path, body=shape('<box size="1 1 1"/>', f'<origin xyz="0 0 0" {wrong}/>'))


@pytest.mark.parametrize("version", ["1", "2.0", "", "x"])
def test_an_unknown_version_is_refused_by_name(version: str, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="robot: version"):
        load(tmp_path, version=f' version="{version}"')


@pytest.mark.parametrize("where", ["base", "body"])
@pytest.mark.parametrize(("lost", "key"), [("radius", "collision"), ("value", "mass")])
def test_what_the_reader_leaves_out_is_an_error_that_names_the_link(
    where: str, lost: str, key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even where the check of numbers has a hole: here the text is spoilt after it."""
    prepare = UrdfFile.__init__

    def spoilt(self: UrdfFile, *args: Any) -> None:
        prepare(self, *args)
        self._text = self._text.replace(f'{lost}="2"', f'{lost}="2 "')

    monkeypatch.setattr(UrdfFile, "__init__", spoilt)
    full = LINK.format(shape('<sphere radius="2"/>') + shape('<box size="1 1 1"/>'))
    with pytest.raises(RobotFileError) as caught:
        load(tmp_path, **{where: full}).hulls()
    assert caught.value.key == f"link {'base' if where == 'base' else 'fore'}: {key}"


@pytest.mark.parametrize("name", ["base", "fore"])
def test_a_link_does_not_take_the_name_of_the_world(name: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM.format_map(USUAL).replace(f'"{name}"', '"universe"'), encoding="utf-8")
    with pytest.raises(RobotFileError, match="link universe: name"):
        load_robot(tmp_path / "arm.urdf")


@given(st.floats(-300.0, 300.0), st.integers(0, 2))
@settings(max_examples=some(16, of=40), deadline=None)
def test_an_axis_of_any_length_is_the_same_joint_or_refused_by_name(folder: Path, power: float, index: int) -> None:
    direction = np.roll([1.0, 2.0, -0.5], index)
    words = " ".join(repr(float(x)) for x in direction * 10.0**power)
    try:
        robot = load(folder, axis=words)
    except RobotFileError as error:
        assert error.key == "joint turn: axis"  # noqa: PT017
        assert abs(power) > 8.0
    else:
        unit = direction / np.linalg.norm(direction)
        np.testing.assert_allclose(robot.jacobian("fore", [0.3])[3:, 0], unit, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "name", ["x" * 300, "package://" + "x" * 300 + "/a.stl", "a/" * 3000 + "a.stl", "\u00e4" * 200]
)
def test_a_mesh_whose_name_no_system_can_have_is_missing(name: str, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="link fore: collision mesh"):
        load(tmp_path, body=shape(f'<mesh filename="{name}"/>'))


COLLADA = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">{head}
<library_geometries><geometry id="g" name="g"><mesh><source id="p">
<float_array id="pa" count="12">{points}</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source><vertices id="v">
<input semantic="POSITION" source="#p"/></vertices><triangles count="4">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes>
<visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def collada(folder: Path, head: str, **mesh: str) -> Robot:
    text = COLLADA.format(head=head, points="0 0 0 1 0 0 0 2 0 0 0 3")
    (folder / "part.DAE").write_text(text, encoding="utf-8")
    return load(folder, body=shape(f'<mesh filename="part.DAE" scale="{mesh.get("scale", "1 1 1")}"/>'))


@pytest.mark.parametrize("axis", ["", "<up_axis>Z_UP</up_axis>", "<up_axis>Y_UP</up_axis>", "<up_axis>X_UP</up_axis>"])
@pytest.mark.parametrize("metres", [None, 1.0, 0.01, 0.0254, 1000.0])
def test_a_collada_mesh_has_its_unit_and_is_not_turned(metres: float | None, axis: str, tmp_path: Path) -> None:
    unit = "" if metres is None else f'<unit name="u" meter="{metres!r}"/>'
    robot = collada(tmp_path, f"<asset><contributor/>{unit}{axis}</asset>", scale="2 1 1")
    ((*_, points),) = robot.hulls()
    np.testing.assert_allclose(np.ptp(points, axis=0), np.array([2.0, 2.0, 3.0]) * (metres or 1.0), rtol=1e-6)
    known = Obstacle.mesh("part", tmp_path / "part.DAE", scale=2.0)
    np.testing.assert_allclose(np.ptp(known.vertices, axis=0), np.array([2.0, 4.0, 6.0]) * (metres or 1.0), rtol=1e-6)
    said = " ".join(note for note in robot.notes if "part.DAE" in note)
    assert ("part.DAE (Y_UP)" in said or "part.DAE (X_UP)" in said) == (axis[9:10] in ("X", "Y"))
    assert ("unit" in said) == (metres not in (None, 1.0))


def test_a_collada_mesh_without_a_head_is_in_metres(tmp_path: Path) -> None:
    ((*_, points),) = collada(tmp_path, "").hulls()
    np.testing.assert_allclose(np.ptp(points, axis=0), [1.0, 2.0, 3.0])


@pytest.mark.parametrize("metres", ["0", "-1", "nan", "inf", "", "cm"])
def test_a_collada_mesh_with_a_unit_that_is_none_is_refused_by_name(metres: str, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"link fore: collision mesh: part\.DAE: unit meter"):
        collada(tmp_path, f'<asset><unit meter="{metres}"/></asset>')
    with pytest.raises(ConfigurationError, match=r"obstacle thing: path: part\.DAE: unit meter"):
        Obstacle.mesh("thing", tmp_path / "part.DAE")


FLAT = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
TILT = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
NO_BODIES = {
    "nan": np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, np.nan, 0.0], [0.0, 0.0, 1.0]]),
    "flat": FLAT,
    "flat and tilted": FLAT @ TILT,
    "a line": FLAT * [1.0, 0.0, 0.0],
    "a point": np.full((4, 3), 0.3),
}


@pytest.mark.parametrize("kind", NO_BODIES)
def test_a_mesh_without_a_volume_is_an_error_that_names_link_and_file(kind: str, tmp_path: Path) -> None:
    corners = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in NO_BODIES[kind].tolist())
    (tmp_path / "part.obj").write_text(corners + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", encoding="utf-8")
    with pytest.raises(RobotFileError) as caught:
        load(tmp_path, body=shape('<mesh filename="part.obj"/>')).hulls()
    assert "fore" in str(caught.value)
    assert "part.obj" in str(caught.value)


NAMES = st.text(st.characters(exclude_categories=("Cs", "Cn"), exclude_characters="\ufffe\uffff"), min_size=1).map(
    lambda text: "".join(c if c in "\t\n\r" or ord(c) >= 32 else "?" for c in text)
)
TINY = st.floats(-14.0, 0.0).map(lambda power: 10.0**power)


@settings(max_examples=some(24, of=60), deadline=None)
@given(NAMES, TINY, TINY, st.floats(-3.0, 3.0))
def test_a_starting_file_reads_back_whatever_the_names_and_however_small_the_ranges(
    folder: Path, name: str, span: float, speed: float, lower: float
) -> None:
    upper = lower + span
    if not lower < upper:
        return
    ends = {"lower": repr(lower), "upper": repr(upper), "velocity": repr(speed)}
    if name in ("base", "universe") or "${" in name or "$(" in name:
        return
    escaped = "".join(f"&#{ord(c)};" for c in name)
    robot = load(folder, link=escaped, joint=escaped, **ends)
    (folder / "robot.toml").write_text(starting_robot_toml(robot, folder), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        again = load_robot(folder)
    assert (again.joint_names, again.frame_names) == (robot.joint_names, robot.frame_names)
    assert again.wire_frames == robot.wire_frames
    for key in ("lower", "upper", "max_velocity", "max_acceleration", "home"):
        np.testing.assert_allclose(getattr(again, key), getattr(robot, key), rtol=0, atol=1e-7)
