"""Only a key can be a long one, wherever dots stand; only a newline ends a line, whatever else a text holds."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from amounts import some, thinned
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict

from qpsafe.errors import ConfigurationError, RobotFileError
from qpsafe.robot.robot_file.schema import read_robot_file
from qpsafe.text.lines import key_lines, toml_lines
from qpsafe.text.toml_parse import DEEPEST, LARGEST, toml_table
from qpsafe.text.toml_text import TomlText

DOTS = "1.2.3.4.5.6.7.8.9.10.11.12"
QUOTES = ('"', "'", '"""', "'''")
#: What stands in comments and strings: dots and all that a reader may take for the end or the start of something.
inside = st.lists(
    st.sampled_from(
        (DOTS, DOTS.replace(".", " . "), '"', "'", '""', "''", "#", "=", "[", "\\", "\\\\", "\\n", " ", "a")
    ),
    max_size=8,
).map("".join)


def written(kind: str, content: str) -> str:
    """A comment, or a string of some kind, with this content as far as the kind can hold it."""
    if kind == "#":
        return f"x = 1 # {content}"
    if kind in ("'", "'''"):
        content = content.replace("'", "")
    else:
        content = content.replace("\\", "\\\\").replace('"', '\\"' if kind == '"' else '"\\"').replace('""', '"\\"')
        content += "\\\\" if content.endswith('"') else ""
    return f"x = {kind}{content}{kind}"


lines = st.builds(written, st.sampled_from(("#", *QUOTES)), inside)


@settings(max_examples=some(30, of=300))
@given(st.lists(lines, min_size=1, max_size=5))
def test_dots_in_comments_and_strings_are_nothing(said: list[str]) -> None:
    text = "".join(line.replace("x =", f"x{k} =", 1) + "\n" for k, line in enumerate(said))
    assert toml_table(text) == tomllib.loads(text)


@pytest.mark.parametrize("closing", ['"""', '""""', '"""""'])
@pytest.mark.parametrize("content", [DOTS, f'""{DOTS}', f"\\\n{DOTS}", f'\\""" {DOTS}', f"# {DOTS}", f"''' {DOTS}"])
def test_strings_of_many_lines_end_where_they_end(content: str, closing: str) -> None:
    text = f'x = """{content}{closing}\ny = """\n{content}"""'
    assert toml_table(text) == tomllib.loads(text)
    with pytest.raises(tomllib.TOMLDecodeError, match="more than 10 parts"):
        toml_table(f"{text}\n{'.'.join('a' * 11)} = 1")


@settings(max_examples=some(30, of=300))
@given(
    st.lists(lines, max_size=3),
    st.lists(st.sampled_from(("a", "b-c", "1", '"d.e"', "'f # g'", '"\\""', '"# h"', '""')), min_size=1, max_size=15),
    st.sampled_from((".", " . ", "\t.")),
    st.sampled_from(("{} = 1", "[{}]", "[[{}]]", "k = {{{} = 1}}", "k = [{{b = 1, {} = 1}}]", "  {} = '.' # .")),
)
def test_a_key_of_too_many_parts_is_refused_wherever_it_stands(
    before: list[str], parts: list[str], dot: str, place: str
) -> None:
    text = "".join(line.replace("x =", f"x{k} =", 1) + "\n" for k, line in enumerate(before))
    text += place.format(dot.join(parts))
    if len(parts) > DEEPEST:
        with pytest.raises(
            tomllib.TOMLDecodeError, match=f"more than {DEEPEST} parts .at line {text.count(chr(10)) + 1}"
        ):
            toml_table(text)
    elif len(parts) < DEEPEST - 2:
        assert toml_table(text) == tomllib.loads(text)


N = LARGEST // 8
SLOW = {
    "a key behind a comment": f"# {DOTS}\n" + "a." * N + "a = 1",
    "a key behind a string": f'x = """\n{DOTS}"""\n' + "a." * N + "a = 1",
    "quotes that are escaped": 'x = "' + '\\"' * N,
    "a string of many lines that never ends": 'x = """' + '\\"""' * N + "\\",
    "the other one": "x = '''" + "''a" * N,
    "short keys": "a.b.c.d.e.f.g.h.i.j," * (N // 4),
    "short quoted keys": '"a"."b"."c"."d"."e",' * (N // 4),
    "a part that never ends": "a . " + '"' + '\\"' * N,
    "blanks around dots": ("a" + " " * 1000 + ".") * 9 + " " * N,
    "comments": "#\n" * N + '"',
}


@pytest.mark.parametrize("name", thinned(2, SLOW))
def test_no_text_takes_a_time_that_grows_with_its_square(name: str) -> None:
    """It ends at all: most would take hours."""
    with pytest.raises(tomllib.TOMLDecodeError):
        toml_table(SLOW[name])


#: All that Unicode, or `str.splitlines`, takes for the end of a line, and TOML takes for a letter or refuses.
ENDS = "\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"
LETTERS = [letter for letter in ENDS if letter in "\x85\u2028\u2029"]


class Said(BaseModel):
    """A file that may say this."""

    model_config = ConfigDict(extra="forbid", strict=True)
    a: str = ""
    size: float = 0.0


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@given(st.text(st.sampled_from([*LETTERS, "a", " "]), max_size=6))
def test_an_error_names_the_line_that_an_editor_shows(end: str, letters: str) -> None:
    for before in (f"# {letters}", f'a = "{letters}"', f"a = '''{letters}{end}{letters}'''"):
        line = before.count("\n") + 3
        for wrong, key in ((f"size = 'x'{end}", "size"), ("size = ", "file"), (f"size = {end}", "file")):
            text = TomlText(f"{before}{end}# b{letters}{end}{wrong}", "x.toml")
            with pytest.raises(ConfigurationError) as refused:
                text.checked(Said)
            assert (refused.value.where, refused.value.key) == (f"x.toml:{line}", key)


@pytest.mark.parametrize("letter", LETTERS)
@pytest.mark.parametrize("wrong", ["lower = = 3", "lower = "])
def test_a_robots_file_that_is_no_toml_is_quoted_at_the_line_that_is_wrong(
    letter: str, wrong: str, tmp_path: Path
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f'# a{letter}b{letter}c\nname = "{letter}"\n{wrong}', encoding="utf-8")
    with pytest.raises(RobotFileError) as refused:
        read_robot_file(path)
    assert (refused.value.key, refused.value.value) == ("line 3", wrong.strip())


@given(st.lists(st.sampled_from([*ENDS, "\n", "\r\n", "a = 1", "# "]), max_size=12).map("".join))
def test_lines_are_those_between_newlines(text: str) -> None:
    found = toml_lines(text)
    assert "\n".join(found) == text.replace("\r\n", "\n").removesuffix("\n")
    assert all(1 <= line <= len(found) for line in key_lines(text).values())
