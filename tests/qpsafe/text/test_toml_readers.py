"""Every reader of a TOML file gives what the file says or a named error, whatever stands in it, in bounded time.

Documents are generated freely, and the bundled ones are mutated; nothing but `ConfigurationError` may come out.
"""

from __future__ import annotations

import codecs
import re
import shutil
import tomllib
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from amounts import some, thinned
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import qpsafe
from qpsafe.errors import ConfigurationError
from qpsafe.ranging.sensor_file import read_range_sensors
from qpsafe.robot.loader import load_robot
from qpsafe.sensing.sharp import SharpCurve
from qpsafe.sensing.skin.calibration import calibration_text, fit_curve, read_calibration
from qpsafe.sensing.skin.spots import SpotArray
from qpsafe.sim.stories.file import load_story
from qpsafe.tasks.program_file import MOST_CHECKS, load_program
from qpsafe.text.toml_parse import DEEPEST, LARGEST, toml_table

ROOT = Path(__file__).resolve().parents[3]
ROBOT = load_robot("irb140")
CELL = """[[box]]
name = "table"
size = [0.8, 1.2, 0.05]
centre = [0.9, 0.0, 0.1]
[[hull]]
name = "ramp"
vertices = [[1.0, 0.0, 0.0], [1.0, 0.4, 0.0], [1.4, 0.0, 0.0], [1.4, 0.4, 0.3]]
"""
CAMERAS = """[[camera]]
name = "ceiling"
kind = "depth"
resolution = [64, 48]
field_of_view = [90.0, 60.0]
position = [1.5, 0.0, 2.6]
look_at = [0.4, 0.0, 0.3]
up = [0.0, 0.0, 1.0]
range_max = 4.0
rate = 30.0
[[camera]]
name = "gate"
kind = "scanner"
angle_min = -90.0
increment = 0.5
rays = 361
position = [2.0, 0.0, 0.3]
quaternion = [0.0, 0.0, 0.0, 1.0]
range_max = 8.0
rate = 40.0
"""
D = [0.2, 0.3, 0.4, 0.5, 0.6, 0.8]
CURVES = calibration_text([fit_curve("a", D, SharpCurve().voltage(D))])


@cache
def robot_folder() -> Path:
    """A copy of a robot's folder, in which its robot.toml may be anything."""
    import tempfile

    folder = Path(tempfile.mkdtemp())
    for name in ("robot.xml", "spots.toml"):
        shutil.copy(ROBOT.folder / name, folder / name)
    return folder


def read_robot(path: Path) -> Any:
    target = robot_folder() / "robot.toml"
    target.write_bytes(path.read_bytes())
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # no arithmetic with absurd numbers
        return load_robot(target.parent)


READERS: dict[str, tuple[Callable[[Path], Any], str]] = {
    "program": (lambda path: load_program(path, ROBOT), (ROOT / "sim/experiments/path/path.toml").read_text()),
    "cell": (qpsafe.load_cell, CELL),
    "cameras": (qpsafe.load_cameras, CAMERAS),
    "story": (load_story, (ROOT / "examples/two_people.toml").read_text()),
    "spots": (lambda path: SpotArray.load(path, ROBOT), (ROBOT.folder / "spots.toml").read_text()),
    "arrays": (lambda path: read_range_sensors(path, ROBOT), (ROBOT.folder / "spots-vl53l5cx.toml").read_text()),
    "robot": (read_robot, (ROBOT.folder / "robot.toml").read_text()),
    "calibration": (read_calibration, CURVES),
}
EXTREMES = (
    "0", "-1", "1e-300", "1e300", "-1e308", "inf", "-inf", "nan", "9" * 19, "9" * 5000, "0x" + "f" * 5000, "true",
    '""', '"' + "a" * 5000 + '"', '"\\u0000"', "[]", "[[]]", "{}", "[" * 400 + "]" * 400, "{a={a={a=1}}}", "1979-05-27",
    "00:32:00", '"../../../x"', "'tcp'", "[1e200, 1e200, 1e200]", "[0.0, 0.0, 0.0]", "[0.3, 0.1, 0.4, 0.2]",
)  # fmt: skip
values = st.sampled_from(EXTREMES) | st.floats().map(repr) | st.integers().map(str)
VALUE = re.compile(r"(?<== )[^\n#{}]+|-?\d+\.\d+")
#: What tells of the library that checks, and nothing to a person.
PYDANTIC = re.compile(r"Input|Field required|Extra|Value error|discriminator|validation|tag |^(List|Tuple|Dict|String)")
ANY = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


