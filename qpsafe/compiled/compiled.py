"""What compiled code shares: how it is compiled, how arrays reach it, and vectors as tuples, kept in registers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from inspect import Parameter, Signature, signature
from pathlib import Path
from threading import Timer
from time import perf_counter, process_time
from types import ModuleType
from typing import Any
from zlib import crc32

import numba
import numpy as np
from llvmlite import binding as llvm
from numba import types
from numba.core import cgutils, event
from numba.extending import intrinsic
from numpy.typing import ArrayLike, NDArray

from qpsafe.compiled import memory
from qpsafe.errors import ConfigurationError

Vector = tuple[float, float, float]
Array = NDArray[np.float64]

# 1/0 = inf as in C; no fastmath, NaN must come through. Without reference counting (`_nrt`), whose atomic counters cost
# more than the arithmetic here: compiled code may not allocate.
OPTIONS = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}
inline = numba.njit(no_cpython_wrapper=True, **OPTIONS)
"""Decorator of functions that only compiled code calls."""

PATIENCE = 1.5  # seconds of compiling that pass without a word: one changed kernel takes less
NOTICE = "qpsafe: compiling for this machine, once, takes about a minute ..."


class _Watch(event.Listener):
    """How long compiling takes, and who is told. numba's event comes for what is not in its cache, so that loading,
    which may be slow on a busy machine, is never called compiling.
    """

    def __init__(self) -> None:
        self.compiling, self.begin, self.told = 0.0, 0.0, False
        self.depth = 0  # a kernel's inner functions are compiled inside its own compilation
        self.timer: Timer | None = None

    def tell(self) -> None:
        """Say, once, what is happening."""
        self.told = True
        print(NOTICE, file=sys.stderr, flush=True)

    def on_start(self, _: event.Event) -> None:
        """Tell if compiling will have taken longer than `PATIENCE`, what was compiled before included."""
        self.depth += 1
        if self.depth == 1 and not self.told:
            self.begin, self.timer = perf_counter(), Timer(max(PATIENCE - self.compiling, 0.0), self.tell)
            self.timer.daemon = True
            self.timer.start()

    def on_end(self, _: event.Event) -> None:
        """Stop the clock."""
        self.depth -= 1
        if self.depth == 0 and self.timer is not None:
            self.timer.cancel()
            self.timer = None
            self.compiling += perf_counter() - self.begin

    @contextmanager
    def over(self, kernel: str) -> Iterator[None]:
        """Make a kernel ready under watch."""
        used = process_time()
        try:
            with event.install_listener("numba:compile", self):
                yield
        finally:
            seconds[kernel] = process_time() - used


_watch = _Watch()
seconds: dict[str, float] = {}
"""Processor time [s] that compiling each kernel, or loading it from the cache, took in this process."""


kernels: dict[str, tuple[Callable[..., Any], tuple[ModuleType, ...]]] = {}
"""Each kernel's function, and the other modules that its name in the cache tells the state of."""


def entry(
    types_: Any, *uses: ModuleType, nogil: bool = False, python: bool = True
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile for one signature at import, from numba's cache where this machine has a place for one.

    Args:
        types_: Types of arguments and result.
        uses: Other modules whose compiled code goes into this one, beside this and `memory`. numba's cache notices
            changes of the entry's own file only; so the name it is kept under tells the state of these, and what was
            linked in them and in its own. Code in the cache that calls what is not there any more ends the process.
        nogil: Whether other threads may run meanwhile; memory that is handed in must then be the thread's own.
        python: Whether Python calls it; else only other compiled code does, by `linked`.
    """
    options = {**OPTIONS, "nogil": nogil, "no_cpython_wrapper": not python}

    def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
        kernel = f"{function.__module__}.{function.__name__}"
        kernels[kernel] = function, uses
        scopes = (function.__globals__, *map(vars, uses))
        calls = sorted({_linked[id(one)][0] for scope in scopes for one in scope.values() if id(one) in _linked})
        state = crc32(" ".join(calls).encode(), checksum(sys.modules[__name__], memory, *uses))
        function.__qualname__ += f"_{state:08x}"
        with _watch.over(kernel):
            try:
                return numba.njit(types_, cache=True, **options)(function)
            except RuntimeError:  # no directory that numba may write to
                return numba.njit(types_, **options)(function)

    return compiled


#: Where what was linked stands -> its name; itself, which stays where it is; the kernel, and what its name tells.
_linked: dict[int, tuple[str, Any, Any, tuple[ModuleType, ...]]] = {}


def linked(compiled: Any, *uses: ModuleType) -> Callable[..., Any]:
    """What `entry` compiled, for other compiled code: called at its address, not compiled into the caller once more.

    numba itself would link and optimise the callee's code again in every caller, which takes as long as compiling it.

    Args:
        compiled: A compiled function of one signature.
        uses: Modules whose code is in it, as for `entry`. Callers in the cache ask for it by a name that tells the
            state of these and of its own.
    """
    if numba.config.DISABLE_JIT:
        return compiled
    function = compiled.py_func
    name = f"qpsafe_{function.__name__}_{checksum(sys.modules[function.__module__], *uses):08x}"
    (result,) = compiled.overloads.values()
    own = result.signature
    llvm.add_symbol(name, result.library.get_pointer_to_function(result.fndesc.llvm_func_name))

    def call(typing_context: Any, *given: Any) -> Any:
        def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
            convention = context.call_conv
            declared = convention.get_function_type(own.return_type, own.args)
            code = cgutils.get_or_insert_function(builder.module, declared, name)
            return convention.call_function(builder, code, own.return_type, own.args, values)[1]

        return own, generate

    context = Parameter("typing_context", Parameter.POSITIONAL_OR_KEYWORD)
    call.__signature__ = Signature([context, *signature(function).parameters.values()])  # type: ignore[attr-defined]
    made = intrinsic(call)
    _linked[id(made)] = name, made, compiled, uses
    return made


def checksum(*modules: ModuleType) -> int:
    """Of the sources of modules."""
    return crc32(b"".join(_source(str(module.__file__)) for module in modules))


@cache
def _source(path: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError:  # installed without sources
        return b""


def readable(ndim: int) -> Any:
    """Type of a float64 array to read: any strides, read-only or not, so that nothing is compiled a second time."""
    return types.Array(types.float64, ndim, "A", readonly=True)


def rows(array: ArrayLike, name: str, count: int | None = None) -> Array:
    """Return the array as an aligned float64 array of shape (count, 3); compiled code itself does not check.

    Args:
        array: (n, 3); an empty list stands for no rows.
        name: what a person calls it, for the error.
        count: the n that is expected; any if None.

    Raises:
        ConfigurationError: the shape is another.
    """
    checked = np.asarray(array, dtype=np.float64)
    if checked.shape == (0,):
        checked = checked.reshape(0, 3)
    if checked.ndim != 2 or checked.shape[1] != 3 or (count is not None and checked.shape[0] != count):
        raise ConfigurationError("danger field", name, checked.shape, f"shape ({'n' if count is None else count}, 3)")
    return checked if checked.flags.aligned else checked.copy()


@inline
def dot(a: Vector, b: Vector) -> float:
    """Return a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def scale(s: float, a: Vector) -> Vector:
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@inline
def add(a: Vector, s: float, b: Vector) -> Vector:
    """Return a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@inline
def row(a: Array, i: int) -> Vector:
    """Return row i of an (n, 3) array."""
    return a[i, 0], a[i, 1], a[i, 2]
