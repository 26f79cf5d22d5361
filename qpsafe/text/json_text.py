"""JSON that every reader reads: JSON knows no NaN and no infinity."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def json_text(value: Any, indent: int | None = 2, sort_keys: bool = False) -> str:
    """A value as JSON: numbers that are not finite become null, arrays lists, what JSON does not know text.

    Args:
        value: Anything.
        indent: Spaces a level; None for one line.
        sort_keys: Whether to sort.
    """
    return json.dumps(plain(value), indent=indent, sort_keys=sort_keys, allow_nan=False)


def plain(value: Any) -> Any:
    """The same value in what JSON knows: None, bool, int, float (finite), str, list, dict."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if callable(getattr(value, "tolist", None)):  # arrays and scalars of numpy, without importing it
        return plain(value.tolist())
    return str(value)
