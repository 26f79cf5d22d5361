"""Named errors for mistakes in a user's configuration.

Data in the control loop never raises: it is reported in the `Tick`. What a person wrote wrongly
(a robot file, a constructor argument, a command-line value) raises one of these at once, and says which value, where,
and what was expected.
"""

from __future__ import annotations

from typing import Any

_LONGEST = 1000  # letters of a message in the loop
_LONGEST_VALUE = 400  # of a value in it


class QpsafeError(Exception):
    """Base class of every error that qpsafe raises on purpose."""

    def __reduce__(self) -> tuple[Any, ...]:
        """As it is, whatever made it: an error of a worker process that cannot be unpickled breaks the whole pool."""
        return _again, (type(self), self.args, dict(vars(self)))


def _again(kind: type[QpsafeError], args: tuple[Any, ...], state: dict[str, Any]) -> QpsafeError:
    """An error that was pickled."""
    error = kind.__new__(kind, *args)
    error.args = args
    vars(error).update(state)
    return error


def in_words(error: BaseException, kind: bool = True) -> str:
    """The message of an error, with the name of its class; never raises, even where a foreign class's own methods do.

    Args:
        error: The error.
        kind: Whether to begin with the name of its class.
    """
    try:
        words = f"{type(error).__name__}: {error}" if kind else f"{error}"
    except Exception:
        words = f"{_name_of(error)} that cannot say what it is about"
    return words[:_LONGEST]


def represented(value: object) -> str:
    """`repr(value)`; never raises."""
    try:
        return f"{value!r}"
    except Exception:
        return f"<{_name_of(value)} that cannot be shown>"


def _name_of(value: object) -> str:
    return str(type.__dict__["__name__"].__get__(type(value)))  # not what a metaclass makes of it


class ConfigurationError(QpsafeError, ValueError):
    """A value in the configuration is wrong.

    Attributes:
        where: File or object that holds the value, e.g. ``"robots/irb140/robot.toml"``.
        key: Path of the value inside it, e.g. ``"joints.joint_2.lower"``.
        value: The value found.
        expected: What was expected instead, in words with units.
    """

    def __init__(self, where: object, key: str, value: object, expected: str) -> None:
        self.where = str(where)
        self.key = key
        self.value = value
        self.expected = expected
        super().__init__(f"{self.where}: {key} = {_shown(value)}: expected {expected}")


def _shown(value: object) -> str:
    """A value for a message, cut short."""
    text = represented(value)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 4] + " ..."


class RobotFileError(ConfigurationError):
    """A robot folder, its `robot.toml`, `spots.toml` or model file is wrong."""


class RobotWarning(UserWarning):
    """Something in a robot's files is missing or doubtful; says what was assumed instead. Also in `robot.notes`."""


class MissingExtraError(QpsafeError, ImportError):
    """An optional dependency is needed for what was asked; the message names the extra to install."""
