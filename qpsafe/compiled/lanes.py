"""Several numbers side by side in one register, for compiled code that does the same to many: `LANES` at a time.

A formula that is written with the operators and functions of this module works on numbers and on lanes alike, and gives
the same bits for each: lanes do not mix. Where numbers would branch, lanes choose: `where(condition, a, b)`, whose two
sides are both computed. What is rarely needed stands behind `if anywhere(condition):`.

Explicit lanes, since LLVM does not find them by itself in formulas of hundreds of operations with logarithms in them.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, models, register_model, type_callable

#: How many.
LANES = 8

VECTOR = ir.VectorType(ir.DoubleType(), LANES)
INDEX = ir.IntType(32)


class _Kind(types.Type):
    """Type of lanes of numbers, or of truth values."""


NUMBERS, FLAGS = _Kind("lanes of numbers"), _Kind("lanes of truth values")


class _Numbers(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        held = ir.DoubleType() if kind is NUMBERS else ir.IntType(1)
        super().__init__(manager, kind, ir.VectorType(held, LANES))


register_model(_Kind)(_Numbers)


def spread_over(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """The same number, or truth value, in every lane; for code that makes code.

    Args:
        context, builder: numba's.
        kind: Type of the value; lanes stay as they are.
        value: In LLVM.
    """
    if isinstance(kind, _Kind):
        return value
    scalar = types.boolean if isinstance(kind, types.Boolean) else types.float64
    value = context.cast(builder, value, kind, scalar)
    if scalar is types.boolean:
        value = builder.trunc(value, ir.IntType(1)) if value.type.width > 1 else value
    nothing = ir.Constant(ir.VectorType(value.type, LANES), ir.Undefined)
    one = builder.insert_element(nothing, value, ir.Constant(INDEX, 0))
    return builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(INDEX, LANES), [0] * LANES))


_Both = (NUMBERS, NUMBERS), (NUMBERS, types.Number), (types.Number, NUMBERS)


def is_number(kind: Any) -> bool:
    """Whether a type is one of numbers, single ones or lanes."""
    return kind is NUMBERS or isinstance(kind, types.Float | types.Integer)


def _binary(operation: Any, result: Any, instruction: str, *how: str, kinds: Any = _Both) -> None:
    """Teach numba what an operator does to two lanes, or to lanes and a number.

    Args:
        operation: The operator.
        result: Kind of what it makes.
        instruction: Of llvmlite's builder, that does so.
        how: What that takes before the operands.
        kinds: Of the operands.
    """

    @type_callable(operation)
    def _type_of(_: Any) -> Any:
        def of(a: Any, b: Any) -> Any:
            own = kinds[0][0]
            if own not in (a, b):
                return None
            fits = is_number if own is NUMBERS else (lambda kind: kind is FLAGS or isinstance(kind, types.Boolean))
            return result if fits(a) and fits(b) else None

        return of

    for pair in kinds:

        @lower_builtin(operation, *pair)
        def _lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            a, b = (spread_over(context, builder, *one) for one in zip(signature.args, values, strict=True))
            return getattr(builder, instruction)(*how, a, b)


for _operation, _name in ((operator.add, "fadd"), (operator.iadd, "fadd"), (operator.sub, "fsub"),
                          (operator.isub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv")):  # fmt: skip
    _binary(_operation, NUMBERS, _name)
for _operation, _name in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
                          (operator.eq, "==")):  # fmt: skip
    _binary(_operation, FLAGS, "fcmp_ordered", _name)
_binary(operator.ne, FLAGS, "fcmp_unordered", "!=")  # true for NaN
_Flags = (FLAGS, FLAGS), (FLAGS, types.Boolean), (types.Boolean, FLAGS)
for _operation, _name in ((operator.and_, "and_"), (operator.or_, "or_")):
    _binary(_operation, FLAGS, _name, kinds=_Flags)


def _alike(context: Any, builder: Any, signature: Any, values: Any) -> list[Any]:
    """Numbers or lanes as what the result is."""
    if signature.return_type is NUMBERS:
        return [spread_over(context, builder, kind, x) for kind, x in zip(signature.args, values, strict=True)]
    return [context.cast(builder, x, kind, types.float64) for kind, x in zip(signature.args, values, strict=True)]


def _intrinsic(builder: Any, name: str, values: Any) -> Any:
    """What LLVM does to numbers, or to whole vectors."""
    one = values[0].type
    kind, suffix = ir.FunctionType(one, [one] * len(values)), f"v{LANES}f64" if one == VECTOR else "f64"
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.{suffix}"), values)


def _unary(operation: Any) -> None:
    @type_callable(operation)
    def _type_of(_: Any) -> Any:
        return lambda a: a if a is NUMBERS else None


_unary(operator.neg)
_unary(abs)


@lower_builtin(operator.neg, NUMBERS)
def _negated(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.fneg(values[0])


@lower_builtin(abs, NUMBERS)
def _absolute(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return _intrinsic(builder, "fabs", values)


def where(condition: Any, yes: Any, no: Any) -> Any:
    """Choose lane by lane.

    Args:
        condition: Truth values.
        yes: Numbers where it holds.
        no: Numbers where it does not.
    """
    return np.where(condition, yes, no)


@type_callable(where)
def _type_of_where(_: Any) -> Any:
    def of(condition: Any, yes: Any, no: Any) -> Any:
        if not ((condition is FLAGS or isinstance(condition, types.Boolean)) and is_number(yes) and is_number(no)):
            return None
        return NUMBERS if FLAGS is condition or NUMBERS in (yes, no) else types.float64

    return of


@lower_builtin(where, types.Any, types.Any, types.Any)
def _where(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    condition, chosen = signature.args[0], values[0]
    sides = _alike(context, builder, signature.replace(args=signature.args[1:]), values[1:])
    if condition is not FLAGS and chosen.type.width > 1:
        chosen = builder.trunc(chosen, ir.IntType(1))
    return builder.select(chosen, *sides)


def anywhere(condition: Any) -> bool:
    """Whether a condition holds in any lane."""
    return bool(np.any(condition))


@type_callable(anywhere)
def _type_of_anywhere(_: Any) -> Any:
    return lambda condition: types.boolean if condition is FLAGS or isinstance(condition, types.Boolean) else None


@lower_builtin(anywhere, types.Any)
def _anywhere(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    if signature.args[0] is not FLAGS:
        return values[0]
    bits = builder.bitcast(values[0], ir.IntType(LANES))
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


def not_(condition: Any) -> Any:
    """Where a condition does not hold."""
    return np.logical_not(condition)


@type_callable(not_)
def _type_of_not(_: Any) -> Any:
    return lambda condition: condition if condition is FLAGS or isinstance(condition, types.Boolean) else None


@lower_builtin(not_, types.Any)
def _not(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.not_(values[0])


def sqrt(x: Any) -> Any:
    """Square root."""
    return np.sqrt(x)


def copysign(x: Any, y: Any) -> Any:
    """x with the sign of y."""
    return np.copysign(x, y)


def split(x: Any) -> tuple[Any, Any, Any]:
    """m, e and 2^-e of x = m 2^e with 1 <= m < 2, for 2^-1022 <= x < 2^1023; anything else for other numbers."""
    m, e = np.frexp(x)
    return 2.0 * m, e - 1.0, np.ldexp(2.0, -e)


def _function(own: Any, name: str, arguments: int) -> None:
    """Teach numba a function of numbers, or of lanes, that LLVM has.

    Args:
        own: The function.
        name: In LLVM.
        arguments: How many it has.
    """

    @type_callable(own)
    def _type_of(_: Any) -> Any:
        def of(*kinds: Any) -> Any:
            if len(kinds) != arguments or not all(map(is_number, kinds)):
                return None
            return NUMBERS if NUMBERS in kinds else types.float64

        return (lambda x: of(x)) if arguments == 1 else (lambda x, y: of(x, y))

    @lower_builtin(own, *[types.Any] * arguments)
    def _lower(context: Any, builder: Any, given: Any, values: Any) -> Any:
        return _intrinsic(builder, name, _alike(context, builder, given, values))


_function(sqrt, "sqrt", 1)
_function(copysign, "copysign", 2)


@type_callable(split)
def _type_of_split(_: Any) -> Any:
    return lambda x: types.UniTuple(NUMBERS if x is NUMBERS else types.float64, 3) if is_number(x) else None


@lower_builtin(split, types.Any)
def _split(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    wide = signature.args[0] is NUMBERS
    (x,) = values if wide else (context.cast(builder, values[0], signature.args[0], types.float64),)
    whole = ir.VectorType(ir.IntType(64), LANES) if wide else ir.IntType(64)

    def constant(number: Any, kind: Any) -> Any:
        return ir.Constant(kind, [number] * LANES if wide else number)

    bits = builder.bitcast(x, whole)
    m = builder.or_(builder.and_(bits, constant((1 << 52) - 1, whole)), constant(1023 << 52, whole))
    # a whole number below 2^52 behind the exponent of 2^52 is that number, more 2^52
    raised = builder.lshr(bits, constant(52, whole))
    e = builder.or_(raised, constant(1075 << 52, whole))
    e = builder.fsub(builder.bitcast(e, x.type), constant(2.0**52 + 1023.0, x.type))
    inverse = builder.shl(builder.sub(constant(2046, whole), raised), constant(52, whole))
    parts = builder.bitcast(m, x.type), e, builder.bitcast(inverse, x.type)
    return context.make_tuple(builder, signature.return_type, parts)
