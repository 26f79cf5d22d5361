"""Whatever name stands in a plan, and whatever a user's module does when imported, is taken or refused by name."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.digests import file_name_of
from qpsafe.sim.campaign.opponents.registry import names, opponent
from qpsafe.sim.campaign.plan import Plan, load_plan
from qpsafe.sim.campaign.trials.station import station

LONG = ["ä" * 200, "a" * 200, "a/" * 100, "ä" * 190 + ".toml", "\\u0000", "a\\u0000.toml", "/dev/null/x", "." * 200]
KEYS = ["robot", "people", "cell", "motions", "controllers"]


def plan_of(key: str, name: str, folder: Path) -> Plan:
    file = folder / "plan.toml"
    file.write_text(f"# a plan\n{key} = " + (f'["{name}"]' if key in ("motions", "controllers") else f'"{name}"'))
    return load_plan(file)


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("name", LONG)
def test_a_name_that_no_file_can_have_is_refused_by_name(key: str, name: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=rf"plan\.toml:2: {key} = "):
        plan_of(key, name, tmp_path)


@pytest.mark.parametrize("key", ["people", "cell", "motions"])
@pytest.mark.parametrize("name", ["ä" * 5000, "\0", "a\0.toml", "a/" * 3000 + ".toml", "\udcff.toml"])
def test_a_plan_made_in_python_refuses_it_too(key: str, name: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        Plan(**{key: (name,) if key == "motions" else name})  # type: ignore[arg-type]
    assert refused.value.key == key


PLACES = ("./x:Y", ":f", ":", "::", ".:f", "..x:f", "x..y:f", " :f", "/:f", "/.py:f", ".py:f", "json:", "json:no",
          "a:b:c", "json:__doc__", "json.no:f", "\0:f", "\0.py:f", "ä" * 5000 + ":f", "ä" * 5000 + ".py:f",
          "\ud800:f")  # fmt: skip


@pytest.mark.parametrize("ending", ["", "_perfect_sight"])
@pytest.mark.parametrize("place", PLACES)
def test_a_place_without_a_controller_is_refused_by_name(place: str, ending: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        opponent(place + ending)
    assert refused.value.key == "controllers"
    assert "module:function" in refused.value.expected or "a function" in refused.value.expected


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(st.characters(codec="utf-8") | st.sampled_from("./:\0"), max_size=12))
def test_any_place_is_refused_by_name(place: str) -> None:
    with pytest.raises(ConfigurationError):
        opponent(f"{place}:no such function")


RAISED = ("import no_such_module", "1 / 0", "raise SystemExit(3)", "import sys; sys.exit()", "raise GeneratorExit",
          "class Odd(BaseException):\n    def __str__(self): return 1 / 0\nraise Odd", "raise MemoryError", "x = = 3",
          "raise AssertionError", "def f(): return f()\nf()", "raise StopIteration", "x = '\0'",
          "def __getattr__(name): raise RuntimeError(name)",
          "import warnings; warnings.warn('odd')\nmake = 3")  # fmt: skip


@pytest.mark.parametrize("source", RAISED)
@pytest.mark.parametrize("how", ["file", "module"])
@pytest.mark.filterwarnings("ignore:odd")
def test_a_module_that_raises_anything_is_refused_by_name(
    source: str, how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"odd_{RAISED.index(source)}"
    (tmp_path / f"{name}.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    place = f"{tmp_path / name}.py:make" if how == "file" else f"{name}:make"
    with pytest.raises(ConfigurationError, match="controllers"):
        plan_of("controllers", place, tmp_path)
    sys.modules.pop(name, None)


def test_who_interrupts_an_import_is_heard(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text("raise KeyboardInterrupt")
    with pytest.raises(KeyboardInterrupt):
        opponent(f"{tmp_path / 'slow.py'}:make")


@pytest.mark.parametrize("said", ['""', '"  \\n "', "3", "None", '"""One.\n\nMore."""'])
def test_a_controller_is_described_whatever_its_docstring_is(said: str, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(f"def make(station): ...\nmake.__doc__ = {said}\n")
    found = opponent(f"{tmp_path / 'mine.py'}:make")
    assert found.sentence == ("One." if "One" in said else "a controller of the user's")


@given(st.lists(st.text(st.characters(codec="utf-8") | st.sampled_from("./-:_ "), min_size=1, max_size=8), unique=True))
def test_two_controllers_have_two_files(names: list[str]) -> None:
    """On disks that know capitals from small letters, or not."""
    words = [file_name_of(name) for name in (*names, "a/b.py:f", "a-b.py:f", "x" * 300, "x" * 301)]
    assert len(set(words)) == len(words)
    assert all(re.fullmatch(r"[\w.][\w.-]{0,120}", word) and word.strip(".") for word in words)


def test_bundled_controllers_have_the_files_that_they_had() -> None:
    for name in names():
        assert file_name_of(name) == name
        assert file_name_of(f"{name}_perfect_sight") == f"{name}_perfect_sight"


@pytest.mark.parametrize("name", ["ä" * 5000, "\0", "/dev/null/x", "a/" * 3000 + ".toml"])
def test_a_motion_that_no_file_can_be_called_is_refused_by_its_station(name: str) -> None:
    with pytest.raises(ConfigurationError, match="motions"):
        station("irb140", name)
