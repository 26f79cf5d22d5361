"""Named errors for mistakes in a user's configuration.

Data in the control loop never raises: it is reported in the [`Tick`][qpsafe.tick.Tick]. What a person wrote wrongly
(a robot file, a constructor argument, a command-line value) raises one of these at once, and says which value, where,
and what was expected.
"""

from __future__ import annotations

#: Characters of a value in a message.
_LONGEST = 400


class QpsafeError(Exception):
    """Base class of every error that qpsafe raises on purpose."""


class ConfigurationError(QpsafeError, ValueError):
    """A value that a person configured is wrong.

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
    """A value for a message, cut short; whatever it is, an error about it can be raised."""
    try:
        text = repr(value)
    except Exception:  # nested too deep, a number of too many digits, a stranger's __repr__
        text = f"<{type(value).__name__} that cannot be shown>"
    return text if len(text) <= _LONGEST else text[: _LONGEST - 4] + " ..."


class RobotFileError(ConfigurationError):
    """A robot folder, its `robot.toml`, `spots.toml` or model file is wrong."""


class RobotWarning(UserWarning):
    """Something in a robot's files is missing or doubtful; says what was assumed instead. Also in `robot.notes`."""


class MissingExtraError(QpsafeError, ImportError):
    """An optional dependency is needed for what was asked; the message names the extra to install."""
