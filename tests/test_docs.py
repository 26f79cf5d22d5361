"""What README and docs say holds: snippets and examples run, links lead somewhere, named commands and files exist."""

from __future__ import annotations

import dataclasses
import re
import shlex
import subprocess
import sys
import types
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer.main

from qpsafe.reference import JointReference
from qpsafe.tick import Tick

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
MADE = ROOT / "docs" / "reference" / "api"  # by `make docs`, from the code
PAGES = [README, *(page for page in sorted((ROOT / "docs").rglob("*.md")) if MADE not in page.parents)]
ALL = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
#: Examples that take an argument to be shorter.
ARGUMENTS = {"compare_to_nullspace.py": ["180"], "mink_evasion.py": ["--steps", "500"]}

FENCE = re.compile(r"^```([\w{}]*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def label(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def fences(page: Path, language: str) -> list[tuple[int, str]]:
    """(first line, text) of every fenced block of one language."""
    text = page.read_text(encoding="utf-8")
    return [(text.count("\n", 0, m.start(2)), m[2]) for m in FENCE.finditer(text) if m[1] == language]


def is_tutorial(page: Path) -> bool:
    """Tutorials run as a whole, in a folder of their own: tests/docs/test_tutorials.py."""
    return page.parent.name == "tutorials"


def inline_code(page: Path) -> list[str]:
    """What stands between single backticks, fenced blocks left out."""
    return re.findall(r"`([^`\n]+)`", FENCE.sub("", page.read_text(encoding="utf-8")))


def anchor(heading: str) -> str:
    """The anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def slow_unless(quick: Callable[[Path], bool], paths: Iterable[Path]) -> list[Any]:
    """Files of a parameter, those that take long marked slow; `.ci/run` runs them after the site is built."""
    return [pytest.param(path, id=label(path), marks=() if quick(path) else pytest.mark.slow) for path in paths]


@pytest.mark.parametrize(
    "page",
    slow_unless(
        lambda page: page == README,
        (page for page in PAGES if fences(page, "python") and not is_tutorial(page)),
    ),
)
def test_snippets_run_in_order(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One fresh namespace per page; errors point to the line of the page."""
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {"__name__": "__main__"}
    for line, code in fences(page, "python"):
        exec(compile("\n" * line + code, str(page), "exec"), names)


def test_the_readme_has_a_snippet_with_the_controller() -> None:
    assert any("SafetyController(" in code for _, code in fences(README, "python"))


@pytest.mark.parametrize("page", ALL, ids=label)
def test_relative_links_and_pictures_exist(page: Path) -> None:
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    dead = []
    for target in LINK.findall(text):
        path, _, fragment = target.partition("#")
        if ":" in path:  # https://…, mailto:…
            continue
        goal = (page.parent / path).resolve() if path else page
        if not goal.exists() or not goal.is_relative_to(ROOT):
            dead.append(target)
        elif fragment:
            headings = re.findall(r"^#+ (.*)$", goal.read_text(encoding="utf-8"), re.MULTILINE)
            if fragment not in map(anchor, headings):
                dead.append(target)
    assert not dead


def test_every_page_is_on_the_index_of_its_kind_and_in_the_contents() -> None:
    home = ROOT / "docs" / "index.md"
    contents = [
        line for _, text in fences(home, "{toctree}") for line in text.splitlines() if re.fullmatch(r"[\w/-]+", line)
    ]
    pages = {page.relative_to(home.parent).with_suffix("").as_posix() for page in PAGES if page not in (home, README)}
    assert sorted(contents) == sorted({*pages, "reference/api/commands", "reference/api/index"})
    for index in home.parent.glob("*/index.md"):
        linked = {
            (index.parent / target.partition("#")[0]).resolve() for target in LINK.findall(index.read_text("utf-8"))
        }
        assert not set(index.parent.glob("*.md")) - linked - {index}, index


def test_every_picture_is_shown_somewhere() -> None:
    shown = {(page.parent / target).resolve() for page in PAGES for target in LINK.findall(page.read_text("utf-8"))}
    assert not set((ROOT / "docs" / "img").iterdir()) - shown


def command_lines(page: Path) -> list[list[str]]:
    """Every `qpsafe ...` of a page, in words: from shell blocks and from code inside the text."""
    lines = [line for _, text in fences(page, "bash") for line in text.splitlines()] + inline_code(page)
    found = (re.match(r"\s*(?:\S*/)?qpsafe (.*)", line) for line in lines)
    return [shlex.split(match[1], comments=True) for match in found if match]


@cache
def commands() -> Any:
    """The whole command line."""
    from qpsafe.cli.main import app

    return typer.main.get_command(app)


@pytest.mark.parametrize("page", ALL, ids=label)
def test_commands_and_their_options_exist(page: Path) -> None:
    """Words in capitals stand for a value; a group's own name without a command is fine."""
    for words in command_lines(page):
        command = commands()
        for word in words:
            subcommands = getattr(command, "commands", {})
            if word not in subcommands and (default := getattr(command, "default", "")):  # no command is named
                command, subcommands = subcommands[default], {}
            if word.startswith("-"):
                options = {name for option in command.params for name in (*option.opts, *option.secondary_opts)}
                assert word.split("=")[0] in options | {"--help", "-h"}, f"qpsafe {' '.join(words)}: {word}"
            elif subcommands:
                assert word in subcommands, f"qpsafe {' '.join(words)}: {word}"
                command = subcommands[word]


def test_the_readme_names_every_command() -> None:
    named = {words[0] for words in command_lines(README) if words}
    assert set(commands().commands) <= named


@pytest.mark.parametrize("page", ALL, ids=label)
def test_make_targets_exist(page: Path) -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    lines = [line for _, text in fences(page, "bash") for line in text.splitlines()] + inline_code(page)
    named = {match[1] for line in lines if (match := re.match(r"\s*make (?:\w+=\S+ )*([a-z-]+)", line))}
    assert named <= targets


@pytest.mark.parametrize("page", ALL, ids=label)
def test_files_named_in_the_text_exist(page: Path) -> None:
    paths = {code for code in inline_code(page) if re.fullmatch(r"[\w.-]+(?:/[\w.-]+)+\.(?:py|md|toml|xml|yml)", code)}
    assert not {path for path in paths if not (ROOT / path).exists()}


def test_every_field_of_a_tick_is_explained() -> None:
    page = " ".join(inline_code(ROOT / "docs" / "reference" / "controller.md"))
    names = [field.name for kind in (Tick, JointReference) for field in dataclasses.fields(kind)]
    names += [name for name, value in vars(Tick).items() if isinstance(value, property)]
    assert not [name for name in names if not re.search(rf"\b{name}\b", page)]


def run_as_main(code: str, path: Path, arguments: Sequence[str], monkeypatch: pytest.MonkeyPatch) -> object:
    """Exit code of a script that is run as the main module in a fresh namespace, without starting Python anew.

    It is registered as `__main__` meanwhile: what a script defines may be looked up there.
    """
    main = types.ModuleType("__main__")
    main.__file__ = str(path)
    with monkeypatch.context() as patch:
        patch.chdir(ROOT)
        patch.setattr(sys, "argv", [str(path), *arguments])
        patch.setitem(sys.modules, "__main__", main)
        try:
            exec(compile(code, str(path), "exec"), vars(main))
        except SystemExit as end:
            return end.code or 0
    return 0


@pytest.mark.parametrize("example", slow_unless(lambda path: path.name == "hello_controller.py", EXAMPLES))
def test_examples_run_and_say_something(
    example: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = example.read_text(encoding="utf-8")
    assert len(code.splitlines()) <= 40
    assert run_as_main(code, example, ARGUMENTS.get(example.name, []), monkeypatch) == 0
    assert capsys.readouterr().out.strip()


@pytest.mark.slow
def test_an_example_runs_in_a_python_of_its_own() -> None:
    command = [sys.executable, "examples/hello_controller.py"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=300)
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip()


def test_the_comparison_exits_with_1_above_its_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    example = ROOT / "examples" / "compare_to_nullspace.py"
    code = example.read_text(encoding="utf-8")
    strict = code.replace("TOLERANCE = 1e-8", "TOLERANCE = 0.0")  # rounding alone exceeds this
    assert strict != code
    assert run_as_main(strict, example, ["36"], monkeypatch) == 1
