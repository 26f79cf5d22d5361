"""Numbers in sentences, and objects in a line."""

from __future__ import annotations

import re


def counted(number: int, noun: str) -> str:
    """The number and its noun, with an s unless there is one."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def growth(change: float) -> str:
    """How memory grew, or shrank, from its change in bytes."""
    return f"{'shrunk' if change < 0.0 else 'grown'} by {abs(change) / 1e6:.3f} MB"


def call(what: object, *values: object, **named: object) -> str:
    """An object as a short call of its class, numbers to four digits: its `repr`.

    Args:
        what: The object.
        values: Shown without names.
        named: Shown with them.
    """
    words = [*map(_word, values), *(f"{name}={_word(value)}" for name, value in named.items())]
    return f"{type(what).__name__}({', '.join(words)})"


def _word(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if hasattr(value, "tolist") and hasattr(value, "ravel"):  # an array, without importing numpy here
        return "[" + ", ".join(f"{number + 0.0:.4g}" for number in value.ravel().tolist()) + "]"
    return repr(value)


def file_word(name: str) -> str:
    """A name as a part of a file's: letters, digits, dots and hyphens, none of them at its ends."""
    return re.sub(r"[^\w.]+", "-", name).strip("-.")
