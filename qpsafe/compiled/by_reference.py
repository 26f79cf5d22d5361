"""Named tuples of arrays, handed to compiled functions by reference.

numba passes a tuple by value: every member of every array is an argument of its own, packed by the caller and unpacked
by the callee. With 20 arrays that is 150 numbers a call, most of what there was to compile. So who makes the tuple puts
it on its stack, and hands on where it is.
"""

from __future__ import annotations

from typing import Any, TypeVar
from zlib import crc32

from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_builtin, lower_getattr_generic, models, register_model, type_callable

T = TypeVar("T")


class Reference(types.Type):
    """Type of a reference to a named tuple; its attributes are those of the tuple."""

    def __init__(self, target: types.NamedTuple) -> None:
        self.target = target
        super().__init__(f"Reference({target.instance_class.__name__}, {crc32(target.name.encode()):08x})")


@register_model(Reference)
class _Pointer(models.OpaqueModel):
    pass


@infer_getattr
class _Attributes(AttributeTemplate):
    key = Reference

    def generic_resolve(self, reference: Reference, name: str) -> Any:
        target = reference.target
        return target.types[target.fields.index(name)] if name in target.fields else None


@lower_getattr_generic(Reference)
def _load(context: Any, builder: Any, reference: Reference, pointer: Any, name: str) -> Any:
    target = reference.target
    index = target.fields.index(name)
    place = builder.bitcast(pointer, context.get_value_type(target).as_pointer())
    value = builder.load(cgutils.gep_inbounds(builder, place, 0, index))
    return impl_ret_borrowed(context, builder, target.types[index], value)


def by_reference(target: T) -> T:
    """The named tuple, for functions that the caller calls; it must not be returned."""
    return target


@type_callable(by_reference)
def _type_of(_: Any) -> Any:
    return lambda target: Reference(target) if isinstance(target, types.NamedTuple) else None


@lower_builtin(by_reference, types.NamedTuple)
def _lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.bitcast(cgutils.alloca_once_value(builder, values[0]), cgutils.voidptr_t)
