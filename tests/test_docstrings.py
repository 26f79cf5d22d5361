"""Whoever calls a public function of three or more parameters reads what each of them is."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = [path for top in ("qpsafe", "tasks", "sim") for path in sorted((ROOT / top).rglob("*.py"))]

Function = ast.FunctionDef | ast.AsyncFunctionDef


def public(tree: ast.AST) -> Iterator[tuple[Function, ast.ClassDef | None]]:
    """Public functions of a module, and methods of its public classes with their class."""
    for node in tree.body:  # type: ignore[attr-defined]
        if isinstance(node, Function) and not node.name.startswith("_"):
            yield node, None
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for inner in node.body:
                if isinstance(inner, Function) and (inner.name == "__init__" or not inner.name.startswith("_")):
                    yield inner, node


def parameters(function: Function, method: bool) -> list[str]:
    """Names of what a caller gives."""
    given = function.args
    names = [
        item.arg for item in (*given.posonlyargs, *given.args, given.vararg, *given.kwonlyargs, given.kwarg) if item
    ]
    static = any(ast.unparse(item) == "staticmethod" for item in function.decorator_list)
    return names[1:] if method and not static else names


def is_kernel(function: Function) -> bool:
    """Compiled code: its blocks are described where they are laid out."""
    return any(re.match(r"(inline|entry)\b", ast.unparse(item)) for item in function.decorator_list)


def is_command(function: Function) -> bool:
    """A command: its options carry their own help."""
    return re.search(r"\b(Option|Argument)\(", ast.unparse(function.args)) is not None


def section(text: str, title: str) -> set[str]:
    """Names that a section of a docstring explains."""
    found = re.search(rf"^{title}:\n((?:    .*\n|\n)+)", text + "\n", re.MULTILINE)
    heads = [] if found is None else re.findall(r"^    ([\w*, ]+):", found[1], re.MULTILINE)  # "q, qd: ..." is two
    return {name for head in heads for name in re.findall(r"\w+", head)}


def explained(function: Function, owner: ast.ClassDef | None) -> set[str]:
    """Names that docstrings explain; those of a constructor stand in its class, too, be it as attributes."""
    names = section(ast.get_docstring(function) or "", "Args")
    if owner is not None and function.name == "__init__":
        text = ast.get_docstring(owner) or ""
        names |= section(text, "Args") | section(text, "Attributes")
    return names


def unexplained(path: Path) -> dict[str, set[str]]:
    """Functions of a module that keep parameters to themselves."""
    found = {}
    for function, owner in public(ast.parse(path.read_text(encoding="utf-8"))):
        names = parameters(function, owner is not None)
        if len(names) >= 3 and not is_kernel(function) and not is_command(function):
            missing = set(names) - explained(function, owner)
            if missing:
                found[f"{path.relative_to(ROOT)}: {owner.name + '.' if owner else ''}{function.name}"] = missing
    return found


def test_every_parameter_of_many_is_explained() -> None:
    assert len(FILES) > 250
    assert {name: missing for path in FILES for name, missing in unexplained(path).items()} == {}


@pytest.mark.slow
def test_no_parameter_is_explained_that_is_not_there() -> None:
    stale = {}
    for path in FILES:
        for function, owner in public(ast.parse(path.read_text(encoding="utf-8"))):
            gone = section(ast.get_docstring(function) or "", "Args") - set(parameters(function, owner is not None))
            if gone:
                stale[f"{path.relative_to(ROOT)}: {function.name}"] = gone
    assert stale == {}


@pytest.mark.parametrize(
    "text",
    [
        "def f(a, b, *, c):\n    {doc}\n",
        "class A:\n    def f(self, a, b, c):\n        {doc}\n",
        "class A:\n    {doc}\n    def __init__(self, a, b, c):\n        pass\n",
    ],
)
def test_this_test_sees_what_is_missing(text: str) -> None:
    tree = ast.parse(text.format(doc=repr("Do.\n\nArgs:\n    a: One.\n    c: Two, of b:\n")))
    ((function, owner),) = public(tree)
    assert set(parameters(function, owner is not None)) - explained(function, owner) == {"b"}
