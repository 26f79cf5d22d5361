"""Arrays in the memory of another array, for compiled code: what slices and `reshape` make, at a fraction of the code.

A slice in numba looks after negative, missing and too large bounds; for the dozens of arrays that kernels cut from
their workspaces that is most of the code there is to compile. Nothing is checked here.
"""

from __future__ import annotations

from math import prod
from typing import Any

from numba import types
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import make_array, populate_array


def view(block: Any, start: int, shape: tuple[int, ...]) -> Any:
    """An array of the given shape in the memory of a contiguous one, from its element `start` on.

    Args:
        block: A contiguous array.
        start: Place of the first element in it.
        shape: Of the result.
    """
    return block.reshape(-1)[start : start + prod(shape)].reshape(shape)


@type_callable(view)
def _type_of(_: Any) -> Any:
    def of(block: Any, start: Any, shape: Any) -> Any:
        if isinstance(block, types.Array) and block.layout == "C" and isinstance(shape, types.BaseTuple):
            return block.copy(ndim=len(shape))
        return None

    return of


@lower_builtin(view, types.Array, types.Integer, types.BaseTuple)
def _lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    source_type, start_type, shape_type = signature.args
    source = make_array(source_type)(context, builder, values[0])
    target = make_array(signature.return_type)(context, builder)
    start = context.cast(builder, values[1], start_type, types.intp)
    shape = [
        context.cast(builder, builder.extract_value(values[2], i), kind, types.intp)
        for i, kind in enumerate(shape_type.types)
    ]
    strides = [source.itemsize]
    for extent in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], extent))
    data = builder.gep(source.data, [start])
    populate_array(target, data, shape, strides, source.itemsize, source.meminfo, source.parent)
    return target._getvalue()
