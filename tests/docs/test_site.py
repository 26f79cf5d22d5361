"""The site: every public name has a place, docstrings become markup that means the same, no link inside is dead."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import qpsafe

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "docs"))

from site_pages import api, links  # noqa: E402
from site_pages.catalogue import exported, modules, path_of, targets  # noqa: E402
from site_pages.markup import converted, marked, where  # noqa: E402


def docstrings() -> list[tuple[str, str, list[str]]]:
    """(place, text, scopes) of every docstring of the package."""
    found = []
    for module in modules().values():
        path = path_of(module.name)
        file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        tree = ast.parse(file.read_text(encoding="utf-8"))
        owners = {inner: node.name for node in tree.body if isinstance(node, ast.ClassDef) for inner in ast.walk(node)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                scopes = [f"{module.name}.{owners[node]}"] if node in owners else []
                text = ast.get_docstring(node) or ""
                found.append((f"{module.name}:{getattr(node, 'lineno', 1)}", text, [*scopes, module.name]))
    return found


@pytest.mark.slow
def test_every_public_name_has_a_place(tmp_path: Path) -> None:
    """What `import qpsafe` offers has a page each; what any other module has stands on its package's page."""
    api.write(tmp_path)
    assert {path.stem for path in (tmp_path / "qpsafe").iterdir()} == set(qpsafe.__all__) - {"__version__"}
    told = "\n".join(path.read_text(encoding="utf-8") for path in tmp_path.rglob("*.rst"))
    documented = set(re.findall(r"^\.\. (?:auto|py:)\w+:: ([\w.]+)", told, re.MULTILINE))
    names = {f"{module.name}.{name.name}" for module in modules().values() for name in module.names}
    assert len(names) > 1500
    assert {targets()[name] for name in names} <= documented


@pytest.mark.slow
def test_what_is_exported_is_where_the_catalogue_says() -> None:
    for name, module in exported().items():
        assert getattr(qpsafe, name) is getattr(sys.modules[module], name)
        assert name in {item.name for item in modules()[module].names}, f"{name} is not defined in {module}"


@pytest.mark.slow
def test_names_of_the_project_in_docstrings_exist() -> None:
    """A dotted name that begins with `qpsafe.` leads somewhere; a moved module is noticed here."""
    dead: list[tuple[str, str]] = []
    for place, text, scopes in docstrings():
        tokens = re.findall(r"`(qpsafe(?:\.\w+)+)(?:\(\))?`", text)
        ours = (token for token in tokens if not token.startswith(("qpsafe.robots", "qpsafe.cli")))
        dead += [(place, token) for token in ours if where(token, scopes) is None]
    assert dead == []


@pytest.mark.slow
def test_no_docstring_has_links_of_another_tool() -> None:
    assert [
        place for place, text, _ in docstrings() if re.search(r"\]\[[\w.]*\]|:(?:class|func|meth|ref):`", text)
    ] == []


@pytest.mark.slow
def test_backticks_become_links_where_they_name_something() -> None:
    scopes = ["qpsafe.SafetyController", "qpsafe.controller"]
    assert marked("`step` asks", scopes) == ":py:obj:`step <qpsafe.SafetyController.step>` asks"
    assert marked("a `Tick`.", scopes) == "a :py:obj:`Tick <qpsafe.Tick>`."
    assert marked("`--json` and `q + 1`", scopes) == "``--json`` and ``q + 1``"


def test_nothing_else_is_markup() -> None:
    assert marked("|e|² and 2*x and n_ of them", []) == r"\|e\|² and 2\*x and n\_ of them"


@pytest.mark.long
def test_equations_stay_as_they_are() -> None:
    text = ["With", "", "    |q̇| <= a*b", "", "it holds for `x`.", "", "Args:", "    x: Of |x|."]
    assert converted(text, []) == [
        "With", "", "::", "", "    |q̇| <= a*b", "", "it holds for ``x``.", "", "Args:", r"    x: Of \|x\|.",
    ]  # fmt: skip


def test_dead_links_are_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<p id="x"><a href="b.html#y">b</a><a href="#x">x</a><a href="https://c">c</a>')
    (tmp_path / "b.html").write_text('<p id="y"><img src="gone.png"><a href="a.html#z">z</a><a href="a.html">a</a>')
    assert links.dead(tmp_path) == ["b.html: gone.png", "b.html: a.html#z"]


@pytest.mark.slow  # a minute of processor time; `.ci/run` builds it by `make docs`
def test_the_site_builds_without_warnings_and_dead_links(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-j", "auto", "-b", "html"]
    command += ["-d", tmp_path / "trees", ROOT / "docs", tmp_path / "html"]
    built = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert built.returncode == 0, built.stderr
    assert links.dead(tmp_path / "html") == []
    assert (tmp_path / "html" / "searchindex.js").is_file()
