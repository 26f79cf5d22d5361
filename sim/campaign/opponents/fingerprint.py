"""A digest of a function that makes controllers: what it does, and what it was given, whatever process it is in.

Two makers that are registered under one name are told apart by their compiled code, defaults, the values that they
close over, and the functions, classes and values of their own module that they use. What belongs to an installed
package counts by its name.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping, Set
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from qpsafe.errors import ConfigurationError

_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis))
_INSTALLED = tuple(sysconfig.get_path(key) + os.sep for key in ("stdlib", "platstdlib", "purelib", "platlib"))
#: Of a class, what says nothing about what its objects do.
_ASIDE = {"__dict__", "__weakref__", "__doc__", "__module__", "__annotations__", "__firstlineno__"}


def fingerprint(name: str, maker: Any) -> str:
    """64 hexadecimal digits that stand for a maker.

    Args:
        name: Under which it is registered, for the error.
        maker: The function.

    Raises:
        ConfigurationError: It holds something that cannot be told from another of its kind.
    """
    found = hashlib.sha256()
    try:
        for word in _words(maker, {}):
            found.update(word.encode("utf-8", "surrogatepass") + b"\n")
    except (_UnknownError, RecursionError) as unknown:
        expected = f"a maker whose trials can be kept; it holds {unknown}, which no later process can tell from another"
        raise ConfigurationError("campaign", "controllers", name, expected) from None
    return found.hexdigest()


class _UnknownError(Exception):
    """Something that has no words."""


class _Word(str):
    """Stands for itself."""

    __slots__ = ()


def _words(value: Any, seen: dict[int, Any]) -> Iterator[str]:
    """A value in words, the same in every process.

    Args:
        value: The value.
        seen: What was met before, by identity: it counts once, and circles end.
    """
    if isinstance(value, _PLAIN):
        yield repr(value)
    elif id(value) in seen:
        yield "again"
    else:
        seen[id(value)] = value  # kept: no other object gets its identity
        yield type(value).__qualname__
        for part in _parts(value):
            yield from [part] if isinstance(part, _Word) else _words(part, seen)


def _parts(value: Any) -> Iterable[Any]:
    """What a value consists of."""
    if isinstance(value, ModuleType | FunctionType | type) and _is_installed(value):
        return [_Word(f"{getattr(value, '__module__', '')} {getattr(value, '__qualname__', value.__name__)}")]
    if isinstance(value, ModuleType):
        return [value.__name__, value.__file__ and hashlib.sha256(Path(value.__file__).read_bytes()).hexdigest()]
    if isinstance(value, FunctionType):
        used = sorted(_names(value.__code__) & value.__globals__.keys())
        held = [cell.cell_contents for cell in value.__closure__ or ()]
        return [value.__code__, value.__defaults__, value.__kwdefaults__, held, *(value.__globals__[k] for k in used)]
    if isinstance(value, CodeType):
        names = (value.co_names, value.co_varnames, value.co_freevars, value.co_consts)
        return [value.co_code, getattr(value, "co_exceptiontable", b""), *names]
    if isinstance(value, MethodType):
        return [value.__func__, value.__self__]
    if isinstance(value, functools.partial):
        return [value.func, value.args, value.keywords]
    if isinstance(value, np.ndarray) and value.dtype != object:
        return [value.dtype.str, value.shape, value.tobytes()]
    if isinstance(value, type):
        return [*value.__bases__, *(part for key, part in sorted(vars(value).items()) if key not in _ASIDE)]
    if isinstance(value, property | staticmethod | classmethod):
        return [getattr(value, key, None) for key in ("fget", "fset", "__func__")]
    if isinstance(value, Mapping):
        return [part for pair in value.items() for part in pair]
    if isinstance(value, Set):
        return sorted(value, key=repr)
    if isinstance(value, list | tuple):
        return value
    if isinstance(getattr(value, "py_func", None), FunctionType):  # compiled by numba
        return [value.py_func]
    return _reduced(value)


def _reduced(value: Any) -> list[Any]:
    """What `pickle` would write of an object: class, arguments, state, items."""
    try:
        made = value.__reduce_ex__(4)
        if isinstance(made, str):
            return [_Word(made)]
        return [type(value), *(list(part) if isinstance(part, Iterator) else part for part in made)]
    except Exception:  # whatever a stranger's class raises
        raise _UnknownError(f"a {type(value).__qualname__}") from None


def _is_installed(value: Any) -> bool:
    """Whether a part belongs to qpsafe, to Python or to an installed package, not to the user's own work."""
    module = value if isinstance(value, ModuleType) else sys.modules.get(value.__module__)
    if module is None or module.__name__ == "__main__":
        return False
    file = getattr(module, "__file__", None)
    return file is None or module.__name__.partition(".")[0] == "qpsafe" or str(file).startswith(_INSTALLED)


def _names(code: CodeType) -> set[str]:
    """Names that code looks up, those of functions inside it too."""
    inner = (part for part in code.co_consts if isinstance(part, CodeType))
    return {*code.co_names}.union(*map(_names, inner))