def outcome(kind: str, text: str | bytes, folder: Path) -> Any:
    """What the reader gives, or its named error; anything else is raised."""
    path = folder / f"{kind}.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogateescape"))
    try:
        return READERS[kind][0](path)
    except ConfigurationError as error:
        found = error
    assert not PYDANTIC.search(found.expected)
    return found


@pytest.mark.parametrize("kind", READERS)
def test_the_bundled_ones_are_read(kind: str, tmp_path: Path) -> None:
    assert not isinstance(outcome(kind, READERS[kind][1], tmp_path), ConfigurationError)


@pytest.mark.parametrize("kind", READERS)
def test_an_editors_mark_and_line_ends_change_nothing(kind: str, tmp_path: Path) -> None:
    said = READERS[kind][1]
    lines = said.replace("\n", "\r\n").encode()
    for changed in (codecs.BOM_UTF8 + said.encode(), lines, codecs.BOM_UTF8 + lines):
        assert not isinstance(outcome(kind, changed, tmp_path), ConfigurationError)
        assert toml_table(changed.decode()) == toml_table(said)


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("coding", ["latin-1", "utf-16"])
def test_another_coding_is_named_with_its_line(kind: str, coding: str, tmp_path: Path) -> None:
    found = outcome(kind, ("\n\n# Größe\n" + READERS[kind][1]).encode(coding, "replace"), tmp_path)
    assert isinstance(found, ConfigurationError)
    assert f"not in UTF-8, in line {3 if coding == 'latin-1' else 1}" in str(found)


def test_the_key_that_says_the_kind_is_named(tmp_path: Path) -> None:
    for do, said in (('do = "lien"', "segment[0].do = 'lien': expected one of 'line', 'arc'"), ("", "do = 'nothing'")):
        found = outcome("program", f"[[segment]]\n{do}\nto = 3\n", tmp_path)
        assert said in str(found)
    assert "camera[1].kind = 'scaner': expected one of 'depth'" in str(
        outcome("cameras", CAMERAS.replace('"scanner"', '"scaner"'), tmp_path)
    )


@pytest.mark.parametrize("kind", READERS)
def test_a_mutated_document_is_read_or_refused_by_name(kind: str, tmp_path: Path) -> None:
    text = READERS[kind][1]
    places = [match.span() for match in VALUE.finditer(text)]
    lines = text.splitlines(keepends=True)

    @settings(ANY, max_examples=some(3, of=15) if kind == "robot" else some(6, of=40))
    @given(st.data())
    def check(data: Any) -> None:
        what = data.draw(st.sampled_from(("value", "value", "value", "line", "bytes")))
        if what == "value":
            start, end = data.draw(st.sampled_from(places))
            changed: Any = text[:start] + data.draw(values) + text[end:]
        elif what == "line":
            i, j = (data.draw(st.integers(0, len(lines) - 1)) for _ in range(2))
            changed = "".join(
                data.draw(st.sampled_from((lines[:i] + lines[i + 1 :], lines[:i] + lines[j : j + 1] + lines[i:])))
            )
        else:
            at = data.draw(st.integers(0, len(text)))
            changed = text.encode()
            changed = changed[:at] + data.draw(st.binary(max_size=4)) + changed[at + data.draw(st.integers(0, 4)) :]
        outcome(kind, changed, tmp_path)

    check()


keys = st.sampled_from(("a", "do", "to", "box", "spot", "person", "segment", "points", "joints", '"b c"', "''"))
scalars = st.sampled_from(EXTREMES) | st.text(st.characters(codec="utf-8"), max_size=5).map(lambda s: repr(s))
trees = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4).map(lambda items: f"[{', '.join(items)}]")
        | st.dictionaries(keys, inner, max_size=3).map(
            lambda d: "{" + ", ".join(f"{k} = {v}" for k, v in d.items()) + "}"
        )
    ),
    max_leaves=8,
)
documents = st.lists(
    st.tuples(keys, trees).map(lambda pair: f"{pair[0]} = {pair[1]}")
    | keys.map(lambda k: f"[[{k}]]")
    | keys.map("[{}]".format),
    max_size=8,
).map("\n".join)


