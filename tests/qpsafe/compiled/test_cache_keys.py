"""A kernel's name in numba's cache tells the state of every module whose code, or constant, went into it.

What it does not tell would be loaded from the cache after it was changed. So each kernel's code is walked, through all
it calls, and every module that a name of it comes from has to be among those that the name is made of.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
from collections.abc import Iterator
from functools import cache
from types import CodeType, ModuleType
from typing import Any

import pytest
from numba.core.dispatcher import Dispatcher

from qpsafe.bench.compilation import modules
from qpsafe.compiled import compiled
from qpsafe.compiled.compiled import kernels

pytestmark = pytest.mark.long  # it makes all kernels ready
#: In the name of every kernel.
ALWAYS = {"qpsafe.compiled.compiled", "qpsafe.compiled.memory"}


@cache
def imports(module: str) -> dict[str, tuple[str, str]]:
    """Names that a module imports from ours: where from, and what they are called there."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("qpsafe")
        for alias in node.names
    }


@cache
def assigned(module: str) -> dict[str, set[str]]:
    """Names that a module assigns at its top, and the names that go into their values."""
    found = {}
    for node in ast.parse(inspect.getsource(sys.modules[module])).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            used = {part.id for part in ast.walk(node.value) if isinstance(part, ast.Name)}
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found.update({part.id: used for t in targets for part in ast.walk(t) if isinstance(part, ast.Name)})
    return found


def origins(module: str, name: str) -> Iterator[str]:
    """Modules that a name, and the constants it is made of, come from."""
    while name in imports(module):
        module, name = imports(module)[name]
        if f"{module}.{name}" in sys.modules:
            return
    yield module
    for part in assigned(module).get(name, ()):
        if part != name and (part in imports(module) or part in assigned(module)):
            yield from origins(module, part)


def codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes(constant)


def modules_of(function: Any, seen: set[Any]) -> set[str]:
    """Modules whose code or constants go into a function when it is compiled; what is linked does not."""
    if function in seen:
        return set()
    seen.add(function)
    found, scope, home = {function.__module__}, function.__globals__, function.__module__
    inside = [cell.cell_contents for cell in function.__closure__ or ()]
    for code in codes(function.__code__):
        for name in (name for name in code.co_names if name in scope):
            value = scope[name]
            if id(value) in compiled._linked:
                continue
            if isinstance(value, ModuleType):
                if value.__name__.startswith("qpsafe"):
                    found.add(value.__name__)
                    inside += [vars(value)[part] for part in code.co_names if part in vars(value)]
            elif isinstance(value, Dispatcher):
                inside.append(value)
            elif not callable(value):
                found.update(origins(home, name))
            elif str(getattr(value, "__module__", "")).startswith("qpsafe."):  # taught to numba, or a tuple's class
                found.add(value.__module__)
    for value in inside:
        if isinstance(value, Dispatcher):
            found |= modules_of(value.py_func, seen)
    return found


@pytest.fixture(scope="module")
def all_kernels() -> None:
    for name in modules():
        importlib.import_module(name)


def test_every_name_in_the_cache_tells_all_of_its_code(all_kernels: None) -> None:
    missing = {}
    for kernel, (function, uses) in kernels.items():
        if function.__module__.startswith("qpsafe."):
            told = {*ALWAYS, function.__module__, *(module.__name__ for module in uses)}
            missing[kernel] = sorted(modules_of(function, set()) - told)
    assert len(missing) > 60
    assert {kernel: left for kernel, left in missing.items() if left} == {}


def test_every_name_that_is_linked_tells_all_of_its_code(all_kernels: None) -> None:
    missing = {}
    for name, _, kernel, uses in compiled._linked.values():
        if kernel.py_func.__module__.startswith("qpsafe."):
            told = {*ALWAYS, kernel.py_func.__module__, *(module.__name__ for module in uses)}
            missing[name] = sorted(modules_of(kernel.py_func, set()) - told)
    assert len(missing) > 20
    assert {name: left for name, left in missing.items() if left} == {}
