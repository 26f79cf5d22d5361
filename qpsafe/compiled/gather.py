"""Lanes from the memory of arrays, and back to single numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import make_array

from qpsafe.compiled.lanes import INDEX, LANES, NUMBERS, VECTOR, is_number, spread_over


def gather(rows: Any, first: int, column: int) -> Any:
    """Lanes from the rows of an array.

    Args:
        rows: (n, m), n >= 1.
        first: The row of the first lane; the last row comes again where there are no more.
        column: Of all of them.
    """
    return rows[np.minimum(first + np.arange(LANES), len(rows) - 1), column]


@type_callable(gather)
def _type_of_gather(_: Any) -> Any:
    def of(rows: Any, first: Any, column: Any) -> Any:
        fits = isinstance(rows, types.Array) and rows.ndim == 2 and rows.dtype == types.float64
        return NUMBERS if fits and isinstance(first, types.Integer) and isinstance(column, types.Integer) else None

    return of


@lower_builtin(gather, types.Array, types.Integer, types.Integer)
def _gather(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    kind, *whole = signature.args
    array = make_array(kind)(context, builder, values[0])
    first, column = (context.cast(builder, x, k, types.intp) for x, k in zip(values[1:], whole, strict=True))
    shape, strides = cgutils.unpack_tuple(builder, array.shape), cgutils.unpack_tuple(builder, array.strides)
    last = builder.sub(shape[0], ir.Constant(shape[0].type, 1))
    result = ir.Constant(VECTOR, ir.Undefined)
    start = builder.ptrtoint(array.data, strides[0].type)
    start = builder.add(start, builder.mul(column, strides[1]))
    for k in range(LANES):
        row = builder.add(first, ir.Constant(first.type, k))
        row = builder.select(builder.icmp_signed("<", row, last), row, last)
        place = builder.inttoptr(builder.add(start, builder.mul(row, strides[0])), array.data.type)
        result = builder.insert_element(result, builder.load(place), ir.Constant(INDEX, k))
    return result


def lane(x: Any, k: int) -> float:
    """The number in lane k."""
    return float(x[k])


@type_callable(lane)
def _type_of_lane(_: Any) -> Any:
    return lambda x, k: types.float64 if x is NUMBERS and isinstance(k, types.Integer) else None


@lower_builtin(lane, NUMBERS, types.Integer)
def _lane(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.extract_element(values[0], context.cast(builder, values[1], signature.args[1], types.int32))


def put(x: Any, array: Any, start: int, count: int) -> None:
    """Lanes into an array.

    Args:
        x: The lanes.
        array: (n,), contiguous.
        start: Where in it.
        count: How many of the lanes, all if there are more.
    """
    array[start : start + min(count, LANES)] = x[: min(count, LANES)]


@type_callable(put)
def _type_of_put(_: Any) -> Any:
    def of(x: Any, array: Any, start: Any, count: Any) -> Any:
        fits = isinstance(array, types.Array) and array.layout == "C" and array.dtype == types.float64
        return types.void if x is NUMBERS and fits else None

    return of


@lower_builtin(put, NUMBERS, types.Array, types.Integer, types.Integer)
def _put(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    _, kind, *whole = signature.args
    array = make_array(kind)(context, builder, values[1])
    start, count = (context.cast(builder, x, k, types.intp) for x, k in zip(values[2:], whole, strict=True))
    for k in range(LANES):
        with builder.if_then(builder.icmp_signed(">", count, ir.Constant(count.type, k)), likely=True):
            place = builder.gep(array.data, [builder.add(start, ir.Constant(start.type, k))])
            builder.store(builder.extract_element(values[0], ir.Constant(INDEX, k)), place)
    return context.get_dummy_value()


def spread(x: Any) -> Any:
    """The same number in every lane."""
    return np.full(LANES, x)


@type_callable(spread)
def _type_of_spread(_: Any) -> Any:
    return lambda x: NUMBERS if is_number(x) else None


@lower_builtin(spread, types.Any)
def _lower_spread(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return spread_over(context, builder, signature.args[0], values[0])