@settings(ANY, max_examples=some(8, of=40))
@given(documents | st.text(max_size=60) | st.binary(max_size=60), st.sampled_from(list(READERS)))
def test_a_generated_document_is_read_or_refused_by_name(tmp_path_factory: Any, text: str | bytes, kind: str) -> None:
    outcome(kind, text, tmp_path_factory.getbasetemp())


LONG = LARGEST - 10
BOMBS = {
    "lists in lists": "x = " + "[" * LONG,
    "tables in tables": "x = " + "{a = " * (LONG // 5),
    "a long key": "a." * (LONG // 2) + "a = 1",
    "a long quoted key": '"". ' * (LONG // 4) + "a = 1",
    "a long header": "[" + "a." * (LONG // 2) + "a]",
    "a number of many digits": "x = " + "9" * LONG,
    "a number in base 16": "x = 0x" + "f" * LONG,
    "a word": "w" * LONG,
    "blanks": "[" + " " * LONG,
    "quotes": '"' * LONG,
    "many tables": "[[a]]\n" * 20_000,
    "many keys": "".join(f"k{k} = 1\n" for k in range(20_000)),
    "too large": "#" * (LARGEST + 1),
}


@pytest.mark.parametrize("name", thinned(2, BOMBS))
def test_what_would_take_for_ever_is_refused(name: str, tmp_path: Path) -> None:
    """It ends at all: the time of each once grew with the square of its length, or the reader's stack overflowed."""
    assert isinstance(outcome("cell", BOMBS[name], tmp_path), ConfigurationError)


@given(st.integers(1, DEEPEST + 5))
def test_nesting_is_read_up_to_a_depth(depth: int) -> None:
    for text in ("x = " + "[" * depth + "]" * depth, ".".join("a" * depth) + " = 1"):
        try:
            assert toml_table(text) == tomllib.loads(text)
        except tomllib.TOMLDecodeError:
            assert depth >= DEEPEST


SLOW = (ROOT / "sim/experiments/path/path.toml").read_text()


@settings(ANY, max_examples=some(4, of=25))
@given(st.floats(1e-4, 1e3), st.floats(1e-4, 1e3), st.floats(1e-4, 1e6))
def test_how_slow_a_program_is_does_not_matter(
    tmp_path_factory: Any, speed: float, acceleration: float, jerk: float
) -> None:
    """Any rates at all: as many poses are checked as its way has room for, and what is read has these rates."""
    text = re.sub(r"(?m)^speed = .*", f"speed = {speed!r}", SLOW)
    text = re.sub(r"(?m)^acceleration = .*", f"acceleration = {acceleration!r}", text)
    text = re.sub(r"(?m)^jerk = .*", f"jerk = {jerk!r}", text)
    program = outcome("program", text, tmp_path_factory.getbasetemp())
    if isinstance(program, ConfigurationError):
        assert "needs" in str(program) or "ruckig" in str(program)
        return
    for k in range(50):
        twist = program.sample(program.duration * k / 50).twist
        assert abs(twist[:3]).max() <= speed * (1.0 + 1e-9) + 1e-12


def test_rounds_without_end_are_refused(tmp_path: Path) -> None:
    """Lists whose lengths have no common divisor multiply."""
    vary = "".join(f"v{n} = {['left'] * n}\n" for n in (7, 11, 13, 17, 19, 23))
    found = outcome("program", SLOW.replace("[[segment]]", f"[vary]\n{vary}\n[[segment]]", 1), tmp_path)
    assert isinstance(found, ConfigurationError)
    assert str(MOST_CHECKS) in found.expected


@pytest.mark.parametrize("name", ["a" * 5000, "\0", "a\0b", "." * 300, "a/" * 3000, "\udcff", "", "/dev/null/x", "/"])
def test_absurd_names_are_named_errors(name: str) -> None:
    for read in (load_robot, qpsafe.load_cell, load_story, lambda path: load_program(path, ROBOT), ROBOT.with_spots):
        try:
            found = read(name)  # type: ignore[operator]
        except ConfigurationError:
            continue
        with pytest.raises(ConfigurationError):
            qpsafe.load_spots(found)  # sensors are read when they are wanted
