"""What a person gives, checked when a part is made: what is not of its kind is an error that names the argument."""

from __future__ import annotations

import math
import sys
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError

#: The largest finite float, and the largest int of compiled code.
LARGEST, MOST = sys.float_info.max, 2**63 - 1


def numbers(where: str, key: str, value: Any, expected: str, ndim: int | None = None) -> NDArray[np.float64]:
    """`value` as an array of its own of float64; NaN and infinities are left to who asks.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        value: As given.
        expected: What would be right, for the error.
        ndim: How many dimensions; any if None.

    Raises:
        ConfigurationError: Masked, complex or text, truth values, other objects, no array at all, other dimensions.
    """
    try:
        given = np.asarray(value)
        masked = np.ma.is_masked(np.ma.asarray(value)) if isinstance(value, list | tuple) else np.ma.is_masked(value)
        good = given.dtype.kind in "fiu" and not masked and ndim in (None, given.ndim)
        if good and isinstance(value, list | tuple):  # True beside numbers would count as 1
            good = not any(isinstance(one, bool | np.bool_) for one in np.array(value, dtype=object).flat)
    except Exception:  # whatever a stranger's __array__ raises
        good = False
    if not good:
        raise ConfigurationError(where, key, value, expected)
    return np.array(given, dtype=np.float64)


def number(
    where: str, key: str, value: Any, expected: str, least: float = -math.inf, *, above: float = -math.inf,
    most: float = LARGEST,
) -> float:  # fmt: skip
    """`value` as a finite float.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        value: As given.
        expected: What would be right, for the error.
        least: It must not be below this one,
        above: must be above this one,
        most: and not beyond this one.

    Raises:
        ConfigurationError: It is no real number, as for `numbers`, or not finite, or out of range.
    """
    try:
        real = isinstance(value, Real) and not isinstance(value, bool)
        found = float(value) if real else float(numbers(where, key, value, expected, 0))
    except (TypeError, ValueError, OverflowError):  # whole numbers of hundreds of digits
        found = math.nan
    if not (least <= found <= most and above < found):  # false for NaN
        raise ConfigurationError(where, key, value, expected)
    return found


def whole(where: str, key: str, value: Any, expected: str, least: int, most: int = MOST) -> int:
    """`value` as an int from `least` to `most`; 3.0 is none.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        value: As given.
        expected: What would be right, for the error.
        least: The smallest that is right.
        most: The largest.

    Raises:
        ConfigurationError: It is no whole number, or not between these.
    """
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (is_whole and least <= value <= most):
        raise ConfigurationError(where, key, value, expected)
    return int(value)


def parts(where: str, key: str, value: Any, expected: str) -> tuple[Any, ...]:
    """What a list, or anything like one, consists of; text does not count.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        value: As given.
        expected: What would be right, for the error.

    Raises:
        ConfigurationError: It is nothing of the kind.
    """
    try:
        if not isinstance(value, str | bytes):
            return tuple(value)
    except Exception:  # whatever a stranger's __iter__ raises
        pass
    raise ConfigurationError(where, key, value, expected)


def one_of(where: str, key: str, value: Any, known: tuple[str, ...]) -> str:
    """`value`, if it is one of these words.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        value: As given.
        known: The words.

    Raises:
        ConfigurationError: It is another word, or none.
    """
    if not (isinstance(value, str) and value in known):
        raise ConfigurationError(where, key, value, f"one of {known}")
    return value


def flag(where: str, key: str, value: Any) -> bool:
    """`value`, if it is True or False: text such as "no" would count as true.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        value: As given.

    Raises:
        ConfigurationError: It is neither.
    """
    if not isinstance(value, bool):
        raise ConfigurationError(where, key, value, "True or False")
    return value


def of_kind(where: str, key: str, value: Any, kind: type) -> None:
    """Refuse what is no object of a class.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        value: As given.
        kind: The class.

    Raises:
        ConfigurationError: It is something else.
    """
    if not isinstance(value, kind):
        raise ConfigurationError(where, key, value, f"an object of the class {kind.__name__}")


def to_call(where: str, key: str, value: Any) -> None:
    """Refuse what cannot be called.

    Args:
        where: Who asks, for the error.
        key: Its name, for the error.
        value: As given.

    Raises:
        ConfigurationError: It cannot.
    """
    if not callable(value):
        raise ConfigurationError(where, key, value, "a function, or another object that can be called")
