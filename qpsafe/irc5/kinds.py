"""Arguments that are no numbers, checked when a part is made; those that are: `qpsafe.text.given`."""

from __future__ import annotations

from typing import Any

from qpsafe.errors import ConfigurationError


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
